// The first tab: the figure of the study. It follows the sliders, with few points first.

import { run } from "./api.js";
import { byId, make, message, perFrame } from "./dom.js";
import * as fit from "./fit.js";
import { PALE } from "./follow.js";
import { digits, duration } from "./format.js";
import { draggable, draw, legend, pixel } from "./plot.js";
import { changeList, on, state, tell } from "./store.js";

/** Time of an answer that feels immediate while a slider moves, s. */
const LIVE = 0.06;
/** Pause of a slider after which the full curve is computed, ms. */
const REST = 160;

let place, status, button, legendPlace, hint, quantity, panels, logarithmic, empty, fitted;
/** Scale of the vertical axis, or null as in the file. @type {string | null} */
let axisScale = null;
/** Time of the last full run, s, and its number of points. */
let cost = { seconds: 0, points: 0 };
/** Points of a curve that take the time of a live answer, as learned from those that moved. */
let live = Infinity;
/** The curve before the last change. @type {any} */
let previous = null;
/** The finished part of a run that takes long. @type {any} */
let partial = null;
/** @type {any} */
let timer = 0;
/** True if the server expects that the study takes long: it then waits for its button. */
let long = false;
/** Number of the newest run, and of the one for a moving slider if it has not ended. */
let newest = 0, movingRun = 0;
/** Runs to begin when the one for a moving slider has ended: another one, and the full curve. */
let again = false, rest = false;

/** @param {any} panel */
export function start(panel) {
  quantity = make("select", { id: "quantity", onchange: () => compute(false) });
  for (const [value, text] of [["", "amplitude"], ["velocity", "velocity"], ["acceleration", "acceleration"], ["receptance", "receptance"], ["force", "joint force"], ["dissipation", "dissipation per cycle"]]) {
    quantity.append(make("option", { value, text }));
  }
  panels = make("select", { id: "panels-of", onchange: () => compute(false) }, ...[["", "as in the file"], ["cases", "per case"], ["masses", "per place"]].map(([value, text]) => make("option", { value, text })));
  logarithmic = make("input", { type: "checkbox", id: "log", onchange: () => { axisScale = logarithmic.checked ? "log" : "linear"; compute(false); } });
  status = make("span", { class: "state", role: "status" });
  legendPlace = make("div", { class: "legend" });
  place = make("div", { class: "plot", id: "response-plot" });
  button = make("button", { type: "button", class: "primary", text: "Compute", hidden: true, onclick: () => compute(false, true) });
  empty = make("div", { class: "empty", hidden: true }, make("p", {}), button);
  fitted = make("div", {});
  hint = make("p", { class: "hint", text: "Click the curve to see its orbit. Drag the vertical marker to another frequency." });
  panel.append(
    make("div", { class: "tools" },
      make("label", { class: "only-response" }, "Show", quantity), make("label", { class: "only-response" }, "Panels", panels), make("label", { class: "only-response" }, logarithmic, "logarithmic"),
      make("button", { type: "button", class: "only-response", id: "pin", text: "Pin this curve", onclick: () => tell("pin") }), status),
    legendPlace, empty, place, hint, fitted);
  place.addEventListener("redraw", () => show());
  place.addEventListener("tap", (/** @type {CustomEvent} */ event) => {
    const at = event.detail;
    mark(toHertz(at.x, state.result.plot.axes[at.panel].x), panelCase(at.panel), true);
    tell("show", "orbit");
  });
  draggable(place, near, perFrame((at, last) => moveMarker(at, last)));
  on("opened", () => { previous = partial = null; long = false; cost = { seconds: 0, points: 0 }; live = Infinity; quantity.value = panels.value = ""; axisScale = null; place.dataset.revision = state.study; legendPlace.replaceChildren(); fitted.replaceChildren(); place.removeAttribute("aria-busy"); explain("Computing …", null); opened(); compute(false); });
  on("moving", () => compute(true));
  on("changed", () => compute(false));
  on("theme", () => show());
  on("pins", () => show());
  on("marker", () => show());
  on("tab", (/** @type {string} */ name) => { if (name === "response") { show(); } });
}

/** Whether the curves are over frequency, so that a click finds an orbit. */
const hasOrbits = () => {
  const axis = (partial ?? state.result)?.plot.axes[0]?.x;
  return ["response", "branch"].includes(state.description.kind) && (axis ? axis.quantity.includes("frequency") : state.description.kind === "response");
};

function opened() {
  for (const element of document.querySelectorAll(".only-response")) { /** @type {any} */ (element).hidden = state.description.kind !== "response"; }
  hint.hidden = !hasOrbits();
}

/**
 * Computes the figure. While a slider moves, long curves get fewer points.
 * @param {boolean} moving @param {boolean} [asked] true if the user wants a long run
 */
