// The studies to choose from.

import { byId, make } from "./dom.js";
import { tell } from "./store.js";

/** @param {any[]} entries */
export function show(entries) {
  const cards = (/** @type {string} */ title, /** @type {any[]} */ list) => (list.length === 0 ? [] : [make("h2", { text: title }), make("div", { class: "cards" }, ...list.map(card))]);
  const of = (/** @type {string} */ begin) => entries.filter((entry) => entry.id.startsWith(begin));
  byId("gallery").replaceChildren(...cards("Study files in this folder", of("file:")), ...cards("Templates", of("template:")));
  byId("gallery").hidden = false;
  byId("workbench").hidden = true;
  byId("title").textContent = "Studies";
  tell("gallery");
}

/** @param {any} entry */
function card(entry) {
  return make("button", { type: "button", class: "card", "data-study": entry.id, onclick: () => tell("choose", entry.id) },
    make("strong", { text: entry.name }), make("span", { text: entry.summary }), make("span", { class: "kind", text: entry.kind }));
}
