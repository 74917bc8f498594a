import { Connection, path } from "./connection.js"
import { Joined } from "./joined.js"
import { fromWire, isoTime, micros, momentOf, toWire } from "./json.js"
import { pastOf } from "./past.js"
import { Streams } from "./streams.js"
import { Writer } from "./writer.js"

/** Gateways send a comment each 15 seconds. */
const SILENCE = 45

/**
 * @typedef {import("./exact.js").Point} Point
 * @typedef {import("./hull-copy.js").Key} Key
 * @typedef {import("./writer.js").AnyKey} AnyKey
 * @typedef {import("./writer.js").Time} Time
 * @typedef {import("./json.js").Moment} Moment
 * @typedef {import("./spans.js").Span} Span
 * @typedef {import("./past.js").Past} Past
 * @typedef {{signal?: AbortSignal | null}} Abortable
 *
 * @typedef {object} Transport how calls and streams reach a server: `dynhull/grpc` has another one
 * @property {Pick<Connection, "url" | "ask" | "events" | "known" | "carry" | "inFlight">} connection
 * @property {Pick<Joined, "follow">} joined
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
 * @property {boolean} restored whether a backup has brought it back, without the batches after it
 * @property {boolean} erased of the past, whether it may lack keys that it had then, since they were erased
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
 * @property {Span} [ttl]
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
 * @property {Span | null} [maxAge]
 * @property {number | null} [maxPoints]
 * @property {"server" | "data"} [clock]
 * @property {Span | null} [maxSkew]
 * @property {"refuse" | "clamp"} [ahead]
 * @property {"arrival" | "event_time"} [ordering]
 * @property {number | null} [pointLimit]
 * @property {boolean} [geographic]
 * @property {Point | null} [center]
 * @property {Quarantine | null} [quarantine]
 * @property {number | null} [shards]
 * @property {boolean | Span | null} [history]
 * @property {number | null} [historyBytes]
 * @property {boolean} [existOk]
 *
 * @typedef {{maxSpeed?: number, maxGrowth?: number, confirmations?: number}} Quarantine
 * @typedef {{key: Key, [field: string]: any}} HeldPosition
 * @typedef {{uid: string, times: (bigint | null)[], [column: string]: any}} Series row by row, the oldest first
 *
 * @typedef {object} FenceSettings
 * @property {object} area `{hull}`, `{center, radius}`, `{exterior, holes}`, several of these, or a GeoJSON geometry
 * @property {string} [subjects]
 * @property {string} [subjectPrefix]
 * @property {string} [otherHull]
 * @property {"closed" | "open"} [boundary]
 * @property {number} [margin]
 * @property {boolean} [crosses]
 * @property {Span} [dwell]
 * @property {number} [confirmations]
 * @property {Span} [minDwell]
 * @property {boolean} [byAccuracy]
 * @property {number} [near]
 * @property {boolean} [withoutSelf]
 * @property {number} [layer]
 * @property {number} [maxEvents]
 * @property {Span} [maxEventAge]
 * @property {readonly AnyKey[]} [expected] keys that should be inside
 * @property {string} [expectedBy] by this time of day, such as "18:00 Europe/Berlin Mon-Fri",
 * @property {Span} [expectedWithin] or for the last time so long ago
 *
 * @typedef {FenceSettings & {name: string, created: bigint, uid: string, lastSequence: bigint, firstSequence: bigint,
 *   dwell?: number, minDwell?: number, maxEventAge?: number, expectedWithin?: number, inside: number, subjectCount: number, consumers: Consumer[]}} Fence
 * @typedef {{name: string, acknowledged: bigint, backlog: number, oldest: bigint | null, lost: number}} Consumer
 *
 * @typedef {object} FeedConsumer a durable reader of the feed of a hull, or of a prefix
 * @property {string} name
 * @property {string | null} hull
 * @property {string | null} prefix
 * @property {bigint | string} after the revision that it has acknowledged; of a prefix, the position, empty for none
 * @property {string} uid of the hull with that revision
 * @property {number} backlog
 * @property {number} lost how many of them are kept no more
 * @property {boolean} replaced whether the hull, or the data of the prefix, is another one since then
 *
 * @typedef {object} NewAlarm
 * @property {string} [hull] the hull that is watched,
 * @property {string} [prefix] or what the names of all hulls that are watched begin with
 * @property {string} when the condition, such as `area > 500 km2`, `silent 5m`, `near fleet/south 3 km`
 * @property {string} [clear] what clears it; default: its opposite
 * @property {Span} [for] how long it must hold before
 * @property {number} [maxEvents]
 * @property {Span} [maxEventAge]
 *
 * @typedef {object} AlarmStatus an alarm at one hull
 * @property {string} hull
 * @property {boolean} raised
 * @property {bigint} revision
 * @property {number | null} value
 * @property {bigint | null} since
 * @property {bigint | null} acknowledged when somebody has acknowledged it
 * @property {bigint | null} mutedUntil
 *
 * @typedef {object} Alarm
 * @property {string} name
 * @property {string | null} hull
 * @property {string | null} prefix
 * @property {string} when
 * @property {string} clear
 * @property {number | null} for seconds
 * @property {number} maxEvents
 * @property {number | null} maxEventAge
 * @property {bigint} created
 * @property {string} uid
 * @property {bigint} lastSequence
 * @property {bigint} firstSequence
 * @property {number} hulls
 * @property {number} raised for how many hulls
 * @property {Consumer[]} consumers
 * @property {AlarmStatus[]} statuses empty in lists
 *
 * @typedef {object} History what there is of the past of a hull
 * @property {bigint} firstRevision
 * @property {bigint | null} firstTime
 * @property {bigint} lastRevision
 * @property {bigint | null} lastTime
 * @property {number} bytes
 * @property {number} batches
 * @property {number} moves
 * @property {number | boolean | null} history seconds; true for ever, null for not at all
 * @property {number | null} historyBytes
 * @property {Erasure[]} erasures
 *
 * @typedef {{time: bigint, firstRevision: bigint, lastRevision: bigint, keys: number, moves: number}} Erasure
 *
 * @typedef {object} Track the way of a key: its place at the beginning, and each after it
 * @property {bigint[]} times microseconds since 1970
 * @property {(Point | null)[]} points null where the key left the hull
 * @property {bigint[]} revisions
 * @property {(bigint | null)[] | null} eventTimes
 * @property {number[] | null} accuracies how far each place may be from where the key was; null if all are exact
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
export class Client extends Streams {
  #connection

  /**
   * @param {string} url of the gateway
   * @param {import("./connection.js").ConnectionOptions & {transport?: Transport}} [options]
   */
  constructor(url, options = {}) {
    const { connection, joined } = options.transport ?? overHttp(url, options)
    super(connection, joined)
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

  /**
   * Wait until there is a hull of that name, at that revision or a later one.
   * @param {string} name
   * @param {{minRevision?: bigint | number} & Abortable} [options]
   * @returns {Promise<HullInfo>}
   */
  async waitForHull(name, { minRevision = 0, signal } = {}) {
    for await (const { type, revision } of this.watch(name, { signal })) {
      if (type !== "deleted" && revision >= minRevision) break
    }
    signal?.throwIfAborted()
    return (await this.getHull(name, { signal })).info
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
   * Let keys in quarantine in, at the positions that are held.
   * @param {string} name
   * @param {readonly AnyKey[]} keys
   * @param {{drop?: readonly AnyKey[]} & Numbering & Abortable} [options] `drop`: keys whose held positions are dropped
   * @returns {Promise<Applied>}
   */
  release(name, keys, options = {}) {
    return this.apply(name, { release: keys, ...options })
  }

  /**
   * Drop the positions of keys in quarantine.
   * @param {string} name
   * @param {readonly AnyKey[]} keys
   * @param {Numbering & Abortable} [options]
   * @returns {Promise<Applied>}
   */
  drop(name, keys, options = {}) {
    return this.apply(name, { drop: keys, ...options })
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

  // Hulls as a whole

  /**
   * Move the centre of a geographic hull; null for the mean direction of its points.
   * @param {string} name
   * @param {Point | null} [center]
   * @param {Abortable} [options]
   * @returns {Promise<HullInfo>}
   */
  async recenter(name, center = null, options = {}) {
    const call = { method: "POST", body: { center }, ...options }
    return fromWire(await this.#connection.ask(path`/hulls/${name}/recenter`, call))
  }

  /**
   * Divide the points of a hull over shards among another number of shards.
   * @param {string} name
   * @param {number} shards
   * @param {Abortable} [options]
   * @returns {Promise<HullInfo>}
   */
  async reshard(name, shards, options = {}) {
    const call = { method: "POST", body: { shards }, ...options }
    return fromWire(await this.#connection.ask(path`/hulls/${name}/reshard`, call))
  }

  /**
   * Replace the rules that hold bad positions out of a keyed hull.
   * @param {string} name
   * @param {Quarantine} rules
   * @param {Abortable} [options]
   * @returns {Promise<HullInfo>}
   */
  async setQuarantine(name, rules, options = {}) {
    const call = { method: "PUT", body: toWire(rules), repeatable: true, ...options }
    return fromWire(await this.#connection.ask(path`/hulls/${name}/quarantine`, call))
  }

  /**
   * The positions in quarantine by key. `apply` releases and drops them.
   * @param {string} name
   * @param {Abortable} [options]
   * @returns {AsyncGenerator<HeldPosition, void, undefined>}
   */
  async *listHeld(name, options = {}) {
    yield* this.#pages(path`/hulls/${name}/held`, "held", undefined, options)
  }

  /**
   * How counts and measures were over the last hour: a row about every ten seconds in which the hull changed.
   * @param {string} name
   * @param {{last?: Span} & Abortable} [options]
   * @returns {Promise<Series>}
   */
  async series(name, { last, signal } = {}) {
    return fromWire(await this.#connection.ask(path`/hulls/${name}/series`, { query: { last }, repeatable: true, signal }))
  }

  /**
   * The distance of two hulls, or the depth of their overlap.
   * @param {string} name
   * @param {string} other
   * @param {{minRevision?: bigint | number, otherMinRevision?: bigint | number} & Abortable} [options]
   * @returns {Promise<Record<string, any>>}
   */
  async separate(name, other, { minRevision, otherMinRevision, signal } = {}) {
    const query = { other, min_revision: minRevision, other_min_revision: otherMinRevision }
    const call = { query, repeatable: true, signal }
    return fromWire(await this.#connection.ask(path`/hulls/${name}/separation`, call))
  }

  /**
   * The hull as a binary phase diagram: its points are compositions from 0 to 1 and energies.
   * @param {string} name
   * @param {readonly Point[]} [entries]
   * @param {{minRevision?: bigint | number} & Abortable} [options]
   * @returns {Promise<{revision: bigint, stable: Point[], energiesAboveHull: (number | null)[], phases: [Point, Point][]}>}
   */
  async phaseDiagram(name, entries = [], { minRevision, signal } = {}) {
    const call = { method: "POST", body: { entries }, query: { min_revision: minRevision }, repeatable: true, signal }
    return fromWire(await this.#connection.ask(path`/hulls/${name}/phase-diagram`, call))
  }

  /**
   * The hull as an efficient frontier: its points are risks and returns.
   * @param {string} name
   * @param {{points?: readonly Point[], rates?: readonly number[], minRevision?: bigint | number} & Abortable} [options]
   * @returns {Promise<Record<string, any>>}
   */
  async frontier(name, { points = [], rates = [], minRevision, signal } = {}) {
    const call = { method: "POST", body: { points, rates }, query: { min_revision: minRevision }, repeatable: true, signal }
    return fromWire(await this.#connection.ask(path`/hulls/${name}/frontier`, call))
  }

  // The past

  /**
   * A hull as it was: an object with the reading methods, without the name.
   * @param {string} name
   * @param {Moment} when
   * @param {Abortable} [options]
   * @returns {Promise<Past>}
   */
  async at(name, when, options = {}) {
    const at = momentOf(when)
    const ask = (/** @type {string} */ what, /** @type {any} */ call) =>
      this.#connection.ask(path`/hulls/${name}` + what, { repeatable: true, ...call })
    const found = await ask("", { query: { at }, ...options })
    return pastOf(name, fromWire(found.info), ask)
  }

  /**
   * What there is of the past of a hull.
   * @param {string} name
   * @param {Abortable} [options]
   * @returns {Promise<History>}
   */
  async history(name, options = {}) {
    return historyOf(await this.#connection.ask(path`/hulls/${name}/history`, { repeatable: true, ...options }))
  }

  /**
   * Change how much of its past a hull keeps.
   * @param {string} name
   * @param {boolean | Span | null} history how long, true for ever, null for not at all
   * @param {{historyBytes?: number | null} & Abortable} [options]
   * @returns {Promise<HullInfo>}
   */
  async setHistory(name, history, { historyBytes = null, signal } = {}) {
    const call = { method: "PUT", body: { history, history_bytes: historyBytes }, repeatable: true, signal }
    return fromWire(await this.#connection.ask(path`/hulls/${name}/history`, call))
  }

  /**
   * Erase keys from the past of a hull. Keys that it has now are refused.
   * @param {string} name
   * @param {readonly AnyKey[]} keys
   * @param {Abortable} [options]
   * @returns {Promise<Erasure | null>} null if no segment had any of them
   */
  async eraseHistory(name, keys, options = {}) {
    const call = { method: "POST", body: { keys }, ...options }
    return erasureOf(await this.#connection.ask(path`/hulls/${name}/history/erase`, call))
  }

  /**
   * Where keys were between two moments.
   * @param {string} name
   * @param {readonly AnyKey[]} keys
   * @param {{start?: Moment, end?: Moment, every?: Span} & Abortable} [options] `every`: of each key the last place in
   *   each span of this length alone
   * @returns {Promise<Map<Key, Track>>}
   */
  async track(name, keys, { start, end, every, signal } = {}) {
    const query = { key: keys.map(String), from: momentOf(start), to: momentOf(end), every }
    const { tracks } = await this.#connection.ask(path`/hulls/${name}/tracks`, { query, repeatable: true, signal })
    return new Map(tracks.map(trackOf))
  }

  // Consumers of feeds

  /**
   * The consumers of feeds whose hulls or prefixes begin so, by what they read.
   * @param {string} [prefix]
   * @param {Abortable} [options]
   * @returns {AsyncGenerator<FeedConsumer, void, undefined>}
   */
  async *listFeedConsumers(prefix = "", options = {}) {
    yield* this.#pages("/feed/consumers", "consumers", prefix, options)
  }

  /**
   * Acknowledge the batches of a hull up to a revision: a feed of that consumer begins after it. A new one is created.
   * @param {string} name
   * @param {string} consumer
   * @param {bigint | number} revision
   * @param {{uid?: string} & Abortable} [options] `uid` of the hull, to notice that it was replaced
   * @returns {Promise<FeedConsumer>}
   */
  async ackFeed(name, consumer, revision, { uid = "", signal } = {}) {
    const call = { method: "PUT", body: { revision, uid }, repeatable: true, signal }
    return consumerOf(await this.#connection.ask(path`/hulls/${name}/feed/consumers/${consumer}`, call))
  }

  /**
   * Acknowledge the batches of the hulls of a prefix up to the position of an event. A new consumer is created.
   * @param {string} prefix
   * @param {string} consumer
   * @param {string} position empty for the beginning
   * @param {Abortable} [options]
   * @returns {Promise<FeedConsumer>}
   */
  async ackFeedMany(prefix, consumer, position, options = {}) {
    const call = { method: "PUT", query: { prefix }, body: { position }, repeatable: true, ...options }
    return consumerOf(await this.#connection.ask(path`/feed/consumers/${consumer}`, call))
  }

  /**
   * Forget a consumer of the feed of a hull, also of one that is not there any more.
   * @param {string} name
   * @param {string} consumer
   * @param {Abortable} [options]
   */
  async deleteFeedConsumer(name, consumer, options = {}) {
    await this.#connection.ask(path`/hulls/${name}/feed/consumers/${consumer}`, { method: "DELETE", ...options })
  }

  /**
   * Forget a consumer of the feed of a prefix.
   * @param {string} prefix
   * @param {string} consumer
   * @param {Abortable} [options]
   */
  async deleteFeedManyConsumer(prefix, consumer, options = {}) {
    await this.#connection.ask(path`/feed/consumers/${consumer}`, { method: "DELETE", query: { prefix }, ...options })
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

  // Alarms

  /**
   * Create an alarm: it is raised for a hull when a condition about its outline holds, and cleared when not.
   * @param {string} name
   * @param {NewAlarm & Abortable} rule
   * @returns {Promise<Alarm>}
   */
  async createAlarm(name, { signal, ...rule }) {
    const body = toWire({ name, ...rule })
    return alarmOf(await this.#connection.ask("/alarms", { method: "POST", body, signal }))
  }

  /**
   * Delete an alarm with its events.
   * @param {string} name
   * @param {Abortable} [options]
   */
  async deleteAlarm(name, options = {}) {
    await this.#connection.ask(path`/alarms/${name}`, { method: "DELETE", ...options })
  }

  /**
   * An alarm, and the hulls for which it is raised, waits, or is muted.
   * @param {string} name
   * @param {Abortable} [options]
   * @returns {Promise<Alarm>}
   */
  async getAlarm(name, options = {}) {
    return alarmOf(await this.#connection.ask(path`/alarms/${name}`, { repeatable: true, ...options }))
  }

  /**
   * The alarms by name.
   * @param {string} [prefix]
   * @param {Abortable} [options]
   * @returns {AsyncGenerator<Alarm, void, undefined>}
   */
  async *listAlarms(prefix = "", options = {}) {
    yield* this.#pages("/alarms", "alarms", prefix, options)
  }

  /**
   * Say that somebody takes care of an alarm that is raised for a hull, until it is cleared.
   * @param {string} name
   * @param {string} hull
   * @param {Abortable} [options]
   * @returns {Promise<AlarmStatus>}
   */
  async acknowledgeAlarm(name, hull, options = {}) {
    const call = { method: "POST", body: { hull }, repeatable: true, ...options }
    return statusOf(await this.#connection.ask(path`/alarms/${name}/acknowledge`, call))
  }

  /**
   * Mute an alarm for a hull; its events are made and sent as before.
   * @param {string} name
   * @param {string} hull
   * @param {Time | null} until null: no longer
   * @param {Abortable} [options]
   * @returns {Promise<AlarmStatus>}
   */
  async muteAlarm(name, hull, until, options = {}) {
    const body = { hull, until: until === null ? null : isoTime(until) }
    const call = { method: "POST", body, repeatable: true, ...options }
    return statusOf(await this.#connection.ask(path`/alarms/${name}/mute`, call))
  }

  /**
   * Acknowledge the events of an alarm up to a number: a watch of that consumer begins after it.
   * @param {string} name
   * @param {string} consumer
   * @param {bigint | number} sequence
   * @param {{uid?: string} & Abortable} [options]
   * @returns {Promise<Consumer>}
   */
  async ackAlarm(name, consumer, sequence, { uid = "", signal } = {}) {
    const call = { method: "PUT", body: { sequence, uid }, repeatable: true, signal }
    return fromWire(await this.#connection.ask(path`/alarms/${name}/consumers/${consumer}`, call))
  }

  /**
   * Forget a consumer of an alarm.
   * @param {string} name
   * @param {string} consumer
   * @param {Abortable} [options]
   */
  async deleteAlarmConsumer(name, consumer, options = {}) {
    await this.#connection.ask(path`/alarms/${name}/consumers/${consumer}`, { method: "DELETE", ...options })
  }

  /**
   * @param {string} at
   * @param {"hulls" | "fences" | "alarms" | "held" | "consumers"} rows
   * @param {string | undefined} prefix
   * @param {Abortable} options
   * @returns {AsyncGenerator<any, void, undefined>}
   */
  async *#pages(at, rows, prefix, options) {
    /** @type {string | null} */
    let after = null
    do {
      const page = await this.#connection.ask(at, { query: { prefix, after }, repeatable: true, ...options })
      yield* page[rows].map({ hulls: fromWire, fences: fenceOf, alarms: alarmOf, held: fromWire, consumers: consumerOf }[rows])
      after = page.next
    } while (after !== null)
  }
}

/** @param {string} url @param {import("./connection.js").ConnectionOptions} options @returns {Transport} */
function overHttp(url, options) {
  const connection = new Connection(url, options)
  return { connection, joined: new Joined(connection, options.silence ?? SILENCE) }
}

/** Of a hull, it has acknowledged a revision. @param {any} consumer @returns {FeedConsumer} */
function consumerOf(consumer) {
  const read = fromWire(consumer)
  return { ...read, after: read.prefix === null ? BigInt(read.after) : read.after }
}

/** A fence; the area is as it was given. @param {any} fence @returns {Fence} */
function fenceOf(fence) {
  return { ...fromWire(fence), area: fence.area }
}

/** @param {any} alarm @returns {Alarm} */
function alarmOf(alarm) {
  return { ...fromWire({ ...alarm, statuses: [] }), statuses: alarm.statuses.map(statusOf) }
}

/** @param {any} status @returns {AlarmStatus} */
function statusOf(status) {
  return { ...fromWire(status), acknowledged: micros(status.acknowledged) }
}

/** @param {any} history @returns {History} */
function historyOf(history) {
  return { ...fromWire({ ...history, erasures: [] }), erasures: history.erasures.map(erasureOf) }
}

/** The number of keys is no key. @param {any} erasure */
function erasureOf(erasure) {
  return erasure && { ...fromWire(erasure), keys: erasure.keys }
}

/** @param {any} track @returns {[Key, Track]} */
function trackOf(track) {
  const { key, ...way } = fromWire(track)
  const points = way.points.map((/** @type {Point} */ point) => (point[0] === null ? null : point))
  return [key, { ...way, points }]
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

/**
 * @template T, U
 * @param {Record<string, T>} values
 * @param {(value: T) => U} change
 * @returns {Record<string, U>}
 */
function mapValues(values, change) {
  return Object.fromEntries(Object.entries(values).map(([name, value]) => [name, change(value)]))
}
