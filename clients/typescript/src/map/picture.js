// The picture: two canvases, one for the ground (coasts or axes), one for what moves, and the order in which things are
// drawn. A new layer is a function of the canvas and the picture, in its place in LAYERS.
import * as d3 from "d3-geo"
import { draw_alarmed } from "./alarmed.js"
import { Boxes, FONT, context_of, square_box } from "./boxes.js"
import { Coasts } from "./coasts.js"
import { Fence, MARK_RADIUS, draw_fence_names, draw_fences, draw_marks } from "./fences.js"
import { Hull, draw_layers, draw_points, draw_surfaces, draw_vertices } from "./hulls.js"
import { Labels, draw_accuracy, draw_rings, place_rings } from "./labels.js"
import { Many, Outline, draw_many } from "./many.js"
import { Tiles } from "./tiles.js"
import { Trails } from "./trails.js"
import { EARTH_RADIUS, GlobeView, PlaneView, RADIAN } from "./views.js"
/**
 * @typedef {import("./views.js").Point} Point
 * @typedef {import("./views.js").View} View
 * @typedef {import("./many.js").NamedLook} NamedLook
 * @typedef {import("./hulls.js").HullMessage & {hull: string, fence?: undefined, within?: undefined}} MessageOfHull
 * @typedef {import("./fences.js").FenceMessage & {fence: string, within?: undefined}} MessageOfFence
 * @typedef {import("./many.js").OutlineMessage & {fence?: undefined}} MessageOfOutline
 * @typedef {MessageOfHull | MessageOfFence | MessageOfOutline} Message
 * @typedef {{place: Point, colour: string, disk?: Point[] | null, hull?: Hull}} Found
 *
 * @typedef {object} PictureOptions
 * @property {string} x_unit
 * @property {string} y_unit their being equal says that x and y have one scale
 * @property {{url: string, largest_zoom: number, attribution: string}} tiles
 * @property {string | null} [coasts] the folder of the coasts
 */
/** @type {((canvas: CanvasRenderingContext2D, picture: Picture) => void)[]} */
export const LAYERS = [draw_fences, draw_many, draw_surfaces, draw_layers, draw_trails, draw_points, draw_vertices, draw_marks, draw_alarmed, draw_fence_names, draw_names,
  draw_accuracy, draw_rings, draw_pointed]
