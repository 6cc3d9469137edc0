// The fourth tab: the peak over one parameter, with its optimum, and over two parameters, as a
// map. The present point can be dragged and moves the sliders.

import { run, stop } from "./api.js";
import { make, perFrame, tall } from "./dom.js";
import { digits, duration, si } from "./format.js";
import * as fit from "./fit.js";
import * as mistuning from "./mistuning.js";
import { draggable, draw, legend, pixel } from "./plot.js";
import { change, changeList, commit, keyOf, on, quantityText, setQuantity, state, tell } from "./store.js";

let panel, empty, body;
let visible = false;

/** The two searches of this tab. @type {any[]} */
const searches = [];

/** @param {any} place */
export function start(place) {
  panel = place;
  empty = make("p", { class: "empty", hidden: true });
  body = make("div", { class: "grid" });
  panel.append(empty, body);
  searches.push(search("performance", "Peak over one parameter", ["x"]), search("map", "Peak over two parameters", ["x", "y"]));
  mistuning.start(body);
  fit.start(body);
  on("opened", () => searches.forEach((one) => one.forget()));
  on("described", () => { if (visible) { offer(); } });
  on("moving", () => searches.forEach((one) => one.show()));
  on("changed", () => searches.forEach((one) => one.changed()));
  on("theme", () => searches.forEach((one) => one.show()));
  on("tab", (/** @type {string} */ name) => { visible = name === "design"; if (visible) { offer(); searches.forEach((one) => one.show()); } });
}

/** The parameters that can be searched. */
const plain = () => state.description.quantities.filter((/** @type {any} */ one) => one.group === "parameters" && one.number !== null && one.number > 0 && one.range !== "count");

function offer() {
  const peaks = plain().length > 0 && ["response", "performance", "map"].includes(state.description.kind);
  const possible = peaks || fit.possible();
  empty.hidden = possible;
  body.hidden = !possible;
  empty.textContent = plain().length === 0 ? "The study has no entry of [parameters] with a plain value to search over." : `A study of kind ${state.description.kind} has no resonance peak to minimize.`;
  searches.forEach((one) => one.offer(peaks));
  if (possible) { mistuning.offer(); fit.offer(); }
}

