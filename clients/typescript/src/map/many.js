// All hulls of some prefixes: outlines alone, each prefix in one colour.
import { Crowd, LEAST_PIXELS } from "./crowd.js"
/**
 * @typedef {import("./views.js").Point} Point
 * @typedef {import("./hulls.js").Drawing} Drawing
 * @typedef {import("./looks.js").Look & {name: string}} NamedLook
 * @typedef {Drawing & {kind?: string, hull: string, within: string, gone?: boolean}} OutlineMessage
 */
import { Hull } from "./hulls.js"
import { box_around } from "./views.js"
export const MANY_ALPHA = 0.08, STRAIGHT_DEGREES = 1, MOST_FILLED = 1_000, FEW = 100
// What is drawn of one of many hulls, with the extreme corners alone for the extent of the picture.
export class Outline extends Hull {
  /** @type {import("./views.js").Extremes} */
  box = [0, 0, 0, 0]
  straight = false
  /** @param {import("./hulls.js").HullMessage} message */
  take(message) {
    super.take(message)
    const [left, low, right, high] = box_around(this.corners)
    this.box = [left, low, right, high]
    this.straight = Math.max(right - left, high - low) < STRAIGHT_DEGREES
  }
  /** @returns {Point[]} */
  get extremes() {
    const [left, low, right, high] = this.box
    return [[left, low], [right, low], [right, high], [left, high]]
  }
  /**
   * Adds it to a path: as a small box where its corners cannot be told apart.
   * @param {CanvasRenderingContext2D} canvas
   * @param {import("./views.js").View} view
   */
  trace(canvas, view) {
    const places = this.extremes.map(place => view.place(...place)), [across, down] = places[0]
    const size = Math.max(Math.abs(places[2][0] - across), Math.abs(places[2][1] - down))
    if (size < LEAST_PIXELS) canvas.rect(across - LEAST_PIXELS / 2, down - LEAST_PIXELS / 2, LEAST_PIXELS, LEAST_PIXELS)
    else if (view.globe && this.straight) {
      this.corners.forEach(([x, y], row) => row ? canvas.lineTo(...view.place(x, y)) : canvas.moveTo(...view.place(x, y)))
      canvas.closePath()
    } else for (const rings of this.polygons(view)) view.polygon(canvas, rings)
  }
}
export class Many {
  /** The look of each, and its hulls by name. @type {Map<string, {look: NamedLook, hulls: Map<string, Outline>}>} */
  prefixes = new Map()
  /** @param {() => void} changed called when there is more to be seen */
  constructor(changed) {
    this.crowd = new Crowd(changed)
  }
  get crowded() {
    return [...this.prefixes.values()].reduce((sum, {hulls}) => sum + hulls.size, 0) > MOST_FILLED
  }
  /** @param {string} name */
  find(name) {
    return [...this.prefixes.values()].map(({hulls}) => hulls.get(name)).find(hull => hull)
  }
  /**
   * The hulls that may be within some pixels of a place in the picture.
   * @param {import("./picture.js").Picture} picture @param {number} across @param {number} down @param {number} pixels
   */
  near(picture, across, down, pixels) {
    return this.crowded ? this.crowd.near(picture, across, down, pixels) : this.hulls
  }
  /** @param {NamedLook[]} looks */
  keep(looks) {
    for (const prefix of this.prefixes.keys()) if (!looks.some(({name}) => name == prefix)) this.prefixes.delete(prefix)
    for (const look of looks) {
      const known = this.prefixes.get(look.name) ?? {look, hulls: new Map()}
      known.look = look
      for (const hull of known.hulls.values()) hull.look = look
      this.prefixes.set(look.name, known)
    }
    this.crowd.forget()
  }
  /** @param {OutlineMessage} message */
  take({within, gone, ...message}) {
    const known = this.prefixes.get(within)
    if (!known) return
    this.crowd.dirty = true
    if (gone || !message.x.length) return void known.hulls.delete(message.hull)
    const outline = known.hulls.get(message.hull) ?? new Outline(message.hull, known.look)
    known.hulls.set(message.hull, outline)
    outline.take({...message, kind: "vertices"})
  }
  get hulls() {
    return [...this.prefixes.values()].flatMap(({hulls}) => [...hulls.values()])
  }
}
/**
 * Each by itself: one path of thousands takes seconds.
 * @param {CanvasRenderingContext2D} canvas
 * @param {import("./picture.js").Picture} picture
 */
export function draw_many(canvas, picture) {
  const {view, many} = picture
  if (many.crowded) return many.crowd.draw(canvas, picture)
  for (const {look, hulls} of many.prefixes.values()) {
    canvas.lineWidth = hulls.size > FEW ? 1 : 2
    canvas.fillStyle = canvas.strokeStyle = look.colour
    for (const hull of hulls.values()) {
      canvas.beginPath()
      hull.trace(canvas, view)
      canvas.globalAlpha = MANY_ALPHA
      canvas.fill()
      canvas.globalAlpha = 1
      canvas.stroke()
    }
  }
}
