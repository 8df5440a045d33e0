// The dashboard in a real browser: a job is ordered, the page follows it to its end, and the plot shows
// the points that the API reports.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";

import { chromium } from "playwright-core";

import { finished, orderDemo, startDaemon } from "./daemon.mjs";

let daemon;
let browser;
const complaints = [];

before(async () => {
  daemon = await startDaemon();
  browser = await chromium.launch({
    executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
    args: ["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update"],
  });
});

after(async () => {
  await browser?.close();
  await daemon?.stop();
});

async function open(hash) {
  const page = await browser.newPage({ viewport: { width: 1200, height: 1600 } });
  page.on("pageerror", (error) => complaints.push(String(error)));
  page.on("console", (message) => {
    if (message.type() === "error") complaints.push(message.text());
  });
  await page.goto(`${daemon.url}/${hash}`);
  return page;
}

test("a job is followed from order to artifacts, and the plot shows its points", async () => {
  const slower = (spec) => ({ ...spec, accuracy: { target_error: 0.006 } });
  // The browser's first page takes longer than the job on a busy machine: it is there before.
  const page = await open("#/");
  await page.waitForSelector("main");
  const job = await orderDemo(daemon.url, "ambient_occlusion", slower);
  await page.evaluate((hash) => (location.hash = hash), `#/jobs/${job.id}`);
  await page.waitForSelector("#state");
  const seen = new Set();
  for (let state = ""; state !== "succeeded"; ) {
    state = await page.textContent("#state");
    seen.add(state);
    assert.ok(["queued", "running", "succeeded"].includes(state), `unexpected state ${state}`);
    await page.waitForTimeout(20);
  }
  assert.ok(seen.has("queued") || seen.has("running"), "the page opened only after the job had ended");

  await page.waitForSelector("#job-artifacts img");
  const api = await (await fetch(`${daemon.url}${job.links.convergence}`)).json();
  const expected = api.rounds.filter((round) => round.error_rms > 0).length;
  assert.ok(expected >= 2, "an adaptive bake takes at least two rounds");
  await page.waitForFunction((n) => document.querySelector(".plot")?.dataset.points === String(n), expected);
  const ink = await page.$eval(".plot canvas", (canvas) => {
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    let blue = 0;
    for (let i = 0; i < data.length; i += 4) if (data[i + 2] > 120 && data[i] < 60 && data[i + 3] > 200) blue += 1;
    return blue;
  });
  assert.ok(ink > 50, `the error curve is not drawn (${ink} pixels of its colour)`);
  assert.equal(await page.locator("#job-plan table").count(), 2);
  const broken = await page.$$eval("#job-artifacts img", (images) => images.filter((i) => i.naturalWidth === 0).length);
  assert.equal(broken, 0, "a preview did not load");
  if (process.env.SCREENSHOTS) await page.screenshot({ path: `${process.env.SCREENSHOTS}/job.png`, fullPage: true });
  await page.close();
});

test("the list filters by state through its address and links to the job", async () => {
  const job = await orderDemo(daemon.url, "environment_maps");
  await finished(daemon.url, job.id);
  const page = await open("#/?state=succeeded");
  const link = page.locator(`a[href="#/jobs/${job.id}"]`);
  await link.waitFor();
  if (process.env.SCREENSHOTS) await page.screenshot({ path: `${process.env.SCREENSHOTS}/jobs.png` });
  await page.selectOption("select[name=state]", "failed");
  await page.waitForFunction(() => document.querySelector("main").textContent.includes("No job matches"));
  assert.ok(page.url().includes("state=failed"));
  await page.close();
});

test("polling an unchanged job is answered with 304", async () => {
  const { items } = await (await fetch(`${daemon.url}/v1/jobs?limit=1`)).json();
  const page = await open(`#/jobs/${items[0].id}`);
  await page.waitForSelector("#job-artifacts img");
  const response = await page.waitForResponse((r) => r.url().endsWith(`/v1/jobs/${items[0].id}`), { timeout: 15000 });
  assert.equal(response.status(), 304);
  await page.close();
});

test("a name that is markup stays text", async () => {
  const response = await fetch(`${daemon.url}/v1/jobs?limit=1`);
  assert.equal(response.status, 200);
  const hostile = "<img src=x onerror=window.pwned=1>";
  const job = await orderDemo(daemon.url, "environment_maps", (spec) => spec);
  assert.ok(job.id);
  const page = await open(`#/jobs/${job.id}`);
  await page.waitForSelector("#state");
  await page.route("**/v1/jobs/*", async (route) => {
    const body = { ...job, name: hostile };
    await route.fulfill({ status: 200, json: body, headers: { etag: '"changed"' } });
  });
  await page.waitForFunction((text) => document.querySelector("h1")?.textContent === text, hostile);
  assert.equal(await page.evaluate(() => window.pwned), undefined);
  await page.close();
});

test("the browser had nothing to complain of", () => {
  assert.deepEqual(complaints, []);
});