/** @param {"performance" | "map"} kind @param {string} title @param {("x" | "y")[]} letters */
function search(kind, title, letters) {
  /** @type {any} */
  let result = null;
  /** Changes of the result, without those of its own parameters. */
  let found = "";
  const place = make("div", { class: "plot", id: `design-${kind}`, hidden: true });
  const legendPlace = make("div", { class: "legend", hidden: true });
  const purpose = kind === "map" ? "How high is the resonance peak for each pair of values? The lowest cell is the best design." : "How high is the resonance peak for each value? The lowest point of the curve is the best value.";
  const words = make("p", { class: "hint", role: "status", text: purpose });
  const button = make("button", { type: "button", class: "primary", text: "Compute", id: `compute-${kind}`, onclick: () => (running ? stop(kind) : compute()) });
  let running = false;
  let turn = 0;
  /** True if the user has read how long the search takes. */
  let asked = false;
  const fields = Object.fromEntries(letters.map((letter, index) => [letter, axisFields(`${kind}-${letter}`, index)]));
  const tile = make("section", { class: "tile wide", "aria-label": title }, make("h2", { text: title }), make("div", { class: "tools" }, ...letters.map((letter) => fields[letter].box), button), words, legendPlace, place);
  body.append(tile);

  async function compute() {
    const ranges = /** @type {any[]} */ (letters.map((letter) => fields[letter].read()));
    if (ranges.some((range) => range === null)) { words.textContent = "Choose different parameters with a range from a smaller to a larger value."; return; }
    if (ranges.length === 2 && ranges[0].name === ranges[1].name) { words.textContent = "Choose two different parameters."; return; }
    const view = kind === "map" ? { kind, x: ranges[0], y: ranges[1] } : { kind, over: ranges[0] };
    const begun = performance.now();
    words.textContent = "computing …";
    turn += 1;
    const own = turn;
    running = true;
    button.textContent = "Stop";
    try {
      let all = 0;
      // the value of a searched parameter does not matter, but its removal from `vary` does
      const event = await run(kind, { study: state.study, changes: changeList(), tables: true, view, wait: !asked }, (event) => {
        if (event.event === "begin") { all = event.points; }
        if (event.event === "progress" && all) { words.textContent = event.done < all ? `${Math.round(100 * event.done / all)} % computed` : "refining …"; }
      });
      if (own !== turn) { return; }
      if (event === null) { words.textContent = "Stopped."; return; }
      if (event.event === "expect") {
        const others = state.description.varied.filter((/** @type {string} */ name) => ranges.every((range) => range.name !== name));
        const each = others.length > 0 ? ` for all values of ${others.join(" and ")}; move the slider to keep one value` : "";
        words.textContent = `This takes ${event.text}${each}. Press the button again to start.`;
        asked = true;
        return;
      }
      asked = false;
      if (event.event === "error") { words.textContent = event.help ? `${event.message}. ${event.help}.` : event.message; return; }
      result = { ...event, ranges };
      found = others(ranges);
      words.textContent = `${sentence(event, ranges)} Computed in ${duration((performance.now() - begun) / 1000)}. Drag the ${kind === "map" ? "crossing of the lines" : "dotted line"} to move the slider${kind === "map" ? "s" : ""}.`;
      show();
    } catch (error) {
      words.textContent = "";
      tell("offline", error);
    } finally {
      if (own === turn) { running = false; button.textContent = "Compute"; }
    }
  }

  const others = (/** @type {any[]} */ ranges) => {
    const own = ranges.map((range) => `parameters.${range.name}`).concat(ranges.map((range) => `study.vary.${range.name}`));
    return JSON.stringify(changeList().filter((/** @type {any} */ one) => !own.includes(keyOf(one.path))));
  };

  const show = perFrame(() => {
    if (!result || !visible) { return; }
    place.hidden = legendPlace.hidden = false;
    place.classList.toggle("stale", others(result.ranges) !== found);
    legend(legendPlace, result.plot, place);
    draw(place, result.plot, { shapes: kind === "map" ? [cross()].flat() : upright(), height: tall(400) });
  });
  place.addEventListener("redraw", () => show());

  /** The present value of the parameter of an axis; axes have the units of the file. @param {"x" | "y"} letter */
  function presentValue(letter) {
    const quantity = plainOf(result.ranges[letters.indexOf(letter)].name);
    const text = quantity && currentText(quantity);
    const axis = result.plot.axes[0][letter];
    return text ? Number.parseFloat(text) / 10 ** axis.power : NaN;
  }

  function upright() {
    return result.plot.axes.map((/** @type {any} */ _, /** @type {number} */ index) => {
      const name = index === 0 ? "" : index + 1;
      const x = presentValue("x");
      return { type: "line", xref: `x${name}`, yref: `y${name} domain`, x0: x, x1: x, y0: 0, y1: 1, line: lineStyle() };
    });
  }

  const lineStyle = () => ({ color: getComputedStyle(document.documentElement).getPropertyValue("--changed").trim(), width: 2, dash: "dot" });

  function cross() {
    return result.plot.axes.flatMap((/** @type {any} */ _, /** @type {number} */ index) => {
      const name = index === 0 ? "" : index + 1;
      const [x, y] = [presentValue("x"), presentValue("y")];
      const style = { ...lineStyle(), dash: "solid" };
      return [
        { type: "line", xref: `x${name}`, yref: `y${name} domain`, x0: x, x1: x, y0: 0, y1: 1, line: style },
        { type: "line", xref: `x${name} domain`, yref: `y${name}`, x0: 0, x1: 1, y0: y, y1: y, line: style },
      ];
    });
  }

  draggable(place, (at) => {
    if (!result) { return false; }
    return kind === "map" || Math.abs(pixel(place, "x", at.panel, presentValue("x")) - at.px) < 9;
  }, perFrame((at, last) => {
    const list = letters.flatMap((letter) => {
      const quantity = plainOf(result.ranges[letters.indexOf(letter)].name);
      const axis = result.plot.axes[at.panel][letter];
      const number = at[letter] * 10 ** axis.power;
      return setQuantity(quantity, quantityText(quantity, number));
    });
    change(list);
    if (last) { commit(); }
  }));

  return {
    show,
    forget() { stop(kind); turn += 1; running = asked = false; button.textContent = "Compute"; result = null; words.textContent = purpose; legendPlace.replaceChildren(); place.hidden = legendPlace.hidden = true; letters.forEach((letter) => fields[letter].forget()); },
    changed() { if (visible && result && result.seconds < 0.5 && others(result.ranges) !== found) { compute(); } else { show(); } },
    offer(/** @type {boolean} */ peaks) { tile.hidden = !peaks; if (peaks) { letters.forEach((letter) => fields[letter].offer()); } },
  };
}

const plainOf = (/** @type {string} */ name) => plain().find((/** @type {any} */ one) => one.name === name);

