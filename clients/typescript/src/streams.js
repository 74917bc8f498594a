import { path, problem } from "./connection.js"
import { invalid } from "./errors.js"
import { fromWire, momentOf, toWire } from "./json.js"
import { Reads } from "./reads.js"
import { alarmEvent, fenceEvent, hullEvent, hullNow } from "./watch.js"

/**
 * @typedef {import("./hull-copy.js").HullCopy} HullCopy
 * @typedef {import("./hull-copies.js").HullCopies} HullCopies
 * @typedef {import("./joined.js").Following} Following
 * @typedef {import("./json.js").Moment} Moment
 * @typedef {import("./spans.js").Span} Span
 * @typedef {import("./watch.js").HullEvent} HullEvent
 * @typedef {import("./watch.js").FenceEvent} FenceEvent
 * @typedef {import("./watch.js").AlarmEvent} AlarmEvent
 * @typedef {import("./watch.js").FeedEvent} FeedEvent
 * @typedef {import("./watch.js").Hulls} Hulls
 *
 * @typedef {object} View what of a hull is followed
 * @property {boolean} [keys] whether to name the vertices
 * @property {boolean} [measures]
 * @property {number} [layer]
 * @property {number} [maxVertices]
 * @property {number} [rate] the most events a second
 * @property {HullCopy} [copy] updated with each event
 *
 * @typedef {Following & View & {wait?: boolean}} WatchOptions `wait`: for a hull that is not there yet, as is usual; else that is
 *   refused
 * @typedef {Following & View & {start?: Moment, end?: Moment, speed?: number, every?: Span}} ReplayOptions
 * @typedef {Following & {outlines?: boolean, maxVertices?: number, rate?: number, copies?: HullCopies}} ManyOptions
 */

const POSITION = /^([0-9a-f]{2})+$/

/** What can be followed: async iterators. Those of one client share a connection, whatever their number. */
export class Streams extends Reads {
  #connection
  #joined

  /**
   * @param {import("./client.js").Transport["connection"]} connection
   * @param {import("./client.js").Transport["joined"]} joined
   */
  constructor(connection, joined) {
    super((name, what, call) => connection.ask(path`/hulls/${name}` + what, { repeatable: true, ...call }))
    this.#connection = connection
    this.#joined = joined
  }

  /**
   * The changes of a hull as they happen, without end; a hull that is not there yet is waited for.
   *
   * Connections that end or fall silent are made again, and the stream goes on where it was. Leave the loop, or abort
   * the signal, to end it.
   * @param {string} name
   * @param {WatchOptions} [options]
   * @returns {AsyncGenerator<HullEvent, void, undefined>}
   */
  async *watch(name, { wait = true, ...options } = {}) {
    const query = { ...viewed(options), wait: wait || undefined }
    for await (const { type, data } of this.#joined.follow(path`/hulls/${name}/events`, query, options)) {
      const event = hullEvent(type, fromWire(data))
      options.copy?.update(event)
      yield event
    }
  }

  /**
   * The past of a hull, from one moment to another one: the events that a watch would have had.
   * @param {string} name
   * @param {ReplayOptions} [options] `speed` says how many seconds of the past go by in one; 0, the default: as fast as
   *   they are read. `every` is the least time of the past between events
   * @returns {AsyncGenerator<HullEvent, void, undefined>}
   */
  async *replay(name, { start, end, speed, every, ...options } = {}) {
    const query = { from: momentOf(start), to: momentOf(end), speed, every, ...viewed(options) }
    for await (const { type, data } of this.#joined.follow(path`/hulls/${name}/replay`, query, options)) {
      if (type === "end") return
      const event = hullEvent(type, fromWire(data))
      options.copy?.update(event)
      yield event
    }
  }

  /**
   * All hulls whose names begin with a prefix, or with these names, as they change.
   * @param {string | readonly string[]} which a prefix, or names
   * @param {ManyOptions} [options]
   * @returns {AsyncGenerator<Hulls, void, undefined>}
   */
  async *watchMany(which, { outlines, maxVertices, rate, copies, ...following } = {}) {
    const named = typeof which === "string" ? { prefix: which } : { name: which }
    const query = { ...named, outlines: outlines || undefined, max_vertices: maxVertices, rate }
    for await (const { type, data } of this.#joined.follow("/events", query, following)) {
      if (type !== "begin" && type !== "restored" && type !== "hulls" && type !== "complete") continue
      const { hulls, gone = [], unchanged = [] } = type === "hulls" ? data : { hulls: [] }
      /** @type {Hulls} */
      const event = { type: type === "restored" ? "begin" : type, hulls: hulls.map(hullNow), gone, unchanged }
      copies?.update(event)
      yield event
    }
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
    for await (const { type, data } of this.#joined.follow(path`/fences/${name}/events`, query, following)) {
      yield fenceEvent(type, fromWire(data))
    }
  }

