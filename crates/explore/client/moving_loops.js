// The loops of the joints with a point at the present time, beside the animation.

import { make, tall } from "./dom.js";
import { scale } from "./format.js";
import { colour, isDark } from "./plot.js";

let canvas;

/** Makes the canvas. */
export function start() {
  canvas = make("canvas", { role: "img", "aria-label": "The loops of the joints, with a point at the present time", height: "260" });
  return canvas;
}

/** A column of the orbit with its least and largest value. @param {any} orbit @param {string} name */
function range(orbit, name) {
  const values = orbit.columns.get(name);
  return { values, least: Math.min(...values), most: Math.max(...values) };
}

/**
 * Draws the loops of an orbit.
 * @param {any} orbit
 * @param {(column: string) => number | null} now the value of a column at the present time
 */
export function draw(orbit, now) {
  const labels = orbit.shown.labels;
  canvas.hidden = labels.length === 0;
  if (labels.length === 0) { return; }
  const [width, height, ratio] = [canvas.clientWidth, tall(260), devicePixelRatio || 1];
  if (canvas.width !== Math.round(width * ratio)) { canvas.width = Math.round(width * ratio); }
  if (canvas.height !== height * ratio) { canvas.height = height * ratio; canvas.style.height = `${height}px`; }
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  const [text, grey] = isDark() ? ["#e4e6ea", "#5a606a"] : ["#1a1a1a", "#b0b0b0"];
  const loops = labels.map((/** @type {string} */ label, /** @type {number} */ index) => ({ label, colour: colour(orbit.shown.places.length + index), x: range(orbit, `${label}_displacement_m`), y: range(orbit, `${label}_force_N`) }));
  const ends = (/** @type {"x" | "y"} */ letter) => ({ least: Math.min(...loops.map((/** @type {any} */ one) => one[letter].least)), most: Math.max(...loops.map((/** @type {any} */ one) => one[letter].most)) });
  const [x, y] = [ends("x"), ends("y")];
  const box = { left: 70, right: width - 20, top: 30, bottom: height - 34 };
  const px = (/** @type {number} */ value) => box.left + (box.right - box.left) * (value - x.least) / (x.most - x.least || 1);
  const py = (/** @type {number} */ value) => box.bottom - (box.bottom - box.top) * (value - y.least) / (y.most - y.least || 1);
  pen.strokeStyle = grey;
  pen.lineWidth = 1;
  pen.strokeRect(box.left - 6, box.top - 6, box.right - box.left + 12, box.bottom - box.top + 12);
  const [ux, uy] = [scale([x.least, x.most], "m"), scale([y.least, y.most], "N")];
  const number = (/** @type {number} */ value, /** @type {{factor: number}} */ unit) => String(Number((value * unit.factor).toPrecision(3)));
  pen.fillStyle = text;
  pen.font = "12px system-ui, sans-serif";
  pen.textAlign = "center";
  pen.fillText(number(x.least, ux), box.left, height - 10);
  pen.fillText(number(x.most, ux), box.right - 8, height - 10);
  pen.fillText(`relative displacement (${ux.unit})`, (box.left + box.right) / 2, height - 10);
  pen.textAlign = "right";
  pen.fillText(number(y.most, uy), box.left - 10, box.top + 4);
  pen.fillText(number(y.least, uy), box.left - 10, box.bottom + 4);
  pen.textAlign = "left";
  pen.fillText(`joint force (${uy.unit})`, 8, 14);
  for (const one of loops) {
    pen.strokeStyle = pen.fillStyle = one.colour;
    pen.lineWidth = 1.5;
    pen.beginPath();
    one.x.values.forEach((/** @type {number} */ value, /** @type {number} */ i) => { pen[i === 0 ? "moveTo" : "lineTo"](px(value), py(one.y.values[i])); });
    pen.stroke();
    const at = [now(`${one.label}_displacement_m`), now(`${one.label}_force_N`)];
    if (at[0] === null || at[1] === null) { continue; }
    pen.beginPath();
    pen.arc(px(at[0]), py(at[1]), 5, 0, 2 * Math.PI);
    pen.fill();
  }
}
