// Draws figures with plotly.js in the colours of the page.

import { byId, make, tall } from "./dom.js";
import { REFERENCE, follow, settle } from "./follow.js";

/** @type {any} */
let Plotly = null;
/** plotly.js, which loads while the rest of the page already works. @type {Promise<void>} */
const loaded = new Promise((resolve, reject) => {
  const take = () => { Plotly = /** @type {any} */ (window).Plotly; resolve(); };
  if (/** @type {any} */ (window).Plotly) { take(); return; }
  byId("plotly").addEventListener("load", take);
  byId("plotly").addEventListener("error", () => reject(new TypeError("plotly.js did not load")));
});

const WORDS = new Set(["text", "name", "legendgroup", "hovertemplate", "quantity", "title", "unit"]);
const CONFIG = {
  responsive: true, displaylogo: false, doubleClickDelay: 400,
  modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d", "toImage"],
};

export const isDark = () => document.documentElement.dataset.theme === "dark";

/**
 * A copy with the dark counterparts of all colours. Lists of numbers are shared, because they are
 * most of a figure.
 * @param {any} value @param {Record<string, string>} dark @param {boolean} [wanted] false keeps the light colours @param {string} [key] key of the value
 * @returns {any}
 */
function tinted(value, dark, wanted = isDark(), key = "") {
  if (typeof value === "string") { return (wanted && !WORDS.has(key) && dark[value]) || value; }
  if (Array.isArray(value)) {
    const isNumbers = typeof value.find((item) => item !== null) === "number";
    // plotly.js changes the two numbers of a range in place
    return isNumbers ? (value.length > 8 ? value : [...value]) : value.map((item) => tinted(item, dark, wanted, key));
  }
  if (value === null || typeof value !== "object") { return value; }
  return Object.fromEntries(Object.entries(value).map(([name, item]) => [name, tinted(item, dark, wanted, name)]));
}

/** Hidden legend groups by plot. @type {WeakMap<any, Set<string>>} */
const hidden = new WeakMap();

/** The figures as they were last drawn in full. @type {WeakMap<any, import("./follow.js").Drawn>} */
const drawnFigures = new WeakMap();

/** Raises the upper ends of the vertical axes, so that the curves of the next values fit. @param {any} layout */
function leaveRoom(layout) {
  for (const name of Object.keys(layout).filter((key) => /^yaxis/.test(key) && layout[key].range)) {
    const [low, high] = layout[name].range;
    layout[name].range = [low, high + 0.25 * (high - low)];
  }
}

/**
 * @typedef {{plot: any, opacity: number, name?: string, dash?: string}} Behind a figure whose curves are drawn behind
 */

/**
 * Draws a figure of the server.
 * @param {any} place
 * @param {any} plot data of the server
 * @param {{behind?: Behind[], shapes?: any[], height?: number, moving?: boolean}} [more] `moving` moves the curves only, if that is possible
 */
export async function draw(place, plot, more = {}) {
  const last = drawnFigures.get(place);
  if (more.moving && last?.dark === isDark() && follow(place, last, plot)) { return; }
  const wide = place.clientWidth > plot.break || plot.axes.length === 1;
  const { data, layout } = figure(plot, { behind: more.behind ?? [], wide, dark: isDark() });
  layout.autosize = true;
  delete layout.width;
  const least = more.height ?? 0;
  // several panels shrink a little, so that all of them are seen at once
  const lowest = (wide ? 0.82 : 1) * layout.height;
  layout.height = plot.axes.length === 1 ? Math.max(340, least) : Math.min(Math.max(least, lowest), Math.max(1.3 * layout.height, 0.55 * place.clientWidth));
  // plotly.js takes the height of the element when the window changes its size
  place.style.height = `${layout.height}px`;
  layout.paper_bgcolor = layout.plot_bgcolor = "rgba(0,0,0,0)";
  layout.shapes = [...(layout.shapes ?? []), ...(more.shapes ?? [])];
  layout.uirevision = place.dataset.revision ?? "same";
  const off = hidden.get(place) ?? new Set();
  for (const trace of data) { if (off.has(trace.legendgroup)) { trace.visible = false; } }
  await loaded;
  if (more.moving) { leaveRoom(layout); }
  settle(place);
  await Plotly.react(place, data, layout, CONFIG);
  drawnFigures.set(place, { plot, layout: JSON.parse(JSON.stringify(layout)), wide, dark: isDark(), width: place.clientWidth, first: data.length - plot.data.length, moving: more.moving === true });
}

