// Bodies and queries of the gateway's calls as messages of the contract.

import { invalid } from "../errors.js"
import { duration, moment, packKeys, packNumbers, packPoints, packTimes, timestamp } from "./values.js"

/** One of some words. @param {string} field @param {any} given @param {Record<string, string>} words */
function choice(field, given, words) {
  if (given == null) return undefined
  if (!Object.hasOwn(words, given)) throw invalid(field, null, given, `must be ${Object.keys(words).join(" or ")}`)
  return words[given]
}

/** @param {any} center */
export function center(center) {
  return center && { longitude: center[0], latitude: center[1] }
}

/** @param {any} rules */
export function rules(rules) {
  return rules && { maxSpeed: rules.max_speed, maxGrowth: rules.max_growth, confirmations: rules.confirmations ?? 1 }
}

/** @param {any} kept @param {any} bytes */
export function history(kept, bytes) {
  if (kept == null || kept === false) return null
  return { maxAge: kept === true ? null : duration(kept, "history"), maxBytes: bytes ?? 0 }
}

/** @param {any} body */
export function hullConfig(body) {
  const windowed = ["max_age", "max_points", "max_skew", "clock", "ahead"].some((name) => body[name] != null)
  return {
    identity: choice("keyed", body.keyed, { str: "IDENTITY_STRING_KEYS", int: "IDENTITY_INTEGER_KEYS" }),
    maxPoints: body.point_limit ?? 0,
    window: windowed
      ? {
          maxAge: duration(body.max_age, "max_age"),
          maxPoints: body.max_points ?? 0,
          clock: choice("clock", body.clock, { server: "CLOCK_SERVER", data: "CLOCK_DATA" }),
          maxSkew: duration(body.max_skew, "max_skew"),
          ahead: choice("ahead", body.ahead, { refuse: "AHEAD_POLICY_REFUSE", clamp: "AHEAD_POLICY_CLAMP" }),
        }
      : null,
    ordering: choice("ordering", body.ordering, { arrival: "ORDERING_ARRIVAL", event_time: "ORDERING_EVENT_TIME" }),
    frame: body.geographic ? "FRAME_GEOGRAPHIC" : undefined,
    center: center(body.center),
    quarantine: rules(body.quarantine),
    shards: body.shards ?? 0,
    history: history(body.history, body.history_bytes),
  }
}

/** @param {any} only */
export function conditionOf(only) {
  return choice("only", only, { absent: "PUT_CONDITION_IF_ABSENT", present: "PUT_CONDITION_IF_PRESENT" })
}

/** @param {any} body */
export function batch(body) {
  const { insert, keys, missing } = body
  const times = packTimes("times", body.times)
  return {
    inserts: packPoints("insert", insert),
    deletes: packPoints("delete", body.delete),
    moves: body.move && {
      origins: packPoints("move/origins", body.move.origins),
      destinations: packPoints("move/destinations", body.move.destinations),
    },
    missingPoints: missing === "count" ? "MISSING_POINT_POLICY_COUNT" : undefined,
    puts: keys && {
      keys: packKeys("keys", keys),
      points: packPoints("points", body.points ?? []),
      times,
      condition: conditionOf(body.only),
      ttl: duration(body.ttl, "ttl"),
      expireTimes: packTimes("expire_times", body.expire_times),
      accuracies: packNumbers("accuracies", body.accuracies),
    },
    removes: packKeys("remove", body.remove),
    missingKeys: missing === "raise" ? "MISSING_KEY_POLICY_REFUSE" : undefined,
    insertTimes: keys ? null : times,
    releases: packKeys("release", body.release),
    drops: packKeys("drop", body.drop),
  }
}

/** The rings of a geometry of GeoJSON end where they begin. @param {any} ring */
const open = (ring) => {
  const last = ring.at(-1)
  return ring.length > 1 && last[0] === ring[0][0] && last[1] === ring[0][1] ? ring.slice(0, -1) : ring
}

/** @param {any} area @returns {object} */
function areaOf(area) {
  if (area?.hull !== undefined) return { hullArea: { name: area.hull } }
  if (area?.radius !== undefined) {
    const [x, y] = area.center
    return { circleArea: { centerX: x, centerY: y, radius: area.radius } }
  }
  return { polygonArea: { polygons: polygons(area).map(({ exterior, holes = [] }) => {
    const pack = (/** @type {any} */ ring) => packPoints("area", open(ring))
    return { exterior: pack(exterior), holes: holes.map(pack) }
  }) } }
}

