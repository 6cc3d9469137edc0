// Mistuned disks: the largest blade of each disk, relative to the tuned one. The histogram fills
// while the disks are computed.

import { run, stop } from "./api.js";
import { make } from "./dom.js";
import { digits, duration } from "./format.js";
import { colour, drawOwn } from "./plot.js";
import { changeList, on, state, tell } from "./store.js";

let tile, menu, deviation, disks, button, words, place;
/** Amplification of each disk, its largest blade, and whether a peak may be outside the range. @type {{values: number[], blades: string[], ends: boolean[], all: number} | null} */
let found = null;
const PURPOSE = "No two blades are equal. How much higher is the largest peak of a disk than that of the tuned disk?";
/** The changes to which the result belongs. */
let basis = "";
let running = false;

/** @param {any} body */
export function start(body) {
  menu = make("select", { id: "mistuning-of" });
  deviation = make("input", { type: "text", id: "mistuning-deviation", size: "6", value: "1 %", autocomplete: "off" });
  disks = make("input", { type: "text", id: "mistuning-disks", size: "4", value: "20", inputmode: "numeric", autocomplete: "off" });
  button = make("button", { type: "button", class: "primary", id: "compute-mistuning", text: "Compute", onclick: () => (running ? stop("mistuning") : compute()) });
  words = make("p", { class: "hint", role: "status", text: PURPOSE });
  place = make("div", { class: "plot", id: "design-mistuning", hidden: true });
  tile = make("section", { class: "tile wide", "aria-label": "Worst blade of mistuned disks", hidden: true }, make("h2", { text: "Worst blade of mistuned disks" }),
    make("div", { class: "tools" }, make("label", {}, "Differs from blade to blade", menu), make("label", {}, "by", deviation), make("label", {}, "number of disks", disks), button), words, place);
  body.append(tile);
  on("opened", () => { stop("mistuning"); found = null; words.textContent = PURPOSE; place.hidden = true; menu.replaceChildren(); });
  on("theme", show);
  on("changed", () => {
    const old = found !== null && basis !== JSON.stringify(changeList());
    place.classList.toggle("stale", old);
    if (!running && found) { words.textContent = `${old ? "Computed for former values: " : ""}${sentence()}`; }
  });
}

/** Shows the fields for a disk. */
export function offer() {
  const disk = state.description.model?.ring && ["response", "performance", "map"].includes(state.description.kind);
  tile.hidden = !disk;
  if (!disk || menu.childElementCount > 0) { return; }
  const plain = state.description.quantities.filter((/** @type {any} */ one) => one.group === "parameters" && one.number > 0 && one.range !== "count");
  const likely = plain.find((/** @type {any} */ one) => /stiffness of a blade/.test(one.doc)) ?? plain.find((/** @type {any} */ one) => /blade/.test(one.doc)) ?? plain[0];
  const matrices = state.description.model.substructure ? ["blade.frequency", "blade.stiffness"] : [];
  menu.append(...[...matrices, ...plain.map((/** @type {any} */ one) => one.name)].map((name) => make("option", { value: name, text: name, title: plain.find((/** @type {any} */ one) => one.name === name)?.doc, selected: matrices.length === 0 && name === likely?.name })));
}

async function compute() {
  const number = Math.round(Number(disks.value));
  disks.setAttribute("aria-invalid", String(!(number >= 2 && number <= 1000)));
  if (!(number >= 2 && number <= 1000)) { words.textContent = "The number of disks is from 2 to 1000."; return; }
  const begun = performance.now();
  found = null;
  running = true;
  basis = JSON.stringify(changeList());
  place.classList.remove("stale");
  button.textContent = "Stop";
  words.textContent = "computing …";
  try {
    const view = { kind: "mistuning", of: menu.value, deviation: deviation.value.trim(), disks: number };
    const event = await run("mistuning", { study: state.study, changes: changeList(), view }, (event) => {
      if (event.event === "partial") { take(event, number); }
    });
    if (event === null) { words.textContent = found ? `Stopped. ${sentence()}` : PURPOSE; return; }
    if (event.event === "error") { words.textContent = event.help ? `${event.message}. ${event.help}.` : event.message; return; }
    take(event, number);
    words.textContent = `${sentence()} Computed in ${duration((performance.now() - begun) / 1000)}.`;
  } catch (error) {
    words.textContent = "";
    tell("offline", error);
  } finally {
    running = false;
    button.textContent = "Compute";
  }
}

/** @param {any} event @param {number} all */
function take(event, all) {
  const column = (/** @type {string} */ name) => event.tables.amplification?.find((/** @type {any} */ one) => one.name === name)?.values ?? [];
  found = { values: column("amplification"), blades: column("mass"), ends: column("at_range_end"), all };
  if (event.event === "partial") { words.textContent = `${found.values.length} of ${all} disks. ${sentence()}`; }
  show();
}

/** The worst disk and the spread, in words. */
function sentence() {
  if (!found || found.values.length === 0) { return ""; }
  const { values, blades, ends } = found;
  const worst = values.indexOf(Math.max(...values));
  const sorted = [...values].sort((a, b) => a - b);
  const outside = ends.filter((end) => end).length;
  const range = outside > 0 ? ` In ${outside} of them the largest amplitude is at an end of the frequency range, so that these ratios are not those of peaks: widen the range.` : "";
  return `Worst of ${values.length} disks: seed ${worst + 1}, where ${blades[worst]} has ${digits(values[worst], 4)} times the peak of the tuned disk. Half of the disks are above ${digits(sorted[Math.floor(sorted.length / 2)], 4)}.${range}`;
}

function show() {
  if (!found || found.values.length === 0 || tile.hidden) { return; }
  place.hidden = false;
  const { values, all } = found;
  const [low, high] = [Math.min(1, ...values), Math.max(...values)];
  const width = Math.max((high - low) / 12, 1e-3);
  drawOwn(place, [
    { x: values, type: "histogram", xbins: { start: low, end: high + width, size: width }, marker: { color: colour(0) }, hovertemplate: "%{x}: %{y} disks<extra></extra>" },
  ], { height: 280, xaxis: { title: "largest amplitude ÷ that of the tuned disk" }, yaxis: { title: `disks of ${all}`, rangemode: "tozero", ...(all <= 12 ? { dtick: 1 } : {}) }, bargap: 0.05 });
}