/** The traces and the layout of a figure with other curves behind its own. @param {any} plot @param {{behind: Behind[], wide: boolean, dark: boolean}} how */
function figure(plot, { behind, wide, dark }) {
  const layout = tinted(wide ? plot.wide : plot.narrow, plot.dark, dark);
  const others = behind.flatMap((other) => {
    const lines = tinted(other.plot.data, other.plot.dark, dark).filter((/** @type {any} */ trace) => trace.mode === "lines" && !REFERENCE.test(trace.legendgroup ?? ""));
    return lines.flatMap((/** @type {any} */ trace) => panelsFor(other.plot, plot, panelOf(trace)).map((/** @type {number} */ panel) => {
      const title = other.plot.axes[panelOf(trace)].title;
      const owner = escaped([other.name, title].filter((part) => part).join(", "));
      const name = other.name && trace.hovertemplate ? { hovertemplate: trace.hovertemplate.replace("<extra>", `<extra>${owner}: `) } : { hoverinfo: "skip", hovertemplate: null };
      const line = { ...trace.line, ...(other.dash ? { dash: other.dash } : {}) };
      return { ...plain(moved(trace, other.plot, plot, panel)), ...name, line, opacity: other.opacity, legendgroup: "", owner: other.name, pale: !other.name };
    }));
  });
  extend(layout, others.filter((trace) => trace.owner));
  const data = [...others, ...tinted(plot.data, plot.dark, dark).map(plain)];
  return { data, layout };
}

/** Extends the vertical axes for pinned curves. @param {any} layout @param {any[]} traces */
function extend(layout, traces) {
  for (const trace of traces) {
    const axis = layout[`yaxis${trace.yaxis.slice(1)}`];
    if (!axis?.range) { continue; }
    const most = trace.y.reduce((/** @type {number} */ so, /** @type {number | null} */ value) => Math.max(so, value ?? -Infinity), -Infinity);
    const end = axis.type === "log" ? Math.log10(most) : most;
    const [low, high] = axis.range;
    if (end > high) { axis.range = [low, end + 0.05 * (end - low)]; }
  }
}

/** The number of the panel of a trace, from 0. @param {any} trace */
const panelOf = (trace) => Number((trace.xaxis ?? "x").slice(1) || 1) - 1;

/**
 * The panels in which a curve of another figure belongs: that with the same title, or all if one
 * of the figures has a single panel. A curve of another quantity belongs nowhere.
 * @param {any} from @param {any} to @param {number} panel
 */
function panelsFor(from, to, panel) {
  const own = from.axes[panel];
  if (!own) { return []; }
  const all = to.axes.map((/** @type {any} */ _, /** @type {number} */ index) => index);
  const same = all.filter((/** @type {number} */ index) => ["x", "y"].every((letter) => ["quantity", "unit"].every((key) => own[letter][key] === to.axes[index][letter][key])));
  const titled = same.filter((/** @type {number} */ index) => to.axes[index].title === own.title);
  if (titled.length > 0) { return titled; }
  if (from.axes.length === to.axes.length) { return same.filter((/** @type {number} */ index) => index === panel); }
  return from.axes.length === 1 || to.axes.length === 1 ? same : [];
}

/** A trace in a panel of another figure, whose axes may leave out other powers of ten. @param {any} trace @param {any} from @param {any} to @param {number} panel */
function moved(trace, from, to, panel) {
  const name = panel === 0 ? "" : String(panel + 1);
  const own = panelOf(trace);
  const scaled = (/** @type {"x" | "y"} */ letter) => {
    const power = from.axes[own][letter].power - to.axes[panel][letter].power;
    return power === 0 ? trace[letter] : trace[letter].map((/** @type {number | null} */ value) => (value === null ? null : value * 10 ** power));
  };
  return { ...trace, x: scaled("x"), y: scaled("y"), xaxis: `x${name}`, yaxis: `y${name}` };
}

/** Drawing by the graphics processor needs scripts that the policy of the page forbids. @param {any} trace */
const plain = (trace) => ({ ...trace, ...(trace.type === "scattergl" ? { type: "scatter" } : {}), showlegend: false });

/** What legends show now: while a slider moves they stay as they are. @type {WeakMap<any, string>} */
const legends = new WeakMap();

/**
 * The legend of a figure: buttons that hide and show curves, and the names of pins.
 * @param {any} place @param {any} plot @param {any} target @param {{name: string, dash: string}[]} [pins]
 */
