// Requests to the server.
//
// The token comes with the address of the page. It is then kept in this tab only, and sent as a
// header, because browsers block cookies in frames.

const found = new URLSearchParams(location.search).get("token");
if (found) {
  sessionStorage.setItem("token", found);
  history.replaceState(null, "", location.pathname + location.hash);
}
const token = sessionStorage.getItem("token") ?? "";
const headers = { "content-type": "application/json", "x-stickslip-token": token };
const client = Array.from(crypto.getRandomValues(new Uint8Array(8)), (byte) => byte.toString(16).padStart(2, "0")).join("");

/** @type {Map<string, AbortController>} */
const running = new Map();

/** Asks for the studies. */
export async function catalog() {
  return checked(await fetch("./api/catalog", { headers }));
}

/** Describes a changed study. @param {string} study @param {any[]} changes */
export async function describe(study, changes) {
  return checked(await fetch("./api/describe", { method: "POST", headers, body: JSON.stringify({ study, changes }) }));
}

/** @param {Response} response */
async function checked(response) {
  if (!response.ok) { throw new Error(await response.text()); }
  return response.json();
}

/**
 * Runs a study. The newest run of a slot wins; the older one ends without a result.
 * @param {string} slot
 * @param {any} request
 * @param {(event: any) => void} [progress] gets `begin`, `progress` and `partial`
 * @returns {Promise<any>} the last event, or null if a newer run took its place
 */
export async function run(slot, request, progress = () => {}) {
  running.get(slot)?.abort();
  const control = new AbortController();
  running.set(slot, control);
  try {
    const response = await fetch("./api/run", {
      method: "POST", headers, signal: control.signal, body: JSON.stringify({ client, slot, ...request }),
    });
    if (!response.ok || !response.body) { throw new Error(await response.text()); }
    /** @type {any} */
    let last = null;
    for await (const event of lines(response.body)) {
      if (["begin", "progress", "partial"].includes(event.event)) { progress(event); } else { last = event; }
    }
    if (last !== null && last.event !== "superseded") { return last; }
    // the server saw an older request after this one, or ended: the newest request is sent again
    return running.get(slot) === control ? run(slot, request, progress) : null;
  } catch (error) {
    if (control.signal.aborted) { return null; }
    throw error;
  } finally {
    if (running.get(slot) === control) { running.delete(slot); }
  }
}

/** Stops the run of a slot. @param {string} slot */
export const stop = (slot) => running.get(slot)?.abort();

/** Reads JSON lines. @param {ReadableStream<Uint8Array>} body */
async function* lines(body) {
  const reader = body.pipeThrough(/** @type {ReadableWritablePair<string, Uint8Array>} */ (/** @type {unknown} */ (new TextDecoderStream()))).getReader();
  let rest = "";
  for (;;) {
    const { value, done } = await reader.read();
    if (done) { return; }
    const parts = (rest + value).split("\n");
    rest = parts.pop() ?? "";
    for (const part of parts) { if (part) { yield JSON.parse(part); } }
  }
}
