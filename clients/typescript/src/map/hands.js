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
    /** @type {Record<string, (event: KeyboardEvent) => void>} */
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
      h: ({shiftKey}) => this.go_on(shiftKey ? -1 : 1),
      v: ({shiftKey}) => this.go_around(shiftKey ? -1 : 1),
      Escape: () => this.let_go(),
    }
    element.addEventListener("keydown", event => {
      const act = keys[event.key] ?? keys[event.key.toLowerCase()]
      if (event.ctrlKey || event.metaKey || event.altKey || !act) return
      event.preventDefault()
      act(event)
    })
    element.addEventListener("blur", () => this.let_go())
    picture.drawn = () => this.show_pointed()
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
    element.addEventListener("pointerleave", () => this.let_go())
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
    const [across, down] = this.at(event)
    this.picture.point_at()
    this.show(this.nearest(across, down), across, down)
  }
  /** What is pointed at, in words. @param {(Thing & {place: Point}) | undefined} thing @param {number} across @param {number} down */
  show(thing, across, down) {
    this.tip.hidden = !thing
    if (!thing) return
    const title = document.createElement("strong")
    title.textContent = thing.title
    const lines = [...place_words(thing.place, this.picture.view.globe), ...(thing.revision == undefined ? [] : [`revision ${thing.revision.toLocaleString("en")}`])]
    const said = [title, ...lines.map(line => {
      const element = document.createElement("div")
      element.textContent = line
      return element
    })]
    // Only what has changed is read aloud.
    if (said.map(({textContent}) => textContent).join() != [...this.tip.children].map(({textContent}) => textContent).join()) this.tip.replaceChildren(...said)
    const {element: {clientWidth, clientHeight}, enlarged} = this.picture, {offsetWidth, offsetHeight} = this.tip
    const beside = (/** @type {number} */ at, /** @type {number} */ size, /** @type {number} */ room) => `${Math.max(0, at + TIP_GAP + size > room ? at - TIP_GAP - size : at + TIP_GAP)}px`
    this.tip.style.left = beside(across * enlarged, offsetWidth, clientWidth)
    this.tip.style.top = beside(down * enlarged, offsetHeight, clientHeight)
  }
  // Points at nothing.
  let_go() {
    this.tip.hidden = true
    this.picture.point_at()
  }
  /** Points at the next hull of those in sight, or at the one before. @param {number} step */
  go_on(step) {
    const {picture} = this, {hulls, many, pointed} = picture
    const seen = new Set([...hulls.values(), ...many.hulls].filter(hull => rows_in_sight(hull, picture).length).map(({name}) => name))
    const names = [...seen], at = pointed ? names.indexOf(pointed.name) : step > 0 ? -1 : 0
    const hull = picture.find(names[(at + step + names.length) % names.length])
    if (hull) picture.point_at({name: hull.name, row: rows_in_sight(hull, picture)[0]})
    else this.let_go()
  }
  /** Points at the next vertex of this hull, or at the one before; the picture goes there. @param {number} step */
  go_around(step) {
    const {picture} = this, {pointed} = picture, hull = pointed && picture.find(pointed.name)
    if (!hull) return this.go_on(step)
    const count = hull.corners.length, {left, top, width, height} = picture.view.rect
    for (let tries = 1; tries <= count; tries++) {
      const row = (pointed.row + step * tries + tries * count) % count, [across, down] = picture.view.place(...hull.corners[row])
      if (isNaN(across)) continue  // on the other side of the globe
      if (!is_in(across, down, picture)) picture.move(view => view.pan(left + width / 2 - across, top + height / 2 - down))
      return picture.point_at({name: hull.name, row})
    }
  }
  // What keys point at, wherever it is by now.
  show_pointed() {
    const {picture} = this, {pointed} = picture, hull = pointed && picture.find(pointed.name)
    if (!pointed) return
    const place = picture.pointed_place(), [across, down] = place ? picture.view.place(...place) : [NaN, NaN]
    if (!hull || !place || !is_in(across, down, picture)) return void (this.tip.hidden = true)
    const key = hull.vertices.keys?.[pointed.row], words = `a vertex of ${hull.name}`
    this.show({title: key == undefined ? words : `${key}: ${words}`, revision: hull.vertices.revision, place}, across, down)
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
/** Which corners of a hull are in sight. @param {import("./hulls.js").Hull} hull @param {import("./picture.js").Picture} picture */
function rows_in_sight({corners}, picture) {
  return [...corners.keys()].filter(row => is_in(...picture.view.place(...corners[row]), picture))
}
/** @param {number} across @param {number} down @param {import("./picture.js").Picture} picture */
function is_in(across, down, {view: {rect: {left, top, width, height}}}) {
  return across >= left && across <= left + width && down >= top && down <= top + height
}
/** @param {Point} one @param {Point} two */
export function distance(one, two) {
  return Math.hypot(one[0] - two[0], one[1] - two[1])
}
