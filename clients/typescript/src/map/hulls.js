// The hulls in the picture.
/**
 * @typedef {import("./views.js").Point} Point
 * @typedef {import("./views.js").Rings} Rings
 * @typedef {import("./looks.js").Look} Look
 * @typedef {import("./picture.js").Picture} Picture
 *
 * @typedef {object} Drawing vertices of a hull, or points
 * @property {bigint | number} revision
 * @property {readonly number[]} x
 * @property {readonly number[]} y
 * @property {readonly string[] | null} [keys]
 * @property {Rings | null} [rings] of a hull on the globe
 *
 * @typedef {object} Outliers
 * @property {Drawing[]} layers the inner ones
 * @property {Point | null} vertex the most influential one
 * @property {string} label
 *
 * @typedef {(Drawing & {kind: "vertices" | "points"}) | (Outliers & {kind: "outliers"})} HullMessage
 */
export const SURFACE_ALPHA = 0.12, POINT_ALPHA = 0.65, POINT_SIZE = 4, VERTEX_SIZE = 8, STAR_SIZE = 16
export const LEAST_SIZE = 0.35, ROOM_FOR = 4  // things in a square of twice their size do not overlap much
export const LAYER_ALPHA = 0.7
/** @type {Drawing} */
export const NOTHING = {revision: 0, x: [], y: [], keys: null, rings: null}
/** @type {Outliers} */
export const NO_OUTLIERS = {layers: [], vertex: null, label: ""}
/** Their corners. @type {Record<string, number[][]>} */
export const SHAPES = {
  square: [[-4, -4], [4, -4], [4, 4], [-4, 4]],
  triangle: [[0, -5], [4.5, 3.5], [-4.5, 3.5]],
  inverted_triangle: [[0, 5], [4.5, -3.5], [-4.5, -3.5]],
  diamond: [[0, -5.5], [4, 0], [0, 5.5], [-4, 0]],
  hex: [0, 1, 2, 3, 4, 5].map(i => [4.6 * Math.sin(i * Math.PI / 3), -4.6 * Math.cos(i * Math.PI / 3)]),
  star: [0, 1, 2, 3, 4, 5, 6, 7, 8, 9].map(i => [(i % 2 ? 3.4 : 8) * Math.sin(i * Math.PI / 5), -(i % 2 ? 3.4 : 8) * Math.cos(i * Math.PI / 5)]),
}
/**
 * How large each of some things is drawn, from LEAST_SIZE to 1: a crowd becomes small, so that it does not hide what is below.
 * @param {Point[]} places
 * @param {number} pixels
 */
