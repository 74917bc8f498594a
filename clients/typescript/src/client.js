import { Connection, path } from "./connection.js"
import { fromWire, isoTime, snake } from "./json.js"
import { follow } from "./sse.js"
import { fenceEvent, hullEvent } from "./watch.js"
import { Writer } from "./writer.js"
import { Reads } from "./reads.js"
import { pastOf } from "./past.js"

/**
 * @typedef {import("./exact.js").Point} Point
 * @typedef {import("./hull-copy.js").HullCopy} HullCopy
 * @typedef {import("./hull-copy.js").Key} Key
 * @typedef {import("./hull-copies.js").HullCopies} HullCopies
 * @typedef {import("./watch.js").HullEvent} HullEvent
 * @typedef {import("./watch.js").FenceEvent} FenceEvent
 * @typedef {import("./watch.js").Hulls} Hulls
 * @typedef {import("./writer.js").AnyKey} AnyKey
 * @typedef {import("./writer.js").Time} Time
 * @typedef {import("./sse.js").Following} Following
 * @typedef {import("./past.js").Past} Past
 * @typedef {{signal?: AbortSignal | null}} Abortable
 *
 * @typedef {object} HullInfo
 * @property {string} name
 * @property {bigint} revision
 * @property {number} points
 * @property {number} distinct
 * @property {bigint} created in microseconds since 1970, as all times
 * @property {string} uid
 * @property {"str" | "int" | null} keyed
 * @property {object | null} window
 * @property {"arrival" | "event_time"} ordering
 * @property {number | null} pointLimit
 * @property {bigint | null} clock
 * @property {boolean} geographic
 * @property {Point | null} center
 * @property {object | null} quarantine
 * @property {number} held
 * @property {number | null} shards
 * @property {bigint | null} changed
 * @property {boolean} restored
 *
 * @typedef {object} Applied the effect of a batch
 * @property {bigint} revision
 * @property {number} inserted
 * @property {number} deleted
 * @property {number} missing
 * @property {boolean} hullChanged
 * @property {number} points
 * @property {boolean} duplicate
 * @property {number} moved
 * @property {number} stale
 * @property {number} late
 * @property {number} skipped
 * @property {number} clamped
 * @property {number} evicted
 * @property {bigint | null} clock
 * @property {number} held
 * @property {number[]} heldRows
 * @property {number} released
 * @property {number} dropped
 * @property {number} gathered
 *
 * @typedef {object} Batch changes that are applied together or not at all
 * @property {readonly Point[]} [insert]
 * @property {readonly Point[]} [delete]
 * @property {{origins: readonly Point[], destinations: readonly Point[]}} [move]
 * @property {readonly AnyKey[]} [keys] keys to put
 * @property {readonly Point[]} [points] their positions
 * @property {readonly Time[]} [times]
 * @property {readonly AnyKey[]} [remove]
 * @property {readonly AnyKey[]} [release]
 * @property {readonly AnyKey[]} [drop]
 * @property {"absent" | "present"} [only]
 * @property {number} [ttl]
 * @property {readonly Time[]} [expireTimes]
 * @property {readonly number[]} [accuracies]
 * @property {"raise" | "count"} [missing]
 *
 * @typedef {object} Numbering makes a batch one that may be sent again
 * @property {string} [producer]
 * @property {bigint | number} [sequence] the number after the last one
 * @property {boolean} [maySkip]
 *
 * @typedef {object} NewHull
 * @property {"str" | "int" | null} [keyed]
 * @property {number | null} [maxAge] seconds
 * @property {number | null} [maxPoints]
 * @property {"server" | "data"} [clock]
 * @property {number | null} [maxSkew]
 * @property {"refuse" | "clamp"} [ahead]
 * @property {"arrival" | "event_time"} [ordering]
 * @property {number | null} [pointLimit]
 * @property {boolean} [geographic]
 * @property {Point | null} [center]
 * @property {{maxSpeed?: number, maxGrowth?: number, confirmations?: number} | null} [quarantine]
 * @property {number | null} [shards]
 * @property {boolean | number | string | null} [history]
 * @property {number | null} [historyBytes]
 * @property {boolean} [existOk]
 *
 * @typedef {object} FenceSettings
 * @property {object} area `{hull}`, `{center, radius}`, `{exterior, holes}`, several of these, or a GeoJSON geometry
 * @property {string} [subjects]
 * @property {string} [subjectPrefix]
 * @property {string} [otherHull]
 * @property {"closed" | "open"} [boundary]
 * @property {number} [margin]
 * @property {boolean} [crosses]
 * @property {number} [dwell]
 * @property {number} [confirmations]
 * @property {number} [minDwell]
 * @property {boolean} [byAccuracy]
 * @property {number} [near]
 * @property {boolean} [withoutSelf]
 * @property {number} [layer]
 * @property {number} [maxEvents]
 * @property {number} [maxEventAge]
 *
 * @typedef {FenceSettings & {name: string, created: bigint, uid: string, lastSequence: bigint, firstSequence: bigint,
 *   inside: number, subjectCount: number, consumers: Consumer[]}} Fence
 * @typedef {{name: string, acknowledged: bigint, backlog: number, oldest: bigint | null, lost: number}} Consumer
 *
 * @typedef {Following & {keys?: boolean, measures?: boolean, layer?: number, maxVertices?: number, rate?: number,
 *   copy?: HullCopy}} WatchOptions
 */

