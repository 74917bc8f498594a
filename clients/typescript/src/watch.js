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
 *
 * @typedef {object} Progress a later revision with the same vertices
 * @property {"progress"} type
 * @property {bigint} revision
 * @property {number} points
 * @property {string} cause
 * @property {bigint | null} clock
 * @property {Point | null} center
 * @property {bigint | null} changed
 *
 * @typedef {object} Deleted the hull was deleted; if it is created again, a snapshot follows
 * @property {"deleted"} type
 * @property {bigint} revision
 *
 * @typedef {Snapshot | Change | Progress | Deleted} HullEvent
 *
 * @typedef {object} FenceEvent
 * @property {string} type enter, exit, cross, dwell, transfer, begin, cease, snapshot, closed, lost or progress
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
 *
 * @typedef {object} HullNow the newest state of one of many hulls
 * @property {string} hull
 * @property {string} uid
 * @property {bigint} revision
 * @property {number} points
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
const ABSENT = { vertexKeys: null, center: null, measures: null, changed: null, error: null, clock: null }
const UNCHANGED = { addedKeys: null, renamedRows: null, renamedKeys: null }

/**
 * @param {string} type
 * @param {any} data as from `fromWire`
 * @returns {HullEvent}
 */
export function hullEvent(type, data) {
  return { ...ABSENT, ...(type === "change" && UNCHANGED), ...data, type }
}

/** @param {any} data @returns {FenceEvent} */
export function fenceEvent(data) {
  const absent = { key: null, position: null, previousPosition: null, distance: null, eventTime: null, firstTime: null }
  return { cause: [], inside: [], hull: "", revision: 0n, areaRevision: 0n, ...absent, ...data }
}
