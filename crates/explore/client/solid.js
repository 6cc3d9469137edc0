// A structure with a mesh in three dimensions: a shaded surface, or points if the mesh has no
// elements. WebGL2 by hand; the picture turns with the pointer and the arrow keys.

import { make } from "./dom.js";
import { colour, isDark } from "./plot.js";

/** Colours of the contact states: none, open, touch, stick, slip. */
const STATES = ["", 3, 4, 0, 1];

const VERTEX = `#version 300 es
in vec3 position, before, after;
in float state;
uniform mat3 turn;
uniform vec3 middle;
uniform vec2 scale;
uniform float gain, part, largest, depth, dots;
out vec3 place;
out float size, contact;
void main() {
  vec3 moved = mix(before, after, part);
  place = turn * (position + gain * moved - middle);
  size = length(moved) / largest;
  contact = state;
  gl_Position = vec4(place.xy * scale, -place.z * depth, 1.0);
  gl_PointSize = dots;
}`;

const FRAGMENT = `#version 300 es
precision highp float;
in vec3 place;
in float size, contact;
uniform vec3 states[5], calm, most;
uniform bool bySize, points;
out vec4 pixel;
void main() {
  vec3 base = bySize ? mix(calm, most, clamp(size, 0.0, 1.0)) : calm;
  int state = int(contact + 0.5);
  if (points) {
    if (length(gl_PointCoord - 0.5) > 0.5) { discard; }
    pixel = vec4(state > 0 ? states[state] : base, 1.0);
    return;
  }
  vec3 normal = normalize(cross(dFdx(place), dFdy(place)));
  pixel = vec4(base * (0.35 + 0.65 * abs(dot(normal, normalize(vec3(0.3, 0.5, 1.0))))), 1.0);
}`;

/** The axes x, y, z in their start position: x to the right, z upwards, seen from above. */
const START = { around: -0.6, above: 0.45, zoom: 1 };

let canvas, box, axes, menu, gl, program;
/** What is drawn. @type {any} */
let solid = null;
let view = { ...START };
let redraw = () => {};

/** Makes the view. @param {() => void} again draws the present time again */
export function start(again) {
  redraw = again;
  canvas = make("canvas", { id: "solid", role: "img", tabindex: "0", "aria-label": "The structure in three dimensions. Arrow keys turn it, plus and minus change its size, Home shows it as at first." });
  axes = make("span", { class: "axes", "aria-hidden": "true" });
  menu = make("select", { id: "solid-colour", onchange: () => redraw() }, make("option", { value: "state", text: "contact" }), make("option", { value: "size", text: "displacement" }));
  box = make("div", { class: "solid", hidden: true }, make("div", { class: "tools" }, make("label", {}, "Colour", menu), make("button", { type: "button", text: "Reset view", onclick: () => turn({ ...START }) })), canvas, axes,
    make("p", { class: "hint", text: "Drag to turn, roll to zoom, or use the arrow keys, + and −. Marks at contact nodes: blue sticks, orange slips, yellow touches, pink is open." }));
  canvas.addEventListener("pointerdown", (/** @type {PointerEvent} */ event) => { canvas.setPointerCapture(event.pointerId); });
  canvas.addEventListener("pointermove", (/** @type {PointerEvent} */ event) => {
    if (canvas.hasPointerCapture(event.pointerId)) { turn({ around: view.around + event.movementX * 0.01, above: view.above + event.movementY * 0.01 }); }
  });
  canvas.addEventListener("wheel", (/** @type {WheelEvent} */ event) => { event.preventDefault(); turn({ zoom: view.zoom * Math.exp(-event.deltaY * 0.001) }); }, { passive: false });
  canvas.addEventListener("keydown", (/** @type {KeyboardEvent} */ event) => {
    const to = { ArrowLeft: { around: view.around - 0.1 }, ArrowRight: { around: view.around + 0.1 }, ArrowUp: { above: view.above - 0.1 }, ArrowDown: { above: view.above + 0.1 }, "+": { zoom: view.zoom * 1.15 }, "-": { zoom: view.zoom / 1.15 }, Home: { ...START } }[event.key];
    if (to) { event.preventDefault(); turn(to); }
  });
  return box;
}

