// Thousands of outlines: painted in pieces into a picture of their own, which is shown until the next one is ready. So nobody waits
// who points at something, and a hull that moves costs no more than its share.
import { context_of, square_box } from "./boxes.js"
/**
 * @typedef {import("./boxes.js").Box} Box
 * @typedef {import("./many.js").Outline} Outline
 * @typedef {import("./picture.js").Picture} Picture
 * @typedef {import("./views.js").View} View
 *
 * @typedef {object} Painting of all hulls of a crowd
 * @property {string} where the view that it is of
 * @property {HTMLCanvasElement} canvas
 * @property {Map<number, Outline[]>} cells where each hull is
 * @property {Outline[]} large those that are in too many cells
 * @property {boolean} globe
 * @property {[number, number]} middle
 * @property {[number, number]} at_middle where that is in the picture
 * @property {number[]} unit
 * @property {number} at when it was done
 */
export const SLICE_MILLISECONDS = 12, FRESH_MILLISECONDS = 1000, CROWD_ALPHA = 0.6, LEAST_PIXELS = 3
// An outline of that many pixels has one corner more; one that is larger is drawn along great circles.
export const PIXELS_A_CORNER = 4, FEWEST_CORNERS = 4, LARGE_PIXELS = 200
export const CELL_PIXELS = 48, MOST_CELLS = 100
export class Crowd {
  /** What is shown. @type {Painting | undefined} */
  front = undefined
  /** What is being painted. @type {Painting | undefined} */
  job = undefined
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  later = undefined
  dirty = true
  /** @param {() => void} changed called when another picture is ready */
  constructor(changed) {
    this.changed = changed
  }
  // What is shown has other colours, or is not shown any more.
  forget() {
    this.front = this.job = undefined
    this.dirty = true
  }
  /** @param {CanvasRenderingContext2D} canvas @param {Picture} picture */
  draw(canvas, picture) {
    const where = place_of(picture), moved = (this.job ?? this.front)?.where != where
    if (moved) this.job = undefined
    // While the viewer moves it, what there is moves along.
    const rest = this.front ? this.front.at + FRESH_MILLISECONDS - performance.now() : 0
    if (!picture.moving && (moved || !this.job && this.dirty && rest <= 0)) this.begin(picture, where)
    else if (this.dirty && !this.job) this.later ??= setTimeout(() => {
      this.later = undefined
      this.changed()
    }, Math.max(rest, FRESH_MILLISECONDS / 10))
    const {front} = this, {view, width, height} = picture
    if (!front || front.globe != view.globe) return
    const [across, down] = view.place(...front.middle)
    const [wide, high] = unit_of(view).map((each, axis) => each / front.unit[axis])
    if (isNaN(across)) return
    canvas.drawImage(front.canvas, across - wide * front.at_middle[0], down - high * front.at_middle[1], wide * width, high * height)
  }
  /** @param {Picture} picture @param {string} where */
  begin(picture, where) {
    const {view, canvases: [{width, height}]} = picture, canvas = Object.assign(document.createElement("canvas"), {width, height})
    const [x, y] = view.middle
    /** @type {Painting} */
    const job = {where, canvas, cells: new Map(), large: [], globe: view.globe, middle: [x, y], at_middle: view.place(x, y), unit: unit_of(view), at: 0}
    this.dirty = false
    this.job = job
    this.go_on(job, paint(job, picture))
  }
  /** @param {Painting} job @param {Generator<void>} painting */
  go_on(job, painting) {
    if (this.job != job) return
    const until = performance.now() + SLICE_MILLISECONDS
    while (performance.now() < until)
      if (painting.next().done) {
        this.front = Object.assign(job, {at: performance.now()})
        this.job = undefined
        return this.changed()
      }
    setTimeout(() => this.go_on(job, painting))
  }
  /** The hulls that may be within some pixels of a place. @param {Picture} picture @param {number} across @param {number} down @param {number} pixels */
  near(picture, across, down, pixels) {
    const {front} = this
    if (!front || front.where != place_of(picture)) return []
    return [...new Set([...cells_of(square_box(across, down, pixels))].flatMap(cell => front.cells.get(cell) ?? []).concat(front.large))]
  }
}
/** Pixels in a unit of each axis. @param {View} view @returns {number[]} */
function unit_of(view) {
  return "unit" in view ? [...view.unit] : [view.scale, view.scale]
}
/** Another text for each view. @param {Picture} picture */
function place_of({view, width, height, ratio}) {
  return String([view.globe, view.middle, unit_of(view), width, height, ratio])
}
/** @param {Box} box @returns {Generator<number>} */
function* cells_of({left, top, right, bottom}) {
  for (let column = Math.floor(left / CELL_PIXELS); column * CELL_PIXELS <= right; column++)
    for (let row = Math.floor(top / CELL_PIXELS); row * CELL_PIXELS <= bottom; row++) yield column * 100_000 + row
}
/** Paints hull by hull, and notes where each is. @param {Painting} job @param {Picture} picture @returns {Generator<void>} */
function* paint(job, picture) {
  const {view, many, ratio} = picture, canvas = context_of(job.canvas)
  canvas.setTransform(ratio, 0, 0, ratio, 0, 0)
  canvas.lineJoin = "round"
  canvas.lineWidth = 1
  canvas.globalAlpha = CROWD_ALPHA
  for (const {look, hulls} of [...many.prefixes.values()]) {
    canvas.strokeStyle = canvas.fillStyle = look.colour
    for (const hull of [...hulls.values()]) {
      const box = box_of(hull, view)
      if (box) {
        paint_hull(canvas, hull, view, box)
        note(job, hull, box)
      }
      yield
    }
  }
}
/** Where a hull is in the picture; undefined where it is not to be seen. @param {Outline} hull @param {View} view @returns {Box | undefined} */
function box_of(hull, view) {
  let [left, top, right, bottom] = [Infinity, Infinity, -Infinity, -Infinity]
  for (const place of hull.extremes) {
    const [across, down] = view.place(...place)
    if (isNaN(across)) continue
    left = Math.min(left, across)
    right = Math.max(right, across)
    top = Math.min(top, down)
    bottom = Math.max(bottom, down)
  }
  const {rect} = view
  return right >= rect.left && left <= rect.left + rect.width && bottom >= rect.top && top <= rect.top + rect.height ? {left, top, right, bottom} : undefined
}
/** @param {CanvasRenderingContext2D} canvas @param {Outline} hull @param {View} view @param {Box} box */
function paint_hull(canvas, hull, view, {left, top, right, bottom}) {
  const pixels = Math.max(right - left, bottom - top)
  if (pixels < LEAST_PIXELS) return canvas.fillRect(left - LEAST_PIXELS / 2, top - LEAST_PIXELS / 2, LEAST_PIXELS, LEAST_PIXELS)
  canvas.beginPath()
  if (pixels > LARGE_PIXELS) for (const rings of hull.polygons(view)) view.polygon(canvas, rings)
  else {
    const {corners} = hull, step = Math.ceil(corners.length / Math.max(FEWEST_CORNERS, pixels / PIXELS_A_CORNER))
    for (let row = 0; row < corners.length; row += step) {
      const [across, down] = view.place(...corners[row])
      if (row) canvas.lineTo(across, down)
      else canvas.moveTo(across, down)
    }
    canvas.closePath()
  }
  canvas.stroke()
}
/** @param {Painting} job @param {Outline} hull @param {Box} box */
function note(job, hull, box) {
  const cells = (2 + (box.right - box.left) / CELL_PIXELS) * (2 + (box.bottom - box.top) / CELL_PIXELS)
  if (cells > MOST_CELLS) return job.large.push(hull)
  for (const cell of cells_of(box)) {
    const there = job.cells.get(cell)
    if (there) there.push(hull)
    else job.cells.set(cell, [hull])
  }
}
