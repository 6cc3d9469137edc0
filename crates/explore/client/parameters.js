// The list of parameters: a slider and a number field for every plain quantity, a text for every
// expression, and a menu for the law of every joint.

import { byId, make } from "./dom.js";
import { digits } from "./format.js";
import { change, changeAtOnce, commit, keyOf, on, quantityText, setQuantity, state } from "./store.js";

const STEPS = 1000;

/** Ranges of sliders that the user has changed, by path. @type {Map<string, {from: number, to: number, log: boolean}>} */
const ranges = new Map();

export function start() {
  on("opened", () => { ranges.clear(); byId("search").value = ""; show(); });
  on("described", show);
  byId("search").addEventListener("input", filter);
}

/** Draws all rows again, and keeps the focus. */
function show() {
  const groups = byId("groups");
  const focused = document.activeElement?.id;
  const closed = new Set([...groups.querySelectorAll("details:not([open])")].map((group) => group.dataset.name));
  const first = groups.childElementCount === 0;
  groups.replaceChildren();
  /** @type {Map<string, any>} */
  const made = new Map();
  for (const quantity of state.description.quantities) {
    if (!made.has(quantity.group)) {
      const name = title(quantity.group);
      const open = first ? made.size < 8 : !closed.has(quantity.group);
      const group = make("details", { class: "group", open, "data-name": quantity.group }, make("summary", { text: name }));
      const law = lawOf(quantity);
      if (law) { group.append(law); }
      groups.append(group);
      made.set(quantity.group, group);
    }
    made.get(quantity.group).append(row(quantity));
  }
  filter();
  if (focused) { byId(focused)?.focus({ preventScroll: true }); }
}

const title = (/** @type {string} */ group) => group.charAt(0).toUpperCase() + group.slice(1);

/** The value that the page shows: the changed one, or that of the study. @param {any} quantity */
function shown(quantity) {
  const value = state.changes.get(keyOf(quantity.path))?.value;
  const text = value?.text ?? (value?.number ?? value?.count)?.toString();
  if (text === undefined) { return { text: quantity.text, number: quantity.number }; }
  const number = quantity.number === null ? null : Number.parseFloat(text);
  return { text, number };
}

/** The name of a quantity; inside a table of [study] with the name of the table. @param {any} quantity */
const labelOf = (quantity) => (quantity.path[0] === "study" && quantity.group === "study" && quantity.path.length > 2 ? quantity.path.slice(1).join(" ") : quantity.name);

/** @param {any} quantity */
function row(quantity) {
  const key = keyOf(quantity.path);
  const id = `q-${key.replaceAll(".", "-")}`;
  const { text, number } = shown(quantity);
  const plain = number !== null && Number.isFinite(number);
  const changed = state.changes.has(key);
  const name = make("label", { class: "name", for: id, title: quantity.doc }, labelOf(quantity));
  if (quantity.doc && quantity.group === "parameters") { name.append(make("small", { text: quantity.doc })); }
  const problem = make("span", { class: "problem", id: `${id}-problem`, role: "status", hidden: true });
  const field = make("input", {
    type: "text", id, inputmode: plain ? "decimal" : null, spellcheck: "false", autocomplete: "off", title: plain ? null : "An expression over parameters",
    value: plain ? digits(number, 6) : text, "aria-describedby": `${id}-problem`,
    onchange: () => typed(quantity, field, problem),
    onkeydown: (/** @type {KeyboardEvent} */ event) => {
      if (event.key === "Escape") { field.value = plain ? digits(shown(quantity).number ?? NaN, 6) : shown(quantity).text; field.select(); }
      if (event.key === "Enter") { field.dispatchEvent(new Event("change")); }
    },
  });
  const value = make("span", { class: "value" }, field, plain ? make("span", { class: "unit", text: quantity.unit }) : null);
  const box = make("div", { class: `row${changed ? " changed" : ""}${plain ? "" : " expression"}`, "data-words": words(quantity) }, name, value);
  if (plain) { box.append(slider(quantity, number, field)); }
  box.append(problem, note(quantity, changed, plain));
  return box;
}

const words = (/** @type {any} */ quantity) => `${quantity.name} ${quantity.group} ${quantity.doc}`.toLowerCase();

/** @param {any} quantity @param {any} field @param {any} problem */
function typed(quantity, field, problem) {
  const plain = quantity.number !== null;
  const text = field.value.trim();
  const number = Number(text.replace(",", "."));
  const wrong = plain && text !== "" && Number.isFinite(number) ? outside(quantity, number) : "";
  // an expression may also replace a number
  const isNumber = plain && text !== "" && Number.isFinite(number);
  const message = text === "" ? "Write a value." : wrong;
  field.setAttribute("aria-invalid", String(message !== ""));
  problem.hidden = message === "";
  problem.textContent = message;
  if (message) { return; }
  ranges.delete(keyOf(quantity.path));
  changeAtOnce(setQuantity(quantity, isNumber ? `${number}${quantity.unit ? ` ${quantity.unit}` : ""}` : text));
}

