// Moves the curves of a figure without drawing it again, while a slider moves.
//
// plotly.js needs 120 ms for a new figure of four panels, most of it for axes, titles and margins.
// Here only the paths of the curves change; axes stay until the slider rests. A figure whose
// curves leave their axes, or which has other curves, is drawn in full.

/** Names of linear curves, which belong to the present values only. */
export const REFERENCE = /joints (free|stuck)/;
/** Opacity of the curves before a change. */
export const PALE = 0.28;

/**
 * A figure as it was drawn. `moving` if that was during a movement: then it has the pale curves
 * already.
 * @typedef {{plot: any, layout: any, wide: boolean, dark: boolean, width: number, first: number, moving: boolean}} Drawn
 */

/** Traces by what they are; several of one sort are numbered. @param {any[]} traces @returns {Map<string, {trace: any, index: number}>} */
function named(traces) {
  const found = new Map();
  traces.forEach((trace, index) => {
    const what = [trace.xaxis ?? "x", trace.legendgroup, trace.mode, trace.fill, trace.line?.dash].join("|");
    let number = 0;
    while (found.has(`${what}|${number}`)) { number += 1; }
    found.set(`${what}|${number}`, { trace, index });
  });
  return found;
}

/** Whether both figures have the same panels and the same frequencies. @param {Drawn} drawn @param {any} plot */
function sameAxes(drawn, plot) {
  const layout = drawn.wide ? plot.wide : plot.narrow;
  const before = drawn.wide ? drawn.plot.wide : drawn.plot.narrow;
  return plot.axes.length === drawn.plot.axes.length && plot.axes.every((/** @type {any} */ axes, /** @type {number} */ i) => {
    const [name, old] = [i === 0 ? "" : String(i + 1), drawn.plot.axes[i]];
    const alike = ["x", "y"].every((letter) => ["quantity", "unit", "power"].every((key) => axes[letter][key] === old[letter][key]) && layout[`${letter}axis${name}`].type === before[`${letter}axis${name}`].type);
    return alike && axes.title === old.title && String(layout[`xaxis${name}`].range) === String(before[`xaxis${name}`].range);
  });
}

/** Whether a curve is inside its axes, or the user has chosen these. @param {any} full @param {Drawn} drawn @param {any} trace */
function inside(full, drawn, trace) {
  const name = `yaxis${(trace.yaxis ?? "y").slice(1)}`;
  const [axis, stated] = [full[name], drawn.layout[name]?.range];
  if (!stated || String(stated) !== String(axis.range)) { return true; }
  const end = axis.type === "log" ? 10 ** axis.range[1] : axis.range[1];
  return trace.y.every((/** @type {number | null} */ value) => value === null || value <= end);
}

/** A path through points with gaps. @param {any} trace @param {any} full */
function path(trace, full) {
  const [x, y] = ["x", "y"].map((letter) => full[`${letter}axis${(trace[`${letter}axis`] ?? letter).slice(1)}`]);
  let text = "";
  let open = false;
  trace.y.forEach((/** @type {number | null} */ value, /** @type {number} */ i) => {
    const [px, py] = value === null || trace.x[i] === null ? [NaN, NaN] : [x.d2p(trace.x[i]), y.d2p(value)];
    if (!Number.isFinite(px) || !Number.isFinite(py)) { open = false; return; }
    text += `${open ? "L" : "M"}${px.toFixed(1)},${py.toFixed(1)}`;
    open = true;
  });
  return text;
}

/**
 * Moves the curves of a figure.
 * @param {any} place @param {Drawn | undefined} drawn @param {any} plot
 * @returns {boolean} false if the figure must be drawn in full
 */
export function follow(place, drawn, plot) {
  const full = place._fullLayout;
  if (!drawn || !full || drawn.width !== place.clientWidth || !sameAxes(drawn, plot)) { return false; }
  const [before, now] = [named(drawn.plot.data), named(plot.data)];
  const moved = [...now].filter(([, { trace }]) => trace.mode === "lines");
  const known = moved.every(([key, { trace }]) => before.has(key) && !trace.fill && (trace.line?.shape ?? "linear") === "linear" && inside(full, drawn, trace));
  if (!known) { return false; }
  for (const [key, { index }] of before) {
    const group = place.calcdata[drawn.first + index]?.[0]?.node3?.node();
    const line = group?.querySelector("path.js-line");
    const next = now.get(key);
    // marks such as peaks come back when the slider rests
    if (group && next?.trace.mode !== "lines") { group.style.visibility = "hidden"; }
    if (!line || !next) { continue; }
    if (!drawn.moving && !group.querySelector(".before") && !REFERENCE.test(next.trace.legendgroup ?? "")) {
      const pale = line.cloneNode(false);
      pale.setAttribute("class", "before");
      pale.style.opacity = String(PALE);
      line.before(pale);
    }
    line.setAttribute("d", path(next.trace, full));
  }
  // the pale curves of an earlier change
  if (!drawn.moving) { hidePale(place); }
  return true;
}

/** @param {any} place */
function hidePale(place) {
  place.data.forEach((/** @type {any} */ trace, /** @type {number} */ index) => {
    const group = trace.pale && place.calcdata[index]?.[0]?.node3?.node();
    if (group) { group.style.visibility = "hidden"; }
  });
}

/** Takes the effects back, before a figure is drawn in full. @param {any} place */
export function settle(place) {
  for (const pale of place.querySelectorAll("path.before")) { pale.remove(); }
  for (const group of place.querySelectorAll(".scatterlayer .trace[style*=visibility]")) { group.style.visibility = ""; }
}
