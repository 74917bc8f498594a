// Messages of the contract as the gateway's answers are after `fromWire`: one client reads both.

import {
  finite,
  finites,
  keysOf,
  keysOrNull,
  lonLatOf,
  pointsOf,
  secondsOf,
  timeOf,
  timesOf,
  word,
} from "./values.js"

const IDENTITIES = new Map([
  ["IDENTITY_STRING_KEYS", "str"],
  ["IDENTITY_INTEGER_KEYS", "int"],
])

/** 0, where it says that there is no such limit. @param {any} value */
const orNull = (value) => Number(value) || null

/** @param {any} window */
function windowOf(window) {
  if (!window) return null
  return {
    maxAge: secondsOf(window.maxAge),
    maxPoints: orNull(window.maxPoints),
    clock: window.clock === "CLOCK_DATA" ? "data" : "server",
    maxSkew: secondsOf(window.maxSkew),
    ahead: window.ahead === "AHEAD_POLICY_CLAMP" ? "clamp" : "refuse",
  }
}

/** @param {any} rules */
export function rulesOf(rules) {
  return rules && { maxSpeed: rules.maxSpeed ?? null, maxGrowth: rules.maxGrowth ?? null, confirmations: rules.confirmations ?? 1 }
}

/** The settings of a hull. @param {any} config */
export function settingsOf(config) {
  return {
    keyed: IDENTITIES.get(config.identity) ?? null,
    window: windowOf(config.window),
    ordering: config.ordering === "ORDERING_EVENT_TIME" ? "event_time" : "arrival",
    geographic: config.frame === "FRAME_GEOGRAPHIC",
    shards: orNull(config.shards),
  }
}

/** @param {any} hull */
export function hullOf(hull) {
  return {
    name: hull.name,
    revision: BigInt(hull.revision),
    points: Number(hull.pointCount),
    distinct: Number(hull.distinctPointCount),
    created: timeOf(hull.createTime),
    uid: hull.uid,
    ...settingsOf(hull.config),
    pointLimit: orNull(hull.config.maxPoints),
    clock: timeOf(hull.clockTime),
    center: lonLatOf(hull.center),
    quarantine: rulesOf(hull.quarantine ?? hull.config.quarantine),
    held: Number(hull.heldCount),
    changed: timeOf(hull.changedTime),
    restored: hull.uid.includes("."),
    erased: hull.erased,
  }
}

/** @param {any} measures */
export function measuresOf(measures) {
  if (!measures) return null
  const { area, perimeter, centroidX, centroidY, minX, minY, maxX, maxY } = measures
  return {
    area: finite(area),
    perimeter: finite(perimeter),
    centroid: finites([centroidX, centroidY]),
    bounds: finites([minX, minY, maxX, maxY]),
    diameter: finite(measures.diameter ?? NaN),
    width: finite(measures.width ?? NaN),
  }
}

const NOTHING = { area: 0, perimeter: 0, centroid: [null, null], bounds: [null, null, null, null], diameter: null, width: null }

/** @param {any} answer */
export function wholeHullOf({ hull, vertices, measures, vertexKeys }) {
  const info = hullOf(hull)
  const keys = keysOrNull(vertexKeys, info.keyed !== null)
  return { info, vertices: pointsOf(vertices), vertexKeys: info.keyed && (keys ?? []), measures: measuresOf(measures) ?? NOTHING }
}

/** @param {any} answer */
export function allMeasuresOf(answer) {
  const { revision, measures, minBox, minPerimeterBox, minCircleX, minCircleY, minCircleRadius, labelX = NaN, labelY = NaN } = answer
  return {
    revision: BigInt(revision),
    .../** @type {object} */ (measuresOf({ ...measures, diameter: answer.diameter, width: answer.width })),
    minBox: pointsOf(minBox),
    minPerimeterBox: pointsOf(minPerimeterBox),
    minCircle: { center: finites([minCircleX, minCircleY]), radius: finite(minCircleRadius) },
    labelPoint: finites([labelX, labelY]),
    geographic: answer.geographic,
  }
}

const COUNTS = ["inserted", "deleted", "missing", "moved", "stale", "late", "skipped", "clamped", "evicted", "held", "released", "dropped"]

/** @param {any} result */
export function appliedOf(result) {
  return {
    revision: BigInt(result.revision),
    ...Object.fromEntries(COUNTS.map((name) => [name, Number(result[name])])),
    hullChanged: result.hullChanged,
    points: Number(result.pointCount),
    duplicate: result.duplicate,
    clock: timeOf(result.clockTime),
    heldRows: result.heldRows,
    gathered: 1,
  }
}