/** @param {Partial<typeof START>} to */
function turn(to) {
  view = { ...view, ...to };
  view.above = Math.min(Math.max(view.above, -Math.PI / 2), Math.PI / 2);
  view.zoom = Math.min(Math.max(view.zoom, 0.2), 40);
  redraw();
}

/** The bytes of a text in base 64. @param {string} text */
const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));

/** Prepares the program of the graphics processor; false if the browser has no WebGL2. */
function prepare() {
  if (program) { return true; }
  gl ??= canvas.getContext("webgl2", { antialias: true });
  if (!gl) { return false; }
  program = gl.createProgram();
  for (const [type, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const shader = gl.createShader(type);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) { throw new Error(gl.getProgramInfoLog(program)); }
  gl.enable(gl.DEPTH_TEST);
  // a context that was lost is made again with the next orbit
  canvas.addEventListener("webglcontextlost", (/** @type {Event} */ event) => { event.preventDefault(); program = null; solid = null; });
  return true;
}

/** Whether a structure is drawn. */
export const active = () => solid !== null;

/** Takes the motion of an orbit. @param {any} data of the server @returns {boolean} true if it can be drawn */
export function take(data) {
  if (!data || !prepare()) { box.hidden = true; solid = null; return false; }
  const positions = new Float32Array(bytes(data.positions).buffer);
  const moves = new Float32Array(bytes(data.displacements).buffer);
  const [count, instants] = [positions.length / 3, data.instants];
  // the mean over the period is not drawn
  let largest = 0;
  for (let i = 0; i < 3 * count; i += 1) {
    let sum = 0;
    for (let k = 0; k < instants; k += 1) { sum += moves[3 * count * k + i]; }
    for (let k = 0; k < instants; k += 1) { moves[3 * count * k + i] -= sum / instants; }
  }
  for (let i = 0; i < moves.length; i += 3) { largest = Math.max(largest, Math.hypot(moves[i], moves[i + 1], moves[i + 2])); }
  const ends = [0, 1, 2].map((axis) => {
    let [low, high] = [Infinity, -Infinity];
    for (let i = axis; i < positions.length; i += 3) { low = Math.min(low, positions[i]); high = Math.max(high, positions[i]); }
    return [low, high];
  });
  const states = bytes(data.contact);
  const touching = Uint32Array.from({ length: count }, (_, i) => i).filter((i) => states[i] > 0);
  const triangles = new Uint32Array(bytes(data.triangles).buffer);
  solid ??= { buffers: ["positions", "moves", "states", "triangles", "touching"].map(() => gl.createBuffer()) };
  [positions, moves, states, triangles, touching].forEach((values, i) => {
    const target = i < 3 ? gl.ARRAY_BUFFER : gl.ELEMENT_ARRAY_BUFFER;
    gl.bindBuffer(target, solid.buffers[i]);
    gl.bufferData(target, values, gl.STATIC_DRAW);
  });
  Object.assign(solid, {
    count, instants, largest: largest || 1, corners: triangles.length, touching: touching.length,
    middle: ends.map(([low, high]) => (low + high) / 2), diameter: Math.hypot(...ends.map(([low, high]) => high - low)) || 1,
  });
  menu.parentElement.hidden = touching.length === 0;
  if (touching.length === 0) { menu.value = "size"; }
  box.hidden = false;
  return true;
}

/** Forgets the structure. */
export function forget() { solid = null; box.hidden = true; view = { ...START }; menu.value = "state"; }

/** The rotation of the view, row by row. */
function rotation() {
  const [c, s, d, e] = [Math.cos(view.around), Math.sin(view.around), Math.cos(view.above), Math.sin(view.above)];
  // around the axis z, then towards the eye: to the right, upwards, to the eye
  return [[c, -s, 0], [e * s, e * c, d], [-d * s, -d * c, e]];
}

const rgb = (/** @type {string} */ text) => [1, 3, 5].map((at) => Number.parseInt(text.slice(at, at + 2), 16) / 255);

/**
 * Draws a time of the period.
 * @param {number} phase from 0 to 1 @param {number} size scale of the displacements
 * @returns {number} the factor of the displacements
 */
export function draw(phase, size) {
  if (!solid || !program) { return 0; }
  const ratio = devicePixelRatio || 1;
  const [width, height] = [Math.round(canvas.clientWidth * ratio), Math.round(canvas.clientHeight * ratio)];
  if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
  const rows = rotation();
  const gain = size * 0.1 * solid.diameter / solid.largest;
  const unit = 1.7 * view.zoom * Math.min(width, height) / solid.diameter;
  const at = (/** @type {string} */ name) => gl.getUniformLocation(program, name);
  const dark = isDark();
  gl.viewport(0, 0, width, height);
  gl.clearColor(0, 0, 0, 0);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  gl.useProgram(program);
  gl.uniformMatrix3fv(at("turn"), true, rows.flat());
  gl.uniform3fv(at("middle"), solid.middle);
  gl.uniform2f(at("scale"), unit / width, unit / height);
  const now = phase * solid.instants;
  const [first, second] = [Math.floor(now) % solid.instants, (Math.floor(now) + 1) % solid.instants];
  const values = { gain, part: now % 1, largest: solid.largest, depth: 0.7 / solid.diameter, dots: Math.max(5, 7 * ratio) };
  for (const [name, value] of Object.entries(values)) { gl.uniform1f(at(name), value); }
  gl.uniform1i(at("bySize"), Number(menu.value === "size"));
  gl.uniform3fv(at("calm"), rgb(dark ? "#8a919c" : "#c9ced6"));
  gl.uniform3fv(at("most"), rgb(dark ? "#ffd75e" : "#7a1f5c"));
  gl.uniform3fv(at("states"), STATES.flatMap((index) => (index === "" ? [0, 0, 0] : rgb(colour(Number(index))))));
  const attribute = (/** @type {string} */ name, /** @type {number} */ buffer, /** @type {number} */ components, /** @type {number} */ offset) => {
    const place = gl.getAttribLocation(program, name);
    if (place < 0) { return; }
    gl.bindBuffer(gl.ARRAY_BUFFER, solid.buffers[buffer]);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, components, components === 1 ? gl.UNSIGNED_BYTE : gl.FLOAT, false, 0, offset);
  };
  attribute("position", 0, 3, 0);
  attribute("before", 1, 3, 12 * solid.count * first);
  attribute("after", 1, 3, 12 * solid.count * second);
  attribute("state", 2, 1, solid.count * (now % 1 < 0.5 ? first : second));
  gl.uniform1i(at("points"), 0);
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, solid.buffers[3]);
  if (solid.corners > 0) { gl.drawElements(gl.TRIANGLES, solid.corners, gl.UNSIGNED_INT, 0); }
  gl.uniform1i(at("points"), 1);
  if (solid.corners === 0) { gl.drawArrays(gl.POINTS, 0, solid.count); }
  if (menu.value === "state" && solid.touching > 0) {
    // contact nodes are seen through the bodies that hide them
    gl.disable(gl.DEPTH_TEST);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, solid.buffers[4]);
    gl.drawElements(gl.POINTS, solid.touching, gl.UNSIGNED_INT, 0);
    gl.enable(gl.DEPTH_TEST);
  }
  triad(rows);
  return gain;
}

/** The directions of the axes, beside the picture. @param {number[][]} rows */
function triad(rows) {
  const space = "http://www.w3.org/2000/svg";
  const made = (/** @type {string} */ tag, /** @type {Record<string, any>} */ set) => { const one = document.createElementNS(space, tag); for (const [name, value] of Object.entries(set)) { one.setAttribute(name, String(value)); } return one; };
  const svg = made("svg", { width: 72, height: 72 });
  ["x", "y", "z"].forEach((name, i) => {
    const [x, y] = [36 + 24 * rows[0][i], 36 - 24 * rows[1][i]];
    svg.append(made("line", { x1: 36, y1: 36, x2: x, y2: y, stroke: "currentColor", "stroke-width": 1.5 }));
    const label = made("text", { x: 36 + 32 * rows[0][i], y: 40 - 32 * rows[1][i], "font-size": 12, fill: "currentColor", "text-anchor": "middle" });
    label.textContent = name;
    svg.append(label);
  });
  axes.replaceChildren(svg);
}
