// Batches of a writer: rows of one kind, in columns, each key once.

import { invalid } from "./errors.js"
import { isoTime, micros } from "./json.js"
import { spanOf } from "./spans.js"

/**
 * @typedef {import("./exact.js").Point} Point
 * @typedef {string | number | bigint} AnyKey
 * @typedef {import("./spans.js").Span} Span
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
 * @property {Span} [ttl]
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
/** The instants that a text of a time can say. */
const [FIRST, LAST] = ["0001-01-01T00:00:00Z", "9999-12-31T23:59:59.999999Z"].map(micros)
/** Of a number, a time or an integer in a message. */
const WORD_BYTES = 8

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
  conditionsOf(conditions)
  const kind = [op, named, !!columns.times, !!columns.expireTimes, !!columns.accuracies, JSON.stringify(conditions)].join()
  return { op, count, kind, conditions, keys: checked, points, destinations, times: stamps, expireTimes: ends, accuracies }
}

/** @param {string} field @param {readonly Point[]} points */
function finites(field, points) {
  for (let row = 0; row < points.length; row++) {
    const point = points[row]
    for (let axis = 0; axis < 2; axis++) {
      if (!Number.isFinite(point?.[axis])) throw invalid(field, row, point?.[axis], "must be a finite number")
    }
  }
}

/** @param {string} field @param {number} row @param {AnyKey} key @returns {AnyKey} */
function keyOf(field, row, key) {
  if (typeof key === "string" || (Number.isSafeInteger(key) && Number(key) >= 0)) return key
  if (typeof key !== "bigint" || key < 0n || key > LARGEST) {
    throw invalid(field, row, key, "must be a string or an integer from 0 to 2**64 - 1")
  }
  return key <= Number.MAX_SAFE_INTEGER ? Number(key) : key
}

/** @param {Conditions} conditions */
function conditionsOf({ only, ttl, missing }) {
  if (only && only !== "absent" && only !== "present") throw invalid("only", null, only, "must be absent or present")
  if (missing && missing !== "raise" && missing !== "count") throw invalid("missing", null, missing, "must be raise or count")
  if (ttl !== undefined && !(spanOf("ttl", ttl) > 0)) throw invalid("ttl", null, ttl, "must be more than 0 seconds")
}

/** Microseconds since 1970. @param {string} field @param {number | null} row @param {any} time @returns {bigint} */
export function instantOf(field, row, time) {
  let instant = null
  try {
    instant = typeof time === "bigint" ? time : micros(isoTime(time))
  } catch {
    // neither a text with a zone, nor a Date that is one
  }
  if (typeof instant !== "bigint" || instant < FIRST || instant > LAST) {
    throw invalid(field, row, time, "must be a time with its zone: a text, a Date, or a bigint of microseconds since 1970")
  }
  return instant
}

/**
 * Rows of one call that go into one batch together.
 * @typedef {object} Run
 * @property {number} from
 * @property {number} to
 * @property {Map<AnyKey, number>} places of its keys: the last row of each, counted from `from`
 */

/**
 * The longest runs: one ends where a key comes again, unless the last position of a key replaces the ones before it. A position with
 * an earlier time than the one before does not: only the server knows whether the hull is ordered by time or by arrival.
 * @param {Rows} rows
 * @param {boolean} coalesces
 * @param {number} most rows of a batch
 * @returns {Generator<Run, void, undefined>}
 */
export function* runsOf({ count, keys, times }, coalesces, most) {
  /** @type {Run} */
  let run = { from: 0, to: 0, places: new Map() }
  for (let row = 0; row < count; row++) {
    const offset = keys.length ? run.places.get(keys[row]) : undefined
    const again = offset !== undefined && !(coalesces && !(times[row] < times[run.from + offset]))
    if (again || row - run.from === most) {
      yield run
      run = { from: row, to: row, places: new Map() }
    }
    if (keys.length) run.places.set(keys[row], row - run.from)
    run.to = row + 1
  }
  yield run
}

/** Doubles that grow in number, beside each other as messages have them. */
export class Column {
  length = 0
  #values = new Float64Array(16)

