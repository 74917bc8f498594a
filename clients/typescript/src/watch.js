import { fromWire } from "./json.js"

/**
 * @typedef {import("./exact.js").Point} Point
 * @typedef {import("./hull-copy.js").Key} Key
 *
 * @typedef {object} Measures
 * @property {number | null} area
 * @property {number | null} perimeter
 * @property {[number | null, number | null]} centroid
 * @property {[number | null, number | null, number | null, number | null]} bounds
 * @property {number | null} diameter
 * @property {number | null} width
 *
 * @typedef {object} Snapshot the whole hull
 * @property {"snapshot"} type
 * @property {bigint} revision
 * @property {number} points
 * @property {Point[]} vertices
 * @property {Key[] | null} vertexKeys with `keys: true`
 * @property {Point | null} center of a geographic hull
 * @property {Measures | null} measures with `measures: true`
 * @property {bigint | null} changed when its newest batch was committed, in microseconds since 1970
 * @property {boolean} [erased] in a replay, whether the hull may lack keys that it had then, since they were erased
 * @property {number | null} error with `maxVertices`, by how far the hull reaches beyond these vertices
 *
 * @typedef {object} Change the difference to the event before
 * @property {"change"} type
 * @property {bigint} revision
 * @property {number} points
 * @property {Point[]} removed
 * @property {number[]} removedRows
 * @property {number} rotation
 * @property {Point[]} added
 * @property {number[]} addedRows
 * @property {Key[] | null} addedKeys
 * @property {number[] | null} renamedRows
 * @property {Key[] | null} renamedKeys
 * @property {Measures | null} measures
 * @property {string} cause
 * @property {bigint | null} clock
 * @property {Point | null} center
 * @property {bigint | null} changed
 * @property {boolean} [erased]
 *
 * @typedef {object} Progress a later revision with the same vertices
 * @property {"progress"} type
 * @property {bigint} revision
 * @property {number} points
 * @property {string} cause
 * @property {bigint | null} clock
 * @property {Point | null} center
 * @property {bigint | null} changed
 * @property {boolean} [erased]
 *
 * @typedef {object} Deleted the hull was deleted; if it is created again, a snapshot follows
 * @property {"deleted"} type
 * @property {bigint} revision
 *
 * @typedef {Snapshot | Change | Progress | Deleted} HullEvent
 *
 * @typedef {object} FenceEvent
 * @property {string} type enter, exit, cross, dwell, transfer, begin, cease, snapshot, closed, lost or replaced
 * @property {bigint} sequence
 * @property {string} fence
 * @property {string} uid
 * @property {string[]} cause
 * @property {string} hull
 * @property {Key | null} key
 * @property {bigint} revision
 * @property {bigint} areaRevision
 * @property {Point | null} position
 * @property {Point | null} previousPosition
 * @property {number | null} distance
 * @property {bigint | null} eventTime
 * @property {bigint | null} time
 * @property {bigint | null} firstTime
 * @property {{hull: string, keys: Key[], revision: bigint}[]} inside
 * @property {bigint} first of `lost`, the first sequence that was dropped
 * @property {bigint} last
 * @property {number} conflated how many events before this one were left out, because they cancel each other
 * @property {string} previousHull of a subject that one batch has moved from another hull, its name
 * @property {bigint} previousHullRevision
 *
 * @typedef {object} AlarmEvent
 * @property {string} type raised, cleared, snapshot, closed, lost or replaced
 * @property {bigint} sequence
 * @property {string} alarm
 * @property {string} uid
 * @property {string} hull empty if there is no single one
 * @property {bigint} revision
 * @property {number | null} value the measure; of `silent` the seconds, of `near` the distance
 * @property {number | null} bound what it was compared with
 * @property {string[]} cause
 * @property {bigint | null} causeRevision the revision with which the condition began to hold
 * @property {string} causeHull
 * @property {bigint | null} causeTime in microseconds since 1970
 * @property {number | null} previous the measure before
 * @property {bigint | null} time
 * @property {Key[]} keys of a condition about vertices
 * @property {string[]} raised of `snapshot` and `closed`, the hulls for which it was raised
 * @property {bigint} first of `lost`, the first sequence that was dropped
 * @property {bigint} last
 *
 * @typedef {object} FeedEvent a batch, or what has become of a feed; a batch has those fields that are not empty
 * @property {string} type batch, lost, deleted, hulls or replaced
 * @property {string} position the id to go on after; empty for one that belongs together with the next
 * @property {string} [hull]
 * @property {bigint} [revision]
 * @property {string} [uid]
 * @property {bigint} [commit] revisions with the same number were committed together
 * @property {bigint} [time] in microseconds since 1970
 * @property {string} [cause]
 * @property {Key[]} [keys] keys put
 * @property {Point[]} [points] their positions
 * @property {Key[]} [removed]
 * @property {Point[]} [inserts]
 * @property {Point[]} [deletes]
 * @property {(bigint | null)[]} [times]
 * @property {(bigint | null)[]} [expireTimes]
 * @property {number} [expired]
 * @property {bigint} [expiredUntil]
 * @property {number[]} [accuracies]
 * @property {"absent" | "present"} [only] whether the batch put only new keys, or only known ones
 * @property {boolean} [lenient] whether some deletes are of points that the hull did not have
 * @property {Point} [center] the new centre of a geographic hull
 * @property {boolean} [more] whether the next batch of the feed of many hulls was committed together with this one
 * @property {bigint} [clock]
 * @property {object} [held]
 * @property {bigint} [first] of `lost`
 * @property {bigint} [last]
 * @property {Record<string, string>} [hulls] of `hulls`, the uids by name
 *
 * @typedef {object} HullNow the newest state of one of many hulls
 * @property {string} hull
 * @property {string} uid
 * @property {bigint} revision
 * @property {number} points
 * @property {number} distinct
 * @property {number} held
 * @property {bigint | null} clock
 * @property {number} vertexCount
 * @property {Measures | null} measures
 * @property {bigint | null} changed
 * @property {boolean} geographic
 * @property {Point | null} center
 * @property {Point[] | null} vertices
 * @property {number | null} error
 *
 * @typedef {object} Hulls hulls that have changed, and the names of those that are gone
 * @property {"begin" | "hulls" | "complete"} type from `begin` to `complete`, all hulls are named
 * @property {HullNow[]} hulls
 * @property {string[]} gone
 * @property {string[]} unchanged
 */

