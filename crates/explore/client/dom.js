// Small helpers for elements.

/** @param {string} id @returns {any} */
export const byId = (id) => document.getElementById(id);

/**
 * Makes an element.
 * @param {string} tag
 * @param {Record<string, any>} [set] attributes; `on…` are listeners, `text` is the text
 * @param {...(Node | string | null | undefined)} children
 * @returns {any}
 */
export function make(tag, set = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(set)) {
    if (value === undefined || value === null || value === false) { continue; }
    if (name === "text") { element.textContent = value; }
    else if (name.startsWith("on")) { element.addEventListener(name.slice(2), value); }
    else if (value === true) { element.setAttribute(name, ""); }
    else { element.setAttribute(name, value); }
  }
  element.append(...children.filter((child) => child !== null && child !== undefined));
  return element;
}

/** Shows a message above the page, or hides it. @param {string} [text] */
export function message(text) {
  const place = byId("message");
  place.hidden = !text;
  place.textContent = text ?? "";
}

/** Lets the user save a file. @param {string} name @param {string} content @param {string} type */
export function download(name, content, type) {
  const address = URL.createObjectURL(new Blob([content], { type }));
  const link = make("a", { href: address, download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(address), 10000);
}

/** Height of a figure: on a screen with more than 900 rows it grows with the window. @param {number} height px */
export const tall = (height) => Math.round(height * Math.max(1, window.innerHeight / 900));

/** Calls at most once per frame, with the last arguments. @template {any[]} T @param {(...a: T) => void} call */
export function perFrame(call) {
  /** @type {T | null} */
  let last = null;
  return (/** @type {T} */ ...all) => {
    const waiting = last !== null;
    last = all;
    if (!waiting) { requestAnimationFrame(() => { const now = /** @type {T} */ (last); last = null; call(...now); }); }
  };
}
