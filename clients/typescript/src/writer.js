import { rowsOf } from "./batch.js"
import { growing, pause } from "./connection.js"
import { DynhullError } from "./errors.js"
import { InFlight } from "./in-flight.js"

/**
 * @typedef {import("./batch.js").Point} Point
 * @typedef {import("./batch.js").AnyKey} AnyKey
 * @typedef {import("./batch.js").Time} Time
 * @typedef {import("./client.js").Transport["connection"]} Connection
 *
 * @typedef {object} WriterOptions
 * @property {string} [producer] the name under which batches are numbered; default: a new one. A writer with the name of an earlier
 *   one goes on after the last batch of that which was applied. Two at the same time must not share a name.
 * @property {number} [batchRows] rows of a batch at most
 * @property {number} [inFlight] batches that are sent and not acknowledged, at most
 * @property {number} [room] rows that wait before `put` does
 * @property {number} [patience] seconds to try for while nobody answers
 * @property {"last" | null} [coalesce] "last" keeps the last of several positions of a key in a batch; by default a key that comes
 *   again begins a batch, and no position is lost
 * @property {string} [uid] the uid of the hull that an earlier writer with this name wrote to: RESTORED if a backup of the hull was
 *   restored since then. Over a gateway it is compared when the writer begins, and where numbers leave a gap.
 * @property {bigint} [acknowledged] the number of the last batch that was acknowledged to that writer: RESTORED if the hull lacks it
 * @property {"raise" | "count"} [missing] whether a point or key to delete, move or remove that is not there refuses the batch;
 *   default: a point does, and a key does not
 * @property {boolean} [maySkip] accept that batches are passed over after a restore of the server
 * @property {AbortSignal} [signal] gives up
 *
 * @typedef {object} Putting
 * @property {readonly Time[]} [times] of the positions
 * @property {"absent" | "present"} [only] puts keys only if they are new, or only if they are there
 * @property {import("./spans.js").Span} [ttl] after which the keys leave,
 * @property {readonly Time[]} [expireTimes] or the moments
 * @property {readonly number[]} [accuracies] how far the positions may be from where the keys really are
 */

/**
 * Writes rows in batches that are applied exactly once, also over broken connections and restarts of the server.
 *
 * Batches are numbered, and several are under way. One that is not answered is sent again with its number, and the server applies
 * no number twice and none before the one before it. Rows gather in the next batch until it is full, or until nothing is under
 * way. What was not acknowledged is lost with the page.
 *
 *     const writer = client.writer("fleet")
 *     await writer.put(["LH400"], [[8.57, 50.03]]) // waits if the server is slower than the page
 *     await writer.flush() // everything is kept
 */
export class Writer {
  #connection
  #name
  #options
  #batches
  /** @type {unknown} */
  #failed = null
  /** @type {(() => void)[]} who waits for room, or for everything to be acknowledged */
  #waiters = []
  #sending = false
  #uid = ""
  #begun = false

  /**
   * @param {Connection} connection
   * @param {string} name
   * @param {WriterOptions} options
   */
  constructor(connection, name, options) {
    const { producer = crypto.randomUUID(), batchRows = 8192, inFlight = connection.inFlight, patience = 60, coalesce = null } = options
    for (const [option, value] of Object.entries({ batchRows, inFlight })) {
      if (!Number.isSafeInteger(value) || value < 1) throw new RangeError(`${option} must be an integer from 1 on, got ${value}`)
    }
    if (coalesce !== null && coalesce !== "last") throw new RangeError(`coalesce must be null or "last", got ${coalesce}`)
    this.#connection = connection
    this.#name = name
    this.#options = { room: (inFlight + 1) * batchRows, patience, maySkip: false, signal: null, uid: "", acknowledged: 0n, ...options, inFlight, producer }
    this.#batches = new InFlight(batchRows, coalesce === "last")
    this.#batches.onAcknowledged = () => this.#wake()
    this.producer = producer
  }

  /** The number of the last batch that was acknowledged. @returns {bigint} */
  get sequence() {
    return this.#batches.sequence
  }

  /** The uid of the hull, for a later writer; empty until the writer has begun. */
  get uid() {
    return this.#uid
  }

  /**
   * Put keys at positions. Resolves when there is room for more; `applied` of what it resolves to is the promise of what the batch
   * has changed, or of the last one of several. Calls may share a batch. A bad value throws, and nothing was added.
   * @param {readonly AnyKey[]} keys
   * @param {readonly Point[]} points
   * @param {readonly Time[] | Putting} [times] of the positions, or with what else `Client.put` takes
   */
  put(keys, points, times) {
    const { only, ttl, ...columns } = isList(times) ? { times } : (times ?? {})
    return this.#add("put", { keys, points, ...columns }, { ...(only && { only }), ...(ttl !== undefined && { ttl }) })
  }

  /**
   * Remove keys.
   * @param {readonly AnyKey[]} keys
   */
  remove(keys) {
    return this.#add("remove", { keys }, { missing: this.#options.missing ?? "count" })
  }