/** Rows beside each other. @param {any} left @param {any} right */
export function pairsOf(left, right) {
  const others = pointsOf(right)
  return pointsOf(left).map((point, row) => [point, others[row]])
}

/** @param {any} answer */
export function verificationOf(answer) {
  const { revision, equal, pointCount, vertexCount, firstDifference: first, keysEqual, fenceCount, fenceDifferences } = answer
  const rounds = answer.rounds.map((/** @type {any} */ round) => ({
    ...round,
    guess: Number(round.guess),
    groups: Number(round.groups),
    steps: Number(round.steps),
  }))
  const only = (/** @type {any} */ points) => pointsOf(points)[0] ?? null
  return {
    revision: BigInt(revision),
    equal,
    points: Number(pointCount),
    vertices: Number(vertexCount),
    rounds,
    difference: first && { row: first.index, live: only(first.live), recomputed: only(first.recomputed) },
    keysEqual,
    fences: Number(fenceCount),
    fenceDifferences,
    whole: equal && keysEqual && !fenceDifferences.length,
  }
}

/** @param {any} answer */
export function separationOf(answer) {
  const { revision, otherRevision, intersect, distance, depth, normalX, normalY, offset, closest } = answer
  return {
    revision: BigInt(revision),
    otherRevision: BigInt(otherRevision),
    intersect,
    distance: finite(distance),
    depth: finite(depth),
    normal: finites([normalX, normalY]),
    offset: finite(offset),
    closest: pointsOf(closest),
  }
}

/** @param {any} answer */
export function seriesOf(answer) {
  const times = timesOf(answer.times)
  const revisions = answer.revisions.map(BigInt)
  const rates = times.map((time, row) => {
    if (!row) return null
    const seconds = Number(/** @type {bigint} */ (time) - /** @type {bigint} */ (times[row - 1])) / 1e6
    return finite(Number(revisions[row] - revisions[row - 1]) / seconds)
  })
  return {
    uid: answer.uid,
    geographic: answer.frame === "FRAME_GEOGRAPHIC",
    since: timeOf(answer.sinceTime),
    interval: secondsOf(answer.interval) ?? 0,
    times,
    changedTimes: timesOf(answer.changedTimes),
    revisions,
    points: answer.pointCounts.map(Number),
    vertices: answer.vertexCounts,
    areas: finites(answer.areas),
    perimeters: finites(answer.perimeters),
    diameters: finites(answer.diameters),
    widths: finites(answer.widths),
    rates,
  }
}

/** @param {any} answer */
export function historyOf(answer) {
  const { history } = answer
  return {
    firstRevision: BigInt(answer.firstRevision),
    firstTime: timeOf(answer.firstTime),
    lastRevision: BigInt(answer.lastRevision),
    lastTime: timeOf(answer.lastTime),
    bytes: Number(answer.bytes),
    batches: Number(answer.batches),
    moves: Number(answer.moves),
    history: history && (secondsOf(history.maxAge) ?? true),
    historyBytes: history && orNull(history.maxBytes),
    erasures: answer.erasures.map(erasureOf),
  }
}

/** @param {any} erasure */
export function erasureOf(erasure) {
  if (!erasure) return null
  const [firstRevision, lastRevision] = [BigInt(erasure.firstRevision), BigInt(erasure.lastRevision)]
  return { time: timeOf(erasure.time), firstRevision, lastRevision, keys: Number(erasure.keys), moves: Number(erasure.moves) }
}

/** @param {any} answer */
export function heldOf(answer) {
  const [points, times, accuracies] = [pointsOf(answer.positions), timesOf(answer.times), numbersOf(answer.accuracies)]
  return keysOf(answer.keys).map((key, row) => {
    const [speed, growth] = [answer.speeds[row], answer.growths[row]]
    const breaks = [...(Number.isNaN(speed) ? [] : ["max_speed"]), ...(Number.isNaN(growth) ? [] : ["max_growth"])]
    return {
      key,
      position: points[row],
      time: times[row] ?? null,
      speed: finite(speed),
      growth: finite(growth),
      revision: BigInt(answer.revisions[row]),
      confirmations: answer.confirmations[row],
      accuracy: accuracies?.[row] ?? 0,
      breaks,
    }
  })
}