/**
 * The hulls and fences behind a gateway (`dynhull gateway`), in the browser and in Node.
 *
 *     const client = new Client("https://hulls.example", { token })
 *     await client.createHull("fleet", { keyed: "str", existOk: true })
 *     await client.put("fleet", ["LH400", "BA117"], [[8.57, 50.03], [-0.45, 51.47]])
 *     const { sides } = await client.locate("fleet", [[4, 50]])
 *
 * Keys of hulls with integers, revisions, sequences and times are bigint. What is refused throws a DynhullError.
 */
export class Client extends Reads {
  #connection

  /**
   * @param {string} url of the gateway
   * @param {import("./connection.js").ConnectionOptions} [options]
   */
  constructor(url, options = {}) {
    const connection = new Connection(url, options)
    super((name, what, call) => connection.ask(path`/hulls/${name}` + what, { repeatable: true, ...call }))
    this.#connection = connection
  }

  // Hulls

  /**
   * Create a hull without points.
   * @param {string} name
   * @param {NewHull & Abortable} [settings]
   * @returns {Promise<HullInfo>}
   */
  async createHull(name, { signal, ...settings } = {}) {
    const body = toWire({ name, ...settings })
    return fromWire(await this.#connection.ask("/hulls", { method: "POST", body, signal }))
  }

  /**
   * Delete a hull with all its points. This cannot be undone.
   * @param {string} name
   * @param {Abortable} [options]
   */
  async deleteHull(name, options = {}) {
    await this.#connection.ask(path`/hulls/${name}`, { method: "DELETE", ...options })
  }

  /**
   * The hulls by name.
   * @param {string} [prefix]
   * @param {Abortable} [options]
   * @returns {AsyncGenerator<HullInfo, void, undefined>}
   */
  async *listHulls(prefix = "", options = {}) {
    yield* this.#pages("/hulls", "hulls", prefix, options)
  }

  // Writes

  /**
   * Put keys at positions, in one batch: a new key is inserted, a known one moves.
   * @param {string} name
   * @param {readonly AnyKey[]} keys
   * @param {readonly Point[]} points
   * @param {Omit<Batch, "keys" | "points"> & Numbering & Abortable} [options]
   * @returns {Promise<Applied>}
   */
  put(name, keys, points, options = {}) {
    return this.apply(name, { keys, points, ...options })
  }

  /**
   * Remove keys, in one batch. By default, a key that is not there is counted as missing.
   * @param {string} name
   * @param {readonly AnyKey[]} keys
   * @param {{missing?: "raise" | "count"} & Numbering & Abortable} [options]
   * @returns {Promise<Applied>}
   */
  remove(name, keys, options = {}) {
    return this.apply(name, { missing: "count", remove: keys, ...options })
  }

  /**
   * Apply a batch: all of it, as one revision, or nothing. With a producer and a sequence, exactly once.
   * @param {string} name
   * @param {Batch & Numbering & Abortable} batch
   * @returns {Promise<Applied>}
   */
  async apply(name, { producer, sequence, maySkip, signal, ...batch }) {
    const numbered = numbering(producer, sequence, maySkip)
    const call = { method: "POST", body: batchToWire(batch), signal, ...numbered }
    return fromWire(await this.#connection.ask(path`/hulls/${name}/points`, call))
  }

  /**
   * Apply batches to several hulls: all of them at the same moment, or none.
   * @param {Record<string, Batch>} batches by the name of the hull
   * @param {Numbering & Abortable} [options]
   * @returns {Promise<Record<string, Applied>>}
   */
  async transfer(batches, { producer, sequence, maySkip, signal } = {}) {
    const numbered = numbering(producer, sequence, maySkip)
    const body = { batches: mapValues(batches, batchToWire) }
    const { results } = await this.#connection.ask("/transfers", { method: "POST", body, signal, ...numbered })
    return mapValues(results, fromWire)
  }

  /**
   * A writer, which numbers its batches: each is applied exactly once.
   * @param {string} name
   * @param {import("./writer.js").WriterOptions} [options]
   */
  writer(name, options = {}) {
    return new Writer(this.#connection, name, options)
  }

  /**
   * The number of the last batch of a producer that was applied; 0 before the first.
   * @param {string} name
   * @param {string} producer
   * @param {Abortable} [options]
   * @returns {Promise<bigint>}
   */
  async lastSequence(name, producer, options = {}) {
    const found = path`/hulls/${name}/producers/${producer}`
    return fromWire(await this.#connection.ask(found, { repeatable: true, ...options })).lastSequence
  }

  // The past

  /**
   * A hull as it was: an object with the reading methods, without the name.
   * @param {string} name
   * @param {bigint | number | Date | string} when a revision, or a time with its zone: the last revision committed by then
   * @param {Abortable} [options]
   * @returns {Promise<Past>}
   */
  async at(name, when, options = {}) {
    const at = typeof when === "bigint" || typeof when === "number" ? String(when) : isoTime(when)
    const ask = (/** @type {string} */ what, /** @type {any} */ call) =>
      this.#connection.ask(path`/hulls/${name}` + what, { repeatable: true, ...call })
    const found = await ask("", { query: { at }, ...options })
    return pastOf(name, fromWire(found.info), ask)
  }

  // Streams

  /**
   * The changes of a hull as they happen, without end; a hull that is not there yet is waited for.
   *
   * Connections that end or fall silent are made again, and the stream goes on where it was. Leave the loop, or abort
   * the signal, to end it.
   * @param {string} name
   * @param {WatchOptions} [options]
   * @returns {AsyncGenerator<HullEvent, void, undefined>}
   */
  async *watch(name, { copy, keys, measures, layer, maxVertices, rate, ...following } = {}) {
    const query = { keys, measures, layer, max_vertices: maxVertices, rate, wait: true }
    for await (const { type, data } of follow(this.#connection, path`/hulls/${name}/events`, query, following)) {
      const event = hullEvent(type, fromWire(data))
      copy?.update(event)
      yield event
    }
  }

  /**
   * All hulls whose names begin with a prefix, or with these names, as they change.
   * @param {string | readonly string[]} which a prefix, or names
   * @param {Following & {outlines?: boolean, maxVertices?: number, rate?: number, copies?: HullCopies}} [options]
   * @returns {AsyncGenerator<Hulls, void, undefined>}
   */
  async *watchMany(which, { outlines, maxVertices, rate, copies, ...following } = {}) {
    const options = { outlines: outlines || undefined, max_vertices: maxVertices, rate }
    const names = typeof which === "string" ? "" : `?${which.map((name) => `name=${encodeURIComponent(name)}`).join("&")}`
    const query = typeof which === "string" ? { prefix: which, ...options } : options
    for await (const { type, data } of follow(this.#connection, `/events${names}`, query, following)) {
      if (type !== "begin" && type !== "hulls" && type !== "complete") continue
      const { hulls, gone = [], unchanged = [] } = type === "hulls" ? data : { hulls: [] }
      /** @type {Hulls} */
      const event = { type, hulls: hulls.map(hullNow), gone, unchanged }
      copies?.update(event)
      yield event
    }
  }

  // Fences

  /**
   * Create a fence.
   * @param {string} name
   * @param {FenceSettings & {initial?: "snapshot" | "events" | "none", existOk?: boolean} & Abortable} settings
   * @returns {Promise<Fence>}
   */
  async createFence(name, { signal, ...settings }) {
    const body = toWire({ name, ...settings })
    return fenceOf(await this.#connection.ask("/fences", { method: "POST", body, signal }))
  }

  /**
   * Replace the area and the settings of a fence; its subjects stay.
   * @param {string} name
   * @param {FenceSettings & Abortable} settings
   * @returns {Promise<Fence>}
   */
  async replaceFence(name, { signal, ...settings }) {
    const call = { method: "PUT", body: toWire(settings), signal }
    return fenceOf(await this.#connection.ask(path`/fences/${name}`, call))
  }

  /**
   * Delete a fence with its events.
   * @param {string} name
   * @param {Abortable} [options]
   */
  async deleteFence(name, options = {}) {
    await this.#connection.ask(path`/fences/${name}`, { method: "DELETE", ...options })
  }

  /**
   * A fence.
   * @param {string} name
   * @param {Abortable} [options]
   * @returns {Promise<Fence>}
   */
  async getFence(name, options = {}) {
    return fenceOf(await this.#connection.ask(path`/fences/${name}`, { repeatable: true, ...options }))
  }

  /**
   * The fences by name.
   * @param {string} [prefix]
   * @param {Abortable} [options]
   * @returns {AsyncGenerator<Fence, void, undefined>}
   */
  async *listFences(prefix = "", options = {}) {
    yield* this.#pages("/fences", "fences", prefix, options)
  }

  /**
   * Who is inside of a fence, and up to which event.
   * @param {string} name
   * @param {Abortable} [options]
   * @returns {Promise<{sequence: bigint, subjects: {hull: string, keys: Key[], revision: bigint}[]}>}
   */
  async fenceInside(name, options = {}) {
    return fromWire(await this.#connection.ask(path`/fences/${name}/inside`, { repeatable: true, ...options }))
  }

  /**
   * The events of a fence, each once and in order, without end.
   * @param {string} name
   * @param {Following & {consumer?: string, after?: bigint | number, conflate?: boolean}} [options] begin after the last
   *   event that a consumer has acknowledged, or after a number; default: what happens from now on
   * @returns {AsyncGenerator<FenceEvent, void, undefined>}
   */
  async *watchFence(name, { consumer, after, conflate, ...following } = {}) {
    const query = { consumer, after, conflate: conflate || undefined }
    for await (const { data } of follow(this.#connection, path`/fences/${name}/events`, query, following)) {
      yield fenceEvent(fromWire(data))
    }
  }

  /**
   * Acknowledge the events of a fence up to a number: a watch of that consumer begins after it.
   * @param {string} name
   * @param {string} consumer
   * @param {bigint | number} sequence
   * @param {{uid?: string} & Abortable} [options]
   * @returns {Promise<Consumer>}
   */
  async ackFence(name, consumer, sequence, { uid = "", signal } = {}) {
    const call = { method: "PUT", body: { sequence, uid }, repeatable: true, signal }
    return fromWire(await this.#connection.ask(path`/fences/${name}/consumers/${consumer}`, call))
  }

  /**
   * Forget a consumer of a fence.
   * @param {string} name
   * @param {string} consumer
   * @param {Abortable} [options]
   */
  async deleteConsumer(name, consumer, options = {}) {
    await this.#connection.ask(path`/fences/${name}/consumers/${consumer}`, { method: "DELETE", ...options })
  }

  /**
   * @param {string} at
   * @param {"hulls" | "fences"} rows
   * @param {string} prefix
   * @param {Abortable} options
   * @returns {AsyncGenerator<any, void, undefined>}
   */
  async *#pages(at, rows, prefix, options) {
    /** @type {string | null} */
    let after = null
    do {
      const page = await this.#connection.ask(at, { query: { prefix, after }, repeatable: true, ...options })
      yield* page[rows].map(rows === "fences" ? fenceOf : fromWire)
      after = page.next
    } while (after !== null)
  }
}

/** @param {any} hull @returns {import("./watch.js").HullNow} */
function hullNow(hull) {
  return { measures: null, changed: null, center: null, vertices: null, error: null, ...fromWire(hull) }
}

/** A fence; the area is as it was given. @param {any} fence @returns {Fence} */
function fenceOf(fence) {
  return { ...fromWire(fence), area: fence.area }
}

/** @param {string | undefined} producer @param {bigint | number | undefined} sequence @param {boolean | undefined} skip */
function numbering(producer, sequence, skip) {
  if (producer === undefined) return {}
  if (sequence === undefined) throw new RangeError("a producer numbers its batches: give a sequence")
  return { idempotencyKey: `${producer}:${sequence}`, repeatable: true, query: { may_skip: skip || undefined } }
}

/** @param {Batch} batch */
function batchToWire(batch) {
  const times = (/** @type {readonly Time[] | undefined} */ given) => given?.map(isoTime)
  return toWire({ ...batch, times: times(batch.times), expireTimes: times(batch.expireTimes) })
}

/** Settings with names as servers write them. @param {Record<string, any>} given @returns {Record<string, any>} */
function toWire(given) {
  const there = Object.entries(given).filter(([, value]) => value !== undefined)
  return Object.fromEntries(there.map(([name, value]) => [snake(name), name === "quarantine" && value ? toWire(value) : value]))
}

/**
 * @template T, U
 * @param {Record<string, T>} values
 * @param {(value: T) => U} change
 * @returns {Record<string, U>}
 */
function mapValues(values, change) {
  return Object.fromEntries(Object.entries(values).map(([name, value]) => [name, change(value)]))
}