  /**
   * The events that a fence would have made between two moments. No fence is created.
   * @param {import("./client.js").FenceSettings & {initial?: "snapshot" | "events" | "none", start?: Moment, end?: Moment, signal?: AbortSignal | null}} settings
   * @returns {AsyncGenerator<FenceEvent, void, undefined>}
   */
  async *fenceEventsBetween({ signal = null, start, end, ...settings }) {
    const body = toWire({ ...settings, start: momentOf(start), end: momentOf(end) })
    for await (const { type, data } of this.#connection.events("/fences/between", { method: "POST", body, signal })) {
      if (type === "complete") return
      if (type === "problem") throw problem(data)
      if (type !== "" && type !== "available" && type !== "unavailable") yield fenceEvent(type, fromWire(data))
    }
    throw problem({ reason: "UNREACHABLE", detail: "the events have ended before the last one" })
  }

  /**
   * The events of an alarm, each once and in order, without end.
   * @param {string} name
   * @param {Following & {consumer?: string, after?: bigint | number}} [options] as of `watchFence`
   * @returns {AsyncGenerator<AlarmEvent, void, undefined>}
   */
  async *watchAlarm(name, { consumer, after, ...following } = {}) {
    for await (const { type, data } of this.#joined.follow(path`/alarms/${name}/events`, { consumer, after }, following)) {
      yield alarmEvent(type, fromWire(data))
    }
  }

  /**
   * Every batch of a hull with its rows, each once and in order, without end.
   * @param {string} name
   * @param {Following & {consumer?: string, after?: bigint | number}} [options] begin after the last revision that a
   *   consumer has acknowledged, or after this one; 0: with the oldest that is kept; default: with the next
   * @returns {AsyncGenerator<FeedEvent, void, undefined>}
   */
  async *feed(name, { consumer, after, ...following } = {}) {
    yield* batches(this.#joined.follow(path`/hulls/${name}/feed`, { consumer, after }, following))
  }

  /**
   * Every batch of all hulls whose names begin with a prefix, each once, by their commits.
   * @param {string} prefix
   * @param {Following & {consumer?: string, begin?: boolean, position?: string}} [options] `consumer`: after the last
   *   event that it has acknowledged; `begin`: with the oldest that is kept; `position`: after an event that had it
   * @returns {AsyncGenerator<FeedEvent, void, undefined>}
   */
  async *feedMany(prefix, { consumer, begin, position, ...following } = {}) {
    if (position && !POSITION.test(position)) throw invalid("position", null, position, "must be the position of an event")
    const query = { prefix, consumer, begin: begin || undefined }
    yield* batches(this.#joined.follow("/feed", query, following, position))
  }
}

/**
 * Batches of a feed. Those of one commit come together: only the last one has a place to go on after.
 * @param {AsyncIterable<import("./joined.js").Message>} messages
 * @returns {AsyncGenerator<FeedEvent, void, undefined>}
 */
async function* batches(messages) {
  /** @type {FeedEvent[]} */
  let together = []
  for await (const { type, data, id } of messages) {
    together.push({ type, position: id, ...(type === "hulls" ? data : batchOf(data)) })
    if (!id && type === "batch") continue
    yield* together
    together = []
  }
}

/** A batch: keys are bigint whatever the names of their fields. @param {any} data @returns {any} */
function batchOf(data) {
  const batch = fromWire(data)
  if (batch.removed) batch.removed = batch.removed.map(keyOf)
  if (batch.held?.dropped) batch.held.dropped = batch.held.dropped.map(keyOf)
  return batch
}

/** @param {string | number | bigint} key */
function keyOf(key) {
  return typeof key === "number" ? BigInt(key) : key
}

/** @param {View} view */
function viewed({ keys, measures, layer, maxVertices, rate }) {
  return { keys, measures, layer, max_vertices: maxVertices, rate }
}
