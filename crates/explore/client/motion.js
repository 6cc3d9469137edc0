// The third tab: the structure, animated over one period. Joints are coloured by stick and slip.

import { make, tall } from "./dom.js";
import { digits } from "./format.js";
import * as loops from "./moving_loops.js";
import { colour, isDark } from "./plot.js";
import { present } from "./orbit.js";
import { sceneOf } from "./scene.js";
import * as solid from "./solid.js";
import { on, state } from "./store.js";

let panel, canvas, play, speed, size, position, status, empty, box, flat;
let visible = false;
let playing = !matchMedia("(prefers-reduced-motion: reduce)").matches;
let phase = 0;
let last = 0;

/** @param {any} place */
export function start(place) {
  panel = place;
  play = make("button", { type: "button", text: playing ? "Pause" : "Play", onclick: () => { playing = !playing; play.textContent = playing ? "Pause" : "Play"; last = 0; } });
  const step = (/** @type {number} */ by) => () => { playing = false; play.textContent = "Play"; phase = (phase + by + 1) % 1; draw(); };
  speed = make("input", { type: "range", min: "0.02", max: "1", step: "0.02", value: "0.3", "aria-label": "Cycles per second" });
  size = make("input", { type: "range", min: "0", max: "2", step: "0.05", value: "1", "aria-label": "Scale of the displacements", oninput: () => draw() });
  position = make("input", { type: "range", min: "0", max: "1", step: "0.002", value: "0", "aria-label": "Time in the period", oninput: () => { playing = false; play.textContent = "Play"; phase = Number(position.value); draw(); } });
  status = make("span", { class: "state" });
  canvas = make("canvas", { role: "img", "aria-label": "The structure in motion", height: "420" });
  empty = make("p", { class: "empty", hidden: true });
  flat = make("div", {}, canvas, make("p", { class: "hint", text: "Blue: the joint sticks. Orange: it slips. Pink, dashed: it is open. Grey: springs. The arrow shows a force." }));
  box = make("div", {}, make("div", { class: "tools" }, play, make("button", { type: "button", text: "◂ Step", onclick: step(-0.01) }), make("button", { type: "button", text: "Step ▸", onclick: step(0.01) }),
    make("label", {}, "Speed", speed), make("label", {}, "Scale", size), make("label", {}, "Time", position), status), solid.start(() => draw()), flat, loops.start());
  panel.append(empty, box);
  on("opened", solid.forget);
  on("orbit", (/** @type {any} */ orbit) => { flat.hidden = solid.take(orbit?.event.solid); draw(); });
  on("theme", () => draw());
  on("tab", (/** @type {string} */ name) => { visible = name === "motion"; if (visible) { last = 0; requestAnimationFrame(frame); } });
  new ResizeObserver(() => draw()).observe(canvas);
}

/** @param {number} now */
function frame(now) {
  if (!visible) { return; }
  if (playing && last > 0) { phase = (phase + (now - last) / 1000 * Number(speed.value)) % 1; }
  last = now;
  if (playing) { draw(); }
  requestAnimationFrame(frame);
}

/** The value of a column at the present time. @param {any} orbit @param {string} name */
function at(orbit, name) {
  const values = orbit.columns.get(name);
  if (!values) { return null; }
  const time = phase * orbit.time.at(-1);
  let high = orbit.time.findIndex((/** @type {number} */ one) => one >= time);
  if (high <= 0) { high = high < 0 ? orbit.time.length - 1 : 1; }
  if (typeof values[0] !== "number") { return values[high - 1]; }
  const part = (time - orbit.time[high - 1]) / (orbit.time[high] - orbit.time[high - 1] || 1);
  return values[high - 1] + part * (values[high] - values[high - 1]);
}

function draw() {
  if (!visible || !panel || panel.hidden) { return; }
  const orbit = present();
  const model = state.description?.model;
  const reason = !model ? "This study has no model to draw." : !orbit ? "Choose a point of a response curve: its orbit is animated here." : "";
  empty.hidden = reason === "";
  empty.textContent = reason;
  box.hidden = reason !== "";
  if (reason) { return; }
  const gain = solid.active() ? solid.draw(phase, Number(size.value)) : drawFlat(orbit, model);
  loops.draw(orbit, (column) => at(orbit, column));
  position.value = String(phase);
  status.textContent = `${digits(phase * orbit.time.at(-1) * 1e3, 3)} ms of ${digits(orbit.time.at(-1) * 1e3, 4)} ms, displacements × ${digits(gain, 2)}`;
}

