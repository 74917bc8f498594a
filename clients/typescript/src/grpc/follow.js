// Streams of the contract as the gateway's events. A call that breaks is made again, and goes on where it was.

import { growing, pause } from "../connection.js"
import { DynhullError } from "../errors.js"
import * as answers from "./answers.js"
import { duration } from "./requests.js"
import { finites, keysOf, lonLatOf, moment, pointsOf, timeOf, timesOf, word } from "./values.js"

/**
 * @typedef {import("../joined.js").Message} Message
 * @typedef {import("../joined.js").Following} Following
 * @typedef {import("./channel.js").Channel} Channel
 *
 * @typedef {object} Stream a stream, and how far it has come
 * @property {string} method
 * @property {() => object} request from where it is
 * @property {(answer: any) => Message[]} take
 * @property {() => Message[]} [end] what the end of the call says; without, the call is made again
 * @property {(error: DynhullError) => Message[] | null} [mended] what an error says after which the stream goes on
 */

const HULL = /^\/hulls\/([^/]+)\/(events|replay|feed)$/
const NUMBERED = /^\/(fences|alarms)\/([^/]+)\/events$/

/** Follows streams over a channel. */
export class Followed {
  #channel

  /** @param {Channel} channel */
  constructor(channel) {
    this.#channel = channel
  }

  /**
   * The events of a stream, from one call to the next.
   * @param {string} path
   * @param {any} query
   * @param {Following} following
   * @param {string} [place] where to go on
   * @returns {AsyncGenerator<Message, void, undefined>}
   */
  async *follow(path, query, { signal, reconnect = true, onLost = () => {} }, place = "") {
    const stream = streamOf(path, query ?? {}, place)
    let pauses = growing()
    let lost = false
    const tell = (/** @type {boolean} */ now) => now !== lost && onLost((lost = now))
    while (!signal?.aborted) {
      try {
        for await (const answer of this.#channel.stream(stream.method, stream.request(), { signal })) {
          pauses = growing()
          tell(false)
          yield* stream.take(answer)
        }
        if (stream.end) return yield* stream.end()
      } catch (error) {
        if (signal?.aborted) return
        if (!(error instanceof DynhullError)) throw error
        const said = stream.mended?.(error)
        if (said) {
          yield* said
        } else {
          if (!reconnect || !(error.passing || error.unknown)) throw error
          tell(true)
        }
      }
      // Who waits for a hull that is to come wants it soon.
      await pause(Math.min(pauses.next().value, lost ? Infinity : 1), signal).catch(() => {})
    }
  }

  /**
   * The events that a fence would have made.
   * @param {object} request
   * @param {AbortSignal | null | undefined} signal
   */
  async *between(request, signal) {
    for await (const { events } of this.#channel.stream("FenceEventsBetween", request, { signal })) {
      for (const event of events) yield fenceMessage("", "", event)
    }
    yield { type: "complete", data: {} }
  }
}

/** @param {string} path @param {any} query @param {string} place @returns {Stream} */
function streamOf(path, query, place) {
  if (path === "/events") return many(query)
  if (path === "/feed") return feedOfMany(query, place)
  const [, name = "", kind] = HULL.exec(path) ?? []
  const known = decodeURIComponent(name)
  if (kind === "events") return hull(known, query)
  if (kind === "replay") return replay(known, query)
  if (kind === "feed") return feed(known, query)
  const [, numbered, subject = ""] = NUMBERED.exec(path) ?? []
  if (numbered === "fences") return events("fence", decodeURIComponent(subject), query)
  if (numbered === "alarms") return events("alarm", decodeURIComponent(subject), query)
  throw new RangeError(`no stream of the contract is ${path}`)
}

/** @param {string} type @param {any} data @param {string} [id] @returns {Message} */
const message = (type, data, id = "") => ({ type, data, id })

/** What of a hull is followed. @param {string} name @param {any} query */
function view(name, { keys = false, measures = false, layer = 1, max_vertices = 0, rate = 0 }) {
  return {
    name,
    includeKeys: keys,
    includeMeasures: measures,
    layer: layer > 1 ? layer : 0,
    maxVertices: max_vertices,
    maxEventsPerSecond: rate,
  }
}

/** The state of a hull that is followed, to go on from it. */
class State {
  uid = ""
  revision = -1n

  /** @param {any} query */
  constructor({ layer = 1, max_vertices, keys = false }) {
    this.resumable = layer <= 1 && !max_vertices
    this.keys = keys
  }

  /** @param {string} name @param {any} query */
  request(name, query) {
    const resume = this.uid && this.resumable ? { uid: this.uid, revision: String(this.revision) } : null
    return { ...view(name, query), resume }
  }

