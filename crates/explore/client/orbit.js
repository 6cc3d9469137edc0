// The second tab: one orbit. Loops, motion over the period with stick, slip and separation,
// harmonics, energies, Floquet multipliers, and its evidence in words.

import { run } from "./api.js";
import { make } from "./dom.js";
import { digits, evidence, scale, si } from "./format.js";
import { mark } from "./response.js";
import { colour, drawOwn, isDark } from "./plot.js";
import { changeList, on, state, tell } from "./store.js";

let panel, tools, grid, empty, frequency, caseMenu, peakButton, status;
/** @type {Record<string, any>} */
const plots = {};
/** The orbit on the screen. @type {any} */
let orbit = null;
let visible = false;
let wanted = "";
/** Largest number of places, and of joint directions, in the plots. */
const MOST = 8;
/** True once the structure of this study was shown in motion: then an orbit has the displacements of all nodes. */
let inMotion = false;

/** @param {any} place */
export function start(place) {
  panel = place;
  frequency = make("input", {
    type: "text", id: "orbit-frequency", inputmode: "decimal", size: "10", autocomplete: "off",
    onchange: () => { const value = Number(frequency.value.replace(",", ".")); frequency.setAttribute("aria-invalid", String(!(value > 0))); if (value > 0) { mark(value, state.marker?.case ?? 0, true); } },
    onkeydown: (/** @type {KeyboardEvent} */ event) => step(event),
  });
  caseMenu = make("select", { id: "orbit-case", onchange: () => (state.marker.atPeak ? atPeak(Number(caseMenu.value)) : mark(state.marker.frequency, Number(caseMenu.value), true)) });
  status = make("span", { class: "state", role: "status" });
  peakButton = make("button", { type: "button", text: "At the peak", onclick: () => atPeak(state.marker?.case ?? 0) });
  tools = make("div", { class: "tools" }, make("label", {}, "Frequency", frequency, "Hz"), make("label", { id: "case-label" }, "Case", caseMenu),
    peakButton, status);
  grid = make("div", { class: "grid" });
  empty = make("p", { class: "empty" });
  panel.append(tools, empty, grid);
  for (const [name, title, size] of [["loops", "Hysteresis loops", ""], ["words", "Evidence", ""], ["time", "Motion over one period", "wide"], ["spectrum", "Harmonics of the displacement", "third"], ["energy", "Energy per cycle", "third"], ["multipliers", "Floquet multipliers", "third"]]) {
    plots[name] = name === "words" ? make("ul", { id: "orbit-words" }) : make("div", { class: "plot", id: `orbit-${name}` });
    grid.append(make("section", { class: `tile ${size}`, "aria-label": title }, make("h2", { text: title }), plots[name],
      name === "time" ? make("p", { class: "hint", text: "Shading: a joint sticks (blue) or is open (pink); it slips where there is none. Several joints have one strip each." }) : null,
      name === "time" ? make("p", { class: "hint", id: "left-out", hidden: true }) : null));
  }
  on("opened", () => { orbit = null; wanted = ""; inMotion = false; grid.hidden = true; status.textContent = ""; });
  on("marker", () => { follow(); });
  on("result", () => { followPeak(); follow(); });
  on("theme", () => show());
  on("tab", (/** @type {string} */ name) => { visible = name === "orbit" || name === "motion"; inMotion ||= name === "motion"; if (visible) { followPeak(); follow(); show(); } });
}

/** The orbit that is shown, for the animation. */
export const present = () => orbit;

/** Arrow keys move the frequency. @param {KeyboardEvent} event */
function step(event) {
  const range = state.description.frequency;
  const by = { ArrowUp: 1, ArrowDown: -1 }[event.key];
  if (!by || !state.marker || !range) { return; }
  event.preventDefault();
  mark(state.marker.frequency + by * (range.to - range.from) / 400, state.marker.case, true);
}

/** The frequency of the highest peak of a case. @param {number} index */
function peakFrequency(index) {
  const table = state.result?.tables?.peaks;
  const column = (/** @type {string} */ name) => table?.find((/** @type {any} */ one) => one.name === name)?.values;
  const [frequencies, amplitudes] = [column("frequency_Hz"), column("amplitude_m")];
  const chosen = state.result?.cases?.[index]?.values ?? [];
  /** @type {number | null} */
  let best = null;
  for (let row = 0; row < (frequencies?.length ?? 0); row += 1) {
    const same = chosen.every((/** @type {any} */ one, /** @type {number} */ k) => Math.abs(table[k].values[row] - siLike(table[k], one)) <= 1e-9 * Math.abs(table[k].values[row]));
    if (same && frequencies[row] !== null && (best === null || amplitudes[row] > amplitudes[best])) { best = row; }
  }
  return best === null ? null : frequencies[best];
}

