// All hulls of some prefixes: outlines alone, each prefix in one colour.
/**
 * @typedef {import("./views.js").Point} Point
 * @typedef {import("./hulls.js").Drawing} Drawing
 * @typedef {import("./looks.js").Look & {name: string}} NamedLook
 * @typedef {Drawing & {kind?: string, hull: string, within: string, gone?: boolean}} OutlineMessage
 */
import { Hull } from "./hulls.js"
import { box_around } from "./views.js"
export const MANY_ALPHA = 0.08, STRAIGHT_DEGREES = 1, LEAST_PIXELS = 3, MOST_FILLED = 2_000, CROWD_ALPHA = 0.5
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
  /** @param {NamedLook[]} looks */
  keep(looks) {
    for (const prefix of this.prefixes.keys()) if (!looks.some(({name}) => name == prefix)) this.prefixes.delete(prefix)
    for (const look of looks) {
      const known = this.prefixes.get(look.name) ?? {look, hulls: new Map()}
      known.look = look
      for (const hull of known.hulls.values()) hull.look = look
      this.prefixes.set(look.name, known)
    }
  }
  /** @param {OutlineMessage} message */
  take({within, gone, ...message}) {
    const known = this.prefixes.get(within)
    if (!known) return
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
 * Each by itself: one path of thousands takes seconds. Of a crowd the lines are enough, through which others can be seen.
 * @param {CanvasRenderingContext2D} canvas
 * @param {import("./picture.js").Picture} picture
 */
export function draw_many(canvas, {view, many}) {
  canvas.lineWidth = 1
  for (const {look, hulls} of many.prefixes.values()) {
    const crowded = hulls.size > MOST_FILLED, line_alpha = crowded ? CROWD_ALPHA : 1
    canvas.fillStyle = canvas.strokeStyle = look.colour
    for (const hull of hulls.values()) {
      canvas.beginPath()
      hull.trace(canvas, view)
      if (!crowded) {
        canvas.globalAlpha = MANY_ALPHA
        canvas.fill()
      }
      canvas.globalAlpha = line_alpha
      canvas.stroke()
    }
  }
  canvas.globalAlpha = 1
}
/**
 * What a message about many hulls says of each, as messages that are kept one by one; `known` are those there were.
 * @param {{prefix: string, whole: boolean, hulls: (Drawing & {hull: string})[]}} message
 * @param {Iterable<string>} known
 * @returns {Generator<OutlineMessage>}
 */
export function* told_apart({prefix, whole, hulls}, known) {
  const names = new Set(hulls.map(({hull}) => hull))
  for (const hull of whole ? known : []) if (!names.has(hull)) yield {kind: "outline", within: prefix, hull, revision: 0, x: [], y: [], rings: null, gone: true}
  for (const each of hulls) yield {kind: "outline", within: prefix, ...each}
}
