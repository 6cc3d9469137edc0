// What the user takes away: the study file, a Python program, tables, pictures, and a report of
// the pinned curves.

import { describe, run } from "./api.js";
import { byId, download, make, message } from "./dom.js";
import { height, nameOf, peaks } from "./pins.js";
import { picture } from "./plot.js";
import { pinned } from "./response.js";
import { digits } from "./format.js";
import { changeList, state, tell } from "./store.js";

export function start() {
  /** @type {[string, string, () => void][]} */
  const items = [
    ["save-study", "Study file", saveStudy], ["save-python", "Copy as Python", copyPython], ["save-csv", "Tables as CSV", saveTables],
    ["save-svg", "Figure as SVG", () => savePicture("svg")], ["save-png", "Figure as PNG", () => savePicture("png")],
    ["save-report", "Report of the pins (HTML)", saveReport],
  ];
  byId("save-items").append(...items.map(([id, text, action]) => make("button", { type: "button", id, text, onclick: async () => {
    byId("save").open = false;
    try { await action(); } catch (error) { tell("offline", error); }
  } })));
  byId("save").addEventListener("keydown", (/** @type {KeyboardEvent} */ event) => {
    if (event.key === "Escape") { byId("save").open = false; byId("save").querySelector("summary").focus(); }
  });
  document.addEventListener("click", (event) => { if (!byId("save").contains(/** @type {Node} */ (event.target))) { byId("save").open = false; } });
}

/** @param {"svg" | "png"} format */
const savePicture = (format) => state.result && picture(state.result.plot, pinned(), format, name());

const name = () => `${state.description.name}_explored`;

/** The text of the study on the screen. Its first line says where it comes from. */
async function studyText() {
  const described = await describe(state.study, changeList());
  if (described.event === "error") { throw new Error(described.message); }
  const origin = state.study.replace(":", " ");
  return state.changes.size === 0 ? described.text : `# Changed in the explorer; the original is the ${origin}.\n${described.text}`;
}

async function saveStudy() {
  download(`${name()}.toml`, await studyText(), "application/toml");
}

async function copyPython() {
  const text = await studyText();
  const quoted = text.replaceAll("\\", "\\\\").replaceAll('"""', '\\"\\"\\"');
  const program = `import stickslip\n\nstudy = stickslip.Study.from_text("""\n${quoted}""", name="${name()}")\nresult = study.run()\nprint(result)\n`;
  await navigator.clipboard.writeText(program);
  message("Copied: a Python program that runs this study.");
  setTimeout(() => message(), 4000);
}

async function saveTables() {
  const event = await run("tables", { study: state.study, changes: changeList(), tables: true, view: { kind: "study", points: null, references: false, scale: null } });
  if (event === null) { return; }
  if (event.event === "error") { throw new Error(event.message); }
  for (const [table, columns] of Object.entries(event.tables)) { download(`${name()}_${table}.csv`, csv(/** @type {any} */ (columns)), "text/csv"); }
}

/** @param {any[]} columns */
export function csv(columns) {
  const cell = (/** @type {any} */ value) => (value === null ? "" : typeof value === "string" && /[",\n]/.test(value) ? `"${value.replaceAll('"', '""')}"` : String(value));
  const rows = columns[0]?.values.length ?? 0;
  const lines = [columns.map((column) => cell(column.name)).join(",")];
  for (let row = 0; row < rows; row += 1) { lines.push(columns.map((column) => cell(column.values[row])).join(",")); }
  return `${lines.join("\n")}\n`;
}

const escape = (/** @type {string} */ text) => text.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;").replaceAll('"', "&quot;");

/** One file with the pinned curves, their peaks and their changes. It needs no other file. */
async function saveReport() {
  const pins = state.pins.length > 0 ? state.pins : state.result ? [{ name: "as on the screen", changes: changeList(), result: state.result }] : [];
  if (pins.length === 0) { return; }
  const script = await (await fetch("./assets/plotly.js")).text();
  const figures = pins.map((/** @type {any} */ pin) => ({ data: pin.result.plot.data.map((/** @type {any} */ trace) => ({ ...trace, type: trace.type === "scattergl" ? "scatter" : trace.type })), layout: { ...pin.result.plot.wide, showlegend: true, legend: { orientation: "h" } } }));
  const data = JSON.stringify(figures).replaceAll("<", "\\u003c").replaceAll("\u2028", "\\u2028").replaceAll("\u2029", "\\u2029");
  const sections = pins.map((/** @type {any} */ pin, /** @type {number} */ i) => {
    const rows = peaks(pin.result).map((/** @type {any} */ peak) => `<tr><td>${escape(peak.case)}</td><td>${escape(peak.mass)}</td><td>${digits(peak.frequency, 6)}</td><td>${escape(height(peak))}</td></tr>`).join("");
    const notes = pin.result.notes.map((/** @type {string} */ note) => `<li>${escape(note)}</li>`).join("");
    return `<section><h2>${escape(pin.name)}</h2><p>Changed values: ${escape(pin.changes.length > 0 ? nameOf(pin.changes) : "none")}</p><div id="figure-${i}"></div><table><tr><th>case</th><th>place</th><th>Hz</th><th>peak</th></tr>${rows}</table><ul>${notes}</ul></section>`;
  }).join("\n");
  const study = escape(await studyText());
  const page = `<!doctype html><html lang="en"><head><meta charset="utf-8"><title>${escape(state.description.title)}</title>
<style>body{font:16px/1.5 system-ui,sans-serif;max-width:1100px;margin:2rem auto;padding:0 1rem}table{border-collapse:collapse}td,th{padding:.2rem .8rem .2rem 0;text-align:left;border-bottom:1px solid #ddd}pre{overflow-x:auto;background:#f6f7f9;padding:1rem}</style>
<script>${script.replaceAll("</script", "<\\/script")}</script></head><body><h1>${escape(state.description.title)}</h1>
${sections}<h2>Study file on the screen</h2><pre>${study}</pre>
<script>${data.length > 0 ? `const figures=${data};figures.forEach((f,i)=>Plotly.newPlot("figure-"+i,f.data,f.layout,{responsive:true}));` : ""}</script></body></html>`;
  download(`${name()}.html`, page, "text/html");
}
