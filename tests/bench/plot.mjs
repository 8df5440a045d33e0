// Draws what accuracy costs: one log-log panel a product, CPU seconds against error, from what
// bench_maps wrote. Light enough to read as text.
//
//   node plot.mjs points.json out.svg

import { readFileSync, writeFileSync } from 'node:fs';

const panel = { width: 250, height: 190, left: 46, right: 10, top: 26, bottom: 34 };
const columns = 3;

// The decades that hold all values.
function decades(values) {
  const logs = values.filter((v) => v > 0).map(Math.log10);
  return [Math.floor(Math.min(...logs)), Math.ceil(Math.max(...logs) + 1e-9)];
}

function power(exponent) {
  return `10<tspan dy="-4" font-size="8">${String(exponent).replace('-', '−')}</tspan>`;
}

function drawPanel(product, points, origin) {
  const [x0, x1] = decades(points.map((p) => p.cpu_s));
  const [y0, y1] = decades(points.flatMap((p) => [p.bound, p.rms, p.target]));
  const plotWidth = panel.width - panel.left - panel.right;
  const plotHeight = panel.height - panel.top - panel.bottom;
  const x = (v) => (panel.left + ((Math.log10(v) - x0) / (x1 - x0)) * plotWidth).toFixed(1);
  const y = (v) => (panel.top + ((y1 - Math.log10(v)) / (y1 - y0)) * plotHeight).toFixed(1);
  const lines = [`<g transform="translate(${origin[0]} ${origin[1]})">`];
  lines.push(`<text class="title" x="${panel.left}" y="16">${product}</text>`);
  for (let e = x0; e <= x1; ++e) {
    lines.push(`<line class="grid" x1="${x(10 ** e)}" x2="${x(10 ** e)}" y1="${panel.top}" y2="${panel.top + plotHeight}"/>`);
    lines.push(`<text x="${x(10 ** e)}" y="${panel.height - 18}" text-anchor="middle">${power(e)}</text>`);
  }
  const step = y1 - y0 > 8 ? 4 : y1 - y0 > 4 ? 2 : 1;
  for (let e = y0; e <= y1; e += step) {
    lines.push(`<line class="grid" x1="${panel.left}" x2="${panel.left + plotWidth}" y1="${y(10 ** e)}" y2="${y(10 ** e)}"/>`);
    lines.push(`<text x="${panel.left - 5}" y="${Number(y(10 ** e)) + 4}" text-anchor="end">${power(e)}</text>`);
  }
  const sorted = [...points].sort((a, b) => a.target - b.target);
  const curve = (kind, value) => {
    const shown = sorted.filter((p) => value(p) > 0);
    if (shown.length === 0) return;
    lines.push(`<polyline class="${kind}" points="${shown.map((p) => `${x(p.cpu_s)},${y(value(p))}`).join(' ')}"/>`);
    for (const p of shown) lines.push(`<circle class="${kind}" cx="${x(p.cpu_s)}" cy="${y(value(p))}" r="2.2"/>`);
  };
  curve('ordered', (p) => p.target);
  curve('bound', (p) => p.bound);
  curve('seen', (p) => p.rms);
  lines.push('</g>');
  return lines;
}

// A log-log plot has no place for what took no time, or what errs by nothing at any price.
function drawable(points) {
  return points.filter((p) => p.cpu_s > 0 && (p.bound > 0 || p.rms > 0));
}

function draw({ map, points: all }) {
  const points = drawable(all);
  const products = [...new Set(points.map((p) => p.product))];
  const rows = Math.ceil(products.length / columns);
  const width = columns * panel.width;
  const height = rows * panel.height + 40;
  const lines = [
    `<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 ${width} ${height}" width="${width}" height="${height}" font-family="sans-serif" font-size="10">`,
    '<style>rect{fill:#fff}text{fill:#333}.title{font-size:12px;font-weight:bold}.grid{stroke:#ddd}',
    'polyline{fill:none;stroke-width:1.5}polyline.ordered{stroke:#999;stroke-dasharray:4 3}circle.ordered{fill:#999}',
    'polyline.bound{stroke:#c60}circle.bound{fill:#c60}polyline.seen{stroke:#06c}circle.seen{fill:#06c}</style>',
    `<rect width="${width}" height="${height}"/>`,
  ];
  products.forEach((product, i) => {
    const origin = [(i % columns) * panel.width, Math.floor(i / columns) * panel.height];
    lines.push(...drawPanel(product, points.filter((p) => p.product === product), origin));
  });
  const y = rows * panel.height + 12;
  lines.push(`<text x="${panel.left}" y="${y}">CPU seconds across, relative error upwards; map ${map.width} × ${map.height}.</text>`);
  let x = panel.left;
  for (const [kind, label] of [['ordered', 'ordered'], ['bound', 'stated bound (rms)'], ['seen', 'measured against the twin (rms)']]) {
    lines.push(`<circle class="${kind}" cx="${x}" cy="${y + 14}" r="3"/><text x="${x + 8}" y="${y + 18}">${label}</text>`);
    x += 22 + 6 * label.length;
  }
  lines.push('</svg>');
  return lines.join('\n') + '\n';
}

const [input, output] = process.argv.slice(2);
if (!input || !output) {
  console.error('usage: node plot.mjs points.json out.svg');
  process.exit(2);
}
writeFileSync(output, draw(JSON.parse(readFileSync(input, 'utf8'))));
