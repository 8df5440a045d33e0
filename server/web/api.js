// The daemon's API as the pages use it: every read is conditional, so that polling an unchanged job costs
// one small 304.

const cache = new Map(); // path -> {etag, body}
let token = sessionStorage.getItem("token") ?? "";

export class Problem extends Error {
  constructor(document, status) {
    super(document.detail ?? document.title ?? `HTTP ${status}`);
    this.document = document;
    this.status = status;
  }
}

export function setToken(text) {
  token = text;
  sessionStorage.setItem("token", text);
  cache.clear();
}

export const hasToken = () => token !== "";

function headers(more = {}) {
  return token ? { ...more, Authorization: `Bearer ${token}` } : more;
}

async function refuse(response) {
  const type = response.headers.get("content-type") ?? "";
  const document = type.includes("json") ? await response.json() : { title: response.statusText };
  throw new Problem(document, response.status);
}

// Returns the body of GET path, from memory when the server says that it has not changed.
export async function get(path) {
  const known = cache.get(path);
  const response = await fetch(path, {
    headers: headers(known?.etag ? { "If-None-Match": known.etag } : {}),
    cache: "no-store",
  });
  if (response.status === 304) return known.body;
  if (!response.ok) await refuse(response);
  const body = await response.json();
  cache.set(path, { etag: response.headers.get("etag"), body });
  if (cache.size > 200) cache.delete(cache.keys().next().value);
  return body;
}

export async function post(path) {
  const response = await fetch(path, {
    method: "POST",
    headers: headers({ "Content-Type": "application/json", "X-Lightkiln-Client": "dashboard" }),
  });
  if (!response.ok) await refuse(response);
  return response.json();
}

// An address for <img> and downloads; with a token the bytes come through memory, since an address must
// never carry a secret.
export async function addressOf(href) {
  if (!hasToken()) return href;
  const response = await fetch(href, { headers: headers() });
  if (!response.ok) await refuse(response);
  return URL.createObjectURL(await response.blob());
}