/** The value of a quantity with the changes of the moment. @param {any} quantity */
function currentText(quantity) {
  const value = state.changes.get(keyOf(quantity.path))?.value;
  return value?.text ?? value?.number?.toString() ?? quantity.text;
}

/** The fields for the parameter and the range of an axis. @param {string} id @param {number} index */
function axisFields(id, index) {
  const field = (/** @type {string} */ name, /** @type {string} */ text, /** @type {number} */ size) => make("input", { type: "text", id: `${id}-${name}`, size: String(size), "aria-label": text, autocomplete: "off" });
  const menu = make("select", { id: `${id}-name`, "aria-label": "Parameter", onchange: () => fill() });
  const [from, to, points] = [field("from", "First value", 9), field("to", "Last value", 9), field("points", "Number of values", 3)];
  const logarithmic = make("input", { type: "checkbox", id: `${id}-log`, checked: true });
  const box = make("span", { class: "tools" }, menu, make("label", {}, "from", from), make("label", {}, "to", to), make("label", {}, "values", points), make("label", {}, logarithmic, "log spacing"));
  function fill() {
    const quantity = plainOf(menu.value);
    if (!quantity) { return; }
    const number = Number.parseFloat(currentText(quantity));
    const varied = quantity.varied?.map((/** @type {string} */ text) => Number.parseFloat(text)).filter(Number.isFinite) ?? [];
    const [low, high] = [Math.min(number, ...varied), Math.max(number, ...varied)];
    from.value = quantityText(quantity, low / (varied.length ? 2 : 5));
    to.value = quantityText(quantity, high * (varied.length ? 2 : 5));
    points.value = id.startsWith("map") ? "12" : "24";
  }
  return {
    box,
    forget() { menu.replaceChildren(); },
    offer() {
      if (menu.childElementCount > 0) { return; }
      const all = plain();
      // the varied parameter first, then those of joints
      const order = [...all].sort((a, b) => Number(Boolean(b.varied)) - Number(Boolean(a.varied)));
      const joint = order.find((one) => one !== order[0] && /contact|slip|friction|limit|joint|damper|shroud|tangential|preload|press/.test(one.doc));
      const first = order[0]?.varied ? order[0] : order.find((one) => /slip limit|preload|press/.test(one.doc)) ?? order[0];
      const chosen = index === 0 ? first : joint && joint !== first ? joint : order.find((one) => one !== first) ?? first;
      menu.replaceChildren(...all.map((/** @type {any} */ one) => make("option", { value: one.name, text: one.doc ? `${one.name}: ${one.doc}` : one.name, selected: one === chosen })));
      fill();
    },
    read() {
      const count = Number(points.value);
      if (!(Number.parseFloat(from.value) < Number.parseFloat(to.value)) || !(count >= 2)) { return null; }
      return { name: menu.value, from: from.value.trim(), to: to.value.trim(), points: Math.round(count), log: logarithmic.checked };
    },
  };
}

/** What was found, in words. @param {any} event @param {any[]} ranges */
function sentence(event, ranges) {
  const column = (/** @type {string} */ table, /** @type {(name: string) => boolean} */ is) => event.tables[table]?.find((/** @type {any} */ one) => is(one.name))?.values;
  const of = (/** @type {string} */ name) => (/** @type {string} */ column) => column === name || column.startsWith(`${name}_`);
  if (event.kind === "performance") {
    const amplitude = column("optimum", (name) => name === "amplitude_m");
    const value = column("optimum", of(ranges[0].name));
    if (!amplitude || amplitude[0] === null || amplitude[0] === undefined) { return "There is no optimum inside the range: extend it."; }
    const unit = event.plot.axes[0]?.x.unit ?? "";
    return amplitude.map((/** @type {number} */ peak, /** @type {number} */ row) => `Best ${ranges[0].name}: ${digits(value[row], 5)} ${unit}, with a peak of ${si(peak, "m", 4)}.`).slice(0, 4).join(" ");
  }
  const peaks = column("map", (name) => name === "amplitude_m") ?? [];
  let best = -1;
  peaks.forEach((/** @type {number | null} */ peak, /** @type {number} */ row) => { if (peak !== null && (best < 0 || peak < peaks[best])) { best = row; } });
  if (best < 0) { return "No peak was found."; }
  const text = ranges.map((range) => { const one = event.tables.map.find((/** @type {any} */ c) => of(range.name)(c.name)); return `${range.name} = ${digits(one.values[best], 4)} ${one.unit ?? ""}`.trim(); });
  return `Lowest peak of the grid: ${si(peaks[best], "m", 4)} at ${text.join(", ")}.`;
}

