// The fences in the picture: areas, margins, names, and the subjects inside.
/**
 * @typedef {import("./views.js").Point} Point
 * @typedef {import("./views.js").Ring} Ring
 * @typedef {import("./views.js").Rings} Rings
 * @typedef {import("./views.js").View} View
 * @typedef {import("./hulls.js").Hull} Hull
 * @typedef {import("./looks.js").Look} Look
 * @typedef {import("./picture.js").Picture} Picture
 *
 * @typedef {object} Area
 * @property {string[]} hulls that it is made of
 * @property {number} margin
 * @property {Rings[]} polygons of its own
 * @property {Rings[]} around with its margin
 * @property {boolean} globe
 *
 * @typedef {object} Inside the subjects inside, row by row
 * @property {readonly string[]} hull
 * @property {readonly string[]} key
 * @property {readonly number[]} x
 * @property {readonly number[]} y
 *
 * @typedef {(Area & {kind: "area"}) | (Inside & {kind: "inside"})} FenceMessage
 */
import { Boxes, FONT, is_inside, square_box, text_width } from "./boxes.js"
import { STAR_SIZE, add_marker, sizes_in_crowds } from "./hulls.js"
import { offset_hull_on_globe } from "./offset.js"
import { box_around, wound } from "./views.js"
export const ARC_STEPS = 96, NAME_FONT = `bold 13px ${FONT}`, NAME_HEIGHT = 18, NAME_GAP = 9, LONGEST_NAME = 28
export const AREA_ALPHA = 0.08, HALO_ALPHA = 0.25, HALO_WIDTH = 8, MARGIN_DASH = [3, 3], MARK_RADIUS = 6
/** @type {Area} */
export const NO_AREA = {hulls: [], margin: 0, polygons: [], around: [], globe: false}
/** @type {Inside} */
export const NOBODY = {hull: [], key: [], x: [], y: []}
export class Fence {
  area = NO_AREA
  inside = NOBODY
  /** Around the hull that it is, as that was. @type {{corners: Ring, margin: Rings[], globe: boolean} | undefined} */
  outer = undefined
  /** @param {string} name @param {Look} look */
  constructor(name, look) {
    this.name = name
    this.look = look
  }
  /** @param {FenceMessage} message */
  take(message) {
    if (message.kind == "inside") this.inside = message
    else if (!message.globe) this.area = message
    else this.area = {...message, polygons: message.polygons.map(wound), around: message.around.map(wound)}
  }
  /**
   * The polygons of the area, each a list of rings: its own, and those of hulls.
   * @param {View} view
   * @param {Map<string, Hull>} hulls
   * @returns {Rings[]}
   */
  polygons(view, hulls) {
    const own = view.globe == this.area.globe || !view.globe ? this.area.polygons : []
    return [...own, ...this.area.hulls.flatMap(name => hulls.get(name)?.polygons(view) ?? [])]
  }
  /** @param {View} view @param {Map<string, Hull>} hulls @returns {Rings[]} */
  margins(view, hulls) {
    const hull = this.area.margin ? hulls.get(this.area.hulls[0]) : undefined
    const own = view.globe == this.area.globe || !view.globe ? this.area.around : []
    if (!hull?.corners.length) return own
    if (this.outer?.corners != hull.corners) {
      const outer = hull.globe ? offset_hull_on_globe(hull.corners, this.area.margin).map(wound) : [[offset_outline(hull.corners, this.area.margin)]]
      this.outer = {corners: hull.corners, margin: outer, globe: hull.globe}
    }
    return this.outer.globe == view.globe ? [...own, ...this.outer.margin] : own
  }
  /**
   * The subjects inside: where the hulls draw them, which are newer than what the fence knows.
   * @param {Map<string, Hull>} hulls
   * @returns {{key: string, hull: string, place: Point}[]}
   */
  marks(hulls) {
    const {hull, key, x, y} = this.inside
    return key.map((text, row) => ({key: text, hull: hull[row], place: hulls.get(hull[row])?.place_of(text) ?? [x[row], y[row]]}))
  }
}
/** @param {CanvasRenderingContext2D} canvas @param {Picture} picture */
export function draw_fences(canvas, {view, hulls, fences}) {
  /** @param {Rings[]} polygons @param {number} width @param {number} alpha @param {number[]} dash */
  const stroke = (polygons, width, alpha, dash) => {
    canvas.beginPath()
    for (const rings of polygons) view.polygon(canvas, rings)
    canvas.globalAlpha = alpha
    canvas.lineWidth = width
    canvas.setLineDash(dash)
    canvas.stroke()
    canvas.globalAlpha = 1
    canvas.setLineDash([])
  }
  for (const fence of fences.values()) {
    canvas.strokeStyle = canvas.fillStyle = fence.look.colour
    const polygons = fence.polygons(view, hulls)
    // Below the hulls, some of which are the areas: their own lines stay visible in the middle of the halo.
    stroke(polygons, HALO_WIDTH, HALO_ALPHA, [])
    canvas.globalAlpha = AREA_ALPHA
    for (const rings of polygons) {  // one by one, for overlaps are no holes
      canvas.beginPath()
      view.polygon(canvas, rings)
      canvas.fill("evenodd")
    }
    stroke(polygons, 2, 1, fence.look.dash)
    stroke(fence.margins(view, hulls), 1, 0.8, MARGIN_DASH)
  }
}
/** @param {CanvasRenderingContext2D} canvas @param {Picture} picture */
export function draw_marks(canvas, {view, hulls, fences, colours}) {
  for (const fence of fences.values()) {
    const places = fence.marks(hulls).map(({place}) => view.place(...place)), sizes = sizes_in_crowds(places, STAR_SIZE)
    canvas.fillStyle = fence.look.colour
    canvas.strokeStyle = colours.paper
    canvas.lineWidth = 1
    for (const crowded of [true, false]) {  // edges of a crowd would be all that is seen
      canvas.beginPath()
      places.forEach((place, row) => isNaN(place[0]) || sizes[row] < 1 != crowded || add_marker(canvas, "star", place, sizes[row]))
      canvas.fill()
      if (!crowded) canvas.stroke()
    }
  }
}
/**
 * The name above or below each area, or in its middle: where there is room; else above or below, over points.
 * @param {CanvasRenderingContext2D} canvas
 * @param {Picture} picture
 */
