// @ts-nocheck
// What the viewer's hands do with the picture: dragging, pinching, scrolling, keys, and pointing at things.
import { place_words } from "./picture.js"
export const PAN_STEP = 60, ZOOM_STEP = 1.4, NEAR = 12, WHEEL_PIXELS = 300, CLICK_PIXELS = 4
export class Hands {
  // `toggle_pause` is what the space bar does.
  constructor(picture, tip, toggle_pause) {
    this.picture = picture
    this.tip = tip
    this.pointers = new Map()
    const element = picture.element
    const keys = {
      ArrowLeft: () => picture.move(view => view.pan(PAN_STEP, 0)),
      ArrowRight: () => picture.move(view => view.pan(-PAN_STEP, 0)),
      ArrowUp: () => picture.move(view => view.pan(0, PAN_STEP)),
      ArrowDown: () => picture.move(view => view.pan(0, -PAN_STEP)),
      "+": () => this.zoom(ZOOM_STEP),
      "=": () => this.zoom(ZOOM_STEP),
      "-": () => this.zoom(1 / ZOOM_STEP),
      0: () => picture.follow(),
      " ": toggle_pause,
    }
    element.addEventListener("keydown", event => {
      if (event.ctrlKey || event.metaKey || event.altKey || !keys[event.key]) return
      event.preventDefault()
      keys[event.key]()
    })
    element.addEventListener("wheel", event => {
      event.preventDefault()
      const pixels = event.deltaMode == WheelEvent.DOM_DELTA_PIXEL ? event.deltaY : 30 * event.deltaY
      picture.move(view => view.zoom(2 ** (-pixels / WHEEL_PIXELS), ...this.at(event)))
    }, {passive: false})
    element.addEventListener("dblclick", event => picture.move(view => view.zoom(ZOOM_STEP ** 2, ...this.at(event))))
    element.addEventListener("pointerdown", event => {
      if (event.button) return
      element.setPointerCapture(event.pointerId)
      this.pointers.set(event.pointerId, this.at(event))
      this.moved = 0
    })
    for (const type of ["pointerup", "pointercancel"])
      element.addEventListener(type, event => {
        this.pointers.delete(event.pointerId)
        if (type == "pointerup" && event.pointerType == "touch" && this.moved < CLICK_PIXELS) this.point(event)
      })
    element.addEventListener("pointermove", event => this.pointers.has(event.pointerId) ? this.drag(event) : this.point(event))
    element.addEventListener("pointerleave", () => this.tip.hidden = true)
  }
  at(event) {
    const {left, top} = this.picture.element.getBoundingClientRect()
    return [event.clientX - left, event.clientY - top]
  }
  zoom(factor) {
    this.picture.move(view => view.zoom(factor, view.rect.left + view.rect.width / 2, view.rect.top + view.rect.height / 2))
  }
  drag(event) {
    const before = this.pointers.get(event.pointerId), now = this.at(event)
    const other = [...this.pointers].find(([id]) => id != event.pointerId)?.[1]
    this.pointers.set(event.pointerId, now)
    this.moved += Math.hypot(now[0] - before[0], now[1] - before[1])
    if (this.moved < CLICK_PIXELS) return
    this.tip.hidden = true
    this.picture.move(view => {
      if (other) view.zoom(distance(now, other) / Math.max(1, distance(before, other)), ...other)
      else view.pan(now[0] - before[0], now[1] - before[1])
    })
  }
  // Shows what is under the pointer.
  point(event) {
    const [across, down] = this.at(event), thing = this.nearest(across, down)
    this.tip.hidden = !thing
    if (!thing) return
    const title = document.createElement("strong")
    title.textContent = thing.title
    const lines = [...place_words(thing.place, this.picture.view.globe), ...(thing.revision == undefined ? [] : [`revision ${thing.revision.toLocaleString("en")}`])]
    this.tip.replaceChildren(title, ...lines.map(line => {
      const element = document.createElement("div")
      element.textContent = line
      return element
    }))
    const {width, height} = this.picture, {offsetWidth, offsetHeight} = this.tip
    this.tip.style.left = `${Math.max(0, across + 14 + offsetWidth > width ? across - 14 - offsetWidth : across + 14)}px`
    this.tip.style.top = `${Math.max(0, down + 14 + offsetHeight > height ? down - 14 - offsetHeight : down + 14)}px`
  }
  nearest(across, down) {
    const {view, hulls, fences, many} = this.picture
    let best, least = NEAR
    const look = (place, thing, advantage) => {
      const [right, low] = view.place(...place), away = Math.hypot(right - across, low - down) - advantage
      if (away < least) [best, least] = [{...thing, place}, away]
    }
    for (const {name, points, vertices} of hulls.values())
      for (const [{keys, x, y, revision}, words, advantage] of [[points, `a point of ${name}`, 0], [vertices, `a vertex of ${name}`, 4]])
        for (let row = 0; row < x.length; row++)
          look([x[row], y[row]], {title: keys ? `${keys[row]}: ${words}` : words, revision}, advantage)
    for (const {name, corners, vertices: {revision}} of many.hulls)
      for (const place of corners) look(place, {title: `a vertex of ${name}`, revision}, 0)
    for (const fence of fences.values())
      for (const {key, place} of fence.marks(hulls)) look(place, {title: `${key}: inside ${fence.name}`}, 5)
    return best
  }
}
export function distance(one, two) {
  return Math.hypot(one[0] - two[0], one[1] - two[1])
}
