// Hulls for which an alarm is raised: a thick line around each, in a frame that is seen from far however small it is, with its name.
import { FONT, is_inside, text_width } from "./boxes.js"
import { box_around } from "./views.js"
export const ALARM_FONT = `bold 16px ${FONT}`, ALARM_HEIGHT = 24, ALARM_GAP = 6, FRAME_PIXELS = 14
/** @param {CanvasRenderingContext2D} canvas @param {import("./picture.js").Picture} picture */
export function draw_alarmed(canvas, {view, hulls, many, alarmed, colours, taken}) {
  canvas.font = ALARM_FONT
  canvas.lineWidth = 4
  for (const name of alarmed) {
    const hull = hulls.get(name) ?? many.find(name)
    const places = (hull?.corners ?? []).map(([x, y]) => view.place(x, y)).filter(([across]) => !isNaN(across))
    if (!hull || !places.length) continue
    canvas.strokeStyle = canvas.fillStyle = colours.alarm
    canvas.beginPath()
    for (const rings of hull.polygons(view)) view.polygon(canvas, rings)
    canvas.stroke()
    const [left, top, right, low] = box_around(places)
    canvas.strokeRect(left - FRAME_PIXELS, top - FRAME_PIXELS, right - left + 2 * FRAME_PIXELS, low - top + 2 * FRAME_PIXELS)
    const text = `▲ ${name}`, wide = text_width(text, ALARM_FONT) + 2 * ALARM_GAP, begin = (left + right - wide) / 2
    const boxes = [top - FRAME_PIXELS - ALARM_HEIGHT, low + FRAME_PIXELS].map(down => ({left: begin, right: begin + wide, top: down, bottom: down + ALARM_HEIGHT}))
    const box = boxes.find(each => is_inside(each, view.rect) && taken.is_free(each))
    if (!box) continue
    taken.add(box)
    canvas.fillRect(box.left, box.top, wide, ALARM_HEIGHT)
    canvas.fillStyle = colours["alarm-ink"]
    canvas.fillText(text, box.left + ALARM_GAP, box.bottom - ALARM_GAP)
  }
}
