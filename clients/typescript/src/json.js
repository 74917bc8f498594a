// JSON with every number as it is: integers beyond 2 ** 53, and -0.

import { parse, stringify } from "lossless-json"

// An integer of so many digits that a double may not hold it.
const LONG = /[[,:]\s*-?\d{16,}\s*[\],}]/
const WHOLE = /^-?\d+$/

/**
 * A value from JSON: integers that are no exact doubles are bigint.
 * @param {string} text
 * @returns {any}
 */
export function fromJson(text) {
  return LONG.test(text) ? parse(text, null, number) : JSON.parse(text)
}

/** @param {string} text */
function number(text) {
  const value = Number(text)
  return Number.isSafeInteger(value) || !WHOLE.test(text) ? value : BigInt(text)
}

const NEGATIVE_ZERO = { test: (/** @type {unknown} */ value) => Object.is(value, -0), stringify: () => "-0.0" }

/**
 * A value as JSON.
 * @param {unknown} value
 * @returns {string}
 */
export function toJson(value) {
  if (isPlain(value)) return JSON.stringify(value)
  return stringify(value, null, undefined, [NEGATIVE_ZERO]) ?? "null"
}

/** Whether a value has neither bigint nor -0: then JSON.stringify, which is much faster, writes the same. @param {unknown} value @returns {boolean} */
function isPlain(value) {
  if (typeof value === "number") return Number.isFinite(value) && !Object.is(value, -0)
  if (typeof value === "string" || typeof value === "boolean" || value === null) return true
  if (Array.isArray(value)) return value.every(isPlain)
  return typeof value === "object" && Object.getPrototypeOf(value) === Object.prototype && Object.values(value).every((each) => each === undefined || isPlain(each))
}

// Fields whose integers may be large, and those that have times.
const INTEGERS = /(^|_)(revisions?|sequence|keys?)$|^(acknowledged|commit|first|last)$/
const TIMES = /(^|_)(times?|until)$|^(created|changed|clock|oldest|since)$/

/**
 * An answer with names as JavaScript writes them: keys, revisions and sequences as bigint, times as microseconds since
 * 1970, bigint as well.
 * @param {any} value
 * @returns {any}
 */
export function fromWire(value) {
  if (Array.isArray(value)) return isObject(value[0]) ? value.map(fromWire) : value
  if (!isObject(value)) return value
  return Object.fromEntries(Object.entries(value).map(([name, field]) => [camel(name), fieldOf(name, field)]))
}

/** @param {string} name @param {any} field @returns {any} */
function fieldOf(name, field) {
  // The clock of a window is a word.
  if (TIMES.test(name)) return mapped(field, (each) => (INSTANT.test(each) ? micros(each) : each))
  if (INTEGERS.test(name)) return mapped(field, (each) => (typeof each === "number" ? BigInt(each) : fromWire(each)))
  return fromWire(field)
}

/** @param {any} value @param {(each: any) => any} change @returns {any} */
function mapped(value, change) {
  return Array.isArray(value) ? value.map((each) => mapped(each, change)) : change(value)
}

/** @param {string} name */
function camel(name) {
  return name.replace(/_([a-z])/g, (_, letter) => letter.toUpperCase())
}

/** Settings with names as servers write them. @param {Record<string, any>} given @returns {Record<string, any>} */
export function toWire(given) {
  const there = Object.entries(given).filter(([, value]) => value !== undefined)
  return Object.fromEntries(there.map(([name, value]) => [snake(name), name === "quarantine" && value ? toWire(value) : value]))
}

/** @param {string} name */
function snake(name) {
  return name.replace(/[A-Z]/g, (letter) => `_${letter.toLowerCase()}`)
}

/** @param {unknown} value */
function isObject(value) {
  return typeof value === "object" && value !== null
}

const INSTANT = /^(\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d)(?:\.(\d{1,6}))?(Z|[+-]\d\d:\d\d)$/

/**
 * A time in ISO 8601, with its zone, as microseconds since 1970.
 * @param {unknown} text
 * @returns {any} a bigint; what is no text as it is
 */
export function micros(text) {
  if (typeof text !== "string") return text
  const found = INSTANT.exec(text)
  if (found === null) throw new RangeError(`no time with a zone: ${text}`)
  const [, seconds, fraction = "", zone] = found
  return BigInt(Date.parse(seconds + zone)) * 1000n + BigInt(fraction.padEnd(6, "0"))
}

/**
 * A time as servers read it.
 * @param {bigint | Date | string} time microseconds since 1970, a Date, or a text in ISO 8601 with its zone
 * @returns {string}
 */
export function isoTime(time) {
  if (typeof time === "string") return time
  const whole = time instanceof Date ? BigInt(time.getTime()) * 1000n : time
  const rest = ((whole % 1_000_000n) + 1_000_000n) % 1_000_000n
  const seconds = new Date(Number((whole - rest) / 1000n)).toISOString().slice(0, -5)
  return `${seconds}.${rest.toString().padStart(6, "0")}Z`
}

/** @typedef {bigint | number | Date | string} Moment a revision; or a time with its zone: the last revision committed by then */

/**
 * A moment of the past as servers read it.
 * @param {Moment | undefined} when
 */
export function momentOf(when) {
  if (when === undefined) return undefined
  return typeof when === "bigint" || typeof when === "number" ? String(when) : isoTime(when)
}