/** @param {any} accuracies @returns {number[] | null} */
export function numbersOf(accuracies) {
  if (!accuracies) return null
  if (!accuracies.packed?.length) return accuracies.values
  const { buffer, byteOffset, byteLength } = accuracies.packed
  const view = new DataView(buffer, byteOffset, byteLength)
  return Array.from({ length: byteLength / 8 }, (_, row) => view.getFloat64(8 * row, true))
}

/** @param {any} config */
function areaOf({ hullArea, circleArea, polygonArea }) {
  if (hullArea) return { hull: hullArea.name }
  if (circleArea) return { center: [circleArea.centerX, circleArea.centerY], radius: circleArea.radius }
  const polygons = polygonArea.polygons.map((/** @type {any} */ { exterior, holes }) => ({
    exterior: pointsOf(exterior),
    holes: holes.map(pointsOf),
  }))
  return polygons.length === 1 ? polygons[0] : polygons
}

/** The settings of a fence. @param {any} config */
export function fenceSettingsOf(config) {
  return {
    area: areaOf(config),
    subjects: config.subjectHull ?? null,
    subjectPrefix: config.subjectPrefix ?? null,
    otherHull: config.otherHull ?? null,
    boundary: config.boundary === "FENCE_BOUNDARY_OPEN" ? "open" : "closed",
    margin: config.margin,
    initial: word(config.initial, "FENCE_INITIAL_").replace("unspecified", "snapshot"),
    crosses: config.reportCrosses,
    dwell: secondsOf(config.dwell),
    confirmations: config.confirmations,
    minDwell: secondsOf(config.minDwell),
    byAccuracy: config.byAccuracy,
    expected: config.expected && keysOf(config.expected),
    expectedBy: config.expectedBy ?? null,
    expectedWithin: secondsOf(config.expectedWithin),
    near: config.nearDistance,
    withoutSelf: config.hullArea?.withoutSelf ?? false,
    layer: config.hullArea?.layer || 1,
    maxEvents: Number(config.maxEvents),
    maxEventAge: secondsOf(config.maxEventAge),
  }
}

/** @param {any} fence */
export function fenceOf(fence) {
  return {
    name: fence.name,
    ...fenceSettingsOf(fence.config),
    created: timeOf(fence.createTime),
    uid: fence.uid,
    lastSequence: BigInt(fence.lastSequence),
    firstSequence: BigInt(fence.firstSequence),
    inside: Number(fence.insideCount),
    subjectCount: Number(fence.subjectCount),
    consumers: fence.consumers.map(consumerOf),
  }
}

/** @param {any} consumer */
export function consumerOf(consumer) {
  return {
    name: consumer.name,
    acknowledged: BigInt(consumer.acknowledgedSequence),
    backlog: Number(consumer.backlog),
    oldest: timeOf(consumer.oldestEventTime),
    lost: Number(consumer.lost),
  }
}

/** @param {any} consumer */
export function feedConsumerOf(consumer) {
  const { name, hull = null, prefix = null, acknowledgedRevision, uid, position, backlog, lost, replaced } = consumer
  const after = prefix === null ? BigInt(acknowledgedRevision) : position.toString("hex")
  return { name, hull, prefix, after, uid, backlog: Number(backlog), lost: Number(lost), replaced }
}

/** @param {any} subjects */
export function subjectsOf({ hull, keys, revision }) {
  return { hull, keys: keysOf(keys), revision: BigInt(revision) }
}

/** @param {any} alarm @param {any[]} [statuses] */
export function alarmOf(alarm, statuses = []) {
  const { rule } = alarm
  return {
    name: alarm.name,
    hull: rule.hull ?? null,
    prefix: rule.prefix ?? null,
    when: rule.when,
    clear: rule.clear,
    for: secondsOf(rule.hold),
    maxEvents: Number(rule.maxEvents),
    maxEventAge: secondsOf(rule.maxEventAge),
    created: timeOf(alarm.createTime),
    uid: alarm.uid,
    lastSequence: BigInt(alarm.lastSequence),
    firstSequence: BigInt(alarm.firstSequence),
    hulls: Number(alarm.hullCount),
    raised: Number(alarm.raisedCount),
    consumers: alarm.consumers.map(consumerOf),
    statuses: statuses.map(statusOf),
  }
}

/** @param {any} status */
export function statusOf(status) {
  return {
    hull: status.hull,
    raised: status.raised,
    revision: BigInt(status.revision),
    value: finite(status.value),
    since: timeOf(status.since),
    acknowledged: timeOf(status.acknowledgeTime),
    mutedUntil: timeOf(status.muteTime),
  }
}