export const AXIS_LEFT = 58, AXIS_BOTTOM = 40, EDGE = 8, MOST_RATIO = 2, TICK_PIXELS = 90, FONT_OF_AXES = `12px ${FONT}`
export const POINTED_RADIUS = 10
export const FONT_PIXELS = 14  // of the text around a picture that is drawn at its own size
export const GRID_STEPS = [30, 15, 10, 5, 2, 1, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01], SCALE_BAR_PIXELS = 130, REST_MILLISECONDS = 200, FIT_MILLISECONDS = 1000
/** @param {CanvasRenderingContext2D} canvas @param {Picture} picture */
export function draw_trails(canvas, picture) {
  picture.trails.draw(canvas, picture)
}
/** @param {CanvasRenderingContext2D} canvas @param {Picture} picture */
export function draw_names(canvas, picture) {
  picture.labels.draw(canvas, picture)
}
/** A ring around the vertex that the viewer's keys point at. @param {CanvasRenderingContext2D} canvas @param {Picture} picture */
export function draw_pointed(canvas, picture) {
  const place = picture.pointed_place(), [across, down] = place ? picture.view.place(...place) : [NaN, NaN]
  if (isNaN(across)) return
  for (const {style, width} of [{style: picture.colours.paper, width: 6}, {style: picture.colours.focus, width: 3}]) {
    canvas.beginPath()
    canvas.arc(across, down, POINTED_RADIUS, 0, 2 * Math.PI)
    canvas.strokeStyle = style
    canvas.lineWidth = width
    canvas.stroke()
  }
}
export class Picture {
  /** The extent to begin with. @type {number[] | undefined} */
  wanted = undefined
  /** Called with the extent, or with none where all is shown. @type {(extent?: number[]) => void} */
  moved_to = () => {}
  /** Where the key is that the viewer looks for: x, y, a colour, and where it may really be. @type {[number, number, string, (Point[] | null)?][]} */
  places = []
  /** Hulls for which an alarm is raised. @type {string[]} */
  alarmed = []
  /** A vertex that keys point at. @type {{name: string, row: number} | undefined} */
  pointed = undefined
  /** Called when it has been drawn. */
  drawn = () => {}
  /** How much larger it is drawn than beside text of FONT_PIXELS. */
  enlarged = 1
  /** When the view was last fitted to what is shown. */
  fitted = 0
  /** Of the page. @type {Record<string, string>} */
  colours = {}
  /** @type {import("./labels.js").PlacedRing[]} */
  rings = []
  taken = new Boxes()
  /** The next frame. @type {number | undefined} */
  awaited = undefined
  /** Until nothing has moved for a moment. @type {ReturnType<typeof setTimeout> | undefined} */
  resting = undefined
  width = 0
  height = 0
  ratio = 1
  ground_drawn = false
  /** @param {HTMLElement} element @param {PictureOptions} options */
  constructor(element, {x_unit, y_unit, tiles, coasts}) {
    this.element = element
    this.units = {x: x_unit, y: y_unit}
    this.canvases = [...element.querySelectorAll("canvas")]
    this.plane = new PlaneView(x_unit == y_unit)
    this.on_globe = new GlobeView()
    /** @type {View} */
    this.view = this.plane
    /** @type {Map<string, Hull>} */
    this.hulls = new Map()
    this.many = new Many(() => this.draw_soon())
    /** @type {Map<string, Fence>} */
    this.fences = new Map()
    this.labels = new Labels()
    this.trails = new Trails()
    this.coasts = new Coasts(coasts, () => this.draw_all())
    this.tiles = new Tiles(tiles, () => {
      const attribution = element.querySelector(".attribution")
      if (attribution) attribution.textContent = this.tiles.failed ? `No map from ${new URL(tiles.url).host}` : tiles.attribution
      this.draw_all()
    })
    this.following = true  // until the viewer moves the picture
    this.moving = false
    this.live = true  // or as it was before
    this.outliers = false
    this.sought = ""
    this.now = Date.now
    this.frames = 0
    new ResizeObserver(() => this.resize()).observe(element)
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw_all())
    this.resize()
  }
  resize() {
    const {clientWidth, clientHeight} = this.element, pixels = Math.min(MOST_RATIO, devicePixelRatio)
    this.enlarged = parseFloat(getComputedStyle(this.element).fontSize) / FONT_PIXELS
    const [width, height] = [clientWidth, clientHeight].map(each => each / this.enlarged)
    this.width = width
    this.height = height
    this.ratio = pixels * this.enlarged
    for (const canvas of this.canvases) {
      canvas.width = clientWidth * pixels
      canvas.height = clientHeight * pixels
    }
    const size = (/** @type {number} */ left, /** @type {number} */ bottom, /** @type {number} */ edge) => ({left, top: edge, width: Math.max(1, width - left - edge), height: Math.max(1, height - edge - bottom)})
    this.plane.resize(size(AXIS_LEFT, AXIS_BOTTOM, EDGE))
    this.on_globe.resize(size(0, 0, 0))
    this.ground_drawn = false
    this.draw()  // at once: an empty canvas would be seen
  }
  /** What is on the page: names and looks. @param {NamedLook[]} hulls @param {NamedLook[]} fences @param {NamedLook[]} prefixes */
  keep(hulls, fences, prefixes) {
    this.many.keep(prefixes)
    keep_these(this.hulls, hulls, Hull)
    keep_these(this.fences, fences, Fence)
    this.trails.keep([...this.hulls.keys()])
    this.plane.refit()
    this.on_globe.refit()
    this.draw_soon()
  }
  /** A drawing of a hull or of a fence, or the outline of one of many hulls. @param {Message} message */
  take(message) {
    if (message.within != undefined) this.many.take(message)
    else if (message.fence != undefined) this.fences.get(message.fence)?.take(message)
    else this.hulls.get(message.hull)?.take(message)
    this.draw_soon()
  }
  /** Where the key is that the viewer looks for: as the server says, or as it was drawn at an earlier moment. @returns {Found[]} */
  found() {
    if (this.live) return this.places.map(([x, y, colour, disk]) => ({place: [x, y], colour, disk}))
    return [...this.hulls.values()].flatMap(hull => {
      const place = hull.place_of(this.sought)
      return place ? [{place, colour: hull.look.colour, hull}] : []
    })
  }
  // The same for an earlier moment in words.
  found_words() {
    const found = this.found().map(({place, hull}) => [`${this.sought} in ${hull?.name}`, place_words(place, Boolean(hull?.globe)).join(", ")])
    return found.length ? found : [[`${this.sought} is not drawn at this moment`, ""]]
  }
  /** A hull of those in the picture. @param {string} name @returns {Hull | undefined} */
  find(name) {
    return this.hulls.get(name) ?? this.many.find(name)
  }
  /** @param {{name: string, row: number}} [pointed] */
  point_at(pointed) {
    if (!pointed && !this.pointed) return
    this.pointed = pointed
    this.draw_soon()
  }
  /** @returns {Point | undefined} */
  pointed_place() {
    return this.pointed && this.find(this.pointed.name)?.corners[this.pointed.row]
  }
  draw_all() {
    this.ground_drawn = false
    this.draw_soon()
  }
  draw_soon() {
    this.awaited ??= requestAnimationFrame(() => {
      this.awaited = undefined
      this.draw()
    })
  }
  // Show all again, whatever comes.
  follow() {
    this.following = true
    this.plane.refit()
    this.on_globe.refit()
    this.moved_to()
    this.draw_soon()
  }
  /** @param {(view: View) => void} change */
  move(change) {
    this.choose_view()  // "Show all" may be asked for, and not drawn yet
    this.following = false
    this.moving = true
    clearTimeout(this.resting)
    this.resting = setTimeout(() => {
      this.moving = false
      if (!this.following) this.moved_to(this.view.extent)
      this.draw_all()
    }, REST_MILLISECONDS)
    change(this.view)
    this.draw_all()
  }
  choose_view() {
    const hulls = [...this.hulls.values(), ...this.many.hulls].filter(hull => hull.vertices.x.length)
    const areas = [...this.fences.values()].filter(fence => fence.area.polygons.length)
    const globe = [...hulls.map(hull => hull.globe), ...areas.map(fence => fence.area.globe)]
    const view = globe.length && globe.every(each => each) ? this.on_globe : this.plane
    if (view != this.view) {
      this.view = view
      this.following = true
      view.refit()
      this.ground_drawn = false
      this.element.closest(".page")?.classList.toggle("globe", view.globe)
    }
    if (this.wanted && globe.length) {
      view.show_extent(this.wanted)
      this.wanted = undefined
      this.following = false
      this.ground_drawn = false
    }
    if (!this.following || this.many.crowded && view.settled && performance.now() < this.fitted + FIT_MILLISECONDS) return
    this.fitted = performance.now()
    const points = hulls.flatMap(hull => hull instanceof Outline ? hull.extremes : view.globe ? hull.corners : hull.polygons(view).flat(2))
    for (const fence of this.fences.values())
      points.push(...(fence.area.globe || !view.globe ? fence.area.polygons.flat(2) : []), ...fence.margins(view, this.hulls).flat(2))
    const before = this.where()
    view.fit(points)
    if (this.where() != before) this.ground_drawn = false
  }
  where() {
    return String([this.view.middle, this.view instanceof PlaneView ? this.view.unit : this.view.scale])
  }
  draw() {
    if (!this.width || !this.height) return
    this.choose_view()
    const [ground, things] = this.canvases.map(context_of)
    if (!this.ground_drawn) {
      this.read_colours()
      this.clear(ground)
      if (this.view instanceof GlobeView) this.draw_globe(ground, this.view)
      else this.draw_axes(ground, this.view)
      this.ground_drawn = true
    }
    this.clear(things)
    this.taken = new Boxes()
    this.rings = place_rings(this)
    for (const fence of this.fences.values())
      for (const {place} of fence.marks(this.hulls)) {
        const [across, down] = this.view.place(...place)
        if (!isNaN(across)) this.taken.add(square_box(across, down, MARK_RADIUS))
      }
    const {left, top, width, height} = this.view.rect
    things.save()
    things.beginPath()
    things.rect(left, top, width, height)
    things.clip()
    for (const layer of LAYERS) layer(things, this)
    things.restore()
    this.frames++
    this.drawn()
  }
  /** @param {CanvasRenderingContext2D} canvas */
  clear(canvas) {
    canvas.setTransform(this.ratio, 0, 0, this.ratio, 0, 0)
    canvas.clearRect(0, 0, this.width, this.height)
    canvas.lineJoin = "round"
  }
  read_colours() {
    const style = getComputedStyle(this.element)
    const colour = (/** @type {string} */ name) => style.getPropertyValue(`--${name}`).trim()
    this.colours = Object.fromEntries(["ink", "faint", "paper", "grid", "coast", "border", "sea", "veil", "alarm", "alarm-ink", "focus"].map(name => [name, colour(name)]))
  }
  /** @param {CanvasRenderingContext2D} canvas @param {GlobeView} view */
  draw_globe(canvas, view, tiles = this.tiles.url) {
    const {colours, width, height} = this
    const path = d3.geoPath(view.projection, canvas)
    const fill = (/** @type {import("d3-geo").GeoPermissibleObjects} */ shape, /** @type {string} */ style) => {
      canvas.beginPath()
      path(shape)
      canvas.fillStyle = style
      canvas.fill()
    }
    fill({type: "Sphere"}, colours.sea)
    if (tiles) {
      this.tiles.draw(canvas, view, this.moving)
      fill({type: "Sphere"}, colours.veil)  // what is drawn on the map has to stand out
    }
    const degrees = TICK_PIXELS / view.scale / RADIAN, step = GRID_STEPS.findLast(each => each > degrees) ?? GRID_STEPS[0]
    if (degrees > GRID_STEPS[GRID_STEPS.length - 1] / 2) {
      const reach = Math.min(90, Math.hypot(width, height) / 2 / view.scale / RADIAN + step)
      const [lon, lat] = view.middle, wide = Math.abs(lat) + reach >= 85 ? 180 : Math.min(180, reach / Math.cos((Math.abs(lat) + reach) * RADIAN) + step)
      const round = (/** @type {number} */ value, up = false) => (up ? Math.ceil : Math.floor)(value / step) * step
      /** @type {[[number, number], [number, number]]} */
      const extent = [[round(lon - wide), Math.max(-90, round(lat - reach))], [round(lon + wide, true), Math.min(90, round(lat + reach, true))]]
      canvas.beginPath()
      path(d3.geoGraticule().step([step, step]).extent(extent).precision(Math.max(0.1, step / 8))())
      canvas.strokeStyle = colours.grid
      canvas.lineWidth = 1
      canvas.stroke()
    }
    this.coasts.draw(canvas, view, colours, this.moving)
    this.draw_scale(canvas, view.scale)
  }
  /** @param {CanvasRenderingContext2D} canvas @param {number} scale */
  draw_scale(canvas, scale) {
    const metre = scale / EARTH_RADIUS, length = nice_below(SCALE_BAR_PIXELS / metre)
    const text = length < 1000 ? `${+length.toPrecision(1)} m` : `${length / 1000} km`
    const left = 12, bottom = this.height - 12
    canvas.strokeStyle = canvas.fillStyle = this.colours.faint
    canvas.lineWidth = 2
    canvas.beginPath()
    canvas.moveTo(left, bottom - 5)
    canvas.lineTo(left, bottom)
    canvas.lineTo(left + length * metre, bottom)
    canvas.lineTo(left + length * metre, bottom - 5)
    canvas.stroke()
    canvas.font = FONT_OF_AXES
    canvas.fillText(text, left + 6, bottom - 6)
  }
  /** @param {CanvasRenderingContext2D} canvas @param {PlaneView} view */
  draw_axes(canvas, view) {
    const {colours, height} = this, {left, top, width: wide, height: high} = view.rect
    const [x, y] = view.invert(left, top + high), [right, up] = view.invert(left + wide, top)
    canvas.font = FONT_OF_AXES
    canvas.fillStyle = colours.faint
    canvas.strokeStyle = colours.grid
    canvas.lineWidth = 1
    canvas.beginPath()
    canvas.textAlign = "center"
    for (const tick of ticks(x, right, wide / TICK_PIXELS)) {
      const [across] = view.place(tick, y)
      canvas.moveTo(across, top)
      canvas.lineTo(across, top + high)
      canvas.fillText(compact(tick), across, top + high + 15)
    }
    canvas.textAlign = "right"
    for (const tick of ticks(y, up, high / TICK_PIXELS * 1.5)) {
      const [, down] = view.place(x, tick)
      canvas.moveTo(left, down)
      canvas.lineTo(left + wide, down)
      canvas.fillText(compact(tick), left - 5, down + 4)
    }
    canvas.stroke()
    const degrees = [...this.hulls.values(), ...this.many.hulls].some(hull => hull.globe)
    const name = (/** @type {string} */ axis, /** @type {string} */ unit) => degrees ? "" : unit ? `${axis} (${unit})` : axis
    canvas.textAlign = "center"
    canvas.fillText(name("x", this.units.x), left + wide / 2, height - 6)
    canvas.save()
    canvas.translate(12, top + high / 2)
    canvas.rotate(-Math.PI / 2)
    canvas.fillText(name("y", this.units.y), 0, 0)
    canvas.restore()
    canvas.textAlign = "left"
  }
}
/**
 * The drawn things that are on the page, by name, each with its look.
 * @template {{look: import("./looks.js").Look}} Thing
 * @param {Map<string, Thing>} known
 * @param {NamedLook[]} looks
 * @param {new (name: string, look: NamedLook) => Thing} Kind
 */