/** The number of a case in the unit of its column. @param {any} column @param {any} one */
function siLike(column, one) {
  const list = [...new Set(column.values.filter((/** @type {any} */ value) => value !== null))];
  if (one.unit === "" || list.includes(one.value)) { return one.value; }
  // the unit of the file differs from SI: the order of the values is the same
  const all = [...new Set(state.result.cases.map((/** @type {any} */ other) => other.values.find((/** @type {any} */ v) => v.name === one.name)?.value))].sort((a, b) => a - b);
  return list.sort((a, b) => a - b)[all.indexOf(one.value)] ?? NaN;
}

/** The marker follows the peak until another frequency is chosen. While a slider moves it stays. */
function followPeak() {
  if (!canShow() || (state.marker && (!state.marker.atPeak || state.result?.reduced))) { return; }
  atPeak(state.marker?.case ?? 0);
}

/** Marks the highest peak of a case, or the middle of the range if it has none. @param {number} chosen */
function atPeak(chosen) {
  const index = state.result?.cases[chosen] ? chosen : 0;
  const range = state.description.frequency;
  mark(peakFrequency(index) ?? (range.from + range.to) / 2, index, true, true);
}

const canShow = () => state.description?.frequency && !["campbell", "nodal-diameter", "modes", "transient"].includes(state.description.kind);

async function follow() {
  if (!visible) { return; }
  const shown = canShow() && state.marker;
  empty.hidden = Boolean(shown);
  tools.hidden = !shown;
  grid.hidden = !shown || orbit === null;
  if (!shown) {
    empty.textContent = `A study of kind ${state.description.kind} has no orbits at an excitation frequency.`;
    return;
  }
  frequency.value = digits(state.marker.frequency, 9);
  peakButton.setAttribute("aria-pressed", String(state.marker.atPeak && peakFrequency(state.marker.case) !== null));
  const cases = state.result?.cases ?? state.description.cases;
  caseMenu.parentElement.hidden = cases.length < 2;
  caseMenu.replaceChildren(...cases.map((/** @type {any} */ one, /** @type {number} */ index) => make("option", { value: index, text: one.label, selected: index === state.marker.case })));
  const fixed = (cases[state.marker.case]?.values ?? []).map((/** @type {any} */ one) => ({ name: one.name, value: one.text }));
  const request = { study: state.study, changes: changeList(), tables: true, view: { kind: "orbit", frequency: state.marker.frequency, case: fixed, fields: inMotion ? state.description.fields : null } };
  const key = JSON.stringify(request);
  if (key === wanted) { return; }
  wanted = key;
  const late = setTimeout(() => { status.textContent = "computing …"; }, 250);
  try {
    const event = await run("orbit", request);
    if (event === null) { return; }
    status.textContent = "";
    if (event.event === "error") { fail(event.message); return; }
    const summary = table(event, "orbits");
    if (!summary || !table(event, "orbit")) { fail(event.failures[0]?.reason ?? "No orbit was found at this frequency."); return; }
    orbit = read(event);
    empty.hidden = true;
    grid.hidden = false;
    show();
    tell("orbit", orbit);
  } catch (error) {
    wanted = "";
    tell("offline", error);
  } finally {
    clearTimeout(late);
  }
}

/** @param {string} reason */
function fail(reason) {
  orbit = null;
  empty.hidden = false;
  grid.hidden = true;
  status.textContent = "";
  empty.textContent = `No orbit was found: ${reason}`;
  tell("orbit", null);
}

/** @param {any} event @param {string} name */
const table = (event, name) => event.tables[name];

