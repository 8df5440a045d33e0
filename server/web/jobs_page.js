// The list of jobs: state, progress, time left and current error. Filters live in the address.

import { get } from "/api.js";
import { element, render, table } from "/dom.js";
import * as format from "/format.js";

const states = ["", "queued", "running", "succeeded", "failed", "cancelled"];
const kinds = ["", "ambient_occlusion", "environment_maps", "probes"];

function choice(label, name, values, query, onchange) {
  const select = element(
    "select",
    { name, onchange },
    values.map((value) =>
      element("option", { value, selected: (query.get(name) ?? "") === value }, value || "any"),
    ),
  );
  return element("label", {}, `${label} `, select);
}

export function progressOf(job) {
  const fraction = job.progress?.fraction ?? 0;
  if (job.state === "succeeded") return "done";
  if (job.state !== "running") return job.reason ?? "";
  const percent = Math.round(fraction * 100);
  return [
    element("progress", { max: 1, value: fraction, "aria-label": `${percent} % done` }),
    ` ${percent} %`,
    element("div", { class: "quiet" }, job.stage ?? ""),
  ];
}

function row(job) {
  return [
    element("a", { href: `#/jobs/${job.id}` }, job.name || job.id),
    job.kind.replaceAll("_", " "),
    element("span", { class: `state state-${job.state}` }, job.state),
    progressOf(job),
    job.terminal ? "" : format.seconds(job.progress?.eta_s),
    format.error(job.quality?.error),
    format.error(job.quality?.target),
    format.time(job.created_at),
  ];
}

export function jobsPage(page, query) {
  const change = (event) => {
    const next = new URLSearchParams(query);
    next.delete("after");
    if (event.target.value) next.set(event.target.name, event.target.value);
    else next.delete(event.target.name);
    location.hash = `#/?${next}`;
  };
  const list = element("div", {});
  page.replaceChildren(
    element("h1", {}, "Jobs"),
    element(
      "div",
      { class: "filters" },
      choice("State", "state", states, query, change),
      choice("Kind", "kind", kinds, query, change),
      element(
        "label",
        {},
        "Name or id ",
        element("input", { name: "text", type: "search", value: query.get("text") ?? "", onchange: change }),
      ),
    ),
    list,
  );
  return async () => {
    const path = `/v1/jobs?${new URLSearchParams([...query, ["limit", "50"]])}`;
    const body = await get(path);
    render(list, JSON.stringify(body), () => {
      if (body.items.length === 0) return element("p", { class: "quiet" }, "No job matches. Order one with `kiln bake`.");
      const headings = ["Name", "Kind", "State", "Progress", "#Left", "#Error", "#Ordered", "Submitted"];
      const more = new URLSearchParams(query);
      more.set("after", body.next ?? "");
      return [
        table(headings, body.items.map(row)),
        body.next && element("p", {}, element("a", { href: `#/?${more}` }, "Older jobs")),
      ];
    });
    return body.items.some((job) => !job.terminal) ? 700 : 2500;
  };
}
