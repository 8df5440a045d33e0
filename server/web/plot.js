// Error against time, both logarithmic, with the ordered error as a line.

import uPlot from "/uPlot.esm.js";

// points: [{seconds, error}] in rising seconds, all above zero. Returns the plot's element.
export function errorPlot(container, points, target) {
  container.replaceChildren();
  const x = points.map((point) => point.seconds);
  const measured = points.map((point) => point.error);
  const line = points.map(() => target);
  const options = {
    width: Math.max(360, Math.min(760, container.clientWidth - 24)),
    height: 320,
    scales: {
      x: { time: false, distr: 3, range: (_plot, low, high) => wholeSteps(low, high) },
      y: { distr: 3, range: (_plot, low, high) => wholeSteps(Math.min(low, target), Math.max(high, target)) },
    },
    axes: [
      { label: "seconds of baking", values: (_plot, ticks) => ticks.map(plain) },
      { label: "error (rms of 95 % half-widths)", size: 70, values: (_plot, ticks) => ticks.map(plain) },
    ],
    series: [
      { label: "seconds", value: (_plot, value) => plain(value) },
      {
        label: "error",
        stroke: "#0b57a8",
        width: 2,
        points: { show: true, size: 8 },
        value: (_plot, value) => plain(value),
      },
      { label: "ordered", stroke: "#a3211b", dash: [6, 4], width: 1.5, points: { show: false } },
    ],
  };
  const plot = new uPlot(options, [x, measured, line], container);
  container.dataset.points = String(points.length);
  return plot;
}

function plain(value) {
  if (value === null || value === undefined) return "";
  return Number(value.toPrecision(2)).toString();
}

// A range that begins and ends on a step of its decade (0.02, 0.3, 70), as the ticks of a logarithmic axis
// need, with at least one whole step of room on both sides.
export function wholeSteps(low, high) {
  const step = (value) => 10 ** Math.floor(Math.log10(value));
  const below = low / 1.2;
  const above = high * 1.2;
  return [Math.floor(below / step(below)) * step(below), Math.ceil(above / step(above)) * step(above)];
}

// Rounds as the API gives them, as points of rising seconds; rounds without an error are left out.
export function pointsOfRounds(rounds) {
  const points = [];
  let elapsed = 0;
  for (const round of rounds ?? []) {
    elapsed += round.wall_s;
    if (round.error_rms > 0 && elapsed > 0) points.push({ seconds: elapsed, error: round.error_rms });
  }
  return points;
}