async function compute(moving, asked = false) {
  clearTimeout(timer);
  if (moving && long) { stale(); return; }
  // the server expects the time from a few points; nothing is known of a study that never ran
  const wait = !asked && (!moving || cost.points === 0);
  if (moving) {
    // the run for the moving slider ends first: its curve comes sooner than the full one
    timer = setTimeout(() => { if (movingRun) { rest = true; } else { compute(false); } }, REST);
    // one run at a time while the slider moves: the next one takes the newest values
    if (movingRun) { again = true; return; }
  }
  const { points } = state.description;
  const cases = Math.max(1, state.description.cases.length);
  const all = points / cases;
  const few = Math.round(Math.max(16, Math.min(live, all * LIVE / Math.max(cost.seconds, 1e-3))));
  const reduced = moving && state.description.kind === "response" && few < all ? few : null;
  const begun = performance.now();
  newest += 1;
  const own = newest;
  if (asked) { button.hidden = true; }
  movingRun = moving ? own : 0;
  again = rest = false;
  const request = {
    study: state.study, changes: changeList(), wait, quantity: quantity.value || null,
    view: { kind: "study", points: reduced, references: quantity.value === "" && state.description.kind === "response", scale: state.description.kind === "response" ? axisScale : null, panels: panels.value || null },
  };
  let points_done = 0;
  const late = setTimeout(() => { status.textContent = "computing …"; place.classList.add("stale"); }, 250);
  try {
    const event = await run("study", request, (event) => {
      if (event.event === "begin") { points_done = event.points ?? 0; }
      if (event.event === "progress" && performance.now() - begun > 500) {
        status.textContent = points_done ? `${event.done} of ${points_done} points${remaining(event.done, points_done, performance.now() - begun)}` : `${event.done} points`;
      }
      if (event.event === "partial") {
        partial = event;
        empty.hidden = true;
        place.hidden = false;
        place.classList.remove("stale");
        show();
        tell("partial", event);
      }
    });
    if (event === null) { return; }
    if (wait) { long = event.event === "expect"; }
    const seconds = (performance.now() - begun) / 1000;
    if (moving && !wait) { live = Math.max(16, Math.min(all, (reduced ?? all) * Math.sqrt(LIVE / seconds))); }
    take(event, { moving, reduced: reduced !== null }, seconds);
  } catch (error) {
    place.classList.remove("stale");
    status.textContent = "";
    partial = null;
    tell("offline", error);
  } finally {
    clearTimeout(late);
    if (own === newest) {
      movingRun = 0;
      if (again) { compute(true); } else if (rest) { compute(false); }
    }
  }
}

/** The remaining time, if it is worth a word. @param {number} done @param {number} all @param {number} time ms */
function remaining(done, all, time) {
  const seconds = time / 1000 * (all - done) / Math.max(done, 1);
  return seconds > 2 ? `, ${duration(seconds)} left` : "";
}

/** @param {any} event @param {{moving: boolean, reduced: boolean}} how @param {number} seconds */
function take(event, { moving, reduced }, seconds) {
  partial = null;
  place.classList.remove("stale");
  if (event.event === "expect") {
    cost = { seconds: Infinity, points: 0 };
    explain(`This study takes ${event.text}.`, "Compute", state.result !== null);
    place.classList.toggle("stale", state.result !== null);
    status.textContent = "";
    return;
  }
  if (event.event === "error") {
    tell("failed", event);
    place.classList.toggle("stale", state.result !== null);
    status.textContent = "not computed";
    if (!state.result) { explain(event.message, null); }
    return;
  }
  message();
  empty.hidden = true;
  place.hidden = false;
  if (axisScale === null) { logarithmic.checked = event.plot.wide.yaxis?.type === "log"; }
  if (!reduced) { cost = { seconds, points: state.description.points }; }
  // the pale curve is the last one at rest
  if (state.result && !state.result.moving) { previous = state.result; }
  state.result = { ...event, reduced, moving };
  hint.hidden = !hasOrbits();
  status.textContent = reduced ? "fewer points while moving" : "";
  fitted.replaceChildren(...(event.fitted ? [fit.table(event)] : []));
  show();
  tell("result", state.result);
}

/** Shows that the figure belongs to former values. */
function stale() {
  place.classList.add("stale");
  explain(state.result ? "The figure belongs to the former values." : "", "Compute again", state.result !== null);
  status.textContent = Number.isFinite(cost.seconds) ? `takes about ${duration(cost.seconds)}` : "";
}

/** @param {string} text @param {string | null} action @param {boolean} [keep] keeps the figure */
function explain(text, action, keep = false) {
  empty.hidden = false;
  empty.firstElementChild.textContent = text;
  button.hidden = action === null;
  button.textContent = action ?? button.textContent;
  place.hidden = !keep;
  hint.hidden = !keep || !hasOrbits();
}