  /**
   * Insert points into a hull without keys.
   * @param {readonly Point[]} points
   * @param {readonly Time[]} [times]
   */
  insert(points, times) {
    return this.#add("insert", { points, times })
  }

  /**
   * Delete points of a hull without keys.
   * @param {readonly Point[]} points
   */
  delete(points) {
    return this.#add("delete", { points }, this.#missing)
  }

  /**
   * Move points of a hull without keys.
   * @param {readonly Point[]} origins
   * @param {readonly Point[]} destinations
   */
  move(origins, destinations) {
    return this.#add("move", { points: origins, destinations }, this.#missing)
  }

  /** Resolves when everything is acknowledged. Throws what the server has refused; no batch after it was applied. */
  async flush() {
    this.#batches.hurry()
    this.#batches.onMore()
    await this.#until(() => this.#batches.empty)
  }

  /** Flush, and take nothing more. */
  async close() {
    await this.flush()
    this.#failed ??= new DynhullError({ reason: "CLOSED", detail: "the writer is closed" })
  }

  get #missing() {
    const { missing } = this.#options
    return missing ? { missing } : {}
  }

  /**
   * @param {import("./batch.js").Operation} op
   * @param {import("./batch.js").Columns} columns
   * @param {import("./batch.js").Conditions} [conditions]
   * @returns {Promise<import("./batch.js").Outcome>}
   */
  async #add(op, columns, conditions) {
    if (this.#failed) throw this.#failed
    const { outcome } = this.#batches.add(rowsOf(op, columns, conditions))
    this.#batches.onMore()
    void this.#send()
    const { room, inFlight } = this.#options
    await this.#until(() => this.#batches.rows <= room && this.#batches.batches <= 2 * inFlight + 1)
    return outcome
  }

  async #send() {
    if (this.#sending) return
    this.#sending = true
    await null // what the caller adds in the same turn goes together
    try {
      await this.#begin()
      await this.#carry()
    } catch (error) {
      this.#failed = error
      this.#batches.abandon(error)
    } finally {
      this.#sending = false
      this.#wake()
    }
    if (!this.#failed && !this.#batches.empty) void this.#send() // came while the last connection ended
  }

  /** After what an earlier writer with this name has sent, to the same hull. */
  async #begin() {
    if (this.#begun) return
    const { uid, acknowledged } = this.#options
    const known = await this.#patiently(() => this.#known())
    if (uid && (known.uid !== uid || known.sequence < acknowledged)) throw this.#restored(known)
    this.#uid = known.uid
    this.#batches.begin(known.sequence)
    this.#begun = true
  }

  #known() {
    const { producer, signal } = this.#options
    return this.#connection.known(this.#name, producer, signal)
  }

  /** @param {import("./connection.js").Known} known */
  #restored({ uid, sequence }) {
    const what = uid === (this.#options.uid || this.#uid) ? "was led back to an earlier state" : "is another one, or was restored from a backup"
    const detail = `the hull ${JSON.stringify(this.#name)} ${what}, and the last batch of producer ${this.producer} that it has is number ${sequence}: go on from there, with a new writer`
    return new DynhullError({ reason: "RESTORED", status: 409, detail, expected: sequence + 1n })
  }

  /** Send what there is, over one connection after the other. */
  async #carry() {
    while (!this.#batches.empty) {
      const carrying = { ...this.#options, uid: this.#uid }
      await this.#patiently(() => this.#connection.carry(this.#name, this.#batches, carrying).catch((error) => this.#explained(error)))
    }
  }

  /** A gap before batches that were acknowledged: the hull is not what it was. @param {unknown} error @returns {Promise<never>} */
  async #explained(error) {
    const gap = error instanceof DynhullError && error.reason === "SEQUENCE_GAP" ? error.expected : null
    if (gap === null || BigInt(gap) > this.sequence) throw error
    throw this.#restored(await this.#known())
  }

  /**
   * What somebody answers, who is asked until then; the time runs from the last acknowledgement on.
   * @template T
   * @param {() => Promise<T>} ask
   * @returns {Promise<T>}
   */
  async #patiently(ask) {
    const { patience, signal } = this.#options
    let [since, sequence, pauses] = [/** @type {number | null} */ (null), this.sequence, growing()]
    for (;;) {
      try {
        return await ask()
      } catch (error) {
        this.#batches.rewind()
        signal?.throwIfAborted()
        const again = error instanceof DynhullError && (error.passing || error.unknown || error.reason === "DEADLINE")
        if (!again) throw error
        if (since === null || this.sequence !== sequence) [since, sequence, pauses] = [performance.now(), this.sequence, growing()]
        if (performance.now() - since > patience * 1000) throw error
        await pause(pauses.next().value, signal)
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

/** @param {readonly Time[] | Putting | undefined} given @returns {given is readonly Time[]} */
function isList(given) {
  return Array.isArray(given)
}
