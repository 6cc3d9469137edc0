// The page: its tabs, its buttons, and what happens when a study is opened or changed.

import * as api from "./api.js";
import * as design from "./design.js";
import { byId, make, message } from "./dom.js";
import * as gallery from "./gallery.js";
import * as motion from "./motion.js";
import * as orbit from "./orbit.js";
import * as output from "./output.js";
import * as parameters from "./parameters.js";
import * as pins from "./pins.js";
import * as response from "./response.js";
import { canRedo, canUndo, changeList, on, open, redo, reset, restore, state, tell, undo } from "./store.js";
import * as trust from "./trust.js";

const TABS = [["response", "Response", response], ["orbit", "Orbit", orbit], ["motion", "Motion", motion], ["design", "Design", design], ["compare", "Compare", pins]];

/** @type {any[]} */
let entries = [];
let shown = "response";
let describing = 0;
/** Timer of the next attempt to reach the server. */
let reconnecting = 0;

function tabs() {
  for (const [name, title, part] of /** @type {[string, string, any][]} */ (TABS)) {
    const tab = make("button", { type: "button", role: "tab", id: `tab-${name}`, "aria-controls": `panel-${name}`, text: title, onclick: () => show(name) });
    const panel = make("section", { role: "tabpanel", id: `panel-${name}`, "aria-labelledby": `tab-${name}`, tabindex: "0", hidden: true });
    byId("tabs").append(tab);
    byId("panels").append(panel);
    part.start(panel);
  }
  byId("tabs").addEventListener("keydown", (/** @type {KeyboardEvent} */ event) => {
    const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!by) { return; }
    const names = TABS.map(([name]) => name);
    const next = String(names[(names.indexOf(shown) + by + names.length) % names.length]);
    show(next);
    byId(`tab-${next}`).focus();
  });
}

/** @param {string} name */
function show(name) {
  shown = name;
  for (const [other] of TABS) {
    byId(`tab-${other}`).setAttribute("aria-selected", String(other === name));
    byId(`tab-${other}`).tabIndex = other === name ? 0 : -1;
    byId(`panel-${other}`).hidden = other !== name;
  }
  tell("tab", name);
}

/** @param {string} id */
async function choose(id) {
  message();
  try {
    const description = await api.describe(id, []);
    if (description.event === "error") { message(sentence(description)); return; }
    byId("gallery").hidden = true;
    byId("workbench").hidden = false;
    title(description);
    location.hash = id;
    byId("tab-response").textContent = description.kind === "response" ? "Response" : description.kind.charAt(0).toUpperCase() + description.kind.slice(1);
    open(id, description);
    show("response");
    buttons();
  } catch (error) {
    offline(error);
  }
}

/** @param {any} description */
function title(description) {
  byId("title").textContent = description.title;
  document.title = `${description.title} – Stickslip explorer`;
}

/** Reads the study again after a change, for values that follow from others. */
async function describe() {
  buttons();
  describing += 1;
  const own = describing;
  try {
    const description = await api.describe(state.study, changeList());
    if (own !== describing) { return; }
    if (description.event === "error") { message(sentence(description)); return; }
    message();
    // the values of `vary` in the file stay known, so that they can come back
    state.description = description;
    tell("described");
  } catch (error) {
    offline(error);
  }
}

/** @param {any} event */
function sentence(event) {
  const where = event.key ? `${event.key}: ` : "";
  return `${where}${event.message}${event.help ? ` – ${event.help}` : ""}`;
}

/** @param {any} error */
function offline(error) {
  const lost = error instanceof TypeError;
  const again = `Start the explorer again with --port ${location.port}, and open the address that it prints: your changes are kept.`;
  message(lost ? `The server does not answer. ${again}` : String(error.message ?? error));
  if (lost) {
    clearTimeout(reconnecting);
    reconnecting = setTimeout(reconnect, 1500);
  }
}

async function reconnect() {
  try {
    await api.catalog();
    message();
    if (state.study) { tell("changed"); }
  } catch (error) {
    offline(error);
  }
}

function buttons() {
  const none = !byId("gallery").hidden;
  for (const id of ["skip", "undo", "redo", "reset", "show-parameters"]) { byId(id).hidden = none; }
  byId("undo").disabled = !canUndo();
  byId("redo").disabled = !canRedo();
  byId("reset").disabled = state.changes.size === 0;
  byId("save").hidden = none || !state.study;
}

function theme() {
  const kept = localStorage.getItem("theme");
  const dark = kept ? kept === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
  document.documentElement.dataset.theme = dark ? "dark" : "light";
  document.documentElement.style.colorScheme = dark ? "dark" : "light";
}

/** On a narrow page the parameters are a sheet below the curve, which a button opens. */
function drawer() {
  const sheet = byId("parameters");
  const button = byId("show-parameters");
  const set = (/** @type {boolean} */ open) => {
    sheet.classList.toggle("open", open);
    button.setAttribute("aria-expanded", String(open));
  };
  button.addEventListener("click", () => { set(!sheet.classList.contains("open")); if (sheet.classList.contains("open")) { byId("search").focus({ preventScroll: true }); } });
  document.addEventListener("keydown", (event) => {
    if (event.key !== "Escape" || !sheet.classList.contains("open") || getComputedStyle(button).display === "none") { return; }
    set(false);
    button.focus();
  });
}

async function start() {
  theme();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { theme(); tell("theme"); });
  byId("theme").addEventListener("click", () => {
    localStorage.setItem("theme", document.documentElement.dataset.theme === "dark" ? "light" : "dark");
    theme();
    tell("theme");
  });
  parameters.start();
  trust.start();
  tabs();
  output.start();
  byId("undo").addEventListener("click", undo);
  byId("redo").addEventListener("click", redo);
  byId("reset").addEventListener("click", reset);
  byId("open-gallery").addEventListener("click", () => { location.hash = ""; message(); gallery.show(entries); });
  document.addEventListener("keydown", (event) => {
    const typing = event.target instanceof HTMLInputElement && event.target.type !== "range";
    if (!(event.ctrlKey || event.metaKey) || typing) { return; }
    if (event.key === "z" && !event.shiftKey) { event.preventDefault(); undo(); }
    if (event.key === "y" || (event.key === "Z" && event.shiftKey)) { event.preventDefault(); redo(); }
  });
  window.addEventListener("resize", () => tell("theme"));
  on("choose", choose);
  on("gallery", buttons);
  drawer();
  on("show", show);
  on("changed", describe);
  on("failed", (event) => message(sentence(event)));
  on("offline", offline);
  buttons();
  try {
    const answer = await api.catalog();
    entries = answer.entries;
    const wanted = decodeURIComponent(location.hash.slice(1)) || answer.first;
    if (wanted) { await choose(wanted); restore(); tell("restore"); } else { gallery.show(entries); }
  } catch (error) {
    offline(error);
  }
}

start();
