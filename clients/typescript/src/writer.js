import { growing, path, pause } from "./connection.js"
import { DynhullError } from "./errors.js"
import { fromWire, isoTime } from "./json.js"

/**
 * @typedef {import("./exact.js").Point} Point
 * @typedef {import("./client.js").Transport["connection"]} Connection
 * @typedef {string | number | bigint} AnyKey
 * @typedef {bigint | Date | string} Time microseconds since 1970, a Date, or a text in ISO 8601 with its zone
 *
 * @typedef {object} WriterOptions
 * @property {string} [producer] the name under which batches are numbered; default: a new one
 * @property {bigint} [sequence] the number of the last batch that was sent before, to go on after it
 * @property {number} [batchRows] rows of a batch at most
 * @property {number} [room] rows that wait before `put` does
 * @property {number} [patience] seconds to try for while nobody answers
 * @property {boolean} [maySkip] accept that batches are passed over after a restore of the server
 * @property {AbortSignal} [signal] gives up
 *
 * @typedef {{op: "put", key: AnyKey, point: Point, time: string | undefined}
 *   | {op: "remove", key: AnyKey}
 *   | {op: "insert", point: Point, time: string | undefined}
 *   | {op: "delete", point: Point}} Row
 *
 * @typedef {{rows: Row[], keys: Set<string>}} Batch rows of one kind, and their keys
 */

/**
 * Writes rows in batches that are applied exactly once, also over broken connections and restarts of the server.
 *
 * Batches are numbered. One that is not answered is sent again with its number, and the server applies no number twice.
 * While a batch is on its way, the next one gathers. What was not acknowledged is lost with the page.
 *
 *     const writer = client.writer("fleet")
 *     await writer.put(["LH400"], [[8.57, 50.03]]) // waits if the server is slower than the page
 *     await writer.flush() // everything is kept
 */
export class Writer {
  #connection
  #name
  #options
  /** @type {Batch[]} batches that are full, and the last one, which gathers */
  #batches = []
  #rows = 0
  /** @type {DynhullError | null} */
  #failed = null
  /** @type {(() => void)[]} who waits for room, or for everything to be acknowledged */
  #waiters = []
  #sending = false

  /**
   * @param {Connection} connection
   * @param {string} name
   * @param {WriterOptions} options
   */
  constructor(connection, name, options) {
    const { producer = crypto.randomUUID(), sequence = 0n, batchRows = 8192, patience = 60 } = options
    this.#connection = connection
    this.#name = name
    this.#options = { batchRows, room: 4 * batchRows, patience, maySkip: false, ...options }
    this.producer = producer
    /** The number of the last batch that was acknowledged. @type {bigint} */
    this.sequence = sequence
    /** What the server said of it. @type {import("./client.js").Applied | null} */
    this.applied = null
  }

  /**
   * Put keys at positions. Resolves when there is room for more.
   * @param {readonly AnyKey[]} keys
   * @param {readonly Point[]} points
   * @param {readonly Time[]} [times] of the positions
   */
  put(keys, points, times) {
    sameLength("points", points, keys)
    if (times) sameLength("times", times, keys)
    return this.#add(keys.map((key, row) => ({ op: "put", key, point: points[row], time: timeOf(times, row) })))
  }

  /**
   * Remove keys.
   * @param {readonly AnyKey[]} keys
   */
  remove(keys) {
    return this.#add(keys.map((key) => ({ op: "remove", key })))
  }

  /**
   * Insert points into a hull without keys.
   * @param {readonly Point[]} points
   * @param {readonly Time[]} [times]
   */
  insert(points, times) {
    if (times) sameLength("times", times, points)
    return this.#add(points.map((point, row) => ({ op: "insert", point, time: timeOf(times, row) })))
  }

  /**
   * Delete points of a hull without keys.
   * @param {readonly Point[]} points
   */
  delete(points) {
    return this.#add(points.map((point) => ({ op: "delete", point })))
  }