  /** The event in a response, after the end of another hull; none that says what is known. @param {any} response @returns {Message[]} */
  take(response) {
    const uid = (response.snapshot ?? response.sketch)?.uid ?? this.uid
    const before = this.uid && uid !== this.uid ? this.forget() : []
    const event = hullMessage(response, this.keys)
    const news = event.type !== "progress" || event.data.revision > this.revision
    this.uid = uid
    this.revision = event.data.revision
    return news ? [...before, event] : before
  }

  /** Expect another hull. @returns {Message[]} */
  forget() {
    const seen = this.uid !== ""
    this.uid = ""
    return seen ? [message("deleted", { revision: this.revision })] : []
  }
}

/** @param {string} name @param {any} query @returns {Stream} */
function hull(name, query) {
  const state = new State(query)
  return {
    method: "Watch",
    request: () => state.request(name, query),
    take: (response) => state.take(response),
    mended({ reason }) {
      if (reason === "HULL_NOT_FOUND" && !query.wait && state.revision < 0n) return null
      if (reason === "HULL_NOT_FOUND" || reason === "HULL_REPLACED") return state.forget()
      if (reason !== "REVISION_FORGOTTEN" || !state.resumable) return null
      state.resumable = false // each call begins with a snapshot
      return []
    },
  }
}

/** @param {string} name @param {any} query @returns {Stream} */
function replay(name, query) {
  const state = new State(query)
  const { from, to, speed = 0, every } = query
  return {
    method: "Replay",
    request: () => ({
      ...state.request(name, query),
      ...(state.uid ? { startRevision: String(state.revision) } : moment("start", from, "from")),
      ...moment("end", to, "to"),
      speed,
      every: duration(every, "every"),
    }),
    take: ({ event }) => state.take(event),
    end: () => [message("end", {})],
  }
}

/** @param {any} response @param {boolean} keys @returns {Message} */
function hullMessage(response, keys) {
  const { snapshot, change, sketch } = response
  const data = {
    revision: BigInt(response.revision),
    points: Number(response.pointCount),
    cause: word(response.cause, "CAUSE_").replace("unspecified", "batch"),
    clock: timeOf(response.clockTime),
    center: lonLatOf(response.center),
    changed: timeOf(response.changedTime),
    measures: answers.measuresOf(response.measures),
    erased: response.erased,
  }
  if (change) {
    return message("change", {
      ...data,
      removed: pointsOf(change.removed),
      removedRows: change.removedIndices,
      rotation: change.rotation,
      added: pointsOf(change.added),
      addedRows: change.addedIndices,
      addedKeys: keys ? keysOf(change.addedKeys) : null,
      renamedRows: keys ? change.renamedIndices : null,
      renamedKeys: keys ? keysOf(change.renamedKeys) : null,
    })
  }
  const whole = snapshot ?? sketch
  if (!whole) return message("progress", data)
  const vertexKeys = keys ? keysOf(snapshot ? snapshot.vertexKeys : sketch.keys) : null
  return message("snapshot", { ...data, vertices: pointsOf(whole.vertices), vertexKeys, error: sketch?.error ?? null })
}

/** @param {any} query @returns {Stream} */
function many({ prefix = "", name = [], outlines = false, max_vertices = 0, rate = 0 }) {
  let position = Buffer.alloc(0)
  return {
    method: "WatchMany",
    request: () => ({
      prefix,
      names: name,
      contents: outlines ? "HULL_CONTENTS_OUTLINE" : "HULL_CONTENTS_SUMMARY",
      maxVertices: max_vertices,
      maxEventsPerSecond: rate,
      position,
    }),
    take(response) {
      if (response.position.length) position = response.position
      const { hulls, picture } = response
      const of = (/** @type {string} */ presence) => hulls.filter((/** @type {any} */ each) => each.presence === `HULL_PRESENCE_${presence}`)
      const names = (/** @type {any[]} */ found) => found.map((each) => each.name)
      const begin = { PICTURE_BEGINS: "begin", PICTURE_BEGINS_ANEW: "restored" }[/** @type {string} */ (picture)]
      const told = { hulls: of("UNSPECIFIED").map((/** @type {any} */ each) => hullNowOf(each, outlines)), gone: names(of("GONE")), unchanged: names(of("UNCHANGED")) }
      return [
        ...(begin ? [message(begin, {})] : []),
        ...(hulls.length ? [message("hulls", told)] : []),
        ...(picture === "PICTURE_COMPLETE" ? [message("complete", {})] : []),
      ]
    },
  }
}

