// Elements from data. Text goes in as text nodes only, so nothing a client named can become markup.

export function element(name, properties = {}, ...children) {
  const node = document.createElement(name);
  for (const [key, value] of Object.entries(properties)) {
    if (value === undefined || value === null || value === false) continue;
    if (key === "class") node.className = value;
    else if (key.startsWith("on")) node.addEventListener(key.slice(2), value);
    else if (key in node && key !== "list") node[key] = value;
    else node.setAttribute(key, value);
  }
  for (const child of children.flat(Infinity)) {
    if (child === undefined || child === null || child === false) continue;
    node.append(child);
  }
  return node;
}

// A table from column headings and rows of cells; a heading "#name" aligns its column as numbers.
export function table(headings, rows, caption) {
  const numeric = headings.map((heading) => heading.startsWith("#"));
  const cell = (name, value, column) =>
    element(name, { class: numeric[column] ? "number" : undefined }, value);
  return element(
    "table",
    {},
    caption && element("caption", { class: "quiet" }, caption),
    element(
      "thead",
      {},
      element(
        "tr",
        {},
        headings.map((heading, i) => cell("th", heading.replace(/^#/, ""), i)),
      ),
    ),
    element(
      "tbody",
      {},
      rows.map((row) =>
        element(
          "tr",
          {},
          row.map((value, i) => cell("td", value, i)),
        ),
      ),
    ),
  );
}

export function facts(pairs) {
  return element(
    "dl",
    { class: "facts" },
    pairs
      .filter(([, value]) => value !== undefined && value !== null && value !== "")
      .map(([name, value]) => [element("dt", {}, name), element("dd", {}, value)]),
  );
}

// Replaces the children of `node` only when `key` says that the data changed, so that focus and selection
// survive a poll that brings nothing new.
export function render(node, key, make) {
  if (node.dataset.key === key) return;
  node.dataset.key = key;
  node.replaceChildren(...[make()].flat(Infinity).filter(Boolean));
}