/** Sorts the columns of the tables by place and joint. @param {any} event */
function read(event) {
  const motion = table(event, "orbit");
  const one = table(event, "orbits");
  const columns = new Map(motion.map((/** @type {any} */ column) => [column.name, column.values]));
  const first = new Map(one.map((/** @type {any} */ column) => [column.name, column.values[0]]));
  const joints = [...columns.keys()].filter((name) => name.endsWith("_contact")).map((name) => name.slice(0, -8));
  const labels = [...columns.keys()].filter((name) => name.endsWith("_force_N")).map((name) => name.slice(0, -8));
  const places = [...columns.keys()].filter((name) => name.endsWith("_displacement_m")).map((name) => name.slice(0, -15)).filter((name) => !labels.includes(name));
  // the sectors of a tuned disk move alike, one after the other: the plots have the first one
  const tuned = state.description.model?.ring?.equal === true;
  const inFirst = (/** @type {string} */ name) => !tuned || !/_\d+(\.|$)/.test(name) || /_0(\.|$)/.test(name);
  const range = (/** @type {string} */ column) => columns.get(column).reduce((/** @type {number[]} */ [low, high], /** @type {number} */ value) => [Math.min(low, value), Math.max(high, value)], [Infinity, -Infinity]);
  const most = (/** @type {string[]} */ names, /** @type {string} */ end) => {
    const size = new Map(names.map((name) => { const [low, high] = range(name + end); return [name, high - low]; }));
    const least = [...size.values()].sort((a, b) => b - a)[MOST - 1] ?? 0;
    return names.filter((name) => /** @type {number} */ (size.get(name)) >= least).slice(0, MOST);
  };
  const shown = { joints: joints.filter(inFirst), labels: most(labels.filter(inFirst), "_force_N"), places: most(places.filter(inFirst), "_displacement_m") };
  return {
    event, columns, first, joints, labels, places, tuned, shown, time: columns.get("time_s"),
    multipliers: event.tables.multipliers ?? null,
  };
}

function show() {
  if (!orbit || panel.hidden || !visible) { return; }
  loops();
  time();
  spectrum();
  energy();
  multipliers();
  const note = grid.querySelector("#left-out");
  note.hidden = orbit.shown.places.length === orbit.places.length && orbit.shown.labels.length === orbit.labels.length;
  note.textContent = leftOut();
  plots.words.replaceChildren(...words().map((text) => make("li", { text })));
}

/** The places and joints that the plots leave out, in words. */
function leftOut() {
  if (orbit.tuned) { return "The plots show the first sector of the tuned disk; the others do the same, one after the other."; }
  const counts = [[orbit.shown.places, orbit.places, "places that move most"], [orbit.shown.labels, orbit.labels, "joint directions with the largest change of force"]];
  const less = counts.filter(([shown, all]) => shown.length < all.length).map(([shown, all, text]) => `the ${shown.length} of ${all.length} ${text}`);
  return `The plots show ${less.join(" and ")}.`;
}

/** Values with one prefix for all. @param {string[]} names @param {string} end @param {string} unit */
function lines(names, end, unit) {
  const all = names.map((name) => orbit.columns.get(name + end));
  const { factor, unit: shown } = scale(all.flatMap((values) => [Math.max(...values), Math.min(...values)]), unit);
  return { unit: shown, values: all.map((values) => values.map((/** @type {number} */ value) => value * factor)) };
}

function loops() {
  const [x, y] = [lines(orbit.shown.labels, "_displacement_m", "m"), lines(orbit.shown.labels, "_force_N", "N")];
  const data = orbit.shown.labels.map((/** @type {string} */ name, /** @type {number} */ i) => ({ x: x.values[i], y: y.values[i], name, mode: "lines", line: { color: colour(orbit.shown.places.length + i), width: 2, simplify: false } }));
  drawOwn(plots.loops, data, { height: 320, xaxis: { title: `relative displacement (${x.unit})`, range: around(x.values.flat()) }, yaxis: { title: `joint force (${y.unit})`, range: around(y.values.flat()) }, ...legendIf(data) });
}

/** A range with a margin. @param {number[]} values */
function around(values) {
  const [low, high] = values.reduce(([a, b], value) => [Math.min(a, value), Math.max(b, value)], [Infinity, -Infinity]);
  const margin = 0.06 * (high - low || 1);
  return [low - margin, high + margin];
}

const legendIf = (/** @type {any[]} */ data) => (data.length > 1 && data.length <= 12 ? { showlegend: true, legend: { orientation: "h", y: 1.02, yanchor: "bottom" }, margin: { l: 60, r: 12, t: 34, b: 44 } } : {});