export function sizes_in_crowds(places, pixels) {
  const cell = 2 * pixels, counts = new Map()
  const cells = places.map(([across, down]) => Math.floor(across / cell) * 100_000 + Math.floor(down / cell))
  for (const each of cells) counts.set(each, (counts.get(each) ?? 0) + 1)
  return cells.map(each => Math.max(LEAST_SIZE, Math.min(1, Math.sqrt(ROOM_FOR / (counts.get(each) ?? 1)))))
}
/** Adds a marker to the path of a canvas. @param {CanvasRenderingContext2D} canvas @param {string | undefined} marker @param {Point} place @param {number} size */
export function add_marker(canvas, marker, [across, down], size) {
  const shape = SHAPES[marker ?? ""]
  if (!shape) {
    canvas.moveTo(across + size * VERTEX_SIZE / 2, down)
    canvas.arc(across, down, size * VERTEX_SIZE / 2, 0, 2 * Math.PI)
    return
  }
  shape.forEach(([x, y], row) => row ? canvas.lineTo(across + size * x, down + size * y) : canvas.moveTo(across + size * x, down + size * y))
  canvas.closePath()
}
export class Hull {
  vertices = NOTHING
  points = NOTHING
  outliers = NO_OUTLIERS
  /** The inner ones, as hulls. @type {Hull[]} */
  layers = []
  /** @type {Point[]} */
  corners = []
  /** On the globe. @type {Point[] | null} */
  outline = null
  /** Of keys. @type {Map<string, Point> | undefined} */
  places = undefined
  /** @param {string} name @param {Look} look */
  constructor(name, look) {
    this.name = name
    this.look = look
  }
  /** @param {HullMessage} message */
  take(message) {
    if (message.kind == "outliers") {
      this.outliers = message
      this.layers = message.layers.map(layer => {
        const hull = new Hull(this.name, this.look)
        hull.take({kind: "vertices", ...layer})
        return hull
      })
      return
    }
    this[message.kind] = message
    this.places = undefined
    if (message.kind == "vertices") {
      this.corners = message.x.map((x, row) => [x, message.y[row]])
      // Counterclockwise, but d3-geo wants the inside of rings on the globe at the right.
      this.outline = message.rings ? [...this.corners].reverse() : null
    }
  }
  get globe() {
    return this.vertices.rings != null
  }
  /** The polygons that the hull fills, each a list of rings. @param {import("./views.js").View} view @returns {Rings[]} */
  polygons(view) {
    if (!this.vertices.x.length) return []
    if (view.globe) return this.outline ? [[this.outline]] : []
    return (this.vertices.rings ?? [this.corners]).map(ring => [ring])
  }
  /** Where a key is, if it is drawn. @param {string} key @returns {Point | undefined} */
  place_of(key) {
    if (!this.places) {
      /** @type {Map<string, Point>} */
      const places = new Map()
      for (const {keys, x, y} of [this.points, this.vertices])
        keys?.forEach((each, row) => places.set(each, [x[row], y[row]]))
      this.places = places
    }
    return this.places.get(key)
  }
}
/** Of all functions that draw: the canvas in CSS pixels, and the picture. @param {CanvasRenderingContext2D} canvas @param {Picture} picture */
export function draw_surfaces(canvas, {view, hulls}) {
  for (const hull of hulls.values()) {
    canvas.beginPath()
    for (const rings of hull.polygons(view)) view.polygon(canvas, rings)
    canvas.fillStyle = canvas.strokeStyle = hull.look.colour
    canvas.globalAlpha = SURFACE_ALPHA
    canvas.fill()
    canvas.globalAlpha = 1
    canvas.lineWidth = 2
    canvas.setLineDash(hull.look.dash)
    canvas.stroke()
    canvas.setLineDash([])
  }
}
/** The deeper, the fainter. @param {CanvasRenderingContext2D} canvas @param {Picture} picture */
export function draw_layers(canvas, {view, hulls, outliers}) {
  if (!outliers) return
  canvas.lineWidth = 1
  for (const {layers, look} of hulls.values()) {
    canvas.strokeStyle = look.colour
    layers.forEach((layer, depth) => {
      canvas.beginPath()
      for (const rings of layer.polygons(view)) view.polygon(canvas, rings)
      canvas.globalAlpha = LAYER_ALPHA ** (depth + 1)
      canvas.stroke()
    })
  }
  canvas.globalAlpha = 1
}
/** @param {CanvasRenderingContext2D} canvas @param {Picture} picture */
export function draw_points(canvas, {view, hulls}) {
  canvas.globalAlpha = POINT_ALPHA
  for (const {points: {x, y}, look} of hulls.values()) {
    canvas.beginPath()
    const places = x.map((each, row) => view.place(each, y[row])), sizes = sizes_in_crowds(places, POINT_SIZE)
    places.forEach(([across, down], row) => {
      const size = POINT_SIZE * sizes[row]
      canvas.rect(across - size / 2, down - size / 2, size, size)
    })
    canvas.fillStyle = look.colour
    canvas.fill()
  }
  canvas.globalAlpha = 1
}
/** @param {CanvasRenderingContext2D} canvas @param {Picture} picture */
export function draw_vertices(canvas, {view, hulls}) {
  for (const {vertices: {x, y}, look} of hulls.values()) {
    canvas.beginPath()
    const places = x.map((each, row) => view.place(each, y[row])), sizes = sizes_in_crowds(places, VERTEX_SIZE)
    places.forEach((place, row) => isNaN(place[0]) || add_marker(canvas, look.marker, place, sizes[row]))
    canvas.fillStyle = look.colour
    canvas.fill()
  }
}
