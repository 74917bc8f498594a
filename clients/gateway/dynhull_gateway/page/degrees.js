// Places on the globe in the picture: longitude to the right, latitude upwards, in degrees.
import * as d3 from "d3-geo"
import { RADIAN } from "./dynhull/map/views.js"
export const SQUARE_KILOMETRE = 1e6
const POLE = 90, PRECISION = 1e-3, ALMOST = 1e-9
// The names of both coordinates. `center`: of a hull on the globe.
export function axes(center) {
  return center ? ["longitude", "latitude"] : ["x", "y"]
}
// A place in words: in degrees to the decimetre, in a plane with eight digits.
export function position_text([x, y], center) {
  return center ? `longitude ${+x.toFixed(6)}, latitude ${+y.toFixed(6)}` : `x ${+x.toPrecision(8)}, y ${+y.toPrecision(8)}`
}
// The places with longitudes within half a turn of the centre, so that no hull is torn at 180 degrees. Without a centre they
// are points of a plane, and stay.
export function shown(places, center) {
  return center ? places.map(place => shown_place(place, center)) : places
}
export function shown_place([lon, lat], center) {
  const turns = center ? (lon - center[0]) / 360 : 0
  return [Math.abs(turns) <= 0.5 ? lon : lon - 360 * Math.round(turns), lat]
}
// The rings that a hull fills in a flat map of degrees; of a segment, its line. Its edges are great circles. A hull that reaches
// half a turn from the centre is cut there, and with a pole inside it reaches the border of the map.
export function outline(vertices, center) {
  if (!center || vertices.length < 2) return [shown(vertices, center)]
  const projection = d3.geoEquirectangular().scale(1 / RADIAN).translate([0, 0]).rotate([-center[0], 0]).precision(PRECISION)
  const rings = [], clockwise = [...vertices].reverse()
  const shape = vertices.length == 2 ? {type: "LineString", coordinates: vertices} : {type: "Polygon", coordinates: [[...clockwise, clockwise[0]]]}
  const sink = {
    lineStart: () => rings.push([]),
    point: (x, y) => rings.at(-1).push([x + center[0], Math.abs(y) > POLE - ALMOST ? -Math.sign(y) * POLE : -y]),
    lineEnd() {}, polygonStart() {}, polygonEnd() {}, sphere() {},
  }
  d3.geoStream(shape, projection.stream(sink))
  return rings.filter(ring => ring.length > 1).map(ring => vertices.length == 2 ? ring : ring.reverse())
}
// The poles in an outline.
export function poles(rings) {
  return [["north", POLE], ["south", -POLE]].filter(([, pole]) => rings.some(ring => ring.some(([, lat]) => lat == pole))).map(([name]) => name)
}
