// Pinned curves: names, a table of their peaks, and what was changed.

import { byId, make } from "./dom.js";
import { digits, si } from "./format.js";
import { keyOf, on, state, tell } from "./store.js";

/** Largest number of rows of a pin. */
const MOST = 24;

let panel;
let visible = false;

/** @param {any} place */
export function start(place) {
  panel = place;
  on("pin", pin);
  on("opened", show);
  on("pins", show);
  on("pins", keep);
  on("restore", restore);
  on("result", () => { if (visible) { show(); } });
  on("tab", (/** @type {string} */ name) => { visible = name === "compare"; if (visible) { show(); } });
}

const storageKey = () => `pins:${state.study}`;

/** Keeps the pins for a reload of this tab, if they fit in its storage. */
function keep() {
  try { sessionStorage.setItem(storageKey(), JSON.stringify(state.pins)); } catch { sessionStorage.removeItem(storageKey()); }
}

/** Takes the pins of this tab before its reload. */
function restore() {
  const kept = sessionStorage.getItem(storageKey());
  if (kept) { state.pins = JSON.parse(kept); tell("pins"); }
}

/** The key of changes, whatever their order. @param {any[]} changes */
const changesKey = (changes) => JSON.stringify(changes.map((change) => [keyOf(change.path), change.value]).sort());

/** The pins, and the present curve if it is none of them. @returns {any[]} */
function compared() {
  const { result, changes, pins } = state;
  const all = pins.map((/** @type {any} */ pin, /** @type {number} */ index) => ({ ...pin, index }));
  const now = [...changes.values()];
  if (!result || result.reduced || pins.some((/** @type {any} */ pin) => changesKey(pin.changes) === changesKey(now))) { return all; }
  return [...all, { name: `${nameOf(now)} (not pinned)`, result, index: null }];
}

function pin() {
  if (!state.result || state.result.reduced) { return; }
  const changes = [...state.changes.values()];
  state.pins.push({ name: unique(nameOf(changes)), changes, result: state.result });
  state.pins = state.pins.slice(-8);
  tell("pins");
}

/** Changes in words. @param {any[]} changes */
export const nameOf = (changes) => changes.map(words).filter((text) => text !== "").join(", ") || "as in the file";

/** @param {any} change */
function words(change) {
  if (change.value === "remove") { return ""; }
  const name = change.path[0] === "parameters" ? change.path[1] : keyOf(change.path);
  return `${name} = ${change.value.text ?? change.value.number ?? change.value.count ?? change.value.law}`;
}

/** @param {string} name */
function unique(name) {
  let text = name;
  for (let i = 2; state.pins.some((/** @type {any} */ pin) => pin.name === text); i += 1) { text = `${name} (${i})`; }
  return text;
}

/** The peaks of a result, as rows. @param {any} result */
export function peaks(result) {
  const table = result.tables.peaks ?? result.tables.optimum;
  if (!table) { return []; }
  const column = (/** @type {string} */ name) => table.find((/** @type {any} */ one) => one.name === name)?.values;
  const [frequency, amplitude, mass, status] = [column("frequency_Hz"), column("amplitude_m"), column("mass") ?? column("place"), column("status")];
  const end = table.findIndex((/** @type {any} */ one) => ["mass", "place", "frequency_Hz"].includes(one.name));
  return (amplitude ?? []).map((/** @type {number} */ value, /** @type {number} */ row) => ({
    case: table.slice(0, Math.max(0, end)).map((/** @type {any} */ one) => `${one.name.replace(/_[^_]*$/, "")} = ${digits(one.values[row], 4)} ${one.unit ?? ""}`.trim()).join(", "),
    mass: mass?.[row] ?? "", frequency: frequency?.[row] ?? null, amplitude: value, doubt: ["converged", undefined].includes(status?.[row]) ? "" : status[row],
  }));
}

