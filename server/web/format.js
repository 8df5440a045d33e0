// Numbers and times for people.

export function seconds(value) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value < 0.0995) return `${(value * 1000).toPrecision(2)} ms`;
  if (value < 99.5) return `${Number(value.toPrecision(2))} s`;
  const minutes = Math.round(value / 60);
  return minutes < 100 ? `${minutes} min` : `${(minutes / 60).toFixed(1)} h`;
}

export function bytes(value) {
  const units = ["B", "KiB", "MiB", "GiB"];
  let unit = 0;
  while (value >= 1024 && unit < units.length - 1) {
    value /= 1024;
    unit += 1;
  }
  return `${unit === 0 ? value : value.toFixed(1)} ${units[unit]}`;
}

export function error(value) {
  if (value === null || value === undefined || value === 0) return "–";
  return Number(value.toPrecision(2)).toString();
}

export const count = (value) => new Intl.NumberFormat("en").format(value);

export function time(text) {
  return text ? new Date(text).toLocaleString() : "–";
}
