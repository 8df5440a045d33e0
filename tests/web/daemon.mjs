// A kilnd on a free loopback port with a store of its own, for one test file.

import { spawn } from "node:child_process";
import { createHash } from "node:crypto";
import { existsSync, mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath } from "node:url";

export const project = fileURLToPath(new URL("../..", import.meta.url));
const binaries = process.env.LIGHTKILN_BINARY_DIR ?? join(project, "build", "test");

const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

export async function startDaemon() {
  const folder = mkdtempSync(join(tmpdir(), "lightkiln-web-"));
  const portFile = join(folder, "port");
  const child = spawn(
    join(binaries, "kilnd"),
    ["serve", "--store", join(folder, "store"), "--listen", "127.0.0.1:0", "--port-file", portFile, "--parent-watch",
      "--allow-missing-sandbox", "all"],
    { stdio: ["ignore", "ignore", "pipe"] },
  );
  let log = "";
  child.stderr.on("data", (text) => (log += text));
  for (let tries = 0; !existsSync(portFile) || readFileSync(portFile, "utf8").trim() === ""; tries += 1) {
    if (tries > 100 || child.exitCode !== null) throw new Error(`kilnd did not start:\n${log}`);
    await sleep(100);
  }
  const url = `http://127.0.0.1:${readFileSync(portFile, "utf8").trim()}`;
  const stop = async () => {
    child.kill("SIGTERM");
    await new Promise((resolve) => (child.exitCode !== null ? resolve() : child.once("exit", resolve)));
    rmSync(folder, { recursive: true, force: true });
  };
  return { url, stop, pid: child.pid };
}

export async function upload(url, path) {
  const bytes = readFileSync(path);
  const digest = `sha256:${createHash("sha256").update(bytes).digest("hex")}`;
  const response = await fetch(`${url}/v1/blobs/${digest}`, { method: "PUT", body: bytes });
  if (!response.ok) throw new Error(`upload of ${path}: ${response.status} ${await response.text()}`);
  return digest;
}

// Orders one of the files of deploy/demo, with `change` applied to its spec.
export async function orderDemo(url, name, change = (spec) => spec) {
  const folder = join(project, "deploy", "demo");
  const spec = JSON.parse(readFileSync(join(folder, `${name}.json`), "utf8"));
  for (const [role, file] of Object.entries(spec.inputs)) spec.inputs[role] = await upload(url, join(folder, file));
  const response = await fetch(`${url}/v1/jobs`, {
    method: "POST",
    headers: { "Content-Type": "application/json", "Idempotency-Key": `web-${name}-${Date.now()}` },
    body: JSON.stringify({ spec: change(spec), name }),
  });
  const body = await response.json();
  if (response.status !== 202) throw new Error(`submit ${name}: ${response.status} ${JSON.stringify(body)}`);
  return body;
}

export async function finished(url, id) {
  for (;;) {
    const job = await (await fetch(`${url}/v1/jobs/${id}`, { headers: { Prefer: "wait=20" } })).json();
    if (job.terminal) return job;
    await sleep(50);
  }
}