const show = perFrame(() => {
  const shown = partial ?? state.result;
  if (!shown || place.closest("[hidden]")) { return; }
  const { plot } = shown;
  const behind = pinned();
  legend(legendPlace, plot, place, behind.map(({ name = "", dash = "" }) => ({ name, dash })));
  if (previous && previous !== shown) { behind.push({ plot: previous.plot, opacity: PALE }); }
  // the figure fills the window; on a narrow page it leaves room for the parameters
  const below = byId("trust").offsetHeight + hint.offsetHeight + 56;
  const free = window.innerHeight - (place.getBoundingClientRect().top + window.scrollY) - below;
  const height = window.innerWidth < 820 ? plot.narrow?.height ?? 340 : Math.max(340, free);
  drawing += 1;
  newestDrawn = shown;
  draw(place, plot, { behind, shapes: markers(plot), height, moving: shown.moving === true }).then(drawn);
});

/** The vertical lines at the marked frequency. @param {any} plot */
function markers(plot) {
  if (!state.marker || !hasOrbits()) { return []; }
  return plot.axes.map((/** @type {any} */ axes, /** @type {number} */ index) => {
    const name = index === 0 ? "" : index + 1;
    const x = fromHertz(state.marker.frequency, axes.x);
    return { type: "line", xref: `x${name}`, yref: `y${name} domain`, x0: x, x1: x, y0: 0, y1: 1, line: { color: getComputedStyle(document.documentElement).getPropertyValue("--changed").trim(), width: 2, dash: "dot" } };
  });
}

const factor = (/** @type {any} */ axis) => ({ Hz: 1, kHz: 1e3, "rad/s": 1 / (2 * Math.PI), rpm: 1 / 60 }[axis.unit] ?? 1) * 10 ** axis.power;
const toHertz = (/** @type {number} */ value, /** @type {any} */ axis) => value * factor(axis);
const fromHertz = (/** @type {number} */ value, /** @type {any} */ axis) => value / factor(axis);

/** @param {any} at */
function near(at) {
  if (!state.marker || !hasOrbits() || !state.result) { return false; }
  const axes = state.result.plot.axes[at.panel];
  return Math.abs(pixel(place, "x", at.panel, fromHertz(state.marker.frequency, axes.x)) - at.px) < 9;
}

/** @param {any} at @param {boolean} last */
function moveMarker(at, last) {
  mark(toHertz(at.x, state.result.plot.axes[at.panel].x), state.marker?.case ?? 0, last);
}

let listened = false;
/** Number of drawings that have not ended; they can end in another order than they began. */
let drawing = 0;
/** The result whose drawing began last. @type {any} */
let newestDrawn = null;
/**
 * Marks the time, so that a test can measure it, says whether the figure is whole, and listens to
 * clicks.
 */
function drawn() {
  performance.clearMarks("curve-drawn");
  performance.mark("curve-drawn");
  drawing -= 1;
  place.setAttribute("aria-busy", String(drawing > 0 || newestDrawn !== state.result));
  if (listened) { return; }
  listened = true;
  place.on("plotly_click", (/** @type {any} */ event) => {
    const point = event.points?.find((/** @type {any} */ point) => point.data.hoverinfo !== "skip");
    if (!point || !hasOrbits() || !state.result || partial) { return; }
    const index = Number((point.xaxis._name.match(/\d+/) ?? [1])[0]) - 1;
    const label = point.data.legendgroup;
    const found = state.result.cases.findIndex((/** @type {any} */ one) => one.label === label);
    mark(toHertz(point.x, state.result.plot.axes[index].x), found >= 0 ? found : panelCase(index), true);
    tell("show", "orbit");
  });
}

/** The case that a panel shows, if each panel shows one. @param {number} panel */
function panelCase(panel) {
  const { title } = state.result.plot.axes[panel] ?? { title: "" };
  const found = state.result.cases.findIndex((/** @type {any} */ one) => one.label !== "" && title.startsWith(one.label));
  return Math.max(0, found);
}

/**
 * Marks a frequency. @param {number} frequency Hz @param {number} index case
 * @param {boolean} last false while the marker moves @param {boolean} [atPeak] true if the marker follows the peak
 */
export function mark(frequency, index, last, atPeak = false) {
  state.marker = { frequency: Number(digits(frequency, 9)), case: index, atPeak };
  tell("marker", last);
}

/** Dashes and gaps of the eight pins, whose colours are those of the places. */
const DASHES = ["7px,4px", "2px,3px", "9px,3px,2px,3px", "14px,4px", "9px,3px,2px,3px,2px,3px", "14px,3px,5px,3px", "4px,8px", "18px,3px,2px,3px"];

/** The pinned curves, to be drawn behind. @returns {import("./plot.js").Behind[]} */
export const pinned = () => state.pins.map((/** @type {any} */ pin, /** @type {number} */ index) => ({ plot: pin.result.plot, opacity: 0.9, name: pin.name, dash: DASHES[index] }));
