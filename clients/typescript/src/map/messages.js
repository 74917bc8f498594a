// What the picture draws, made of what the gateway sends.

import { geoCircle } from "d3-geo"

import { offset_on_globe, offset_rings } from "./offset.js"
import { EARTH_RADIUS, RADIAN } from "./views.js"

/**
 * @typedef {import("../exact.js").Point} Point
 * @typedef {import("../hull-copy.js").Key} Key
 */

const STEPS = 96
/** Corners of an area around which its margin is drawn: of more, each of some. */
const MOST_CORNERS = 1000
const LEAST_CORNERS = 3

/**
 * The outline of a hull, with the names of its vertices.
 * @param {string} hull
 * @param {bigint} revision
 * @param {readonly Point[]} vertices
 * @param {readonly Key[] | null} keys
 * @param {boolean} globe
 */
export function outlineMessage(hull, revision, vertices, keys, globe) {
  const [x, y] = [0, 1].map((axis) => vertices.map((vertex) => vertex[axis]))
  return { kind: "vertices", hull, revision, x, y, keys: keys?.map(String) ?? null, rings: globe ? [vertices] : null }
}

/**
 * The area of a fence.
 * @param {import("../client.js").Fence} fence
 * @param {boolean} globe
 */
export function areaMessage(fence, globe) {
  const parts = [fence.area].flat()
  const hulls = parts.flatMap((part) => ("hull" in part ? [part.hull] : []))
  if (fence.otherHull) hulls.push(fence.otherHull)
  const margin = (fence.otherHull ? fence.near : fence.margin) ?? 0
  const polygons = parts.flatMap((part) => ("hull" in part ? [] : [ringsOf(part, globe)]))
  const around = margin && polygons.length ? (globe ? offset_on_globe : offset_rings)(thinned(polygons), margin) : []
  return { kind: "area", fence: fence.name, hulls, margin, polygons, around, globe }
}

/** @param {Point[][][]} polygons */
function thinned(polygons) {
  const step = Math.ceil(polygons.flat(2).length / MOST_CORNERS)
  const thin = (/** @type {Point[]} */ ring) => {
    const each = Math.max(1, Math.min(step, Math.floor(ring.length / LEAST_CORNERS)))
    return ring.filter((_, row) => row % each === 0)
  }
  return polygons.map((rings) => rings.map(thin))
}

/**
 * The subjects inside of a fence.
 * @param {string} fence
 * @param {{hull: string, key: Key, place: Point}[]} marks
 */
export function insideMessage(fence, marks) {
  return {
    kind: "inside",
    fence,
    hull: marks.map(({ hull }) => hull),
    key: marks.map(({ key }) => String(key)),
    x: marks.map(({ place }) => place[0]),
    y: marks.map(({ place }) => place[1]),
  }
}

/** @param {any} part of an area @param {boolean} globe @returns {Point[][]} */
function ringsOf(part, globe) {
  if (!("radius" in part)) return [part.exterior, ...(part.holes ?? [])]
  const { center, radius } = part
  if (globe) return [geoCircle().center(center).radius(radius / EARTH_RADIUS / RADIAN)().coordinates[0].slice(1).map(([x, y]) => [x, y])]
  const at = (/** @type {number} */ step) => (2 * Math.PI * step) / STEPS
  const place = (/** @type {number} */ angle) => [center[0] + radius * Math.cos(angle), center[1] + radius * Math.sin(angle)]
  return [Array.from({ length: STEPS }, (_, step) => /** @type {Point} */ (/** @type {unknown} */ (place(at(step)))))]
}
