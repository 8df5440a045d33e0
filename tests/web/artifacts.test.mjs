// What comes out, read by programs that are not ours: the glTF validator and a JSON-schema validator that
// holds the daemon's answers to its own OpenAPI document.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { after, before, test } from "node:test";

import Ajv2020 from "ajv/dist/2020.js";
import addFormats from "ajv-formats";
import validator from "gltf-validator";

import { finished, orderDemo, project, startDaemon } from "./daemon.mjs";

let daemon;
let job;
before(async () => {
  daemon = await startDaemon();
  job = await finished(daemon.url, (await orderDemo(daemon.url, "ambient_occlusion")).id);
  assert.equal(job.state, "succeeded", JSON.stringify(job.error));
});
after(() => daemon?.stop());

test("the baked GLB passes the glTF validator and carries one _AO a vertex", async () => {
  const { items } = await (await fetch(`${daemon.url}${job.links.artifacts}`)).json();
  const glb = items.find((item) => item.media_type === "model/gltf-binary");
  const bytes = new Uint8Array(await (await fetch(`${daemon.url}${glb.href}`)).arrayBuffer());
  const report = await validator.validateBytes(bytes);
  assert.equal(report.issues.numErrors, 0, JSON.stringify(report.issues.messages));
  const length = new DataView(bytes.buffer).getUint32(12, true);
  const document = JSON.parse(new TextDecoder().decode(bytes.subarray(20, 20 + length)));
  for (const mesh of document.meshes) {
    for (const primitive of mesh.primitives) {
      if ((primitive.mode ?? 4) < 4) continue;
      const { POSITION, _AO, _AO_ERROR } = primitive.attributes;
      assert.equal(document.accessors[_AO].count, document.accessors[POSITION].count);
      assert.equal(document.accessors[_AO_ERROR].count, document.accessors[POSITION].count);
    }
  }
});

test("sun and light set pass the glTF validator and hold the map's energy", async () => {
  const order = (spec) => ({ ...spec, parameters: { sun: {}, light_set: { lights: 8 } } });
  const baked = await finished(daemon.url, (await orderDemo(daemon.url, "environment_maps", order)).id);
  assert.equal(baked.state, "succeeded", JSON.stringify(baked.error));
  const { items } = await (await fetch(`${daemon.url}${baked.links.artifacts}`)).json();
  const fetched = async (name) => {
    const item = items.find((candidate) => candidate.name === name);
    return item && new Uint8Array(await (await fetch(`${daemon.url}${item.href}`)).arrayBuffer());
  };
  const document = JSON.parse(new TextDecoder().decode(await fetched("environment_maps.json")));
  assert.equal(document.sun.found, (await fetched("sun.gltf")) !== undefined);
  for (const name of document.sun.found ? ["sun.gltf", "light_set.gltf"] : ["light_set.gltf"]) {
    const bytes = await fetched(name);
    const report = await validator.validateBytes(bytes);
    assert.equal(report.issues.numErrors + report.issues.numWarnings, 0, JSON.stringify(report.issues.messages));
    const { lights } = JSON.parse(new TextDecoder().decode(bytes)).extensions.KHR_lights_punctual;
    const expected = name === "sun.gltf" ? document.sun.disk.irradiance : document.sun.energy_after;
    for (let c = 0; c < 3; c += 1) {
      const sum = lights.reduce((total, light) => total + light.intensity * light.color[c], 0);
      assert.ok(Math.abs(sum - expected[c]) <= 1e-9 * expected[c], `${name}: ${sum} is not ${expected[c]}`);
    }
  }
});

test("the daemon's answers are what its OpenAPI document says", async () => {
  const openapi = await (await fetch(`${daemon.url}/openapi.json`)).json();
  assert.deepEqual(openapi, JSON.parse(readFileSync(join(project, "proto", "openapi.json"), "utf8")));
  const ajv = new Ajv2020({ strict: false, allErrors: true });
  addFormats(ajv);
  ajv.addSchema(openapi, "openapi");
  const escape = (part) => part.replaceAll("~", "~0").replaceAll("/", "~1").replaceAll("{", "%7B").replaceAll("}", "%7D");
  const check = async (template, path, init) => {
    const response = await fetch(`${daemon.url}${path}`, init);
    const method = (init?.method ?? "GET").toLowerCase();
    const { responses } = openapi.paths[template][method];
    const status = responses[response.status] ? response.status : "default";
    assert.ok(status !== "default" || response.status >= 400, `${template}: ${response.status} is not documented`);
    const described = responses[status];
    const reference = described.$ref ?? `#/paths/${escape(template)}/${method}/responses/${status}`;
    const resolved = described.$ref
      ? reference.slice(2).split("/").reduce((node, part) => node[part], openapi)
      : described;
    const media = Object.keys(resolved.content ?? {})[0];
    const validate = ajv.compile({ $ref: `openapi${reference}/content/${escape(media)}/schema` });
    const body = await response.json();
    assert.ok(validate(body), `${path}: ${ajv.errorsText(validate.errors)}`);
    return body;
  };
  await check("/v1/jobs", "/v1/jobs?limit=5");
  await check("/v1/jobs", "/v1/jobs?limit=0");
  await check("/v1/jobs/{id}", `/v1/jobs/${job.id}`);
  await check("/v1/jobs/{id}", "/v1/jobs/00000000000000000000000000");
  await check("/v1/jobs/{id}/plan", job.links.plan);
  await check("/v1/jobs/{id}/accuracy", job.links.accuracy);
  await check("/v1/jobs/{id}/convergence", job.links.convergence);
  await check("/v1/jobs/{id}/events", `${job.links.events}?after=0&limit=100`);
  await check("/v1/jobs/{id}/artifacts", job.links.artifacts);
  await check("/version", "/version");
  const faults = await check("/v1/jobs", "/v1/jobs", {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify({ spec: { kind: "ambient_occlusion", parameters: { max_distnace: -1, falloff: 7 } } }),
  });
  assert.ok(faults.errors.length >= 3, "all faults of a spec come at once");
});