export function legend(place, plot, target, pins = []) {
  const off = hidden.get(target) ?? new Set();
  hidden.set(target, off);
  /** @type {Map<string, any>} */
  const entries = new Map();
  for (const trace of plot.data) { if (trace.showlegend && trace.name && !entries.has(trace.legendgroup)) { entries.set(trace.legendgroup, tinted({ ...trace, x: null, y: null }, plot.dark)); } }
  const present = new Set(plot.data.map((/** @type {any} */ trace) => trace.legendgroup));
  for (const name of [...off]) { if (!present.has(name)) { off.delete(name); } }
  const now = JSON.stringify([[...entries], [...off], pins]);
  if (legends.get(place) === now && place.childElementCount > 0) { return; }
  legends.set(place, now);
  place.replaceChildren(...[...entries].map(([group, trace]) => {
    const button = make("button", {
      type: "button", "aria-pressed": String(!off.has(group)),
      onclick: () => {
        if (off.has(group)) { off.delete(group); } else { off.add(group); }
        button.setAttribute("aria-pressed", String(!off.has(group)));
        // the button keeps the focus
        legends.set(place, JSON.stringify([[...entries], [...off], pins]));
        target.dispatchEvent(new CustomEvent("redraw"));
      },
    }, sample(trace), text(trace.name));
    return button;
  }), ...pins.map(({ name, dash }) => make("span", { class: "pin" }, sample({ mode: "lines", line: { dash } }), name)));
}

/** A name for plotly.js, which reads marks in it. @param {string} name */
const escaped = (name) => name.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;");

/** The text of a name, in which the server has escaped marks. @param {string} name */
function text(name) {
  return name.replaceAll("&lt;", "<").replaceAll("&gt;", ">").replaceAll("&amp;", "&").replaceAll("\u200b", "");
}

/** @param {string | undefined} dash */
function dashes(dash) {
  if (!dash || dash === "solid") { return "none"; }
  return { dash: "6 3", dot: "2 3" }[dash] ?? dash.replaceAll("px", "").replaceAll(",", " ");
}

/** @param {any} trace */
function sample(trace) {
  const space = "http://www.w3.org/2000/svg";
  const svg = document.createElementNS(space, "svg");
  svg.setAttribute("width", "26");
  svg.setAttribute("height", "12");
  svg.setAttribute("aria-hidden", "true");
  const marks = trace.mode === "markers";
  const triangle = marks && trace.marker?.symbol === "triangle-up";
  const shape = document.createElementNS(space, triangle ? "path" : marks ? "circle" : trace.fill ? "rect" : "path");
  const colour = (marks ? trace.marker?.line?.color ?? trace.marker?.color : trace.line?.color) ?? trace.marker?.color ?? "currentColor";
  const set = triangle ? { d: "M13 1L18 10H8Z", fill: trace.marker.color ?? "none", stroke: colour, "stroke-width": 1.5 } : marks ? { cx: 13, cy: 6, r: 4, fill: "none", stroke: colour, "stroke-width": 2 }
    : trace.fill ? { x: 2, y: 1, width: 22, height: 10, fill: trace.fillcolor ?? colour }
      : { d: "M0 6H26", stroke: colour, "stroke-width": 2, "stroke-dasharray": dashes(trace.line?.dash) };
  for (const [name, value] of Object.entries(set)) { shape.setAttribute(name, String(value)); }
  svg.append(shape);
  return svg;
}

/** Base of a layout that the page draws itself. */
export function ownLayout(/** @type {any} */ more = {}) {
  const dark = isDark();
  const [text, grid, line] = dark ? ["#e4e6ea", "#2e323a", "#9aa0a8"] : ["#1a1a1a", "#e3e3e3", "#444444"];
  const axis = { showline: true, mirror: true, linecolor: line, gridcolor: grid, zerolinecolor: dark ? "#5a606a" : "#b0b0b0", ticks: "outside", tickcolor: line, automargin: true, title: { standoff: 6 } };
  const layout = {
    font: { family: "system-ui, 'DejaVu Sans', sans-serif", size: 13, color: text }, paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
    margin: { l: 55, r: 12, t: 8, b: 42 }, height: 280, showlegend: false, hovermode: "closest", autosize: true, ...more,
  };
  for (const name of new Set(["xaxis", "yaxis", ...Object.keys(more).filter((key) => /^[xy]axis/.test(key))])) {
    layout[name] = { ...axis, ...(layout[name] ?? {}) };
    if (typeof layout[name].title === "string") { layout[name].title = { text: layout[name].title, standoff: 6 }; }
  }
  return layout;
}

/** Palette of the figures: Okabe and Ito, with counterparts for dark pages. */
const PALETTE = [["#0072b2", "#2f7fc9"], ["#d55e00", "#ff8616"], ["#009e73", "#2dc181"], ["#cc79a7", "#c896d8"], ["#e69f00", "#ecd65f"], ["#56b4e9", "#aeddf5"], ["#222222", "#fffed8"]];
export const colour = (/** @type {number} */ index) => PALETTE[index % PALETTE.length][isDark() ? 1 : 0];

