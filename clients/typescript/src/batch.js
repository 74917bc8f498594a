// Batches of a writer: rows of one kind, in columns, each key once.

import { invalid } from "./errors.js"
import { isoTime, micros } from "./json.js"

/**
 * @typedef {import("./exact.js").Point} Point
 * @typedef {string | number | bigint} AnyKey
 * @typedef {bigint | Date | string} Time microseconds since 1970, a Date, or a text in ISO 8601 with its zone
 * @typedef {"put" | "remove" | "insert" | "delete"} Operation
 *
 * @typedef {object} Rows checked, of one call
 * @property {Operation} op
 * @property {number} count
 * @property {readonly AnyKey[] | null} keys integers that are exact numbers are numbers
 * @property {readonly Point[] | null} points
 * @property {readonly bigint[] | null} times microseconds since 1970
 */

const LARGEST = (1n << 64n) - 1n
/** Of a row without its key: a point, a time, and what frames them. */
const ROW_BYTES = 32

/**
 * Rows as they go into batches; a bad value is refused with its field and row.
 * @param {Operation} op
 * @param {{keys?: readonly AnyKey[], points?: readonly Point[], times?: readonly Time[] | undefined}} columns
 * @returns {Rows}
 */
export function rowsOf(op, { keys, points, times }) {
  const count = (keys ?? points ?? []).length
  for (const [name, values] of Object.entries({ points, times })) {
    if (values && values.length !== count) throw new RangeError(`${name} has ${values.length} rows for ${count}`)
  }
  points?.forEach((point, row) => {
    for (const axis of [0, 1]) {
      if (!Number.isFinite(point?.[axis])) throw invalid(keys ? "points" : op, row, point?.[axis], "must be a finite number")
    }
  })
  const checked = keys ? keys.map((key, row) => keyOf(op === "remove" ? "remove" : "keys", row, key)) : null
  return { op, count, keys: checked, points: points ?? null, times: times?.map(instantOf) ?? null }
}

/** @param {string} field @param {number} row @param {AnyKey} key @returns {AnyKey} */
function keyOf(field, row, key) {
  if (typeof key === "string" || (Number.isSafeInteger(key) && Number(key) >= 0)) return key
  if (typeof key !== "bigint" || key < 0n || key > LARGEST) {
    throw invalid(field, row, key, "must be a string or an integer from 0 to 2**64 - 1")
  }
  return key <= Number.MAX_SAFE_INTEGER ? Number(key) : key
}

/** @param {Time} time @param {number} row @returns {bigint} */
function instantOf(time, row) {
  try {
    return typeof time === "bigint" ? time : micros(isoTime(time))
  } catch {
    throw invalid("times", row, time, "must be a time with its zone")
  }
}

/** One batch. */
export class Batch {
  rows = 0
  /** About its bytes in a message. */
  size = 0
  /** @type {AnyKey[]} */
  keys = []
  /** x and y of one point after the other. @type {number[]} */
  coordinates = []
  /** @type {bigint[]} */
  times = []
  /** Its number, once it takes no more rows. */
  sequence = 0n
  /** How often it was sent. */
  sent = 0
  /** What the server said. @type {import("./client.js").Applied | null} */
  applied = null
  /** @type {Set<AnyKey>} */
  #seen = new Set()

  /** @param {Rows} rows what it begins with: its kind */
  constructor({ op, keys, times }) {
    this.op = op
    this.timed = times !== null
    this.named = keys !== null && typeof keys[0] === "string"
  }

  /**
   * Add rows from one on, as long as they may be in this batch.
   * @param {Rows} rows
   * @param {number} from
   * @param {number} most rows of a batch
   * @returns {number} the first row that was not added
   */
  add({ op, count, keys, points, times }, from, most) {
    if (op !== this.op || (times !== null) !== this.timed) return from
    let row = from
    for (; row < count && this.rows < most; row++) {
      if (keys) {
        const key = keys[row]
        if ((typeof key === "string") !== this.named || this.#seen.has(key)) break
        this.#seen.add(key)
        this.keys.push(key)
        this.size += typeof key === "string" ? 3 * key.length : 8
      }
      if (points) this.coordinates.push(points[row][0], points[row][1])
      if (times) this.times.push(times[row])
      this.rows++
      this.size += ROW_BYTES
    }
    return row
  }

  /** It takes no more rows: its number. @param {bigint} sequence */
  close(sequence) {
    this.sequence = sequence
    this.#seen.clear()
  }
}
