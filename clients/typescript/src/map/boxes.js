// Room for text: boxes that do not overlap.
/**
 * @typedef {{left: number, right: number, top: number, bottom: number}} Box
 * @typedef {Box & {side: "left" | "right"}} LabelBox on which side of its place the text is
 */
export const LABEL_HEIGHT = 15, LABEL_GAP = 3, CELL_WIDTH = 96, CELL_HEIGHT = 32
export const FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Noto Sans', sans-serif"
export const LABEL_FONT = `12px ${FONT}`, FOUND_LABEL_FONT = `bold ${LABEL_FONT}`
export const MOST_WIDTHS = 20_000
export const ruler = context_of(document.createElement("canvas"))
/** Of texts in fonts. @type {Map<string, number>} */
export const widths = new Map()
/** @param {HTMLCanvasElement} canvas @returns {CanvasRenderingContext2D} */
export function context_of(canvas) {
  const context = canvas.getContext("2d")
  if (!context) throw new Error("the browser draws on no more canvases")
  return context
}
/** @param {string} text @param {string} font @returns {number} */
export function text_width(text, font) {
  const id = font + text
  let width = widths.get(id)
  if (width == undefined) {
    if (widths.size >= MOST_WIDTHS) widths.clear()
    ruler.font = font
    widths.set(id, width = ruler.measureText(text).width)
  }
  return width
}
/**
 * The box of a text whose left or right end is at x.
 * @param {number} x
 * @param {number} bottom
 * @param {number} width
 * @param {"left" | "right"} side
 * @returns {LabelBox}
 */
export function label_box(x, bottom, width, side) {
  const left = side == "left" ? x : x - width
  return {left: left - LABEL_GAP, right: left + width + LABEL_GAP, top: bottom - LABEL_HEIGHT, bottom, side}
}
/** @param {number} across @param {number} down @param {number} radius @returns {Box} */
export function square_box(across, down, radius) {
  return {left: across - radius, right: across + radius, top: down - radius, bottom: down + radius}
}
/** @param {Box} box @param {import("./views.js").Rect} rect */
export function is_inside(box, {left, top, width, height}) {
  return box.left >= left && box.right <= left + width && box.top >= top && box.bottom <= top + height
}
export class Boxes {
  /** @type {Map<number, Box[]>} */
  cells = new Map()
  /** @param {Box} box */
  add(box) {
    for (const cell of this.around(box)) {
      const boxes = this.cells.get(cell)
      if (boxes) boxes.push(box)
      else this.cells.set(cell, [box])
    }
  }
  /** @param {Box} box */
  is_free(box) {
    for (const cell of this.around(box))
      for (const other of this.cells.get(cell) ?? [])
        if (box.left < other.right && other.left < box.right && box.top < other.bottom && other.top < box.bottom) return false
    return true
  }
  /** The cells that a box lies in. @param {Box} box @returns {Generator<number>} */
  *around({left, right, top, bottom}) {
    for (let across = Math.floor(left / CELL_WIDTH); across * CELL_WIDTH <= right; across++)
      for (let down = Math.floor(top / CELL_HEIGHT); down * CELL_HEIGHT <= bottom; down++) yield across * 10_000 + down
  }
}
