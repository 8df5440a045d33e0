// Coefficients for other engines, in the hands of an engine that is not ours: Babylon.js turns the
// files into the harmonics that its shader reads, and those pass the self-test that the files carry.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";

import { SphericalHarmonics, SphericalPolynomial } from "@babylonjs/core/Maths/sphericalPolynomial.js";
import { Vector3 } from "@babylonjs/core/Maths/math.vector.js";

import { finished, orderDemo, startDaemon } from "./daemon.mjs";

let daemon;
let items;
before(async () => {
  daemon = await startDaemon();
  const order = (spec) => {
    spec.parameters = { sh: { bands: 3, exports: ["babylon", "ext_lights_image_based"] } };
    return spec;
  };
  const job = await finished(daemon.url, (await orderDemo(daemon.url, "environment_maps", order)).id);
  assert.equal(job.state, "succeeded", JSON.stringify(job.error));
  ({ items } = await (await fetch(`${daemon.url}${job.links.artifacts}`)).json());
});
after(() => daemon?.stop());

async function read(name) {
  const item = items.find((artifact) => artifact.name === name);
  assert.ok(item, `${name} is among the artifacts`);
  return (await fetch(`${daemon.url}${item.href}`)).json();
}

// harmonicsFunctions.fx of the engine, on harmonics that preScaleForRendering() has scaled.
function shade(harmonics, [x, y, z]) {
  const terms = [
    ["l00", 1],
    ["l1_1", y],
    ["l10", z],
    ["l11", x],
    ["l2_2", y * x],
    ["l2_1", y * z],
    ["l20", 3 * z * z - 1],
    ["l21", z * x],
    ["l22", x * x - y * y],
  ];
  const sum = Vector3.Zero();
  for (const [name, factor] of terms) sum.addInPlace(harmonics[name].scale(factor));
  return sum.asArray();
}

function passes(selftest, harmonics) {
  assert.equal(selftest.length, 6);
  for (const { normal, diffuse } of selftest) {
    const seen = shade(harmonics, normal);
    const scale = Math.max(...diffuse.map(Math.abs));
    seen.forEach((value, i) => assert.ok(Math.abs(value - diffuse[i]) <= 1e-4 * scale, `${seen} is not ${diffuse}`));
  }
}

test("Babylon.js shades with the exported harmonics as the file says", async () => {
  const { sphericalHarmonics, lightkiln } = await read("sh_babylon.json");
  const harmonics = SphericalHarmonics.FromArray(sphericalHarmonics);
  passes(lightkiln.selftest, SphericalPolynomial.FromHarmonics(harmonics).preScaledHarmonics);
});

test("the irradiance of an .env header gives the same light", async () => {
  const { irradiance, lightkiln } = await read("sh_babylon.json");
  const names = ["x", "y", "z", "xx", "yy", "zz", "yz", "zx", "xy"];
  const polynomial = SphericalPolynomial.FromArray(names.map((name) => irradiance[name]));
  passes(lightkiln.selftest, polynomial.preScaledHarmonics);
});

test("irradianceCoefficients of the glTF extension load as Babylon.js loads them", async () => {
  const { irradianceCoefficients, lightkiln } = await read("sh_ext_lights_image_based.json");
  const harmonics = SphericalHarmonics.FromArray(irradianceCoefficients);
  harmonics.convertIrradianceToLambertianRadiance();
  passes(lightkiln.selftest, SphericalPolynomial.FromHarmonics(harmonics).preScaledHarmonics);
});
