// Fits to measured data. A fit starts at the present sliders and searches within their ranges; its
// values can then be given to the sliders.

import { run, stop } from "./api.js";
import { byId, make, tall } from "./dom.js";
import { digits, duration } from "./format.js";
import { rangeOf } from "./parameters.js";
import { draw, legend } from "./plot.js";
import { changeAtOnce, changeList, on, setQuantity, state, tell } from "./store.js";

const PURPOSE = "Which values explain the measured curve? The search starts at the present sliders and stays within their ranges.";

let tile, menu, choice, starts, button, words, result, legendPlace, place;
/** The last fit. @type {any} */
let found = null;
let running = false;
let turn = 0;

/** @param {any} body */
export function start(body) {
  menu = make("select", { id: "fit-target" });
  starts = make("input", { type: "text", id: "fit-starts", size: "3", value: "0", inputmode: "numeric", autocomplete: "off" });
  button = make("button", { type: "button", class: "primary", id: "compute-fit", text: "Fit", onclick: () => (running ? stop("fit") : compute()) });
  choice = make("fieldset", { class: "choice" });
  words = make("p", { class: "hint", role: "status", text: PURPOSE });
  result = make("div", {});
  legendPlace = make("div", { class: "legend", hidden: true });
  place = make("div", { class: "plot", id: "design-fit", hidden: true });
  tile = make("section", { class: "tile wide", "aria-label": "Fit to measured data", hidden: true }, make("h2", { text: "Fit to measured data" }),
    make("div", { class: "tools" }, make("label", {}, "Measured", menu), make("label", {}, "further starts", starts), button), choice, words, result, legendPlace, place);
  body.append(tile);
  place.addEventListener("redraw", show);
  on("opened", () => { stop("fit"); turn += 1; running = false; found = null; button.textContent = "Fit"; words.textContent = PURPOSE; menu.replaceChildren(); choice.replaceChildren(); result.replaceChildren(); place.hidden = legendPlace.hidden = true; });
  on("theme", show);
}

/** The parameters that a fit can change. */
const plain = () => state.description.quantities.filter((/** @type {any} */ one) => one.group === "parameters" && one.number > 0 && one.range !== "count");

/** Whether the study has measured curves and parameters. */
export const possible = () => (state.description.targets ?? []).length > 0 && state.description.kind !== "identify" && plain().length > 0;

/** Shows the fields. */
export function offer() {
  tile.hidden = !possible();
  if (tile.hidden || menu.childElementCount > 0) { return; }
  menu.append(...state.description.targets.map((/** @type {any} */ one, /** @type {number} */ index) => make("option", { value: index, text: `${one.data}: ${one.is} of ${one.at}` })));
  const all = plain();
  const likely = all.filter((/** @type {any} */ one) => one.varied || /slip|friction|contact|joint/.test(one.doc)).slice(0, 3);
  const chosen = likely.length > 0 ? likely : all.slice(0, 2);
  choice.replaceChildren(make("legend", { text: "Fitted parameters" }), ...all.map((/** @type {any} */ one) => make("label", { title: one.doc }, make("input", { type: "checkbox", id: `fit-${one.name}`, checked: chosen.includes(one) }), one.name)));
}

async function compute() {
  const chosen = plain().filter((/** @type {any} */ one) => byId(`fit-${one.name}`)?.checked);
  const further = Number(starts.value);
  starts.setAttribute("aria-invalid", String(!(further >= 0 && further <= 1000)));
  if (chosen.length === 0) { words.textContent = "Choose the parameters that the fit may change."; return; }
  if (!(further >= 0 && further <= 1000)) { words.textContent = "The number of further starts is from 0 to 1000."; return; }
  const parameters = chosen.map((/** @type {any} */ one) => {
    const { from, to, log } = rangeOf(one, one.number);
    return { name: one.name, from: `${from} ${one.unit}`.trim(), to: `${to} ${one.unit}`.trim(), points: 2, log };
  });
  const begun = performance.now();
  turn += 1;
  const own = turn;
  running = true;
  button.textContent = "Stop";
  words.textContent = "searching …";
  try {
    const view = { kind: "fit", target: state.description.targets[Number(menu.value)], parameters, starts: Math.round(further) };
    const event = await run("fit", { study: state.study, changes: changeList(), tables: true, view });
    if (own !== turn) { return; }
    if (event === null) { words.textContent = "Stopped."; return; }
    if (event.event === "error") { words.textContent = event.help ? `${event.message}. ${event.help}.` : event.message; return; }
    if (!event.fitted || event.fitted.length === 0) { words.textContent = `No fit: ${event.failures[0]?.reason ?? "the search did not converge"}`; return; }
    found = event;
    result.replaceChildren(table(event));
    words.textContent = `Found in ${duration((performance.now() - begun) / 1000)}.`;
    show();
  } catch (error) {
    words.textContent = "";
    tell("offline", error);
  } finally {
    if (own === turn) { running = false; button.textContent = "Fit"; }
  }
}

function show() {
  if (!found || tile.hidden) { return; }
  place.hidden = legendPlace.hidden = false;
  legend(legendPlace, found.plot, place);
  draw(place, found.plot, { height: tall(360) });
}

const STATUS = { determined: "determined", "at-bound": "at the end of its range", "not-determined": "not determined by the data" };

/**
 * The fitted values with their errors, and a button that gives them to the sliders.
 * @param {any} event the result of a fit
 */
export function table(event) {
  const head = ["Parameter", "Fitted", "Standard error", "95 % interval", "Status"].map((text, i) => make("th", { text, scope: "col", class: i > 0 && i < 4 ? "number" : null }));
  const rows = event.fitted.map((/** @type {any} */ one) => make("tr", {}, make("th", { scope: "row", text: one.name }), make("td", { class: "number", text: `${digits(one.value, 5)} ${one.unit}`.trim() }),
    make("td", { class: "number", text: one.error === null ? "–" : digits(one.error, 2) }), make("td", { class: "number", text: one.low === null ? "–" : `${digits(one.low, 4)} to ${digits(one.high, 4)}` }),
    make("td", { text: STATUS[/** @type {keyof typeof STATUS} */ (one.status)] ?? one.status })));
  const warnings = event.notes.filter((/** @type {string} */ note) => note.startsWith("warning"));
  return make("div", { class: "scroll" }, make("table", { class: "fitted" }, make("caption", { text: "Fitted values" }), make("thead", {}, make("tr", {}, ...head)), make("tbody", {}, ...rows)),
    make("ul", { class: "hint" }, ...warnings.map((/** @type {string} */ text) => make("li", { text }))),
    make("button", { type: "button", class: "take", text: "Move the sliders to these values", onclick: () => changeAtOnce(event.fitted.flatMap((/** @type {any} */ one) => taken(one))) }));
}

/** The changes that give a parameter its fitted value. @param {any} one */
function taken(one) {
  const quantity = state.description.quantities.find((/** @type {any} */ other) => other.group === "parameters" && other.name === one.name);
  return quantity ? setQuantity(quantity, `${Number(one.value.toPrecision(8))} ${one.unit}`.trim()) : [];
}