function keep_these(known, looks, Kind) {
  const names = looks.map(({name}) => name)
  for (const name of known.keys()) if (!names.includes(name)) known.delete(name)
  for (const look of looks) {
    const thing = known.get(look.name)
    if (thing) thing.look = look
    else known.set(look.name, new Kind(look.name, look))
  }
}
/** An extent as it is in an address; undefined for what is none. @param {string | null} text */
export function read_extent(text) {
  const numbers = text?.split(",").map(Number) ?? [], [, , wide, high = wide] = numbers
  return numbers.every(isFinite) && wide > 0 && high > 0 ? numbers : undefined
}
/** A place, on the globe to the decimetre. @param {Point} place @param {boolean} globe */
export function place_words(place, globe) {
  const [x, y] = place.map(each => globe ? +each.toFixed(6) : +each.toPrecision(8))
  return globe ? [`longitude ${x}`, `latitude ${y}`] : [`x ${x}`, `y ${y}`]
}
/** One, two or five times a power of ten; NaN if there is none. @param {number} length */
export function nice_below(length) {
  const power = 10 ** Math.floor(Math.log10(length))
  return ([5, 2, 1].find(each => each * power <= length) ?? NaN) * power
}
/** @param {number} low @param {number} high @param {number} count */
export function ticks(low, high, count) {
  const step = nice_below(2 * (high - low) / Math.max(2, count))
  const first = Math.ceil(low / step), last = Math.floor(high / step)
  if (!(step > 0) || !isFinite(first) || last - first > 100) return []
  return Array.from({length: last - first + 1}, (_, row) => (first + row) * step)
}
export const short_number = new Intl.NumberFormat("en", {notation: "compact", maximumSignificantDigits: 4})
/** 1.2K and 3.4M; very small and very large numbers with an exponent. @param {number} value */
export function compact(value) {
  const size = Math.abs(value)
  return size > 0 && (size < 1e-3 || size >= 1e15) ? value.toExponential(1) : short_number.format(value)
}
