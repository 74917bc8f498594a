// Coasts and borders of Natural Earth, drawn again for each view. Great circles between their points would look the same.
import * as topojson from "topojson-client"
import { RADIAN, unit_vector } from "./views.js"
/**
 * @typedef {import("./views.js").GlobeView} GlobeView
 * @typedef {import("./views.js").Vector} Vector
 * @typedef {{points: Float64Array, middle: Vector, reach: number}} Piece of a line: unit vectors, and a ball around them
 * @typedef {{coasts: Piece[], borders: Piece[]}} Lines
 */
export const COARSE = "countries-110m.json", FINE = "countries-50m.json", PIECE = 48
// Pixels in a radian from which the fine coasts are drawn. Most of them are out of sight when the scale is larger still:
// then they can be drawn while the picture moves, too.
export const FINE_SCALE = 900, FINE_MOVING_SCALE = 5000
/** @type {Lines} */
export const NO_LINES = {coasts: [], borders: []}
export class Coasts {
  /** Undefined until they have come. @type {Map<string, Lines | undefined>} */
  known = new Map()
  /** @param {string | null | undefined} folder has the files of world-atlas; without one there are no lines @param {() => void} changed */
  constructor(folder, changed) {
    this.folder = folder
    this.changed = changed
  }
  /** The lines to draw, once they are loaded. @param {number} scale @param {boolean} moving */
  lines(scale, moving) {
    if (!this.folder) return NO_LINES
    const name = scale > (moving ? FINE_MOVING_SCALE : FINE_SCALE) ? FINE : COARSE
    if (!this.known.has(name)) {
      this.known.set(name, undefined)
      fetch(this.folder + name).then(answer => answer.json()).then(atlas => {
        this.known.set(name, decoded(atlas))
        this.changed()
      }).catch(() => this.known.delete(name))  // the next view asks again
    }
    return this.known.get(name) ?? this.known.get(COARSE) ?? this.known.get(FINE) ?? NO_LINES
  }
  /** @param {CanvasRenderingContext2D} canvas @param {GlobeView} view @param {Record<string, string>} colours @param {boolean} moving */
  draw(canvas, view, colours, moving) {
    const {coasts, borders} = this.lines(view.scale, moving)
    for (const {pieces, colour} of [{pieces: borders, colour: colours.border}, {pieces: coasts, colour: colours.coast}]) {
      canvas.beginPath()
      for (const piece of pieces) trace(canvas, view, piece)
      canvas.strokeStyle = colour
      canvas.lineWidth = 1
      canvas.stroke()
    }
  }
}
/** @param {any} atlas a topology @returns {Lines} */
export function decoded(atlas) {
  const {countries} = atlas.objects
  const lines = (/** @type {(one: object, two: object) => boolean} */ filter) =>
    topojson.mesh(atlas, countries, filter).coordinates.flatMap(pieces)
  return {coasts: lines((one, two) => one == two), borders: lines((one, two) => one != two)}
}
/** A line as pieces of few points: unit vectors, with a ball around them, so that what is out of sight costs little. @param {number[][]} line */
export function pieces(line) {
  /** @type {Piece[]} */
  const found = []
  for (let first = 0; first + 1 < line.length; first += PIECE) {
    const part = line.slice(first, first + PIECE + 1)
    const points = new Float64Array(3 * part.length)
    /** @type {Vector} */
    const middle = [0, 0, 0]
    part.forEach(([lon, lat], row) => {
      unit_vector(lon, lat).forEach((each, axis) => {
        points[3 * row + axis] = each
        middle[axis] += each / part.length
      })
    })
    let reach = 0
    for (let i = 0; i < points.length; i += 3)
      reach = Math.max(reach, Math.hypot(points[i] - middle[0], points[i + 1] - middle[1], points[i + 2] - middle[2]))
    found.push({points, middle, reach})
  }
  return found
}
/** @param {CanvasRenderingContext2D} canvas @param {GlobeView} view @param {Piece} piece */
export function trace(canvas, view, {points, middle, reach}) {
  if (!view.sees(middle, reach)) return
  const lon = view.middle[0] * RADIAN, sin_lon = Math.sin(lon), cos_lon = Math.cos(lon), {sin, cos, scale} = view
  const [center, center_down] = view.center()
  let pen = false
  for (let i = 0; i < points.length; i += 3) {
    const front = points[i] * cos_lon + points[i + 1] * sin_lon
    if (sin * points[i + 2] + cos * front < 0) {
      pen = false
      continue
    }
    const right = center + scale * (points[i + 1] * cos_lon - points[i] * sin_lon)
    const down = center_down - scale * (cos * points[i + 2] - sin * front)
    if (pen) canvas.lineTo(right, down)
    else canvas.moveTo(right, down)
    pen = true
  }
}