function show() {
  panel.replaceChildren();
  if (state.pins.length === 0) {
    panel.append(make("p", { class: "empty", text: "Nothing is pinned. Move sliders, then press “Pin this curve” beside the response: the curve stays in the plot, dashed, and its peaks are compared here." }));
    return;
  }
  const all = compared();
  const isCase = all.some((one) => peaks(one.result).some((/** @type {any} */ peak) => peak.case));
  panel.append(summary(all, isCase), make("h2", { text: "Peaks of every place and case" }), make("div", { class: "scroll" }, make("table", {},
    make("thead", {}, header(["Pin", isCase && "Case", "Place", "Peak at (Hz)", "Peak", "Action"], ["Peak at (Hz)", "Peak"])),
    make("tbody", {}, ...all.flatMap((one) => rows(one, isCase))))));
}

/** @param {(string | false)[]} titles @param {string[]} numbers titles of columns of numbers */
const header = (titles, numbers) => make("tr", {}, ...titles.filter((text) => text).map((text) => make("th", { text, scope: "col", class: numbers.includes(String(text)) ? "number" : null })));

/** The highest peak of every curve, and how it compares with the first pin. @param {any[]} all @param {boolean} isCase */
function summary(all, isCase) {
  const best = all.map((one) => peaks(one.result).reduce((/** @type {any} */ so, /** @type {any} */ peak) => (so && so.amplitude >= peak.amplitude ? so : peak), null));
  const change = (/** @type {any} */ one) => (one && best[0] && one !== best[0] ? `${one.amplitude > best[0].amplitude ? "+" : "−"}${digits(Math.abs(100 * (one.amplitude / best[0].amplitude - 1)), 3)} %` : "");
  const numbers = ["Highest peak", "Against the first pin", "At (Hz)"];
  return make("div", { class: "scroll" }, make("table", { id: "pin-summary" }, make("caption", { text: "Highest peak of each pin" }),
    make("thead", {}, header(["Pin", ...numbers, "Place", isCase && "Case"], numbers)),
    make("tbody", {}, ...all.map((one, row) => make("tr", {}, make("th", { scope: "row", text: one.name }),
      make("td", { class: "number", text: best[row] ? height(best[row]) : "–" }), make("td", { class: "number", text: change(best[row]) }),
      make("td", { class: "number", text: best[row]?.frequency ? digits(best[row].frequency, 6) : "" }), make("td", { text: best[row]?.mass ?? "" }), isCase ? make("td", { text: best[row]?.case ?? "" }) : null)))));
}

/** A peak in words, with its status if that is not `converged`. @param {any} peak */
export const height = (peak) => `${si(peak.amplitude, "m", 4)}${peak.doubt ? ` (${peak.doubt})` : ""}`;

/** The highest peak of every place in every case. @param {any[]} list */
function highest(list) {
  const best = new Map();
  for (const peak of list) {
    const key = `${peak.case}|${peak.mass}`;
    if (!(best.get(key)?.amplitude >= peak.amplitude)) { best.set(key, peak); }
  }
  return [...best.values()];
}

/** The rows of a pin, or of the present curve. @param {any} one @param {boolean} isCase */
function rows(one, isCase) {
  const list = highest(peaks(one.result));
  const shown = list.length > 0 ? list : [{ case: "", mass: "", frequency: null, amplitude: null }];
  const pin = one.index === null ? null : state.pins[one.index];
  const id = `pin-${one.index}`;
  const name = pin ? make("input", { type: "text", id, "aria-label": "Name of the pin", value: pin.name, size: "22", onchange: () => { pin.name = byId(id).value; tell("pins"); } }) : one.name;
  const action = pin
    ? make("button", { type: "button", class: "link", text: "remove", "aria-label": `Remove ${pin.name}`, onclick: () => { state.pins.splice(one.index, 1); tell("pins"); } })
    : make("button", { type: "button", class: "link", text: "pin", "aria-label": "Pin the present curve", onclick: () => tell("pin") });
  return shown.slice(0, MOST).map((/** @type {any} */ peak, /** @type {number} */ row) => make("tr", {},
    make("td", {}, row === 0 ? name : ""), isCase ? make("td", { text: peak.case }) : null,
    make("td", { text: peak.mass }), make("td", { class: "number", text: peak.frequency === null ? "" : digits(peak.frequency, 6) }),
    make("td", { class: "number", text: peak.amplitude === null ? "" : height(peak) }), make("td", {}, row === 0 ? action : "")));
}
