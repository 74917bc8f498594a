// Time spans, as people write them.

import { invalid } from "./errors.js"

/** @typedef {number | string} Span seconds, or a text such as 30m or 7d */

const SPAN = /^\s*(\d+(?:\.\d+)?)\s*(ms|s|m|h|d)?\s*$/
/** @type {Record<string, number>} */
const UNITS = { ms: 0.001, s: 1, m: 60, h: 3600, d: 86400 }

/** The seconds of a time span. @param {string} field @param {any} given @returns {number} */
export function spanOf(field, given) {
  if (typeof given === "string") {
    const found = SPAN.exec(given)
    if (found === null) throw invalid(field, null, given, "write for example 500ms, 90s, 30m, 2h or 7d; a number alone is seconds")
    return Number(found[1]) * UNITS[found[2] ?? "s"]
  }
  if (typeof given !== "number" || !Number.isFinite(given)) throw invalid(field, null, given, "must be seconds, or a text such as 30m")
  return given
}