/** @param {any} quantity @param {number} number */
function outside(quantity, number) {
  if (quantity.range === "positive" && !(number > 0)) { return "The value must be more than zero."; }
  if (quantity.range === "zero" && !(number >= 0)) { return "The value must be zero or more."; }
  if (quantity.range === "count" && !(number >= 1 && Number.isInteger(number))) { return "The value must be a whole number from 1."; }
  return "";
}

/** The range of a slider: a decade around the value, logarithmic where the value is positive. */
export function rangeOf(/** @type {any} */ quantity, /** @type {number} */ number) {
  const key = keyOf(quantity.path);
  const known = ranges.get(key);
  if (known && number >= known.from && number <= known.to) { return known; }
  const whole = quantity.range === "count";
  const made = number > 0
    ? { from: whole ? Math.max(1, Math.floor(number / 5)) : number / 10, to: number * (whole ? 3 : 10), log: !whole }
    : number < 0 ? { from: 3 * number, to: -3 * number, log: false } : { from: 0, to: 1, log: false };
  ranges.set(key, made);
  return made;
}

/** @param {any} quantity @param {number} number @param {any} field */
function slider(quantity, number, field) {
  const range = rangeOf(quantity, number);
  const part = (/** @type {number} */ value) => (range.log
    ? Math.log(value / range.from) / Math.log(range.to / range.from) : (value - range.from) / (range.to - range.from));
  const at = (/** @type {number} */ part) => (range.log
    ? range.from * (range.to / range.from) ** part : range.from + part * (range.to - range.from));
  const input = make("input", {
    type: "range", id: `${field.id}-slider`, min: "0", max: String(STEPS), step: "1", value: String(Math.round(STEPS * part(number))),
    "aria-label": `${quantity.name}, slider`, "aria-valuetext": quantityText(quantity, number),
    oninput: () => {
      let value = at(Number(input.value) / STEPS);
      if (quantity.range === "count") { value = Math.max(1, Math.round(value)); }
      const text = quantityText(quantity, value);
      input.setAttribute("aria-valuetext", text);
      field.value = digits(Number.parseFloat(text), 6);
      change(setQuantity(quantity, text));
    },
    onchange: () => commit(),
  });
  return input;
}

/** @param {any} quantity @param {boolean} changed @param {boolean} plain */
function note(quantity, changed, plain) {
  const box = make("span", { class: "note" });
  if (quantity.varied) {
    const last = quantity.varied.at(-1);
    const list = quantity.varied.length > 4 ? `${quantity.varied[0]} … ${last}` : quantity.varied.join(", ");
    box.append(`Varied: ${list}`);
  }
  if (!changed && quantity.inherited) { box.append("from the template"); }
  if (changed) {
    const list = [{ path: quantity.path, value: undefined }, { path: ["study", "vary", quantity.name], value: undefined }];
    const was = state.original.quantities.find((/** @type {any} */ other) => keyOf(other.path) === keyOf(quantity.path));
    box.append(was ? `Was ${was.varied ? was.varied.join(", ") : was.text}` : "Changed");
    box.append(make("button", { type: "button", class: "link", text: "reset", "aria-label": `Reset ${quantity.name}`, onclick: () => changeAtOnce(list) }));
  }
  return box.childNodes.length > 0 ? box : "";
}

/** The menu for the law of the joint to which a quantity belongs. @param {any} quantity */
function lawOf(quantity) {
  const [list, index, key] = quantity.path;
  if (list !== "joint" || key !== "law") { return null; }
  const path = [list, index, "law"];
  const joint = state.description.model?.joints?.[index];
  const present = state.changes.get(keyOf(path))?.value?.law ?? joint?.law?.kind ?? joint?.law?.name ?? "";
  const own = state.description.laws.find((/** @type {any} */ law) => law.name === present);
  const id = `law-${index}`;
  const menu = make("select", {
    id, onchange: () => {
      const inner = [...state.changes.values()].filter((change) => keyOf(change.path).startsWith(`${keyOf(path)}.`));
      changeAtOnce([...inner.map((change) => ({ path: change.path, value: undefined })), { path, value: { law: menu.value } }]);
    },
  });
  const laws = state.description.laws.filter((/** @type {any} */ law) => !own || law.directions === own.directions);
  if (!own) { menu.append(make("option", { value: "", text: "Choose a law", selected: true })); }
  for (const law of laws) {
    menu.append(make("option", { value: law.name, text: law.name, title: law.summary, selected: law.name === present }));
  }
  return make("div", { class: "row", "data-words": `law ${quantity.group}` }, make("label", { class: "name", for: id, text: "law" }), menu);
}

function filter() {
  const wanted = byId("search").value.trim().toLowerCase();
  for (const group of byId("groups").children) {
    let any = false;
    for (const one of group.querySelectorAll(".row")) {
      one.hidden = wanted !== "" && !one.dataset.words.includes(wanted);
      any ||= !one.hidden;
    }
    group.hidden = !any;
    if (wanted !== "" && any) { group.open = true; }
  }
}
