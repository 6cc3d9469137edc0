// Numbers as text.

const PREFIXES = [["G", 1e9], ["M", 1e6], ["k", 1e3], ["", 1], ["m", 1e-3], ["µ", 1e-6], ["n", 1e-9]];

/** Formats with a number of significant digits and without useless zeros. @param {number} value */
export function digits(value, count = 4) {
  if (!Number.isFinite(value)) { return "–"; }
  const text = value.toPrecision(count);
  return String(Number(text));
}

/** Formats a number of SI unit with a prefix: 0.0498 m is 49.8 mm. @param {number | null} value @param {string} unit */
export function si(value, unit, count = 4) {
  if (value === null || value === undefined || !Number.isFinite(value)) { return "–"; }
  if (value === 0 || !["m", "N", "J", "W", "s", "m/s", "Hz"].includes(unit)) { return `${digits(value, count)} ${unit}`.trim(); }
  const size = Math.abs(value);
  const [name, factor] = PREFIXES.find(([, factor]) => size >= Number(factor) * 0.9999999) ?? ["n", 1e-9];
  return `${digits(value / Number(factor), count)} ${name}${unit}`;
}

/** Formats a duration. @param {number} seconds */
export function duration(seconds) {
  if (seconds < 1) { return `${Math.max(1, Math.round(seconds * 1000))} ms`; }
  return seconds < 60 ? `${digits(seconds, 3)} s` : `${Math.round(seconds / 60)} min`;
}

/** Formats evidence such as 2.3e-12. @param {number | null} value */
export const evidence = (value) => (value === null || value === undefined ? "not measured" : value.toExponential(1));

/** The factor and prefix for a list of SI values. @param {number[]} values @param {string} unit */
export function scale(values, unit) {
  const size = values.reduce((most, value) => Math.max(most, Math.abs(value) || 0), 0);
  const found = PREFIXES.find(([, factor]) => size >= Number(factor)) ?? ["n", 1e-9];
  if (size === 0) { return { factor: 1, unit }; }
  return { factor: 1 / Number(found[1]), unit: `${found[0]}${unit}` };
}
