// Figures of the whole service: measured from outside, printed, never asserted.
//
//   node tests/bench/service.mjs          needs a release build in build/release
//
// Each figure is the median of several runs; wall seconds on this machine, whose cores are named first.

import { cpus, tmpdir } from "node:os";
import { execFileSync } from "node:child_process";
import { existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { join } from "node:path";

process.env.LIGHTKILN_BINARY_DIR ??= new URL("../../build/release", import.meta.url).pathname;
const { doubledHdr } = await import("./doubled_hdr.mjs");
const { finished, project, startDaemon, upload } = await import("../web/daemon.mjs");

const data = process.env.LIGHTKILN_TEST_DATA ?? join(project, "..", "shared", "data");
const median = (values) => values.toSorted((a, b) => a - b)[Math.floor(values.length / 2)];
const say = (name, text) => console.log(`${name.padEnd(62)} ${text}`);

// One triangle as a .gltf with its buffer inside.
function triangle() {
  const buffer = Buffer.alloc(36);
  [0, 0, 0, 1, 0, 0, 0, 1, 0].forEach((value, i) => buffer.writeFloatLE(value, 4 * i));
  return JSON.stringify({
    asset: { version: "2.0" },
    scene: 0,
    scenes: [{ nodes: [0] }],
    nodes: [{ mesh: 0 }],
    meshes: [{ primitives: [{ attributes: { POSITION: 0 } }] }],
    accessors: [{ bufferView: 0, componentType: 5126, count: 3, type: "VEC3", min: [0, 0, 0], max: [1, 1, 0] }],
    bufferViews: [{ buffer: 0, byteLength: 36 }],
    buffers: [{ byteLength: 36, uri: `data:application/octet-stream;base64,${buffer.toString("base64")}` }],
  });
}

async function submit(url, spec, wait_s = 60) {
  const response = await fetch(`${url}/v1/jobs`, {
    method: "POST",
    headers: { "Content-Type": "application/json", Prefer: `wait=${wait_s}` },
    body: JSON.stringify({ spec }),
  });
  if (response.status >= 300) throw new Error(await response.text());
  return response.json();
}

async function bake(url, spec) {
  const started = performance.now();
  const job = await finished(url, (await submit(url, spec)).id);
  if (job.state !== "succeeded") throw new Error(JSON.stringify(job.error));
  return { job, seconds: (performance.now() - started) / 1000 };
}

function residentMiB(pid) {
  return Number(/VmRSS:\s+(\d+)/.exec(readFileSync(`/proc/${pid}/status`, "utf8"))[1]) / 1024;
}

// Requests a second of GET `path`, eight connections for four seconds.
function readsPerSecond(url, path) {
  const output = execFileSync("wrk", ["-t1", "-c8", "-d4s", "--latency", `${url}${path}`], { encoding: "utf8" });
  const rate = Number(/Requests\/sec:\s+([\d.]+)/.exec(output)[1]);
  const slowest = /99%\s+(\S+)/.exec(output)[1];
  const refused = /Non-2xx or 3xx responses: (\d+)/.exec(output)?.[1] ?? 0;
  return `${Math.round(rate)} a second, p99 ${slowest}, ${refused} refused`;
}

// One order of the products that an engine needs of a map, on a daemon that knows the map and whose
// oven waits. Every order asks for another error by a hair, so that the store answers none of them.
async function measureWarmMaps(url) {
  const source = join(data, "environments", "latlong_hdr", "kloppenheim_05_1k.hdr");
  if (!existsSync(source)) {
    say("chain + SH + irradiance + DFG of a 2k HDR", "left out: no shared/data folder beside the project");
    return;
  }
  const path = join(folder, "2k.hdr");
  writeFileSync(path, doubledHdr(readFileSync(source)));
  const environment = await upload(url, path);
  const parameters = { prefilter: {}, sh: {}, irradiance: {}, dfg: {} };
  let order = 0;
  for (const check_texels of [4, 0]) {
    const runs = [];
    for (let i = 0; i < 10; i += 1) {
      const accuracy = { target_error: 0.001 + 1e-9 * (order += 1), check_texels };
      const { job, seconds } = await bake(url, { kind: "environment_maps", inputs: { environment }, parameters, accuracy });
      if (job.from_cache) throw new Error("the store answered");
      const { items } = await (await fetch(`${url}/v1/jobs/${job.id}/events?limit=100`)).json();
      const time = (stage) => Date.parse(items.find((event) => event.data.stage === stage).time);
      const begin = Date.parse(job.started_at), end = Date.parse(job.finished_at);
      const phases = [time("bake") - begin, time("assemble") - time("bake"), end - time("assemble")];
      runs.push({ seconds, phases: phases.map((ms) => (ms / 1000).toFixed(2)).join(" + ") });
    }
    const [fastest, ...rest] = runs.slice(1).toSorted((a, b) => a.seconds - b.seconds);
    say(
      `chain + SH + irradiance + DFG of a 2k HDR, ${check_texels} texels checked`,
      `${fastest.seconds.toFixed(2)} s at least (plan, bake, assemble: ${fastest.phases}), ` +
        `${rest[3].seconds.toFixed(2)} s in the median of 9`,
    );
  }
}

const folder = mkdtempSync(join(tmpdir(), "lightkiln-bench-"));
const daemon = await startDaemon();
try {
  say("machine", `${cpus().length} x ${cpus()[0].model}`);
  say("idle daemon, resident", `${residentMiB(daemon.pid).toFixed(1)} MiB`);

  writeFileSync(join(folder, "triangle.gltf"), triangle());
  const scene = await upload(daemon.url, join(folder, "triangle.gltf"));
  const warm = [];
  for (let seed = 0; seed < 9; seed += 1) {
    const spec = { kind: "ambient_occlusion", inputs: { scene }, seed };
    warm.push((await bake(daemon.url, spec)).seconds);
  }
  say("AO of one triangle, submit to artifacts", `${Math.round(median(warm.slice(1)) * 1000)} ms (median of 8)`);

  await measureWarmMaps(daemon.url);

  const idle = (await fetch(`${daemon.url}/v1/jobs?limit=1`)).json();
  const id = (await idle).items[0].id;
  say("status reads, idle", readsPerSecond(daemon.url, `/v1/jobs/${id}`));

  const hotel = join(data, "scenes", "interior_hotel_room", "hotel-room.decoded.glb");
  if (existsSync(hotel)) {
    const started = performance.now();
    const blob = await upload(daemon.url, hotel);
    const room = { kind: "ambient_occlusion", inputs: { scene: blob }, accuracy: { target_error: 0.02 } };
    const { job } = await bake(daemon.url, room);
    const accuracy = await (await fetch(`${daemon.url}${job.links.accuracy}`)).json();
    say("AO of the hotel room at 0.02, upload to artifacts", `${((performance.now() - started) / 1000).toFixed(1)} s`);
    say("  predicted and actual seconds of baking", `${accuracy.predicted_s.toFixed(1)} and ${accuracy.actual_s.toFixed(1)}`);

    const other = await submit(daemon.url, { ...room, accuracy: { target_error: 0.002 }, seed: 1 }, 0);
    while ((await (await fetch(`${daemon.url}/v1/jobs/${other.id}`)).json()).stage !== "bake") {
      await new Promise((resolve) => setTimeout(resolve, 50));
    }
    say("status reads while baking", readsPerSecond(daemon.url, `/v1/jobs/${other.id}`));
    const asked = performance.now();
    await fetch(`${daemon.url}/v1/jobs/${other.id}:cancel`, { method: "POST" });
    await finished(daemon.url, other.id);
    say("cancel of a running bake", `${Math.round(performance.now() - asked)} ms`);
  } else {
    say("hotel room", "left out: no shared/data folder beside the project");
  }
  say("daemon after all that, resident", `${residentMiB(daemon.pid).toFixed(1)} MiB`);
} finally {
  await daemon.stop();
  rmSync(folder, { recursive: true, force: true });
}
