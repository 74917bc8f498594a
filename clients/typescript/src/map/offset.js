// The outline at a distance from polygons: their edges moved outwards, with arcs around the corners. For the eye.
import * as d3 from "d3-geo"
import { EARTH_RADIUS } from "./views.js"
/**
 * @typedef {import("./views.js").Point} Point
 * @typedef {import("./views.js").Ring} Ring
 * @typedef {import("./views.js").Rings} Rings
 * @typedef {[Point, Point]} Edge
 */
// Of what reaches farther from its middle, in radians, there is no outline around: that is nearly a hemisphere.
const RIM = 1.55
const ARC = Math.PI / 48, ALMOST = 1 - 1e-6
/**
 * Of each polygon the rings at the distance; a hole becomes narrower, or disappears. What is nearer to any of the polygons, as at
 * corners that point inwards and where polygons overlap, is left out.
 * @param {Rings[]} polygons
 * @param {number} distance
 * @returns {Rings[]}
 */
export function offset_rings(polygons, distance) {
  const edges = polygons.flat().flatMap(edges_of), least = distance * ALMOST
  const is_free = (/** @type {Point} */ place) => edges.every(edge => distance_to(place, edge) >= least)
  return polygons.map(rings => rings.map((ring, row) => {
    const moved = offset_ring((signed_area(ring) > 0) == (row == 0) ? ring : [...ring].reverse(), distance)
    return moved.filter(place => is_free(place) && !polygons.some(other => other != rings && is_inside(place, other)))
  }).filter(ring => ring.length > 2)).filter(rings => rings.length)
}
/**
 * The same around polygons on the globe, with the distance in metres: in a plane that is true from their middle.
 * @param {Rings[]} polygons
 * @param {number} distance
 * @returns {Rings[]}
 */
export function offset_on_globe(polygons, distance) {
  return in_plane(polygons, flat => offset_rings(flat, distance))
}
/**
 * The outline around a hull on the globe: of its corners, none of which points inwards.
 * @param {Ring} corners counterclockwise
 * @param {number} distance metres
 * @returns {Rings[]}
 */
export function offset_hull_on_globe(corners, distance) {
  if (corners.length < 2) return corners.map(place => [around(place, distance)])
  return in_plane([[corners]], ([[ring]]) => [[offset_ring(signed_area(ring) < 0 ? [...ring].reverse() : ring, distance)]])
}
/** @param {Point} place @param {number} distance metres @returns {Ring} */
function around([lon, lat], distance) {
  const [ring] = d3.geoCircle().center([lon, lat]).radius(distance / EARTH_RADIUS / (Math.PI / 180))().coordinates
  return ring.slice(1).map(([x, y]) => /** @type {const} */ ([x, y]))
}
/** @param {Rings[]} polygons @param {(flat: Rings[]) => Rings[]} offset @returns {Rings[]} */
function in_plane(polygons, offset) {
  const places = polygons.flatMap(([exterior]) => exterior.map(place => [...place]))
  const [lon, lat] = d3.geoCentroid({type: "MultiPoint", coordinates: places})
  const projection = d3.geoAzimuthalEquidistant().scale(EARTH_RADIUS).translate([0, 0]).rotate([-lon, -lat])
  const far = RIM * EARTH_RADIUS
  const placed = (/** @type {Point} */ [x, y]) => projection([x, y]) ?? [NaN, NaN]
  const flat = polygons.map(rings => rings.map(ring => ring.map(placed)))
  if (flat.flat(2).some(([x, y]) => !(Math.hypot(x, y) < far))) return []
  const back = (/** @type {Point} */ [x, y]) => {
    const nearer = Math.min(1, far / Math.hypot(x, y) || 1)
    return projection.invert?.([x * nearer, y * nearer]) ?? [NaN, NaN]
  }
  return offset(flat).map(rings => rings.map(ring => ring.map(back)))
}
/** A ring that has the area at its left, moved to its right. @param {Ring} ring @param {number} distance @returns {Ring} */
function offset_ring(ring, distance) {
  const edges = edges_of(ring).filter(([[x, y], [x1, y1]]) => x != x1 || y != y1)
  const angles = edges.map(([[x, y], [x1, y1]]) => Math.atan2(y1 - y, x1 - x) - Math.PI / 2)
  return edges.flatMap(([start], row) => {
    const before = angles[(row || angles.length) - 1], turn = wrapped(angles[row] - before)
    const at = (/** @type {number} */ angle) => /** @type {Point} */ ([start[0] + distance * Math.cos(angle), start[1] + distance * Math.sin(angle)])
    if (turn > 0) {
      const steps = Math.max(1, Math.ceil(turn / ARC))
      return Array.from({length: steps + 1}, (_, step) => at(before + turn * step / steps))
    }
    // Both lines meet there, if the corner is not too sharp.
    const half = before + turn / 2, far = distance / Math.max(Math.cos(turn / 2), 0.01)
    return [[start[0] + far * Math.cos(half), start[1] + far * Math.sin(half)]]
  })
}
/** @param {Ring} ring @returns {Edge[]} */
function edges_of(ring) {
  return ring.map((place, row) => [place, ring[(row + 1) % ring.length]])
}
/** @param {number} angle */
function wrapped(angle) {
  return angle - 2 * Math.PI * Math.round(angle / (2 * Math.PI))
}
/** @param {Ring} ring */
function signed_area(ring) {
  return edges_of(ring).reduce((sum, [[x, y], [x1, y1]]) => sum + (x - ring[0][0]) * (y1 - ring[0][1]) - (x1 - ring[0][0]) * (y - ring[0][1]), 0)
}
/** @param {Point} place @param {Edge} edge */
function distance_to([x, y], [[x0, y0], [x1, y1]]) {
  const [across, up] = [x1 - x0, y1 - y0], size = across * across + up * up
  const along = size ? Math.max(0, Math.min(1, ((x - x0) * across + (y - y0) * up) / size)) : 0
  return Math.hypot(x - x0 - along * across, y - y0 - along * up)
}
/** @param {Point} place @param {Rings} rings */
function is_inside([x, y], rings) {
  return rings.flatMap(edges_of).reduce((inside, [[x0, y0], [x1, y1]]) =>
    (y0 > y) != (y1 > y) && x < x0 + (y - y0) / (y1 - y0) * (x1 - x0) ? !inside : inside, false)
}
