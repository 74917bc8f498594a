// Hulls for which an alarm is raised: a thick line around each, a frame around what is too small to be seen from far, and its name.
import { FONT, is_inside, text_width } from "./boxes.js"
import { box_around } from "./views.js"
/**
 * @typedef {import("./hulls.js").Hull} Hull
 * @typedef {import("./picture.js").Picture} Picture
 * @typedef {{hull: Hull, left: number, top: number, right: number, low: number, gap: number}} Frame where a hull is, and the room around it
 */
export const ALARM_FONT = `bold 16px ${FONT}`, ALARM_HEIGHT = 24, ALARM_GAP = 6, FRAME_PIXELS = 14, SMALL_PIXELS = 60
/** @param {CanvasRenderingContext2D} canvas @param {Picture} picture */
export function draw_alarmed(canvas, picture) {
  const {alarmed, colours, view} = picture
  canvas.lineWidth = 4
  canvas.strokeStyle = colours.alarm
  const seen = alarmed.flatMap(name => frames_of(picture.find(name), view))
  for (const {hull, left, top, right, low, gap} of seen) {
    canvas.beginPath()
    for (const rings of hull.polygons(view)) view.polygon(canvas, rings)
    if (gap) canvas.rect(left - gap, top - gap, right - left + 2 * gap, low - top + 2 * gap)
    canvas.stroke()
  }
  canvas.font = ALARM_FONT
  for (const frame of seen) draw_name(canvas, frame, picture)  // over all lines
}
/** The frame of a hull; none where it is not to be seen. @param {Hull | undefined} hull @param {import("./views.js").View} view @returns {Frame[]} */
function frames_of(hull, view) {
  const places = (hull?.corners ?? []).map(([x, y]) => view.place(x, y)).filter(([across]) => !isNaN(across))
  if (!hull || !places.length) return []
  const [left, top, right, low] = box_around(places)
  return [{hull, left, top, right, low, gap: Math.max(right - left, low - top) < SMALL_PIXELS ? FRAME_PIXELS : 0}]
}
/** @param {CanvasRenderingContext2D} canvas @param {Frame} frame @param {Picture} picture */
function draw_name(canvas, {hull: {name}, left, top, right, low, gap}, {view, taken, colours}) {
  const text = `▲ ${name}`, wide = text_width(text, ALARM_FONT) + 2 * ALARM_GAP, begin = (left + right - wide) / 2
  const boxes = [top - gap - ALARM_GAP - ALARM_HEIGHT, low + gap + ALARM_GAP].map(down =>
    ({left: begin, right: begin + wide, top: down, bottom: down + ALARM_HEIGHT}))
  const box = boxes.find(each => is_inside(each, view.rect) && taken.is_free(each))
  if (!box) return
  taken.add(box)
  canvas.fillStyle = colours.alarm
  canvas.fillRect(box.left, box.top, wide, ALARM_HEIGHT)
  canvas.fillStyle = colours["alarm-ink"]
  canvas.fillText(text, box.left + ALARM_GAP, box.bottom - ALARM_GAP)
}