  /** Resolves when everything is acknowledged. Throws what the server has refused; nothing after it was sent. */
  async flush() {
    await this.#until(() => !this.#rows)
  }

  /** Flush, and take nothing more. */
  async close() {
    await this.flush()
    this.#failed = new DynhullError({ reason: "CLOSED", detail: "the writer is closed" })
  }

  /** @param {Row[]} rows */
  async #add(rows) {
    if (this.#failed) throw this.#failed
    for (const row of rows) {
      let last = this.#batches.at(-1)
      if (last === undefined || !fits(last, row, this.#options.batchRows)) {
        last = { rows: [], keys: new Set() }
        this.#batches.push(last)
      }
      last.rows.push(row)
      if ("key" in row) last.keys.add(String(row.key))
    }
    this.#rows += rows.length
    void this.#send()
    await this.#until(() => this.#rows <= this.#options.room)
  }

  async #send() {
    if (this.#sending) return
    this.#sending = true
    await null // what the caller adds in the same turn goes together
    try {
      for (let batch = this.#batches.shift(); batch; batch = this.#batches.shift()) {
        this.applied = await this.#deliver(batch.rows)
        this.sequence += 1n
        this.#rows -= batch.rows.length
        this.#wake()
      }
    } catch (error) {
      this.#failed = /** @type {DynhullError} */ (error)
    } finally {
      this.#sending = false
      this.#wake()
    }
  }

  /** @param {Row[]} rows */
  async #deliver(rows) {
    const { patience, maySkip, signal } = this.#options
    const until = performance.now() + patience * 1000
    const call = {
      method: "POST",
      query: { may_skip: maySkip || undefined },
      body: bodyOf(rows),
      idempotencyKey: `${this.producer}:${this.sequence + 1n}`,
      signal: signal ?? null,
    }
    for (const seconds of growing()) {
      try {
        return fromWire(await this.#connection.ask(path`/hulls/${this.#name}/points`, call))
      } catch (error) {
        const again = error instanceof DynhullError && (error.passing || error.unknown || error.reason === "DEADLINE")
        if (!again || signal?.aborted || performance.now() > until) throw error
        await pause(seconds, signal ?? null)
      }
    }
  }

  /** @param {() => boolean} condition */
  async #until(condition) {
    while (!condition()) {
      if (this.#failed) throw this.#failed
      await new Promise((resolve) => this.#waiters.push(() => resolve(null)))
    }
    if (this.#failed) throw this.#failed
  }

  #wake() {
    for (const wake of this.#waiters.splice(0)) wake()
  }
}

/**
 * Whether a row may join a batch: a batch has a key once, and either puts or inserts.
 * @param {Batch} batch
 * @param {Row} row
 * @param {number} most
 */
function fits({ rows, keys }, row, most) {
  const first = rows[0]
  if (rows.length >= most || first.op !== row.op) return false
  if ("time" in row && "time" in first && (row.time === undefined) !== (first.time === undefined)) return false
  return !("key" in row) || !keys.has(String(row.key))
}

/** @param {Row[]} rows */
function bodyOf(rows) {
  const [first] = rows
  const column = (/** @type {string} */ name) => rows.map((row) => /** @type {any} */ (row)[name])
  const times = "time" in first && first.time !== undefined ? { times: column("time") } : {}
  if (first.op === "put") return { keys: column("key"), points: column("point"), ...times }
  if (first.op === "remove") return { remove: column("key"), missing: "count" }
  return { [first.op]: column("point"), ...times }
}

/** @param {readonly Time[] | undefined} times @param {number} row */
function timeOf(times, row) {
  return times && isoTime(times[row])
}

/** @param {string} name @param {readonly unknown[]} values @param {readonly unknown[]} keys */
function sameLength(name, values, keys) {
  if (values.length !== keys.length) throw new RangeError(`${name} has ${values.length} rows for ${keys.length}`)
}