/** @param {any} now @param {boolean} outlines */
function hullNowOf(now, outlines) {
  return {
    hull: now.name,
    uid: now.uid,
    revision: BigInt(now.revision),
    points: Number(now.pointCount),
    distinct: Number(now.distinctCount),
    held: Number(now.heldCount),
    vertexCount: now.vertexCount,
    geographic: now.frame === "FRAME_GEOGRAPHIC",
    center: lonLatOf(now.center),
    measures: answers.measuresOf(now.measures),
    changed: timeOf(now.changedTime),
    clock: timeOf(now.clockTime),
    vertices: outlines ? pointsOf(now.vertices) : null,
    error: outlines ? now.error : null,
  }
}

/**
 * The numbered events of a fence or an alarm.
 * @param {"fence" | "alarm"} kind
 * @param {string} name
 * @param {any} query
 * @returns {Stream}
 */
function events(kind, name, { consumer, after, conflate = false }) {
  let [uid, sequence, closed] = ["", after === undefined ? null : String(after), false]
  const replaced = `${kind.toUpperCase()}_REPLACED`
  const made = kind === "fence" ? fenceMessage : alarmMessage
  return {
    method: kind === "fence" ? "WatchFence" : "WatchAlarm",
    request: () => ({
      name,
      uid,
      conflate,
      ...(sequence !== null ? { afterSequence: sequence } : consumer ? { consumer } : { onlyNew: true }),
    }),
    take(response) {
      uid = response.uid
      sequence = response.sequence
      const { lost, conflated = 0 } = response
      const gap = { [kind]: name, uid, sequence: BigInt(response.sequence), first: BigInt(lost?.firstSequence ?? 0), last: BigInt(lost?.lastSequence ?? 0) }
      const messages = response.events.map((/** @type {any} */ event) => made(name, uid, event))
      if (messages.length && kind === "fence") messages[0].data.conflated = Number(conflated)
      closed = messages.some((/** @type {Message} */ each) => each.type === "closed")
      return [...(lost ? [message("lost", gap)] : []), ...messages]
    },
    mended(error) {
      if (error.reason !== replaced || !uid) return null
      ;[uid, sequence] = ["", "0"]
      return [message("replaced", { [kind]: name })]
    },
    get end() {
      return closed ? () => [] : undefined
    },
  }
}

/** @param {string} type @param {string} [prefix] */
const typeOf = (type, prefix = "FENCE_EVENT_TYPE_") => word(type, prefix)

/** The key of an event. @param {any} event */
function keyOf({ stringKey, integerKey }) {
  return stringKey ?? (integerKey === undefined ? null : BigInt(integerKey))
}

/** @param {string} fence @param {string} uid @param {any} event @returns {Message} */
function fenceMessage(fence, uid, event) {
  const at = (/** @type {any} */ position) => (position ? finites([position.x, position.y]) : null)
  return message(typeOf(event.type), {
    fence,
    uid,
    sequence: BigInt(event.sequence),
    cause: event.causes.map((/** @type {string} */ cause) => word(cause, "FENCE_CAUSE_")),
    hull: event.subjectHull,
    key: keyOf(event),
    revision: BigInt(event.subjectRevision),
    areaRevision: BigInt(event.areaRevision),
    position: at(event.position),
    previousPosition: at(event.previousPosition),
    distance: event.distance === undefined ? null : finites([event.distance])[0],
    eventTime: timeOf(event.eventTime),
    time: timeOf(event.time),
    firstTime: timeOf(event.firstTime),
    inside: event.inside.map(answers.subjectsOf),
    previousHull: event.previousHull,
    previousHullRevision: BigInt(event.previousHullRevision),
  })
}

/** @param {string} alarm @param {string} uid @param {any} event @returns {Message} */
function alarmMessage(alarm, uid, event) {
  const about = event.hull !== ""
  const value = (/** @type {number | undefined} */ each) => (each === undefined ? null : finites([each])[0])
  return message(typeOf(event.type, "ALARM_EVENT_TYPE_"), {
    alarm,
    uid,
    sequence: BigInt(event.sequence),
    hull: event.hull,
    revision: BigInt(event.revision),
    value: value(event.value),
    bound: about ? finites([event.bound])[0] : null,
    cause: event.causes.map((/** @type {string} */ cause) => word(cause, "ALARM_CAUSE_")),
    causeRevision: BigInt(event.causeRevision) || null,
    causeHull: event.causeHull,
    causeTime: timeOf(event.causeTime),
    previous: value(event.previousValue),
    time: timeOf(event.time),
    keys: keysOf(event.keys),
    raised: event.raised,
  })
}