/** Draws masses, springs and joints in a plane. @param {any} orbit @param {any} model @returns {number} the factor of the displacements */
function drawFlat(orbit, model) {
  const scene = sceneOf(model);
  const width = canvas.clientWidth;
  const bounds = [...scene.masses, ...scene.ground];
  const [left, right] = [Math.min(...bounds.map((one) => one.x)) - 1.3, Math.max(...bounds.map((one) => one.x)) + 1.3];
  const [top, bottom] = [Math.min(...bounds.map((one) => one.y)) - 1.2, Math.max(...bounds.map((one) => one.y)) + 0.8];
  const unit = Math.min(width / (right - left), window.innerHeight * 0.55 / (bottom - top), tall(scene.wheel ? 90 : 130));
  const height = Math.max(240, (bottom - top) * unit);
  const ratio = devicePixelRatio || 1;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    canvas.style.height = `${height}px`;
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  const [aside, below] = [(width - (right - left) * unit) / 2, (height - (bottom - top) * unit) / 2];
  const to = (/** @type {number} */ x, /** @type {number} */ y) => [aside + (x - left) * unit, below + (y - top) * unit];
  const most = Math.max(1e-30, ...orbit.places.map((/** @type {string} */ name) => { const values = orbit.columns.get(`${name}_displacement_m`); return Math.max(...values) - mean(values); }));
  const gain = 0.75 * Number(size.value) / most;
  const places = new Map(bounds.map((one) => [one.name, { ...one, ...moved(orbit, one, gain) }]));
  const dark = isDark();
  const [text, grey] = dark ? ["#e4e6ea", "#9aa0a8"] : ["#1a1a1a", "#777777"];
  pen.lineCap = "round";
  for (const link of scene.links) {
    const [a, b] = [places.get(link.from), places.get(link.to)];
    if (!a || !b) { continue; }
    const [from, end] = [to(a.x, a.y), to(b.x, b.y)];
    if (link.kind === "spring") { pen.strokeStyle = grey; pen.lineWidth = 1.5; pen.setLineDash([]); zigzag(pen, from, end, unit * 0.13, link.bend * unit * 0.42); }
    else { joint(pen, from, end, at(orbit, `${link.name}_contact`), link.bend * unit * 0.42); }
  }
  pen.setLineDash([]);
  for (const one of scene.ground) {
    const [x, y] = to(one.x, one.y);
    pen.strokeStyle = grey;
    pen.lineWidth = 2;
    line(pen, [x - 0.35 * unit, y], [x + 0.35 * unit, y]);
    for (let i = -2; i <= 2; i += 1) { line(pen, [x + i * 0.15 * unit, y], [x + (i * 0.15 - 0.12) * unit, y + 0.16 * unit], 1); }
  }
  pen.textAlign = "center";
  pen.font = `${Math.max(11, Math.min(14, unit * 0.24))}px system-ui, sans-serif`;
  scene.masses.forEach((mass) => {
    const place = /** @type {any} */ (places.get(mass.name));
    const [x, y] = to(place.x, place.y);
    const r = 0.45 * mass.radius * unit;
    // colours are those of stick and slip, at the joints alone
    pen.fillStyle = grey;
    pen.beginPath();
    if (pen.roundRect) { pen.roundRect(x - r, y - r, 2 * r, 2 * r, 0.3 * r); } else { pen.rect(x - r, y - r, 2 * r, 2 * r); }
    pen.fill();
    pen.fillStyle = text;
    if (scene.masses.length <= 16) { pen.fillText(mass.name, x, y - r - 6); }
    for (const force of scene.forces.filter((force) => force.on === mass.name)) {
      const size = Math.cos(2 * Math.PI * phase * force.harmonic + force.phase) * 0.6 * unit;
      const along = vector(mass, force.direction);
      arrow(pen, [x + (r + 4) * along[0], y + (r + 4) * along[1]], along, size, text);
    }
  });
  return gain;
}

