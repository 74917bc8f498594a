// Batches of a writer: rows of one kind, in columns, each key once.

import { invalid } from "./errors.js"
import { isoTime, micros } from "./json.js"

/**
 * @typedef {import("./exact.js").Point} Point
 * @typedef {string | number | bigint} AnyKey
 * @typedef {bigint | Date | string} Time microseconds since 1970, a Date, or a text in ISO 8601 with its zone
 * @typedef {"put" | "remove" | "insert" | "delete" | "move"} Operation
 *
 * @typedef {object} Columns of one call
 * @property {readonly AnyKey[]} [keys]
 * @property {readonly Point[]} [points]
 * @property {readonly Point[]} [destinations] of moves
 * @property {readonly Time[]} [times]
 * @property {readonly Time[]} [expireTimes]
 * @property {readonly number[]} [accuracies]
 *
 * @typedef {object} Conditions what all rows of a batch have in common
 * @property {"absent" | "present"} [only]
 * @property {number} [ttl] seconds
 * @property {"raise" | "count"} [missing]
 *
 * @typedef {object} Rows checked
 * @property {Operation} op
 * @property {number} count
 * @property {string} kind only rows of one kind go into one batch
 * @property {Conditions} conditions
 * @property {readonly AnyKey[]} keys integers that are exact numbers are numbers
 * @property {readonly Point[]} points
 * @property {readonly Point[]} destinations
 * @property {readonly bigint[]} times microseconds since 1970
 * @property {readonly bigint[]} expireTimes
 * @property {readonly number[]} accuracies
 */

const LARGEST = (1n << 64n) - 1n
/** Of a row without its key: places, times, and what frames them. */
const ROW_BYTES = 48

/**
 * Rows as they go into batches; a bad value is refused with its field and row.
 * @param {Operation} op
 * @param {Columns} columns
 * @param {Conditions} [conditions]
 * @returns {Rows}
 */
export function rowsOf(op, columns, conditions = {}) {
  const { keys = [], points = [], destinations = [], times = [], expireTimes = [], accuracies = [] } = columns
  const count = (columns.keys ?? points).length
  for (const [name, values] of Object.entries(columns)) {
    if (values && values.length !== count) throw new RangeError(`${name} has ${values.length} rows for ${count}`)
  }
  finites(columns.keys ? "points" : op === "move" ? "move/origins" : op, points)
  finites("move/destinations", destinations)
  accuracies.forEach((each, row) => {
    if (!Number.isFinite(each) || each < 0) throw invalid("accuracies", row, each, "must be a finite number that is not negative")
  })
  const checked = keys.map((key, row) => keyOf(op === "remove" ? "remove" : "keys", row, key))
  const stamps = times.map((time, row) => instantOf("times", row, time))
  const ends = expireTimes.map((time, row) => instantOf("expire_times", row, time))
  const named = typeof checked[0] === "string"
  checked.forEach((key, row) => {
    if ((typeof key === "string") !== named) throw invalid("keys", row, key, `must be ${named ? "a string" : "an integer"}, as the first one`)
  })
  const kind = [op, named, !!columns.times, !!columns.expireTimes, !!columns.accuracies, JSON.stringify(conditions)].join()
  return { op, count, kind, conditions, keys: checked, points, destinations, times: stamps, expireTimes: ends, accuracies }
}

/** @param {string} field @param {readonly Point[]} points */
function finites(field, points) {
  points.forEach((point, row) => {
    for (const axis of [0, 1]) {
      if (!Number.isFinite(point?.[axis])) throw invalid(field, row, point?.[axis], "must be a finite number")
    }
  })
}

/** @param {string} field @param {number} row @param {AnyKey} key @returns {AnyKey} */
function keyOf(field, row, key) {
  if (typeof key === "string" || (Number.isSafeInteger(key) && Number(key) >= 0)) return key
  if (typeof key !== "bigint" || key < 0n || key > LARGEST) {
    throw invalid(field, row, key, "must be a string or an integer from 0 to 2**64 - 1")
  }
  return key <= Number.MAX_SAFE_INTEGER ? Number(key) : key
}

/** @param {string} field @param {number} row @param {Time} time @returns {bigint} */
function instantOf(field, row, time) {
  try {
    return typeof time === "bigint" ? time : micros(isoTime(time))
  } catch {
    throw invalid(field, row, time, "must be a time with its zone")
  }
}

/** One batch. */
export class Batch {
  rows = 0
  /** About its bytes in a message. */
  size = 0
  /** @type {AnyKey[]} */
  keys = []
  /** x and y of one point after the other, and of one destination. @type {number[]} */
  coordinates = []
  /** @type {number[]} */
  destinations = []
  /** @type {bigint[]} */
  times = []
  /** @type {bigint[]} */
  expireTimes = []
  /** @type {number[]} */
  accuracies = []
  /** Its number, once it takes no more rows. */
  sequence = 0n
  /** How often it was sent. */
  sent = 0
  /** What the server said. @type {import("./client.js").Applied | null} */
  applied = null
  #kind
  /** @type {Set<AnyKey>} */
  #seen = new Set()

  /** @param {Rows} rows what it begins with */
  constructor({ op, kind, conditions }) {
    this.op = op
    this.conditions = conditions
    this.#kind = kind
  }

  /**
   * Add rows from one on, as long as they may be in this batch.
   * @param {Rows} rows
   * @param {number} from
   * @param {number} most rows of a batch
   * @returns {number} the first row that was not added
   */
  add(rows, from, most) {
    const { count, kind, keys, points, destinations, times, expireTimes, accuracies } = rows
    if (kind !== this.#kind) return from
    const end = Math.min(count, from + most - this.rows)
    let row = from
    for (; row < end; row++) {
      if (keys.length) {
        const key = keys[row]
        if (this.#seen.has(key)) break
        this.#seen.add(key)
        this.keys.push(key)
        this.size += typeof key === "string" ? 3 * key.length : 8
      }
      if (points.length) this.coordinates.push(points[row][0], points[row][1])
      if (destinations.length) this.destinations.push(destinations[row][0], destinations[row][1])
      if (times.length) this.times.push(times[row])
      if (expireTimes.length) this.expireTimes.push(expireTimes[row])
      if (accuracies.length) this.accuracies.push(accuracies[row])
    }
    this.rows += row - from
    this.size += (row - from) * ROW_BYTES
    return row
  }

  /** It takes no more rows: its number. @param {bigint} sequence */
  close(sequence) {
    this.sequence = sequence
    this.#seen.clear()
  }
}
