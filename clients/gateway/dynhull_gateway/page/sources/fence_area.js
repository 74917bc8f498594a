// The area of a fence and its margin as they are drawn. For the eye: the server decides who is inside.
import { offset_on_globe, offset_rings } from "../dynhull/map/offset.js"
import { EARTH_RADIUS, RADIAN, box_around } from "../dynhull/map/views.js"
import { shown } from "../degrees.js"
import { MOST_DRAWN } from "./hull_state.js"
const LEAST_CORNERS = 3, MOST_POLYGONS = Math.floor(MOST_DRAWN / LEAST_CORNERS), CORNERS_OF_CIRCLE = 180
// The hulls whose outlines are the area; in a fence around another hull, both.
export function area_hulls({area, otherHull}) {
  const own = [area].flat().flatMap(part => "hull" in part ? [part.hull] : [])
  return otherHull == null ? own : [...own, otherHull]
}
// The hulls that show what the fence does: those of its area, and of its subjects among the `known` hulls.
export function hulls_of(fence, known) {
  const {subjects, subjectPrefix} = fence
  const found = subjectPrefix == null ? [subjects].filter(name => name != null) : known.filter(name => name.startsWith(subjectPrefix)).sort()
  return [...new Set([...area_hulls(fence), ...found])]
}
export function corner_count({area}) {
  return [area].flat().reduce((sum, part) => sum + rings_of(part).reduce((sum, ring) => sum + ring.length, 0), 0)
}
// What is drawn of it, an empty message where there is no fence; the box around that, and how many corners are drawn. With
// `center` it is on the globe, and drawn around this centre.
export function area_of(name, fence, center = null) {
  const empty = {kind: "area", fence: name, hulls: [], margin: 0, globe: false, polygons: [], around: []}
  if (!fence) return {message: empty, bounds: undefined, drawn: 0}
  const margin = (fence.otherHull == null ? fence.margin : fence.near) ?? 0
  const polygons = polygons_of(fence, center != null).map(rings => rings.map(ring => shown(ring, center)))
  const around = !polygons.length || !margin ? [] : center ? offset_on_globe(polygons, margin).map(rings => rings.map(ring => shown(ring, center))) : offset_rings(polygons, margin)
  const drawn = polygons.flat().reduce((sum, ring) => sum + ring.length, 0)
  const bounds = polygons.length ? box_around([...polygons, ...around].flatMap(([exterior]) => exterior)) : undefined
  return {message: {...empty, hulls: area_hulls(fence), margin, globe: center != null, polygons, around}, bounds, drawn}
}
function rings_of(part) {
  return "exterior" in part ? [part.exterior, ...part.holes ?? []] : []
}
function polygons_of(fence, on_globe) {
  const parts = [fence.area].flat()
  if ("radius" in parts[0]) return [[circle(parts[0], on_globe)]]
  const step = Math.ceil(corner_count(fence) / MOST_DRAWN)
  const thin = ring => {
    const each = Math.max(1, Math.min(step, Math.floor(ring.length / LEAST_CORNERS)))
    return ring.filter((_, row) => row % each == 0)
  }
  return parts.slice(0, MOST_POLYGONS).map(part => rings_of(part).map(thin)).filter(rings => rings.length)
}
// The border of the disk around a place as it is shown, clockwise; no places without a radius.
export function disk(place, radius, center) {
  return radius ? shown(circle({center: place, radius}, center != null).reverse(), center) : []
}
// On the globe its radius is in metres.
export function circle({center: [x, y], radius}, on_globe) {
  const angles = Array.from({length: CORNERS_OF_CIRCLE}, (_, row) => 2 * Math.PI * row / CORNERS_OF_CIRCLE)
  if (!on_globe) return angles.map(angle => [x + radius * Math.cos(angle), y + radius * Math.sin(angle)])
  const away = radius / EARTH_RADIUS, lat = y * RADIAN, {sin, cos} = Math
  return angles.map(angle => {
    const north = Math.asin(sin(lat) * cos(away) + cos(lat) * sin(away) * sin(angle))
    return [x + Math.atan2(cos(angle) * sin(away) * cos(lat), cos(away) - sin(lat) * sin(north)) / RADIAN, north / RADIAN]
  })
}
