// The strip at the bottom: how many points converged, their worst evidence, the methods that
// found them, all warnings, and the time.

import { byId, make } from "./dom.js";
import { duration, evidence } from "./format.js";
import { on } from "./store.js";

export function start() {
  on("opened", () => byId("trust").replaceChildren());
  on("gallery", () => byId("trust").replaceChildren());
  on("result", show);
  // the strip keeps the last result and says that it is not that of the present values
  on("failed", () => {
    const strip = byId("trust");
    if (strip.childElementCount > 0 && !strip.querySelector(".old")) { strip.prepend(make("span", { class: "bad old", text: "no result for the present values; last result:" })); }
  });
}

/** @param {any} result */
function show(result) {
  const strip = byId("trust");
  const open = strip.querySelector("details")?.open ?? false;
  const all = Object.values(result.points).reduce((/** @type {number} */ sum, /** @type {any} */ count) => sum + count, 0);
  const converged = result.points.converged ?? 0;
  const others = Object.entries(result.points).filter(([status]) => status !== "converged").map(([status, count]) => `${count} ${status}`);
  const found = Object.entries(result.found_by).map(([name, count]) => `${name} ${count}`).join(", ");
  const warnings = result.notes.filter((/** @type {string} */ note) => note.startsWith("warning"));
  strip.replaceChildren(...[
    make("span", { class: converged === all ? "good" : "bad", text: converged === all ? (all === 1 ? "✓ converged" : `✓ all ${all} points converged`) : `${converged} of ${all} points converged; ${others.join(", ")}` }),
    result.energy_gap === null ? null : make("span", { text: `energy gap ≤ ${evidence(result.energy_gap)}` }), result.residual === null ? null : make("span", { text: `residual ≤ ${evidence(result.residual)}` }),
    result.methods.length > 0 ? make("span", { text: `method: ${result.methods.join("; ")}` }) : null, found ? make("span", { text: `found by: ${found}` }) : null,
    make("span", { text: `computed in ${duration(result.seconds)}${result.reduced ? ", fewer points while moving" : ""}` }),
  ].filter((part) => part !== null));
  const lines = [...result.notes, ...result.failures.map((/** @type {any} */ one) => `No orbit was found at ${one.at || "this point"}: ${one.reason}`)];
  if (result.failed > result.failures.length) { lines.push(`and ${result.failed - result.failures.length} more points without an orbit`); }
  if (lines.length > 0) {
    const text = warnings.length > 0 ? `${warnings.length} warning${warnings.length > 1 ? "s" : ""}, ${lines.length} note${lines.length > 1 ? "s" : ""} in all` : `${lines.length} note${lines.length > 1 ? "s" : ""}`;
    strip.append(make("details", { open }, make("summary", { class: warnings.length > 0 ? "bad" : null, text }), make("ul", {}, ...lines.map((text) => make("li", { text })))));
  }
}
