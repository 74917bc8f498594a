// Where things are in the picture: in a plane, and on the globe. Both have the same methods.
import * as d3 from "d3-geo"
/**
 * @typedef {import("../exact.js").Point} Point
 * @typedef {Point[]} Ring
 * @typedef {Ring[]} Rings a polygon: its exterior, and its holes
 * @typedef {[number, number, number, number]} Extremes least x and y, and greatest
 * @typedef {{left: number, top: number, width: number, height: number}} Rect
 * @typedef {[number, number, number]} Vector
 * @typedef {PlaneView | GlobeView} View
 */
export const FRAME_MARGIN = 0.08, LEAST_FILLED = 0.5
/** @type {Extremes} */
export const NO_FRAME = [0, 0, 1, 1]
export const EARTH_RADIUS = 6371008.8, ALONE_METRES = 100_000, LARGEST_SCALE = 1e10, RADIAN = Math.PI / 180
/** The smallest box around some points. @param {Iterable<Point>} points */
export function box_around(points) {
  /** @type {Extremes} */
  const box = [Infinity, Infinity, -Infinity, -Infinity]
  for (const [x, y] of points) {
    box[0] = Math.min(box[0], x)
    box[1] = Math.min(box[1], y)
    box[2] = Math.max(box[2], x)
    box[3] = Math.max(box[3], y)
  }
  return box
}
/**
 * The region that a picture shows: the old frame while the box fits and fills it, else a new one, so that the picture
 * stands still while the hulls in it move. With one scale for both axes the box fills the frame along either of them,
 * otherwise along both.
 * @param {Extremes} box
 * @param {Extremes} [frame]
 * @param {boolean} [same_scale]
 * @returns {Extremes}
 */