/** @param {string} name @param {any} query @returns {Stream} */
function feed(name, { consumer, after }) {
  let [uid, revision] = ["", after === undefined ? null : String(after)]
  return {
    method: "Feed",
    request: () => ({
      name,
      uid,
      ...(revision !== null ? { afterRevision: revision } : consumer ? { consumer } : { onlyNew: true }),
    }),
    take(response) {
      uid = response.uid || uid
      const messages = [...response.lost.map(lostOf), ...response.batches.map(batchOf)]
      revision = response.revision
      return messages.map((each) => ({ ...each, id: `${uid}:${each.data.revision ?? each.data.last}` }))
    },
    mended(error) {
      if (error.reason !== "HULL_REPLACED" || !uid) return null
      ;[uid, revision] = ["", "0"]
      return [message("replaced", { hull: name }, `${uid}:0`)]
    },
  }
}

/** @param {any} query @param {string} place @returns {Stream} */
function feedOfMany({ prefix, consumer, begin = false }, place) {
  let position = place ? Buffer.from(place, "hex") : null
  let goesOn = false
  /** The hulls that there are, while the feed begins. @type {Record<string, string> | null} */
  let there = {}
  /** What has come since the last position, and comes again. @type {Set<string>} */
  const unplaced = new Set()
  return {
    method: "Feed",
    request() {
      there = {}
      goesOn = position !== null || consumer !== undefined
      return { prefix, ...(position ? { position } : consumer ? { consumer } : begin ? { afterRevision: "0" } : { onlyNew: true }) }
    },
    take(response) {
      const { hulls, lost, gone, batches } = response
      /** @type {Message[]} */
      const messages = []
      if (there) {
        for (const each of hulls) there[each.name] = each.uid
        if (response.position.length) {
          if (goesOn) messages.push(message("hulls", { hulls: there }))
          there = null
        }
      }
      messages.push(...gone.map((/** @type {any} */ each) => message("deleted", { hull: each.name, uid: each.uid })), ...lost.map(lostOf))
      for (const each of batches) {
        const known = `${each.uid} ${each.revision}`
        if (!unplaced.has(known)) messages.push(batchOf(each))
        unplaced.add(known)
      }
      if (response.position.length) {
        position = response.position
        unplaced.clear()
        const last = messages.at(-1)
        if (last) last.id = response.position.toString("hex")
      }
      return messages
    },
  }
}

/** @param {any} lost @returns {Message} */
function lostOf({ firstRevision, lastRevision, hull, uid }) {
  return message("lost", { hull, uid, revision: BigInt(lastRevision), first: BigInt(firstRevision), last: BigInt(lastRevision) })
}

/** A batch, without what is empty. @param {any} fed @returns {Message} */
function batchOf(fed) {
  const batch = fed.batch ?? {}
  const { puts } = batch
  const only = { PUT_CONDITION_IF_ABSENT: "absent", PUT_CONDITION_IF_PRESENT: "present" }[/** @type {string} */ (puts?.condition)]
  const times = batch.insertTimes ?? puts?.times
  const data = {
    keys: keysOf(puts?.keys),
    points: pointsOf(puts?.points),
    removed: keysOf(batch.removes),
    inserts: pointsOf(batch.inserts),
    deletes: pointsOf(batch.deletes),
    times: timesOf(times),
    expireTimes: timesOf(puts?.expireTimes),
    accuracies: answers.numbersOf(puts?.accuracies) ?? [],
    only,
    lenient: batch.missingPoints === "MISSING_POINT_POLICY_COUNT" || undefined,
    expired: Number(fed.expiredCount) || undefined,
    expiredUntil: timeOf(fed.expiredUntil) ?? undefined,
    clock: timeOf(fed.clockTime) ?? undefined,
    center: lonLatOf(fed.center) ?? undefined,
    held: fed.held ? heldOf(fed.held) : undefined,
    more: fed.more || undefined,
  }
  const there = Object.entries(data).filter(([, value]) => value !== undefined && !(Array.isArray(value) && !value.length))
  const named = { hull: fed.hull, revision: BigInt(fed.revision), uid: fed.uid, commit: BigInt(fed.commit), time: timeOf(fed.commitTime) }
  return message("batch", { ...named, cause: word(fed.cause, "CAUSE_"), ...Object.fromEntries(there) })
}

/** @param {any} held */
function heldOf(held) {
  const { dropped, keys, positions, times, rules } = held
  return { dropped: keysOf(dropped), keys: keysOf(keys), points: pointsOf(positions), times: times && timesOf(times), rules: answers.rulesOf(rules) }
}