const SHADES = { stick: "#0072b2", open: "#cc79a7", touch: "#e69f00" };

function time() {
  const { factor, unit } = scale([orbit.time.at(-1)], "s");
  const t = orbit.time.map((/** @type {number} */ value) => value * factor);
  const rows = [
    { what: "displacement", list: lines(orbit.shown.places, "_displacement_m", "m"), names: orbit.shown.places, first: 0 },
    { what: "velocity", list: lines(orbit.shown.places, "_velocity_m_per_s", "m/s"), names: orbit.shown.places, first: 0 },
    { what: "joint force", list: lines(orbit.shown.labels, "_force_N", "N"), names: orbit.shown.labels, first: orbit.shown.places.length },
  ].filter((row) => row.names.length > 0);
  const layout = /** @type {any} */ ({ height: 150 * rows.length + 80, margin: { l: 62, r: 12, t: 40, b: 42 }, xaxis: { title: `time (${unit})`, range: [0, t.at(-1)], anchor: `y${rows.length > 1 ? rows.length : ""}` }, shapes: shading(t, rows.length) });
  const data = rows.flatMap((row, r) => {
    const axis = r === 0 ? "" : String(r + 1);
    const height = 1 / rows.length;
    layout[`yaxis${axis}`] = { title: `${row.what}<br>(${row.list.unit})`, domain: [1 - (r + 1) * height + 0.03, 1 - r * height - 0.02] };
    return row.names.map((/** @type {string} */ name, /** @type {number} */ i) => ({ x: t, y: row.list.values[i], yaxis: `y${axis}`, name, legendgroup: name, showlegend: row.names.length <= 10 && r !== 1, mode: "lines", line: { color: colour(row.first + i), width: 2, simplify: false } }));
  });
  Object.assign(layout, { showlegend: true, legend: { orientation: "h", y: 1.01, yanchor: "bottom" } });
  drawOwn(plots.time, data, layout);
}

/** Shades the times in which a joint sticks or is open. The strip of each joint is a part of the height. @param {number[]} t @param {number} rows */
function shading(t, rows) {
  const joints = orbit.shown.joints.filter((/** @type {string} */ joint) => orbit.columns.get(`${joint}_contact`)?.some((/** @type {string} */ word) => word !== "")).slice(0, 6);
  return joints.flatMap((/** @type {string} */ joint, /** @type {number} */ j) => {
    const states = orbit.columns.get(`${joint}_contact`).map((/** @type {string} */ word) => (word.startsWith("slip") ? "slip" : word));
    const shapes = [];
    let from = 0;
    for (let i = 1; i <= states.length; i += 1) {
      if (i < states.length && states[i] === states[from]) { continue; }
      const fill = SHADES[/** @type {keyof typeof SHADES} */ (states[from])];
      if (fill) {
        shapes.push({ type: "rect", xref: "x", yref: "paper", x0: t[from], x1: t[Math.min(i, states.length - 1)], y0: j / joints.length, y1: (j + 1) / joints.length, fillcolor: fill, opacity: isDark() ? 0.28 : 0.14, line: { width: 0 }, layer: "below" });
      }
      from = i;
    }
    return shapes;
  });
}

function spectrum() {
  const data = orbit.shown.places.map((/** @type {string} */ name, /** @type {number} */ i) => {
    const values = [1, 2, 3, 4, 5].map((h) => orbit.first.get(`${name}_harmonic${h}_m`) ?? null);
    return { x: [1, 2, 3, 4, 5], y: values.map((value) => (value === null ? null : value * 1e3)), name, type: "bar", marker: { color: colour(i) } };
  });
  // the even harmonics of a symmetric motion are zero except for rounding
  const all = data.flatMap((/** @type {any} */ one) => one.y);
  const most = Math.max(...all);
  const range = [Math.min(...all.filter((value) => value > 1e-9 * most)) / 3, most * 2].map(Math.log10);
  drawOwn(plots.spectrum, data, { xaxis: { title: "harmonic", dtick: 1, range: [0.5, 5.5] }, yaxis: { title: "amplitude (mm)", type: "log", exponentformat: "power", nticks: 6, ...(most > 0 ? { range } : {}) }, bargap: 0.3, ...legendIf(data) });
}

