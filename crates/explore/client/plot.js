// Draws figures with plotly.js in the colours of the page.

import { make } from "./dom.js";
/** @type {any} */
const Plotly = /** @type {any} */ (window).Plotly;

const WORDS = new Set(["text", "name", "legendgroup", "hovertemplate", "quantity", "title", "unit"]);
const CONFIG = {
  responsive: true, displaylogo: false, doubleClickDelay: 400,
  modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d", "toImage"],
};

export const isDark = () => document.documentElement.dataset.theme === "dark";

/** A copy with the dark counterparts of all colours. @param {any} value @param {Record<string, string>} dark */
function tinted(value, dark) {
  return JSON.parse(JSON.stringify(value), (key, item) =>
    (typeof item === "string" && !WORDS.has(key) && isDark() && dark[item]) || item);
}

/** Hidden legend groups by plot. @type {WeakMap<any, Set<string>>} */
const hidden = new WeakMap();

/**
 * Draws a figure of the server.
 * @param {any} place
 * @param {any} plot data of the server
 * @param {{behind?: {plot: any, opacity: number, name?: string, dash?: string, colour?: string}[], shapes?: any[], height?: number}} [more]
 */
export async function draw(place, plot, more = {}) {
  const wide = place.clientWidth > plot.break || plot.axes.length === 1;
  const layout = tinted(wide ? plot.wide : plot.narrow, plot.dark);
  layout.autosize = true;
  delete layout.width;
  const least = more.height ?? 0;
  layout.height = plot.axes.length === 1 ? Math.max(340, least) : Math.max(layout.height, Math.min(least, 1.3 * layout.height));
  // plotly.js takes the height of the element when the window changes its size
  place.style.height = `${layout.height}px`;
  layout.paper_bgcolor = layout.plot_bgcolor = "rgba(0,0,0,0)";
  layout.shapes = [...(layout.shapes ?? []), ...(more.shapes ?? [])];
  layout.uirevision = place.dataset.revision ?? "same";
  const off = hidden.get(place) ?? new Set();
  const data = tinted(plot.data, plot.dark).map(plain);
  for (const trace of data) { if (off.has(trace.legendgroup)) { trace.visible = false; } }
  const behind = (more.behind ?? []).flatMap((other) => {
    if (other.plot.axes.length !== plot.axes.length) { return []; }
    const lines = tinted(other.plot.data, other.plot.dark).filter((/** @type {any} */ trace) => trace.mode === "lines");
    return lines.map((/** @type {any} */ trace) => {
      const line = { ...trace.line, ...(other.dash ? { dash: other.dash } : {}), ...(other.colour ? { color: other.colour } : {}) };
      const name = other.name ? { hovertemplate: trace.hovertemplate.replace("<extra>", `<extra>${other.name}: `) } : { hoverinfo: "skip", hovertemplate: null };
      return { ...plain(trace), ...name, line, opacity: other.opacity, showlegend: false, legendgroup: "" };
    });
  });
  await Plotly.react(place, [...behind, ...data], layout, CONFIG);
}

/** Drawing by the graphics processor needs scripts that the policy of the page forbids. @param {any} trace */
const plain = (trace) => ({ ...trace, ...(trace.type === "scattergl" ? { type: "scatter" } : {}), showlegend: false });

/**
 * The legend of a figure: buttons that hide and show curves.
 * @param {any} place @param {any} plot @param {any} target
 */
export function legend(place, plot, target) {
  const off = hidden.get(target) ?? new Set();
  hidden.set(target, off);
  const data = tinted(plot.data, plot.dark);
  /** @type {Map<string, any>} */
  const entries = new Map();
  for (const trace of data) { if (trace.showlegend && trace.name && !entries.has(trace.legendgroup)) { entries.set(trace.legendgroup, trace); } }
  const present = new Set(plot.data.map((/** @type {any} */ trace) => trace.legendgroup));
  for (const name of [...off]) { if (!present.has(name)) { off.delete(name); } }
  place.replaceChildren(...[...entries].map(([group, trace]) => {
    const button = make("button", {
      type: "button", "aria-pressed": String(!off.has(group)),
      onclick: () => {
        if (off.has(group)) { off.delete(group); } else { off.add(group); }
        button.setAttribute("aria-pressed", String(!off.has(group)));
        target.dispatchEvent(new CustomEvent("redraw"));
      },
    }, sample(trace), text(trace.name));
    return button;
  }));
}

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
  const shape = document.createElementNS(space, marks ? "circle" : trace.fill ? "rect" : "path");
  const colour = (marks ? trace.marker?.line?.color ?? trace.marker?.color : trace.line?.color) ?? trace.marker?.color ?? "currentColor";
  const set = marks ? { cx: 13, cy: 6, r: 4, fill: "none", stroke: colour, "stroke-width": 2 }
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
export function drawOwn(place, data, layout) {
  const whole = ownLayout(layout);
  place.style.height = `${whole.height}px`;
  return Plotly.react(place, data, whole, { ...CONFIG, displayModeBar: false });
}

/** Saves a plot as a picture on white. @param {any} place @param {"svg" | "png"} format @param {string} filename */
export function picture(place, format, filename) {
  return Plotly.downloadImage(place, { format, filename, width: place.clientWidth, height: place.clientHeight, scale: format === "png" ? 2 : 1 });
}

/** @param {any} place */
export const forget = (place) => Plotly.purge(place);

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
