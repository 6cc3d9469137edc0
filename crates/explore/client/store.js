// The state of the page: the study, its changes with undo and redo, and who wants to know.

/** @typedef {{path: (string | number)[], value: any}} Change */

/** @type {any} */
export const state = {
  /** Entry of the catalog. */
  study: "",
  /** Description of the study with all changes. */
  description: null,
  /** Description of the study without changes. */
  original: null,
  /** Changes by path. @type {Map<string, Change>} */
  changes: new Map(),
  /** Frequency (Hz) and case of the orbit that is shown, and whether it follows the peak. */
  marker: null,
  /** The last result of the study itself. */
  result: null,
  pins: [],
};

/** @type {Map<string, Change>[]} */
let past = [];
/** @type {Map<string, Change>[]} */
let future = [];
/** Changes before the slider that is moving. @type {Map<string, Change> | null} */
let before = null;

/** @type {Map<string, ((detail?: any) => void)[]>} */
const listeners = new Map();

/** Calls `listener` at every event of this name. @param {string} name @param {(detail?: any) => void} listener */
export function on(name, listener) {
  listeners.set(name, [...(listeners.get(name) ?? []), listener]);
}

/** @param {string} name @param {any} [detail] */
export function tell(name, detail) {
  for (const listener of listeners.get(name) ?? []) { listener(detail); }
}

/** @param {(string | number)[]} path */
export const keyOf = (path) => path.join(".");

/** The changes as the server takes them. The law comes before its parameters. */
export function changeList() {
  const all = [...state.changes.values()];
  return all.sort((a, b) => a.path.length - b.path.length);
}

/**
 * Changes values while a slider moves. `commit` ends the movement.
 * @param {Change[]} list a value of `undefined` takes a change back
 */
export function change(list) {
  before ??= new Map(state.changes);
  for (const { path, value } of list) {
    const key = keyOf(path);
    if (value === undefined) { state.changes.delete(key); } else { state.changes.set(key, { path, value }); }
  }
  tell("moving");
}

/** Keeps the changes for a reload of this tab. */
function keep() {
  sessionStorage.setItem(`changes:${state.study}`, JSON.stringify([...state.changes]));
}

/** Takes the changes of this tab before its reload. */
export function restore() {
  const kept = sessionStorage.getItem(`changes:${state.study}`);
  const changes = kept ? new Map(JSON.parse(kept)) : new Map();
  if (changes.size === 0) { return; }
  past.push(state.changes);
  state.changes = /** @type {Map<string, Change>} */ (changes);
  tell("changed");
}

on("changed", keep);

/** @param {Map<string, Change>} changes */
const textOf = (changes) => JSON.stringify([...changes]);

/** Ends a movement: one step of undo, if a value changed. */
export function commit() {
  if (!before) { return; }
  if (textOf(before) !== textOf(state.changes)) {
    past.push(before);
    past = past.slice(-200);
    future = [];
  }
  before = null;
  tell("changed");
}

/** @param {Change[]} list */
export function changeAtOnce(list) {
  change(list);
  commit();
}

export function undo() {
  const earlier = past.pop();
  if (!earlier) { return; }
  future.push(state.changes);
  state.changes = earlier;
  tell("changed");
}

export function redo() {
  const later = future.pop();
  if (!later) { return; }
  past.push(state.changes);
  state.changes = later;
  tell("changed");
}

export function reset() {
  if (state.changes.size === 0) { return; }
  past.push(state.changes);
  future = [];
  state.changes = new Map();
  tell("changed");
}

/** Begins with another study. @param {string} study @param {any} description */
export function open(study, description) {
  Object.assign(state, { study, description, original: description, changes: new Map(), marker: null, result: null, pins: [] });
  past = [];
  future = [];
  before = null;
  tell("opened");
}

export const canUndo = () => past.length > 0;
export const canRedo = () => future.length > 0;

/** The changes that give a parameter one value. @param {any} quantity @param {string} text */
export function setQuantity(quantity, text) {
  const value = quantity.unit === "" && quantity.number !== null && /^[\d.+-]/.test(text)
    ? (quantity.range === "count" ? { count: Math.round(Number(text)) } : { number: Number(text) })
    : { text };
  /** @type {Change[]} */
  const list = [{ path: quantity.path, value }];
  if (quantity.varied) { list.push({ path: ["study", "vary", quantity.name], value: "remove" }); }
  return list;
}

/** The text of a number in the unit of a quantity. @param {any} quantity @param {number} number */
export function quantityText(quantity, number) {
  const short = Number(number.toPrecision(4));
  return quantity.unit ? `${short} ${quantity.unit}` : String(short);
}