/** What events leave out. */
const ABSENT = { vertexKeys: null, center: null, measures: null, changed: null, error: null, clock: null, erased: false }
const NOTHING_YET = { distinct: 0, held: 0, clock: null, measures: null, changed: null, center: null, vertices: null, error: null }
const UNCHANGED = { addedKeys: null, renamedRows: null, renamedKeys: null }

/**
 * @param {string} type
 * @param {any} data as from `fromWire`
 * @returns {HullEvent}
 */
export function hullEvent(type, data) {
  return { ...ABSENT, ...(type === "change" && UNCHANGED), ...data, type }
}

/** @param {string} type @param {any} data @returns {FenceEvent} */
export function fenceEvent(type, data) {
  const absent = { key: null, position: null, previousPosition: null, distance: null, eventTime: null, firstTime: null }
  const numbers = { sequence: 0n, revision: 0n, areaRevision: 0n, first: 0n, last: 0n, conflated: 0 }
  const before = { previousHull: "", previousHullRevision: 0n }
  return { type, cause: [], inside: [], fence: "", uid: "", hull: "", time: null, ...before, ...numbers, ...absent, ...data }
}

/** @param {string} type @param {any} data @returns {AlarmEvent} */
export function alarmEvent(type, data) {
  const absent = { value: null, bound: null, causeRevision: null, causeTime: null, previous: null, time: null }
  const numbers = { sequence: 0n, revision: 0n, first: 0n, last: 0n }
  return { type, cause: [], keys: [], raised: [], alarm: "", uid: "", hull: "", causeHull: "", ...numbers, ...absent, ...data }
}

/** The newest state of one of many hulls. @param {any} hull @returns {HullNow} */
export function hullNow(hull) {
  return { ...NOTHING_YET, ...fromWire(hull) }
}