  /** @param {number} value */
  push(value) {
    if (this.length === this.#values.length) {
      const values = new Float64Array(2 * this.length)
      values.set(this.#values)
      this.#values = values
    }
    this.#values[this.length++] = value
  }

  /** @param {number} place @param {number} value */
  set(place, value) {
    this.#values[place] = value
  }

  /** All of them, as they are in here. */
  get values() {
    return this.#values.subarray(0, this.length)
  }
}

/** What a `put` resolves to: in an object, since `await` would wait for a promise. @typedef {{applied: Promise<import("./client.js").Applied>}} Outcome */

/** One batch. */
export class Batch {
  /** Rows that were given, those that later ones have replaced among them. */
  rows = 0
  /** About its bytes in a message. */
  size = 0
  /** @type {AnyKey[]} */
  keys = []
  /** x and y of one point after the other, and of one destination. */
  coordinates = new Column()
  destinations = new Column()
  /** @type {bigint[]} */
  times = []
  /** @type {bigint[]} */
  expireTimes = []
  accuracies = new Column()
  /** Its number, once it takes no more rows. */
  sequence = 0n
  /** How often it was sent. */
  sent = 0
  /** What the server said. @type {import("./client.js").Applied | null} */
  applied = null
  /** @type {Outcome} */
  outcome
  #kind
  #coalesces
  /** The rows of the keys. @type {Map<AnyKey, number>} */
  #places = new Map()
  /** @type {(applied: import("./client.js").Applied) => void} */
  #resolve = () => {}
  /** @type {(error: unknown) => void} */
  #reject = () => {}

  /**
   * @param {Rows} rows what it begins with
   * @param {boolean} coalesces whether the last position of a key replaces the ones before it
   */
  constructor({ op, kind, conditions }, coalesces) {
    this.op = op
    this.conditions = conditions
    this.#kind = kind
    this.#coalesces = coalesces
    const applied = new Promise((resolve, reject) => {
      this.#resolve = resolve
      this.#reject = reject
    })
    applied.catch(() => {}) // whoever does not look at it hears of the error from `put` and `flush`
    this.outcome = { applied }
  }

  /**
   * Whether a run may be in this batch.
   * @param {Rows} rows
   * @param {Run} run
   * @param {number} most rows of a batch
   */
  admits({ kind, times }, { from, to, places }, most) {
    if (kind !== this.#kind || this.rows + to - from > most) return false
    for (const [key, offset] of this.#places.size ? places : []) {
      const place = this.#places.get(key)
      if (place !== undefined && !(this.#coalesces && !(times[from + offset] < this.times[place]))) return false
    }
    return true
  }

  /** @param {Rows} rows @param {Run} run */
  add(rows, { from, to, places }) {
    const fresh = !this.rows && places.size === to - from
    if (fresh) this.#places = places
    for (let row = from; row < to; row++) {
      const place = fresh ? undefined : this.#places.get(rows.keys[row])
      if (place !== undefined) this.#replace(place, rows, row)
      else {
        if (!fresh && rows.keys.length) this.#places.set(rows.keys[row], this.keys.length)
        this.#append(rows, row)
      }
    }
    this.rows += to - from
  }

  /** @param {Rows} rows @param {number} row */
  #append({ keys, points, destinations, times, expireTimes, accuracies }, row) {
    if (keys.length) {
      const key = keys[row]
      this.keys.push(key)
      this.size += typeof key === "string" ? 2 + 3 * key.length : WORD_BYTES
    }
    if (points.length) {
      this.coordinates.push(points[row][0])
      this.coordinates.push(points[row][1])
      this.size += 2 * WORD_BYTES
    }
    if (destinations.length) {
      this.destinations.push(destinations[row][0])
      this.destinations.push(destinations[row][1])
      this.size += 2 * WORD_BYTES
    }
    if (times.length) {
      this.times.push(times[row])
      this.size += WORD_BYTES
    }
    if (expireTimes.length) {
      this.expireTimes.push(expireTimes[row])
      this.size += WORD_BYTES
    }
    if (accuracies.length) {
      this.accuracies.push(accuracies[row])
      this.size += WORD_BYTES
    }
  }

  /** @param {number} place @param {Rows} rows @param {number} row */
  #replace(place, { points, times, expireTimes, accuracies }, row) {
    this.coordinates.set(2 * place, points[row][0])
    this.coordinates.set(2 * place + 1, points[row][1])
    if (times.length) this.times[place] = times[row]
    if (expireTimes.length) this.expireTimes[place] = expireTimes[row]
    if (accuracies.length) this.accuracies.set(place, accuracies[row])
  }

  /** It takes no more rows: its number. @param {bigint} sequence */
  close(sequence) {
    this.sequence = sequence
    this.#places = new Map()
  }

  /** @param {import("./client.js").Applied} applied */
  acknowledge(applied) {
    this.applied = applied
    this.#resolve(applied)
  }

  /** It is not known to be applied, and not sent any more. @param {unknown} error */
  abandon(error) {
    this.#reject(error)
  }
}