/** The unit vector of a direction of a mass. On a wheel, `x` and `t` are along the circumference. @param {any} one @param {string} direction */
function vector(one, direction) {
  return ["", "x", "t", "t1"].includes(direction) ? one.along : direction === "y" && one.along[1] === 0 && one.along[0] === 1 ? [0, -1] : one.out;
}

/** The displaced position of a mass. The mean over the period is not drawn. @param {any} orbit @param {any} one @param {number} gain */
function moved(orbit, one, gain) {
  let [x, y] = [one.x, one.y];
  for (const direction of ["", "x", "y", "z", "r", "t", "n"]) {
    const column = direction === "" ? `${one.name}_displacement_m` : `${one.name}_${direction}_displacement_m`;
    const value = at(orbit, column);
    if (value === null) { continue; }
    const along = vector(one, direction);
    const by = gain * (value - mean(orbit.columns.get(column)));
    x += by * along[0];
    y += by * along[1];
  }
  return { x, y };
}

/** The means of columns, which do not change. @type {WeakMap<number[], number>} */
const means = new WeakMap();

/** The middle of a column. @param {number[]} values */
function mean(values) {
  let value = means.get(values);
  if (value === undefined) { value = (Math.max(...values) + Math.min(...values)) / 2; means.set(values, value); }
  return value;
}

/** @param {CanvasRenderingContext2D} pen @param {number[]} from @param {number[]} to @param {number} [width] */
function line(pen, from, to, width = pen.lineWidth) {
  pen.lineWidth = width;
  pen.beginPath();
  pen.moveTo(from[0], from[1]);
  pen.lineTo(to[0], to[1]);
  pen.stroke();
}

/** @param {CanvasRenderingContext2D} pen @param {number[]} from @param {number[]} to @param {number} size @param {number} aside */
function zigzag(pen, from, to, size, aside) {
  const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
  const length = Math.hypot(dx, dy) || 1;
  const [nx, ny] = [-dy / length, dx / length];
  pen.beginPath();
  pen.moveTo(from[0], from[1]);
  for (let i = 0; i <= 12; i += 1) {
    const part = 0.22 + 0.56 * i / 12;
    const off = aside + (i === 0 || i === 12 ? 0 : (i % 2 ? size : -size));
    pen.lineTo(from[0] + part * dx + off * nx, from[1] + part * dy + off * ny);
  }
  pen.lineTo(to[0], to[1]);
  pen.stroke();
}

/** @param {CanvasRenderingContext2D} pen @param {number[]} from @param {number[]} to @param {string | null} contact @param {number} aside */
function joint(pen, from, to, contact, aside) {
  const sticks = contact === "stick" || contact === "touch";
  const open = contact === "open";
  pen.strokeStyle = open ? colour(3) : sticks ? colour(0) : contact ? colour(1) : colour(2);
  pen.setLineDash(open ? [5, 5] : []);
  pen.lineWidth = 4;
  const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
  const length = Math.hypot(dx, dy) || 1;
  const [ax, ay] = [-dy / length * aside, dx / length * aside];
  pen.beginPath();
  pen.moveTo(from[0], from[1]);
  pen.quadraticCurveTo(from[0] + dx / 2 + 2 * ax, from[1] + dy / 2 + 2 * ay, to[0], to[1]);
  pen.stroke();
  pen.setLineDash([]);
}

/** @param {CanvasRenderingContext2D} pen @param {number[]} from @param {number[]} along @param {number} length @param {string} text */
function arrow(pen, [x, y], [ax, ay], length, text) {
  pen.strokeStyle = pen.fillStyle = text;
  const [tx, ty] = [x + length * ax, y + length * ay];
  line(pen, [x, y], [tx, ty], 2);
  const head = Math.sign(length) * 6;
  pen.beginPath();
  pen.moveTo(tx + head * ax, ty + head * ay);
  pen.lineTo(tx - 5 * ay, ty + 5 * ax);
  pen.lineTo(tx + 5 * ay, ty - 5 * ax);
  pen.fill();
}
