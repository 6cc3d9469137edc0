// Pinned curves: names, a table of their peaks, and what was changed.

import { byId, make } from "./dom.js";
import { digits, si } from "./format.js";
import { keyOf, on, state, tell } from "./store.js";

/** Largest number of rows of a pin. */
const MOST = 24;

let panel;

/** @param {any} place */
export function start(place) {
  panel = place;
  on("pin", pin);
  on("opened", show);
  on("pins", show);
}

function pin() {
  if (!state.result || state.result.reduced) { return; }
  const changes = [...state.changes.values()];
  const name = changes.map(words).filter((text) => text !== "").join(", ") || "as in the file";
  state.pins.push({ name: unique(name), changes, result: state.result });
  state.pins = state.pins.slice(-8);
  tell("pins");
}

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
  const [frequency, amplitude, mass] = [column("frequency_Hz"), column("amplitude_m"), column("mass") ?? column("place")];
  const end = table.findIndex((/** @type {any} */ one) => ["mass", "place", "frequency_Hz"].includes(one.name));
  return (amplitude ?? []).map((/** @type {number} */ value, /** @type {number} */ row) => ({
    case: table.slice(0, Math.max(0, end)).map((/** @type {any} */ one) => `${one.name.replace(/_[^_]*$/, "")} = ${digits(one.values[row], 4)} ${one.unit ?? ""}`.trim()).join(", "),
    mass: mass?.[row] ?? "", frequency: frequency?.[row] ?? null, amplitude: value,
  }));
}

function show() {
  panel.replaceChildren();
  if (state.pins.length === 0) {
    panel.append(make("p", { class: "empty", text: "Nothing is pinned. Move sliders, then press “Pin this curve” beside the response: the curve stays in the plot, dashed, and its peaks are compared here." }));
    return;
  }
  panel.append(summary(), make("h2", { text: "Peaks of every place and case" }), make("div", { class: "scroll" }, make("table", {},
    make("thead", {}, make("tr", {}, ...["Pin", "Case", "Place", "Peak at (Hz)", "Peak", "Action"].map((text, i) => make("th", { text, scope: "col", class: i === 3 || i === 4 ? "number" : null })))),
    make("tbody", {}, ...state.pins.flatMap((/** @type {any} */ one, /** @type {number} */ index) => rows(one, index))))));
}

/** The highest peak of every pin, and how it compares with the first pin. */
function summary() {
  const best = state.pins.map((/** @type {any} */ pin) => peaks(pin.result).reduce((/** @type {any} */ so, /** @type {any} */ peak) => (so && so.amplitude >= peak.amplitude ? so : peak), null));
  const change = (/** @type {any} */ one) => (one && best[0] && one !== best[0] ? `${one.amplitude > best[0].amplitude ? "+" : "−"}${digits(Math.abs(100 * (one.amplitude / best[0].amplitude - 1)), 3)} %` : "");
  return make("div", { class: "scroll" }, make("table", { id: "pin-summary" }, make("caption", { text: "Highest peak of each pin" }),
    make("thead", {}, make("tr", {}, ...["Pin", "Highest peak", "Against the first pin", "At (Hz)", "Place", "Case"].map((text, i) => make("th", { text, scope: "col", class: i >= 1 && i <= 3 ? "number" : null })))),
    make("tbody", {}, ...state.pins.map((/** @type {any} */ pin, /** @type {number} */ index) => make("tr", {}, make("th", { scope: "row", text: pin.name }),
      make("td", { class: "number", text: best[index] ? si(best[index].amplitude, "m", 4) : "–" }), make("td", { class: "number", text: change(best[index]) }),
      make("td", { class: "number", text: best[index]?.frequency ? digits(best[index].frequency, 6) : "" }), make("td", { text: best[index]?.mass ?? "" }), make("td", { text: best[index]?.case ?? "" }))))));
}

/** The highest peak of every place in every case. @param {any[]} list */
function highest(list) {
  const best = new Map();
  for (const peak of list) {
    const key = `${peak.case}|${peak.mass}`;
    if (!(best.get(key)?.amplitude >= peak.amplitude)) { best.set(key, peak); }
  }
  return [...best.values()];
}

/** @param {any} pin @param {number} index */
function rows(pin, index) {
  const list = highest(peaks(pin.result));
  const shown = list.length > 0 ? list : [{ case: "", mass: "", frequency: null, amplitude: null }];
  return shown.slice(0, MOST).map((/** @type {any} */ peak, /** @type {number} */ row) => make("tr", {},
    make("td", {}, row === 0 ? make("input", { type: "text", id: `pin-${index}`, "aria-label": "Name of the pin", value: pin.name, size: "22", onchange: () => { pin.name = byId(`pin-${index}`).value; tell("pins"); } }) : ""),
    make("td", { text: peak.case }), make("td", { text: peak.mass }), make("td", { class: "number", text: peak.frequency === null ? "" : digits(peak.frequency, 6) }),
    make("td", { class: "number", text: peak.amplitude === null ? "" : si(peak.amplitude, "m", 4) }),
    make("td", {}, row === 0 ? make("button", { type: "button", class: "link", text: "remove", "aria-label": `Remove ${pin.name}`, onclick: () => { state.pins.splice(index, 1); tell("pins"); } }) : "")));
}
