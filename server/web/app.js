// Which page is shown, and when it asks again. A page is a function that returns its refresher: an async
// function that brings the page up to date and returns how many milliseconds to wait.

import { Problem, setToken } from "/api.js";
import { element } from "/dom.js";
import { jobPage } from "/job_page.js";
import { jobsPage } from "/jobs_page.js";

const page = document.getElementById("page");
const freshness = document.getElementById("freshness");
const tokenForm = document.getElementById("token-form");
let turn = 0; // rises with every navigation; a refresher of an earlier page stops

function open() {
  const [path, query] = location.hash.replace(/^#/, "").split("?");
  const job = /^\/jobs\/([A-Za-z0-9]+)$/.exec(path);
  return job ? jobPage(page, job[1]) : jobsPage(page, new URLSearchParams(query));
}

async function show() {
  const mine = ++turn;
  const refresh = open();
  for (let failures = 0; mine === turn; ) {
    let wait = 1000;
    try {
      if (!document.hidden) wait = await refresh();
      failures = 0;
      freshness.textContent = `updated ${new Date().toLocaleTimeString()}`;
    } catch (error) {
      failures += 1;
      wait = Math.min(15000, 500 * 2 ** failures);
      tokenForm.hidden = !(error instanceof Problem && error.status === 401);
      freshness.textContent = `not updated: ${error.message}`;
      if (error instanceof Problem && error.status === 404) {
        page.replaceChildren(element("p", { class: "problem" }, error.message));
        return;
      }
    }
    await new Promise((resolve) => setTimeout(resolve, wait));
  }
}

tokenForm.addEventListener("submit", (event) => {
  event.preventDefault();
  setToken(document.getElementById("token").value);
  tokenForm.hidden = true;
  show();
});
addEventListener("hashchange", show);
show();