/** @param {any} area @returns {{exterior: any, holes?: any[]}[]} */
function polygons(area) {
  if (Array.isArray(area)) return area.flatMap(polygons)
  if (area?.type === "MultiPolygon") return area.coordinates.map((/** @type {any[]} */ [exterior, ...holes]) => ({ exterior, holes }))
  if (area?.type === "Polygon") return [{ exterior: area.coordinates[0], holes: area.coordinates.slice(1) }]
  if (!Array.isArray(area?.exterior)) throw invalid("area", null, area, "must be a hull, a circle, polygons or a geometry of GeoJSON")
  return [area]
}

/** Refuse a second one of what excludes each other: the message has room for one, and would drop the others.
 * @param {any} body @param {string[]} names */
function atMostOne(body, ...names) {
  const given = names.filter((name) => body[name] != null)
  if (given.length > 1) throw invalid(given[1], null, body[given[1]], `give one of ${names.join(", ")}`)
}

/** @param {any} body */
export function fenceConfig(body) {
  atMostOne(body, "subjects", "subject_prefix", "other_hull")
  atMostOne(body, "expected_by", "expected_within")
  const config = /** @type {any} */ ({
    ...areaOf(body.area),
    ...(body.subjects != null && { subjectHull: body.subjects }),
    ...(body.subject_prefix != null && { subjectPrefix: body.subject_prefix }),
    ...(body.other_hull != null && { otherHull: body.other_hull }),
    boundary: choice("boundary", body.boundary, { closed: "FENCE_BOUNDARY_CLOSED", open: "FENCE_BOUNDARY_OPEN" }),
    margin: body.margin ?? 0,
    nearDistance: body.near ?? 0,
    initial: choice("initial", body.initial, {
      snapshot: "FENCE_INITIAL_SNAPSHOT",
      events: "FENCE_INITIAL_EVENTS",
      none: "FENCE_INITIAL_NONE",
    }),
    reportCrosses: body.crosses ?? false,
    dwell: duration(body.dwell, "dwell"),
    confirmations: body.confirmations === 1 ? 0 : (body.confirmations ?? 0),
    minDwell: duration(body.min_dwell, "min_dwell"),
    maxEvents: body.max_events ?? 0,
    maxEventAge: duration(body.max_event_age, "max_event_age"),
    byAccuracy: body.by_accuracy ?? false,
    expected: packKeys("expected", body.expected),
    ...(body.expected_by != null && { expectedBy: body.expected_by }),
    ...(body.expected_within != null && { expectedWithin: duration(body.expected_within, "expected_within") }),
  })
  if (config.hullArea) {
    config.hullArea.withoutSelf = body.without_self ?? false
    config.hullArea.layer = body.layer > 1 ? body.layer : 0
  }
  return config
}

/** @param {any} body */
export function alarmRule(body) {
  return {
    ...(body.hull != null && { hull: body.hull }),
    ...(body.prefix != null && { prefix: body.prefix }),
    when: body.when,
    clear: body.clear ?? "",
    hold: duration(body.for, "for"),
    maxEvents: body.max_events ?? 0,
    maxEventAge: duration(body.max_event_age, "max_event_age"),
  }
}

/** What all questions about a hull have. @param {string} name @param {any} query */
export function reading(name, query) {
  const { min_revision = 0, layer = 1, keys = false, at, at_uid = "" } = query
  return {
    name,
    minRevision: String(min_revision),
    layer: layer > 1 ? layer : 0,
    includeKeys: keys,
    ...moment("at", at),
    atUid: at_uid,
  }
}

/** Points, or keys that have positions. @param {any} body */
export function aboutPoints(body) {
  if (body.keys == null) return { points: packPoints("points", body.points) }
  const { keys, keys_of, keys_min_revision = 0 } = body
  return { keys: packKeys("keys", keys), keysOf: keys_of ?? "", keysMinRevision: String(keys_min_revision) }
}

/** @param {string | undefined} key the Idempotency-Key @param {any} query */
export function numbering(key, query) {
  if (key === undefined) return {}
  const [producer, sequence] = key.split(":")
  return { producer, sequence, maySkip: query?.may_skip ?? false }
}

export { duration, packKeys, packPoints, timestamp }
