// The names beside vertices, subjects of fences and points: as many as fit without overlap. Hovering shows the others.
/**
 * @typedef {import("./views.js").Point} Point
 * @typedef {import("./picture.js").Picture} Picture
 * @typedef {{text: string, id: string, boxes: import("./boxes.js").LabelBox[], colour: string, rank: number}} Name
 *
 * @typedef {object} PlacedRing
 * @property {number} across
 * @property {number} down
 * @property {import("./boxes.js").LabelBox} box
 * @property {string} colour
 * @property {string} text
 * @property {number} radius
 * @property {number[]} dash
 */
import { FOUND_LABEL_FONT, LABEL_FONT, LABEL_GAP, LABEL_HEIGHT, is_inside, label_box, square_box, text_width } from "./boxes.js"
import { AREA_ALPHA, MARGIN_DASH } from "./fences.js"
export const LABEL_OFFSET = 8, RING_RADIUS = 13, WIDE_RING_RADIUS = 17, RING_DASH = [5, 3]
export const MOST_HALOS = 100  // of more names, drawing takes too long
export class Labels {
  /** @type {Set<string>} */
  shown = new Set()
  all = false  // of points that are no vertices, too
  /** @param {CanvasRenderingContext2D} canvas @param {Picture} picture */
  draw(canvas, picture) {
    const {view, taken, colours} = picture
    // Names that are shown come first: otherwise they would come and go while the hull moves.
    const names = this.names(picture).sort((one, two) => Number(this.shown.has(two.id)) - Number(this.shown.has(one.id)) || one.rank - two.rank)
    this.shown.clear()
    canvas.font = LABEL_FONT
    canvas.lineWidth = 3
    canvas.strokeStyle = colours.paper
    /** @type {[string, number, number, string][]} */
    const placed = []
    for (const {text, id, boxes, colour} of names) {
      if (this.shown.has(id)) continue  // a vertex, and a subject inside
      const box = boxes.find(each => is_inside(each, view.rect) && taken.is_free(each))
      if (!box) continue
      taken.add(box)
      this.shown.add(id)
      placed.push([text, box.left + LABEL_GAP, box.bottom - 3, colour])
    }
    placed.sort((one, two) => one[3] < two[3] ? -1 : one[3] > two[3] ? 1 : 0)
    for (const [text, across, down, colour] of placed) {
      if (placed.length <= MOST_HALOS) canvas.strokeText(text, across, down)
      if (canvas.fillStyle != colour) canvas.fillStyle = colour
      canvas.fillText(text, across, down)
    }
  }
  /** The names, and the boxes that each can have: first towards the middle of the picture. @param {Picture} picture */
  names({view, hulls, fences}) {
    /** @type {Name[]} */
    const found = []
    const {left, width, top, height} = view.rect, middle = left + width / 2
    /** @param {string} text @param {string} hull @param {Point} place @param {string} colour @param {number} rank */
    const add = (text, hull, [x, y], colour, rank) => {
      const [across, down] = view.place(x, y)
      if (!(across >= left && across <= left + width && down >= top && down <= top + height)) return
      const wide = text_width(text, LABEL_FONT), bottom = down - LABEL_OFFSET + 2
      const boxes = [label_box(across, bottom, wide, "left"), label_box(across, bottom, wide, "right")]
      found.push({text, id: `${text} of ${hull}`, boxes: across > middle ? boxes.reverse() : boxes, colour, rank})
    }
    for (const fence of fences.values())
      for (const {key, hull, place} of fence.marks(hulls)) add(key, hull, place, fence.look.colour.toLowerCase(), 0)
    for (const {name, look, vertices, points} of hulls.values())
      for (const {keys, x, y, rank} of [{...vertices, rank: 1}, ...(this.all ? [{...points, rank: 2}] : [])])
        keys?.forEach((key, row) => add(key, name, [x[row], y[row]], look.colour.toLowerCase(), rank))
    return found
  }
}
/**
 * The rings around the key that the viewer looks for and around the most influential vertices, and their names: where they
 * are, before other text takes the room.
 * @param {Picture} picture
 * @returns {PlacedRing[]}
 */
export function place_rings(picture) {
  const {view, sought, taken, hulls, outliers} = picture, found = sought ? picture.found() : []
  const stretching = outliers ? [...hulls.values()] : []
  const ringed = [
    ...found.map(({place, colour}) => ({place, colour, text: sought, radius: RING_RADIUS, dash: [], below: false})),
    ...stretching.flatMap(({outliers: {vertex, label}, look: {colour}}) =>
      vertex ? [{place: vertex, colour, text: label, radius: WIDE_RING_RADIUS, dash: RING_DASH, below: true}] : []),
  ]
  return ringed.flatMap(({place, below, ...ring}) => {
    const [across, down] = view.place(...place)
    if (isNaN(across)) return []
    const side = across > view.rect.left + view.rect.width / 2 ? "right" : "left"
    const bottom = below ? down + ring.radius + 3 + LABEL_HEIGHT : down - ring.radius - 3
    const box = label_box(across, bottom, text_width(ring.text, FOUND_LABEL_FONT), side)
    taken.add(box)
    taken.add(square_box(across, down, ring.radius))
    return [{across, down, box, ...ring}]
  })
}
/** Where the key that the viewer looks for may really be. @param {CanvasRenderingContext2D} canvas @param {Picture} picture */
export function draw_accuracy(canvas, picture) {
  if (!picture.sought) return
  for (const {colour, disk} of picture.found()) {
    if (!disk?.length) continue
    canvas.beginPath()
    picture.view.polygon(canvas, [disk])
    canvas.fillStyle = canvas.strokeStyle = colour
    canvas.globalAlpha = AREA_ALPHA
    canvas.fill("evenodd")
    canvas.globalAlpha = 1
    canvas.lineWidth = 1
    canvas.setLineDash(MARGIN_DASH)
    canvas.stroke()
    canvas.setLineDash([])
  }
}
/** @param {CanvasRenderingContext2D} canvas @param {Picture} picture */
export function draw_rings(canvas, {rings, colours}) {
  canvas.font = FOUND_LABEL_FONT
  for (const {across, down, colour, text, radius, dash, box: {left, top, right, bottom}} of rings) {
    for (const {style, width} of [{style: colours.paper, width: 7}, {style: colour, width: 3}]) {
      canvas.beginPath()
      canvas.arc(across, down, radius, 0, 2 * Math.PI)
      canvas.strokeStyle = style
      canvas.lineWidth = width
      canvas.setLineDash(style == colour ? dash : [])
      canvas.stroke()
    }
    canvas.setLineDash([])
    canvas.fillStyle = colours.paper
    canvas.lineWidth = 1
    canvas.fillRect(left, top, right - left, LABEL_HEIGHT)
    canvas.strokeRect(left, top, right - left, LABEL_HEIGHT)
    canvas.fillStyle = colours.ink
    canvas.fillText(text, left + LABEL_GAP, bottom - 4)
  }
}