export function frame_around(box, frame, same_scale = true) {
  let size = [box[2] - box[0], box[3] - box[1]]
  if (frame) {
    const fits = box[0] >= frame[0] && box[1] >= frame[1] && box[2] <= frame[2] && box[3] <= frame[3]
    const filled = size.map((each, axis) => each >= LEAST_FILLED * (frame[axis + 2] - frame[axis]))
    if (fits && (same_scale ? filled.some(each => each) : filled.every(each => each))) return frame
  }
  if (same_scale || !(size[0] || size[1])) size = [Math.max(...size), Math.max(...size)]
  // Points in a row, or a single point, have no size along an axis: their distance from zero serves instead.
  const room = size.map((each, axis) => FRAME_MARGIN * (each || Math.max(Math.abs(box[axis]), Math.abs(box[axis + 2])) || 1))
  return [box[0] - room[0], box[1] - room[1], box[2] + room[0], box[3] + room[1]]
}
export class PlaneView {
  globe = false
  rect = {left: 0, top: 0, width: 1, height: 1}
  /** Pixels in one of x and of y. */
  unit = [1, 1]
  /** @type {Point} */
  middle = [0, 0]
  /** @type {Extremes | undefined} */
  frame = undefined
  /** @param {boolean} same_scale */
  constructor(same_scale) {
    this.same_scale = same_scale
    this.show(NO_FRAME)
  }
  /** @param {Rect} rect */
  resize(rect) {
    this.rect = rect
    if (this.frame) this.show(this.frame)
  }
  /** @param {Extremes} frame */
  show(frame) {
    const [wide, high] = [frame[2] - frame[0], frame[3] - frame[1]]
    this.unit = [this.rect.width / wide, this.rect.height / high]
    if (this.same_scale) this.unit.fill(Math.min(...this.unit))
    this.middle = [frame[0] + wide / 2, frame[1] + high / 2]
  }
  // The middle, and how much of x and y is in the picture.
  get extent() {
    return [...this.middle, this.rect.width / this.unit[0], this.rect.height / this.unit[1]]
  }
  /** @param {readonly number[]} extent */
  show_extent([x, y, wide, high = wide]) {
    this.frame = undefined
    this.show([x - wide / 2, y - high / 2, x + wide / 2, y + high / 2])
  }
  /** @param {Point[]} points */
  fit(points) {
    if (!points.length) return
    const frame = frame_around(box_around(points), this.frame, this.same_scale)
    if (frame != this.frame) this.show(this.frame = frame)
  }
  refit() {
    this.frame = undefined
  }
  // Whether it has been fitted, and nobody wants it anew.
  get settled() {
    return this.frame != undefined
  }
  /** @param {number} x @param {number} y @returns {[number, number]} */
  place(x, y) {
    const {left, top, width, height} = this.rect
    return [left + width / 2 + (x - this.middle[0]) * this.unit[0], top + height / 2 - (y - this.middle[1]) * this.unit[1]]
  }
  /** @param {number} across @param {number} down @returns {[number, number]} */
  invert(across, down) {
    const {left, top, width, height} = this.rect
    return [this.middle[0] + (across - left - width / 2) / this.unit[0], this.middle[1] - (down - top - height / 2) / this.unit[1]]
  }
  /** @param {number} across @param {number} down */
  pan(across, down) {
    this.frame = undefined
    this.middle = [this.middle[0] - across / this.unit[0], this.middle[1] + down / this.unit[1]]
  }
  /** @param {number} factor @param {number} across @param {number} down */
  zoom(factor, across, down) {
    const [x, y] = this.invert(across, down)
    this.unit = this.unit.map(each => each * factor)
    const [now_across, now_down] = this.place(x, y)
    this.pan(across - now_across, down - now_down)
  }
  /** Adds a polygon, exterior first, to the path of a canvas. @param {CanvasRenderingContext2D} canvas @param {Rings} rings */
  polygon(canvas, rings) {
    for (const ring of rings) {
      ring.forEach(([x, y], row) => row ? canvas.lineTo(...this.place(x, y)) : canvas.moveTo(...this.place(x, y)))
      canvas.closePath()
    }
  }
}
// The globe as seen from far away (orthographic), from above the middle of the picture: there the scale is right in all
// directions, and poles and 180 degrees are places like others. d3-geo follows great circles to within half a pixel.
export class GlobeView {
  globe = true
  projection = d3.geoOrthographic().precision(0.5)
  rect = {left: 0, top: 0, width: 1, height: 1}
  /** @type {Point} */
  middle = [0, 0]
  /** The sine and cosine of the latitude of the middle. */
  sin = 0
  cos = 1
  fitted = false
  constructor() {
    this.turn([0, 0])
    this.scale = 1
  }
  /** @param {Rect} rect */
  resize(rect) {
    this.rect = rect
    this.projection.translate(this.center())
      .clipExtent([[rect.left - 20, rect.top - 20], [rect.left + rect.width + 20, rect.top + rect.height + 20]])
    this.fitted = false
  }
  /** @returns {[number, number]} */
  center() {
    return [this.rect.left + this.rect.width / 2, this.rect.top + this.rect.height / 2]
  }
  /** @param {Point} middle */
  turn([lon, lat]) {
    this.middle = [lon - 360 * Math.round(lon / 360), Math.max(-90, Math.min(90, lat))]
    this.projection.rotate([-this.middle[0], -this.middle[1]])
    this.sin = Math.sin(this.middle[1] * RADIAN)
    this.cos = Math.cos(this.middle[1] * RADIAN)
  }
  get scale() {
    return this.projection.scale()
  }
  set scale(scale) {
    this.projection.scale(Math.max(Math.min(this.rect.width, this.rect.height) / 8, Math.min(LARGEST_SCALE, scale)))
  }
  // The middle, and the metres from the left to the right of the picture.
  get extent() {
    return [...this.middle, this.rect.width * EARTH_RADIUS / this.scale]
  }
  /** @param {readonly number[]} extent */
  show_extent([lon, lat, wide]) {
    this.turn([lon, lat])
    this.scale = this.rect.width * EARTH_RADIUS / wide
    this.fitted = true
  }
  /** NaN for what is on the other side. @param {number} lon @param {number} lat @returns {[number, number]} */
  place(lon, lat) {
    const east = (lon - this.middle[0]) * RADIAN, north = lat * RADIAN
    const sin = Math.sin(north), cos = Math.cos(north), front = cos * Math.cos(east)
    if (this.sin * sin + this.cos * front < 0) return [NaN, NaN]
    const [across, down] = this.center(), scale = this.scale
    return [across + scale * cos * Math.sin(east), down - scale * (this.cos * sin - this.sin * front)]
  }
  /** Whether any place of a ball is in sight: around a unit vector, with a radius of at most 2. @param {Vector} middle @param {number} reach */
  sees([x, y, z], reach) {
    const lon = this.middle[0] * RADIAN, front = x * Math.cos(lon) + y * Math.sin(lon)
    const across = y * Math.cos(lon) - x * Math.sin(lon), up = this.cos * z - this.sin * front
    return this.sin * z + this.cos * front + reach >= 0
      && (Math.abs(across) - reach) * this.scale <= this.rect.width / 2 && (Math.abs(up) - reach) * this.scale <= this.rect.height / 2
  }
  /** NaN beside the globe. @param {number} across @param {number} down @returns {[number, number]} */
  invert(across, down) {
    return this.projection.invert?.([across, down]) ?? [NaN, NaN]
  }
  /** @param {Point[]} places */
  fit(places) {
    if (!places.length || this.fitted && this.filled(places)) return
    const [lon, lat] = d3.geoCentroid({type: "MultiPoint", coordinates: places.map(place => [...place])})
    this.turn([lon || 0, lat || 0])
    this.projection.scale(1)
    let reach = [0, 0]
    for (let step = 0; step < 4; step++) {
      const seen = places.map(([lon, lat]) => this.place(lon, lat)).filter(([across]) => !isNaN(across))
      const box = box_around(seen), [across, down] = this.center()
      reach = [Math.max(across - box[0], box[2] - across), Math.max(down - box[1], box[3] - down)]
      const middle = this.invert((box[0] + box[2]) / 2, (box[1] + box[3]) / 2)
      if (step < 3 && middle.every(isFinite)) this.turn(middle)
    }
    const room = 1 + 2 * FRAME_MARGIN
    const scales = [this.rect.width, this.rect.height].map((each, axis) => each / 2 / (room * reach[axis]))
    const alone = this.rect.width * EARTH_RADIUS / ALONE_METRES
    this.scale = Math.max(...reach) > 1e-9 ? Math.min(...scales) : alone
    this.fitted = true
  }
  /** @param {Point[]} places */
  filled(places) {
    const {left, top, width, height} = this.rect
    const box = box_around(places.map(([lon, lat]) => this.place(lon, lat)))  // NaN of what is hidden
    const fits = box[0] >= left && box[1] >= top && box[2] <= left + width && box[3] <= top + height
    return fits && (box[2] - box[0] >= LEAST_FILLED * width || box[3] - box[1] >= LEAST_FILLED * height
      || Math.max(box[2] - box[0], box[3] - box[1]) == 0)
  }
  refit() {
    this.fitted = false
  }
  get settled() {
    return Boolean(this.fitted)
  }
  /** @param {number} across @param {number} down */
  pan(across, down) {
    const [lon, lat] = this.middle, turn = 1 / this.scale / RADIAN
    const widest = Math.max(this.cos, 0.05)
    this.turn([lon - Math.max(-90, Math.min(90, across * turn / widest)), lat + Math.max(-90, Math.min(90, down * turn))])
  }
  /** @param {number} factor @param {number} across @param {number} down */
  zoom(factor, across, down) {
    const under = this.invert(across, down)
    this.scale *= factor
    if (!under.every(isFinite)) return
    const [now_across, now_down] = this.place(...under)
    if (!isNaN(now_across)) this.pan(across - now_across, down - now_down)
  }
  /** @param {CanvasRenderingContext2D} canvas @param {Rings} rings */
  polygon(canvas, rings) {
    const coordinates = rings.map(closed)
    const line = rings[0].length < 3
    d3.geoPath(this.projection, canvas)(line ? {type: "LineString", coordinates: coordinates[0]} : {type: "Polygon", coordinates})
  }
}
/** @param {number} lon @param {number} lat @returns {Vector} */
export function unit_vector(lon, lat) {
  const cos = Math.cos(lat * RADIAN)
  return [cos * Math.cos(lon * RADIAN), cos * Math.sin(lon * RADIAN), Math.sin(lat * RADIAN)]
}
/** Rings as d3-geo wants them: the exterior, which is smaller than half the globe, clockwise, and the holes the other way. @param {Rings} rings */
export function wound(rings) {
  return rings.map((ring, row) => {
    const large = d3.geoArea({type: "Polygon", coordinates: [closed(ring)]}) > 2 * Math.PI
    return large == (row == 0) ? [...ring].reverse() : ring
  })
}
/** A ring whose first place is its last, too. @param {Ring} ring */
function closed(ring) {
  return [...ring, ring[0]].map(place => [...place])
}
