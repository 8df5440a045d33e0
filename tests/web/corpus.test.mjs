// Malformed files of other projects, ordered through the whole service: each ends as a succeeded job or as
// a failed one that says why, within ten seconds, and the daemon stays well. Runs where the folder of test
// data is present beside the project.

import assert from "node:assert/strict";
import { existsSync, readdirSync, readFileSync, statSync } from "node:fs";
import { basename, dirname, join, relative } from "node:path";
import { after, before, test } from "node:test";

import { finished, project, startDaemon, upload } from "./daemon.mjs";

const data = process.env.LIGHTKILN_TEST_DATA ?? join(project, "..", "shared", "data");
const invalid = join(data, "invalid");
const skip = existsSync(invalid) ? false : "no shared/data folder beside the project";

let daemon;
before(async () => {
  if (!skip) daemon = await startDaemon();
});
after(() => daemon?.stop());

function filesBelow(folder) {
  return readdirSync(folder, { recursive: true })
    .map((name) => join(folder, name))
    .filter((path) => statSync(path).isFile());
}

async function order(spec) {
  const response = await fetch(`${daemon.url}/v1/jobs`, {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify({ spec }),
  });
  assert.equal(response.status, 202, await response.clone().text());
  return (await response.json()).id;
}

async function endsWell(path, spec) {
  const started = Date.now();
  const job = await finished(daemon.url, await order(spec));
  const spent_ms = Date.now() - started;
  assert.ok(spent_ms < 10000, `${path} took ${spent_ms} ms`);
  if (job.state !== "succeeded") {
    assert.equal(job.state, "failed", path);
    assert.notEqual(job.error.code, "internal", `${path}: ${job.error.detail}`);
    assert.ok(job.error.detail.length > 20, `${path}: "${job.error.detail}" explains nothing`);
  }
  return job;
}

// A .gltf with every file of its folder as a resource, a .glb alone.
async function sceneInput(path) {
  const blob = await upload(daemon.url, path);
  if (path.endsWith(".glb")) return blob;
  const folder = dirname(path);
  const resources = {};
  for (const file of filesBelow(folder)) {
    if (file !== path && !/\.(gltf|glb|md)$/.test(file)) {
      resources[relative(folder, file)] = await upload(daemon.url, file);
    }
  }
  return { blob, resources };
}

test("malformed scenes end with a diagnosis and hurt nobody", { skip }, async () => {
  const scenes = filesBelow(invalid).filter((path) => /\.(gltf|glb)$/.test(path));
  assert.ok(scenes.length > 150);
  const clean = [];
  for (const path of scenes) {
    const scene = await sceneInput(path);
    const job = await endsWell(path, { kind: "ambient_occlusion", inputs: { scene } });
    if (path.includes(`${"gltf_validator"}/clean/`) && job.state !== "succeeded") {
      clean.push(`${relative(invalid, path)}: ${job.error.detail}`);
    }
  }
  assert.deepEqual(clean, [], "files without errors were refused");
  assert.equal((await fetch(`${daemon.url}/readyz`)).status, 200);
});

test("malformed images end with a diagnosis and hurt nobody", { skip }, async () => {
  const images = filesBelow(invalid).filter((path) => path.includes("exr_"));
  assert.ok(images.length > 50);
  for (const path of images) {
    const environment = await upload(daemon.url, path);
    await endsWell(path, {
      kind: "environment_maps",
      inputs: { environment },
      parameters: { sh: { bands: 3 } },
    });
  }
  assert.equal((await fetch(`${daemon.url}/readyz`)).status, 200);
});

test("real scenes bake or are refused for their stated reason", { skip }, async () => {
  const scenes = filesBelow(join(data, "scenes")).filter((path) => /small_features.*\.(gltf|glb)$/.test(path));
  assert.ok(scenes.length > 20);
  for (const path of scenes) {
    const scene = await sceneInput(path);
    const job = await endsWell(path, {
      kind: "ambient_occlusion",
      inputs: { scene },
      accuracy: { target_error: 0.2, max_samples: 256 },
    });
    const refused = basename(path) === "cube_att.gltf"; // one node under four parents
    assert.equal(job.state, refused ? "failed" : "succeeded", `${path}: ${JSON.stringify(job.error)}`);
    if (refused) assert.match(job.error.detail, /parent/);
  }
});