/** Draws traces of the page. @param {any} place @param {any[]} data @param {any} layout */
export async function drawOwn(place, data, layout) {
  const whole = ownLayout(layout);
  whole.height = tall(whole.height);
  place.style.height = `${whole.height}px`;
  await loaded;
  return Plotly.react(place, data, whole, { ...CONFIG, displayModeBar: false });
}

/**
 * Saves a figure as a picture: on white, with its title and legend.
 * @param {any} plot data of the server @param {Behind[]} behind @param {"svg" | "png"} format @param {string} filename
 */
export async function picture(plot, behind, format, filename) {
  const { data, layout } = figure(plot, { behind, wide: true, dark: false });
  const named = new Set();
  for (const trace of plot.data) {
    const own = data.find((/** @type {any} */ other) => other.legendgroup === trace.legendgroup && other.name === trace.name);
    if (trace.showlegend && own && !named.has(trace.legendgroup)) { own.showlegend = true; named.add(trace.legendgroup); }
  }
  behind.forEach((other) => {
    const first = data.find((/** @type {any} */ trace) => trace.owner === other.name);
    if (other.name && first) { Object.assign(first, { showlegend: true, name: escaped(other.name) }); }
  });
  await loaded;
  const height = Math.max(layout.height ?? 0, 520) + 60;
  const more = { showlegend: named.size > 0, legend: { orientation: "h", y: -0.12, yanchor: "top" }, paper_bgcolor: "#ffffff", plot_bgcolor: "#ffffff" };
  return Plotly.downloadImage({ data, layout: { ...layout, ...more, height, margin: { ...layout.margin, b: 110 } } }, { format, filename, width: 1000, height, scale: format === "png" ? 2 : 1 });
}

/**
 * Calls `move` with data coordinates while the pointer is pressed where `near` says yes.
 * @param {any} place
 * @param {(point: {x: number, y: number, panel: number, px: number, py: number}) => boolean} near
 * @param {(point: {x: number, y: number, panel: number}, last: boolean) => void} move
 */
export function draggable(place, near, move) {
  /** @type {number | null} */
  let panel = null;
  let begun = { x: 0, y: 0 };
  const point = (/** @type {PointerEvent} */ event, /** @type {number | null} */ fixed) => {
    const full = place._fullLayout;
    if (!full) { return null; }
    const box = place.getBoundingClientRect();
    const [px, py] = [event.clientX - box.left, event.clientY - box.top];
    for (let index = 0; index < 60; index += 1) {
      const name = index === 0 ? "" : String(index + 1);
      const [xa, ya] = [full[`xaxis${name}`], full[`yaxis${name}`]];
      if (!xa || !ya) { return null; }
      const [dx, dy] = [px - xa._offset, py - ya._offset];
      const inside = dx >= 0 && dx <= xa._length && dy >= 0 && dy <= ya._length;
      if (fixed === null ? inside : fixed === index) {
        const clamp = (/** @type {number} */ value, /** @type {number} */ most) => Math.min(Math.max(value, 0), most);
        return { x: xa.p2d(clamp(dx, xa._length)), y: ya.p2d(clamp(dy, ya._length)), panel: index, px: dx, py: dy };
      }
    }
    return null;
  };
  place.addEventListener("pointerdown", (/** @type {PointerEvent} */ event) => {
    const at = event.button === 0 && !(/** @type {any} */ (event.target).closest?.(".modebar")) ? point(event, null) : null;
    if (!at || !near(at)) { return; }
    event.preventDefault();
    event.stopPropagation();
    panel = at.panel;
    begun = { x: event.clientX, y: event.clientY };
    place.setPointerCapture(event.pointerId);
    move(at, false);
  }, true);
  // plotly.js begins its own zoom with the mouse event that follows
  place.addEventListener("mousedown", (/** @type {MouseEvent} */ event) => { if (panel !== null) { event.stopPropagation(); } }, true);
  place.addEventListener("pointermove", (/** @type {PointerEvent} */ event) => {
    const at = panel === null ? null : point(event, panel);
    if (at) { move(at, false); }
  });
  for (const name of ["pointerup", "pointercancel"]) {
    place.addEventListener(name, (/** @type {PointerEvent} */ event) => {
      const at = panel === null ? null : point(event, panel);
      panel = null;
      if (at) { move(at, true); }
      // a press without a movement is a click
      if (at && Math.hypot(event.clientX - begun.x, event.clientY - begun.y) < 3) { place.dispatchEvent(new CustomEvent("tap", { detail: at })); }
    });
  }
}

/** Position of a value on an axis in pixels. @param {any} place @param {"x" | "y"} letter @param {number} panel @param {number} value */
export function pixel(place, letter, panel, value) {
  const axis = place._fullLayout?.[`${letter}axis${panel === 0 ? "" : panel + 1}`];
  return axis ? axis.d2p(value) : NaN;
}
