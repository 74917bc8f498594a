// What the viewer's hands do with the picture: dragging, pinching, scrolling, keys, and pointing at things.
import { place_words } from "./picture.js"
/**
 * @typedef {import("./views.js").Point} Point
 * @typedef {{title: string, revision?: bigint | number}} Thing
 */
export const PAN_STEP = 60, ZOOM_STEP = 1.4, NEAR = 12, WHEEL_PIXELS = 300, CLICK_PIXELS = 4, TIP_GAP = 14
export class Hands {
  /** Where each pointer is. @type {Map<number, Point>} */
  pointers = new Map()
  moved = 0
  /** @param {import("./picture.js").Picture} picture @param {HTMLElement} tip @param {() => void} toggle_pause what the space bar does */
  constructor(picture, tip, toggle_pause) {
    this.picture = picture
    this.tip = tip
    const element = picture.element
    /** @type {Record<string, () => void>} */
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
    for (const type of /** @type {const} */ (["pointerup", "pointercancel"]))
      element.addEventListener(type, event => {
        this.pointers.delete(event.pointerId)
        if (type == "pointerup" && event.pointerType == "touch" && this.moved < CLICK_PIXELS) this.point(event)
      })
    element.addEventListener("pointermove", event => this.pointers.has(event.pointerId) ? this.drag(event) : this.point(event))
    element.addEventListener("pointerleave", () => this.tip.hidden = true)
  }
  /** Where the pointer is in the picture, which is drawn larger where the text is. @param {MouseEvent} event @returns {[number, number]} */
  at(event) {
    const {left, top} = this.picture.element.getBoundingClientRect(), {enlarged} = this.picture
    return [(event.clientX - left) / enlarged, (event.clientY - top) / enlarged]
  }
  /** @param {number} factor */
  zoom(factor) {
    this.picture.move(view => view.zoom(factor, view.rect.left + view.rect.width / 2, view.rect.top + view.rect.height / 2))
  }
  /** @param {PointerEvent} event */
  drag(event) {
    const now = this.at(event), before = this.pointers.get(event.pointerId) ?? now
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
  /** Shows what is under the pointer. @param {MouseEvent} event */
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
    const {element: {clientWidth, clientHeight}, enlarged} = this.picture, {offsetWidth, offsetHeight} = this.tip
    const beside = (/** @type {number} */ at, /** @type {number} */ size, /** @type {number} */ room) => `${Math.max(0, at + TIP_GAP + size > room ? at - TIP_GAP - size : at + TIP_GAP)}px`
    this.tip.style.left = beside(across * enlarged, offsetWidth, clientWidth)
    this.tip.style.top = beside(down * enlarged, offsetHeight, clientHeight)
  }
  /** @param {number} across @param {number} down */
  nearest(across, down) {
    const {view, hulls, fences, many} = this.picture
    /** @type {(Thing & {place: Point}) | undefined} */
    let best
    let least = NEAR
    /** @param {Point} place @param {() => Thing} about @param {number} advantage */
    const look = (place, about, advantage) => {
      const [right, low] = view.place(...place), away = Math.hypot(right - across, low - down) - advantage
      if (away >= least || isNaN(away)) return
      best = {...about(), place}
      least = away
    }
    for (const {name, points, vertices} of hulls.values())
      for (const {keys, x, y, revision, words, advantage} of [
        {...points, words: `a point of ${name}`, advantage: 0}, {...vertices, words: `a vertex of ${name}`, advantage: 4},
      ])
        for (let row = 0; row < x.length; row++)
          look([x[row], y[row]], () => ({title: keys ? `${keys[row]}: ${words}` : words, revision}), advantage)
    for (const {name, corners, vertices: {revision}} of many.near(this.picture, across, down, NEAR))
      for (const place of corners) look(place, () => ({title: `a vertex of ${name}`, revision}), 0)
    for (const fence of fences.values())
      for (const {key, place} of fence.marks(hulls)) look(place, () => ({title: `${key}: inside ${fence.name}`}), 5)
    return best
  }
}
/** @param {Point} one @param {Point} two */
export function distance(one, two) {
  return Math.hypot(one[0] - two[0], one[1] - two[1])
}