export function draw_fence_names(canvas, {view, hulls, fences, taken, colours, rings}) {
  const names = new Boxes()
  for (const {across, down, radius, box} of rings) {
    names.add(square_box(across, down, radius))
    names.add(box)
  }
  canvas.font = NAME_FONT
  canvas.textAlign = "center"
  canvas.lineWidth = 3
  canvas.strokeStyle = colours.paper
  for (const fence of fences.values()) {
    const around = fence.margins(view, hulls)
    const places = (around.length ? around : fence.polygons(view, hulls)).flat(2).map(([x, y]) => view.place(x, y))
      .filter(([across]) => !isNaN(across))
    if (!places.length) continue
    const [left, top, right, low] = box_around(places), name = fence.name
    const label = name.length > LONGEST_NAME ? `…${name.slice(1 - LONGEST_NAME)}` : name
    const width = text_width(label, NAME_FONT), at = (/** @type {number} */ down) => places.find(place => place[1] == down)?.[0] ?? NaN
    const [above, below, middle] = [
      [at(top), top - NAME_GAP], [at(low), low + NAME_GAP + NAME_HEIGHT], [(left + right) / 2, (top + low + NAME_HEIGHT) / 2],
    ].map(([across, bottom]) => ({left: across - width / 2, right: across + width / 2, top: bottom - NAME_HEIGHT, bottom}))
    const fits = (/** @type {import("./boxes.js").Box} */ box) => is_inside(box, view.rect) && names.is_free(box)
    const box = [above, below, middle].find(each => fits(each) && taken.is_free(each)) ?? [above, below].find(fits)
    if (!box) continue
    taken.add(box)
    names.add(box)
    canvas.fillStyle = fence.look.colour
    canvas.strokeText(label, (box.left + box.right) / 2, box.bottom - 4)
    canvas.fillText(label, (box.left + box.right) / 2, box.bottom - 4)
  }
  canvas.textAlign = "left"
}
/**
 * The outline at a distance from a convex polygon whose vertices are counterclockwise.
 * @param {Ring} corners
 * @param {number} distance
 */
export function offset_outline(corners, distance) {
  /** @type {Ring} */
  const outline = []
  let at = corners.reduce((best, [x], row) => x > corners[best][0] ? row : best, 0)
  for (let step = 0; step < ARC_STEPS; step++) {
    const angle = 2 * Math.PI * step / ARC_STEPS, across = Math.cos(angle), up = Math.sin(angle)
    const height = (/** @type {number} */ row) => corners[row][0] * across + corners[row][1] * up
    for (let next = (at + 1) % corners.length; height(next) > height(at); next = (at + 1) % corners.length) at = next
    outline.push([corners[at][0] + distance * across, corners[at][1] + distance * up])
  }
  return outline
}