function energy() {
  const names = ["work of<br>the forces", "viscous<br>loss", "friction<br>loss"];
  const values = ["work_in_J", "viscous_J", "friction_J"].map((name) => orbit.first.get(name));
  const { factor, unit } = scale(values, "J");
  drawOwn(plots.energy, [{ x: names, y: values.map((value) => value * factor), type: "bar", marker: { color: [colour(0), colour(2), colour(1)] }, text: values.map((value) => si(value, "J", 3)), textposition: "auto", textangle: 0, hoverinfo: "x+text" }], { xaxis: {}, yaxis: { title: `energy per cycle (${unit})` }, bargap: 0.4 });
}

function multipliers() {
  const column = (/** @type {string} */ name) => orbit.multipliers?.find((/** @type {any} */ one) => one.name === name)?.values ?? [];
  const circle = Array.from({ length: 121 }, (_, i) => 2 * Math.PI * i / 120);
  drawOwn(plots.multipliers, [
    { x: circle.map(Math.cos), y: circle.map(Math.sin), mode: "lines", line: { color: isDark() ? "#9a9a9a" : "#777777", dash: "dash", width: 1 }, hoverinfo: "skip" },
    { x: column("real"), y: column("imaginary"), mode: "markers", marker: { size: 9, color: "rgba(0,0,0,0)", line: { color: colour(1), width: 2 } }, hovertemplate: "%{x:.4f} %{y:+.4f} i<extra></extra>" },
  ], { xaxis: { title: "real part", range: [-1.3, 1.3] }, yaxis: { title: "imaginary part", scaleanchor: "x", range: [-1.2, 1.2] }, annotations: column("real").length === 0 ? [{ text: "not known for this method", x: 0, y: 0, showarrow: false }] : [] });
}

/** What the joints do. The joints of a ring, which have a name and a number, share a sentence. @param {(name: string) => any} get */
function jointWords(get) {
  /** @type {Map<string, {slip: number, open: number, loss: number}[]>} */
  const groups = new Map();
  for (const joint of orbit.joints) {
    const slip = get(`${joint}_slip_fraction`);
    if (slip === null) { continue; }
    const name = orbit.joints.length > 6 ? joint.replace(/_\d+$/, "") : joint;
    groups.set(name, [...(groups.get(name) ?? []), { slip, open: get(`${joint}_open_fraction`) ?? 0, loss: get(`${joint}_dissipation_J`) ?? 0 }]);
  }
  const share = (/** @type {number[]} */ values) => {
    const [low, high] = [Math.min(...values), Math.max(...values)].map((value) => digits(100 * value, 3));
    return low === high ? `${low} %` : `${low} to ${high} %`;
  };
  return [...groups].map(([name, list]) => {
    const open = list.map((one) => one.open);
    const loss = list.reduce((sum, one) => sum + one.loss, 0);
    const who = list.length > 1 ? `${list.length} joints ${name}: slip` : `${name}: slips`;
    const parts = [`${who} ${share(list.map((one) => one.slip))} of the period`, Math.max(...open) > 0 ? `open ${share(open)}` : "", `${list.length > 1 ? "dissipate together" : "dissipates"} ${si(loss, "J", 3)} per cycle`];
    return `${parts.filter((part) => part !== "").join(", ")}.`;
  });
}

/** The evidence as sentences. */
function words() {
  const get = (/** @type {string} */ name) => orbit.first.get(name) ?? null;
  const list = [];
  const by = get("found_by");
  list.push(`Method: ${orbit.event.methods.join("; ") || "–"}${by ? `, found by ${by} in ${get("iterations")} iterations` : ""}.`);
  const stable = get("stable");
  list.push(stable === true ? "The orbit is stable: no small disturbance grows." : stable === false ? "The orbit is unstable: a real structure leaves it." : "Its stability is not known.");
  list.push(`The energy balance closes to ${evidence(get("energy_gap"))} of the work put in.`);
  list.push(`After one period the motion deviates from its start by ${evidence(get("return_defect") ?? get("residual"))} (relative).`);
  if (get("truncation") !== null) { list.push(`Estimated error of the series: ${evidence(get("truncation"))}.`); }
  if (get("reduction_error") !== null) { list.push(`Error of the reduced model: ${evidence(get("reduction_error"))}.`); }
  list.push(...jointWords(get));
  return [...list, ...orbit.event.notes.filter((/** @type {string} */ note) => !list.includes(note))];
}
