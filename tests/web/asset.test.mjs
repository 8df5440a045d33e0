// The glTF asset in the viewer that implements its extension: what a mirror, a rough metal and a white wall
// show in known directions, against what the map holds there. The map tells every axis apart: red, green and
// blue rise with x, y and z.

import assert from "node:assert/strict";
import { writeFileSync, mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";

import validator from "gltf-validator";

import { finished, startDaemon, upload } from "./daemon.mjs";
import { jsonOf, startViewer, withPlaces } from "./viewer.mjs";

const radiance = (d) => d.map((x) => 0.5 + 0.5 * x);

// Longitude 0 looks at +Z in the image's centre, +X lies left of it; the top row is +Y.
function latlong(width, height) {
  const lines = Buffer.alloc(4 * width * height);
  for (let y = 0; y < height; y += 1) {
    for (let x = 0; x < width; x += 1) {
      const longitude = Math.PI * (1 - (2 * x + 1) / width);
      const latitude = Math.PI * (0.5 - (y + 0.5) / height);
      const d = [Math.cos(latitude) * Math.sin(longitude), Math.sin(latitude), Math.cos(latitude) * Math.cos(longitude)];
      const rgb = radiance(d);
      const exponent = Math.ceil(Math.log2(Math.max(...rgb, 1e-9)) + 1e-9);
      const at = 4 * (y * width + x);
      rgb.forEach((value, c) => (lines[at + c] = Math.min(255, Math.round((value * 256) / 2 ** exponent))));
      lines[at + 3] = exponent + 128;
    }
  }
  const header = `#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y ${height} +X ${width}\n`;
  return Buffer.concat([Buffer.from(header), lines]);
}

// Twenty directions over the sphere, the six axes first.
const directions = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]];
for (let i = 0; i < 14; i += 1) {
  const z = 1 - (2 * i + 1) / 14;
  const r = Math.sqrt(1 - z * z);
  directions.push([r * Math.cos(2.4 * i), r * Math.sin(2.4 * i), z]);
}
const places = directions.map((_, i) => `place ${i}`);

// The lobe of roughness^2 at n = v = r keeps this share of what varies as a direction's components do: half
// vectors of density D cos(h), a weight of n.l = cos(2h).
function share(alpha) {
  let kept = 0;
  let all = 0;
  for (let i = 0; i < 20000; i += 1) {
    const h = ((i + 0.5) / 20000) * (Math.PI / 4);
    const cosine = Math.cos(h);
    const weight = (cosine * Math.sin(h) * Math.cos(2 * h)) / (cosine * cosine * (alpha * alpha - 1) + 1) ** 2;
    kept += weight * Math.cos(2 * h);
    all += weight;
  }
  return kept / all;
}

let daemon;
let viewer;
let folder;
const assets = {};

async function bake(roughness) {
  const path = join(folder, "axes.hdr");
  writeFileSync(path, latlong(256, 128));
  const spec = {
    kind: "environment_maps",
    inputs: { environment: await upload(daemon.url, path) },
    parameters: { asset: { size: 128, roughness } },
  };
  const response = await fetch(`${daemon.url}/v1/jobs`, {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify({ spec }),
  });
  assert.equal(response.status, 202, await response.clone().text());
  const job = await finished(daemon.url, (await response.json()).id);
  assert.equal(job.state, "succeeded", JSON.stringify(job.error));
  const { items } = await (await fetch(`${daemon.url}${job.links.artifacts}`)).json();
  const glb = items.find((item) => item.media_type === "model/gltf-binary");
  return new Uint8Array(await (await fetch(`${daemon.url}${glb.href}`)).arrayBuffer());
}

before(async () => {
  folder = mkdtempSync(join(tmpdir(), "lightkiln-asset-"));
  daemon = await startDaemon();
  assets.linear = await bake("linear");
  assets.babylon = await bake("babylon");
  viewer = await startViewer();
});
after(async () => {
  await viewer?.stop();
  await daemon?.stop();
  rmSync(folder, { recursive: true, force: true });
});

const worst = (seen, expected) => Math.max(...seen.flatMap((rgb, i) => rgb.map((value, c) => Math.abs(value - expected[i][c]))));

test("the asset passes the glTF validator", async () => {
  for (const glb of Object.values(assets)) {
    const report = await validator.validateBytes(glb);
    assert.equal(report.issues.numErrors, 0, JSON.stringify(report.issues.messages));
    assert.equal(report.issues.numWarnings, 0, JSON.stringify(report.issues.messages));
    const [light] = jsonOf(glb).extensions.EXT_lights_image_based.lights;
    assert.equal(light.irradianceCoefficients.length, 9);
    assert.deepEqual(light.specularImages.map((faces) => faces.length), [6, 6, 6, 6]); // 128 64 32 16
  }
});

test("a mirror shows every direction where glTF puts it", async () => {
  const about = await viewer.load(withPlaces(assets.linear, directions));
  assert.deepEqual(about, { name: "environment", size: 128, level: 1 });
  const seen = await viewer.look(places, { metallic: 1, roughness: 0 });
  const error = worst(seen, directions.map(radiance));
  assert.ok(error < 0.03, `the mirror is wrong by ${error}: ${JSON.stringify(seen)}`);
  if (process.env.SCREENSHOTS) await viewer.picture(`${process.env.SCREENSHOTS}/asset.png`, "place 4", { metallic: 1, roughness: 0 });
  // What a mirrored or turned world would show is far from it.
  for (const wrong of [([x, y, z]) => [-x, y, z], ([x, y, z]) => [x, y, -z], ([x, y, z]) => [-x, y, -z], ([x, y, z]) => [x, -y, z]]) {
    assert.ok(worst(seen, directions.map(wrong).map(radiance)) > 0.8);
  }
});

// Why the page corrects what the loader says of its texture: the control of the test above.
test("as the loader leaves its texture, colours come out to the power 2.2", async () => {
  await viewer.load(withPlaces(assets.linear, directions), { gammaSpace: true });
  const seen = await viewer.look(places, { metallic: 1, roughness: 0 });
  assert.ok(worst(seen, directions.map((d) => radiance(d).map((x) => x ** 2.2))) < 0.03, JSON.stringify(seen));
});

test("a white wall is lit by the irradiance of its side", async () => {
  await viewer.load(withPlaces(assets.linear, directions));
  const seen = await viewer.look(places, { metallic: 0, roughness: 1 });
  const expected = directions.map((d) => d.map((x) => 0.5 + 0.5 * (2 / 3) * x)); // irradiance / pi
  const error = worst(seen, expected);
  assert.ok(error < 0.02, `the wall is wrong by ${error}: ${JSON.stringify(seen)}`);
});

test("rough metal shows the lobe of its roughness when levels follow the viewer", async () => {
  const errors = {};
  for (const [rule, glb] of Object.entries(assets)) {
    await viewer.load(withPlaces(glb, directions));
    errors[rule] = [];
    for (const roughness of [0.3, 0.45, 0.6, 0.8, 1]) {
      const seen = await viewer.look(places, { metallic: 1, roughness });
      const kept = share(roughness * roughness);
      errors[rule].push(worst(seen, directions.map((d) => d.map((x) => 0.5 + 0.5 * kept * x))));
    }
  }
  assert.ok(Math.max(...errors.babylon) < 0.03, JSON.stringify(errors));
  // Levels as the extension's text says look rougher in it than the material is.
  assert.ok(Math.max(...errors.linear) > 0.03, JSON.stringify(errors));
});

test("the viewer had nothing to complain of", () => {
  assert.deepEqual(viewer.complaints, []);
});
