// One job from order to artifacts: what it will do and why, what accuracy costs, what came out.

import { addressOf, get, hasToken, post } from "/api.js";
import { element, facts, render, table } from "/dom.js";
import * as format from "/format.js";
import { progressOf } from "/jobs_page.js";
import { errorPlot, pointsOfRounds } from "/plot.js";

function headerOf(job) {
  const act = (label, link) =>
    element("button", { onclick: () => post(link).catch((error) => alert(error.message)) }, label);
  return [
    element("h1", {}, job.name || job.id),
    facts([
      ["State", element("span", { class: `state state-${job.state}`, id: "state" }, job.state)],
      ["Why", job.reason],
      ["Progress", job.state === "running" ? element("span", {}, progressOf(job)) : ""],
      ["Time left", job.terminal ? "" : format.seconds(job.progress?.eta_s)],
      ["Error now", `${format.error(job.quality?.error)} (ordered ${format.error(job.quality?.target)})`],
      ["Kind", job.kind.replaceAll("_", " ")],
      ["Id", element("code", {}, job.id)],
      ["Spec digest", element("span", { class: "digest" }, job.spec_digest)],
      ["Submitted", format.time(job.created_at)],
      ["Finished", job.finished_at ? format.time(job.finished_at) : ""],
      ["From the store", job.from_cache ? "yes: an identical order was baked before" : ""],
    ]),
    job.error &&
      element(
        "p",
        { class: "problem", role: "alert" },
        `${job.error.code}: ${job.error.detail}`,
        job.error.pointer && element("div", { class: "digest" }, job.error.pointer),
      ),
    element(
      "p",
      {},
      !job.terminal && act("Cancel", job.links.cancel),
      (job.state === "failed" || job.state === "cancelled") && act("Retry", job.links.retry),
    ),
  ];
}

function planOf(plan) {
  const effect = (item) => [
    item.effect.replaceAll("_", " "),
    element("span", { class: item.active ? "on" : "off" }, item.active ? "simulated" : "left out"),
    item.reason,
    format.error(item.bound),
  ];
  const price = (item) => [
    `${Number((item.error * 100).toPrecision(2))} %`,
    format.count(item.samples),
    (item.extrapolated ? "≈ " : "") + format.seconds(item.seconds),
  ];
  return [
    element("h2", {}, "Plan"),
    element(
      "p",
      { class: "quiet" },
      `Elements: ${format.count(plan.elements)} (${plan.element_unit}), chunks: ${plan.chunks.length}; predicted ${format.seconds(plan.predicted_s)}.`,
    ),
    plan.warnings?.map((text) => element("p", { class: "problem" }, text)),
    table(["Effect", "", "Why", "#Bound"], plan.effects.map(effect)),
    plan.repairs.length > 0 &&
      facts(plan.repairs.map((item) => [item.what.replaceAll("_", " "), format.count(item.count)])),
    element("h2", {}, "What accuracy costs, as predicted"),
    table(["#Error", "#Samples", "#Time"], plan.prices.map(price)),
  ];
}

// What became of the prediction.
function billOf(accuracy) {
  return [
    element("h2", {}, "What accuracy cost"),
    facts([
      ["Status", accuracy.status],
      ["Predicted", format.seconds(accuracy.predicted_s)],
      ["Actual", `${format.seconds(accuracy.actual_s)}, ${format.seconds(accuracy.cpu_s)} of CPU`],
      ["Error", `${format.error(accuracy.error_rms)} rms, ${format.error(accuracy.error_max)} at worst`],
      ["Error is", accuracy.error_unit],
      ["Left out", accuracy.bias_bound > 0 ? `at most ${format.error(accuracy.bias_bound)}` : ""],
    ]),
  ];
}

async function previewsOf(artifacts) {
  const figures = [];
  for (const item of artifacts.filter((artifact) => artifact.role === "preview")) {
    const image = element("img", { src: await addressOf(item.href), alt: item.name, loading: "lazy" });
    figures.push(element("figure", {}, image, element("figcaption", {}, item.name)));
  }
  return element("div", { class: "previews" }, figures);
}

function artifactsOf(artifacts) {
  const download = async (event, item) => {
    if (!hasToken()) return;
    event.preventDefault();
    const link = element("a", { href: await addressOf(item.href), download: item.name });
    link.click();
  };
  return table(
    ["Artifact", "Role", "#Size", "Digest"],
    artifacts.map((item) => [
      element("a", { href: item.href, download: item.name, onclick: (event) => download(event, item) }, item.name),
      item.role,
      format.bytes(item.bytes),
      element("span", { class: "digest" }, item.digest.slice(0, 23) + "…"),
    ]),
  );
}

export function jobPage(page, id) {
  const parts = ["head", "plot", "bill", "plan", "artifacts"].map((name) => element("section", { id: `job-${name}` }));
  const [head, plot, bill, plan, artifacts] = parts;
  const canvas = element("div", { class: "plot", role: "img", "aria-label": "error against time" });
  const numbers = element("details", {});
  page.replaceChildren(...parts);

  const drawPlot = (convergence) => {
    const points = pointsOfRounds(convergence.rounds);
    if (points.length === 0) return;
    if (!canvas.isConnected) {
      plot.replaceChildren(element("h2", {}, "Error against time"), canvas, numbers);
    }
    render(numbers, JSON.stringify(points), () => [
      element("summary", {}, "The same as a table"),
      table(
        ["#Seconds", "#Error"],
        points.map((point) => [format.seconds(point.seconds), format.error(point.error)]),
      ),
    ]);
    errorPlot(canvas, points, convergence.target_error);
  };

  let drawn = "";
  return async () => {
    const job = await get(`/v1/jobs/${id}`);
    render(head, JSON.stringify(job), () => headerOf(job));
    if (job.stage !== "plan") {
      const planned = await get(job.links.plan);
      render(plan, JSON.stringify(planned), () => planOf(planned));
    }
    const convergence = await get(job.links.convergence);
    const key = JSON.stringify(convergence);
    if (key !== drawn) {
      drawn = key;
      drawPlot(convergence);
    }
    if (job.state === "succeeded" && !job.plan_only) {
      const accuracy = await get(job.links.accuracy);
      render(bill, JSON.stringify(accuracy), () => billOf(accuracy));
      const { items } = await get(job.links.artifacts);
      const previews = artifacts.dataset.key === job.id ? null : await previewsOf(items);
      render(artifacts, job.id, () => [element("h2", {}, "Artifacts"), previews, artifactsOf(items)]);
    }
    return job.terminal ? 5000 : 500;
  };
}
