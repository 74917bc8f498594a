import { Client } from "../client.js"
import { followAlarm, followFence, followHull, followPrefix } from "./following.js"
import { Hands } from "./hands.js"
import { ALARM_LOOK, FENCE_LOOKS, HULL_LOOKS, lit } from "./looks.js"
import { Picture } from "./picture.js"
import { STYLE } from "./style.js"

/** @typedef {import("./looks.js").Look} Look */

const FOLLOW = { hull: followHull, prefix: followPrefix, fence: followFence, alarm: followAlarm }
const BUTTONS = '<button name="in" aria-label="Zoom in">+</button><button name="out" aria-label="Zoom out">−</button><button name="all" aria-label="Show all">⤢</button>'
const INSIDE = `<div class="map" tabindex="0" role="application" aria-label="Map. Arrow keys move it, plus and minus zoom, 0 shows all. H points at the next hull, V at its next vertex, with Shift at the one before">
<canvas></canvas><canvas></canvas><ul class="alarms" role="status"></ul><div class="buttons">${BUTTONS}</div><p class="attribution"></p><p class="note" role="status"></p><div class="tip" aria-live="polite" hidden></div></div>`
const ZOOM = 1.4
const system = matchMedia("(prefers-color-scheme: dark)")
/** Hulls that are drawn because an alarm is raised for them. */
const MOST_RAISED = 20

/**
 * A map of hulls, fences and alarms as they are now.
 *
 *     <dynhull-map gateway="http://127.0.0.1:8080" hull="fleet" fence="yard" alarm="spread"></dynhull-map>
 *
 * Attributes: `gateway`, its URL, that of the page by default; `hull`, `fence`, `alarm` and `prefix`, names with spaces
 * between; `look`, "day" or "night", otherwise as the system has it; `coasts`, the folder of world-atlas, for coasts below hulls on the globe; `unit`, that of x and y in a plane.
 * Set `client` for a token, or to share a client: all maps and streams of one take one connection.
 *
 * Each event is told as `dynhull-event`, with its kind and the event in `detail`; what cannot be followed, and why, as
 * `dynhull-problem`.
 */
export class DynhullMap extends HTMLElement {
  static observedAttributes = ["gateway", "hull", "prefix", "fence", "alarm", "look"]

  /** What is followed, by kind and name. @type {Map<string, AbortController>} */
  #followed = new Map()
  /** @type {Client | null} */
  #client = null
  /** @type {Client | null} */
  #own = null
  /** @type {any} */
  #picture = null
  /** For which hulls each alarm is raised. @type {Map<string, Map<string, number | null>>} */
  #raised = new Map()
  #changing = false
  #lost = false

  connectedCallback() {
    if (this.#picture === null) this.#build()
    this.#change()
  }

  disconnectedCallback() {
    this.#change()
  }

  /** @param {string} name */
  attributeChangedCallback(name) {
    if (name === "gateway") this.#end()
    if (name === "look") this.#picture?.draw_all()
    this.#change()
  }

  /** The client that is asked: its own, of the gateway, unless it was given one. */
  get client() {
    return this.#client ?? (this.#own ??= new Client(this.getAttribute("gateway") ?? location.origin))
  }

  set client(client) {
    this.#end()
    this.#client = client
    this.#change()
  }

  /** The frames drawn so far. @returns {number} */
  get frames() {
    return this.#picture?.frames ?? 0
  }

  /** @param {string} selector @returns {any} */
  #find(selector) {
    return this.shadowRoot?.querySelector(selector)
  }

  #build() {
    const root = this.attachShadow({ mode: "open" })
    root.innerHTML = INSIDE
    const style = new CSSStyleSheet() // which a page's policy about its content lets in
    style.replaceSync(STYLE)
    root.adoptedStyleSheets = [style]
    const unit = this.getAttribute("unit") ?? ""
    const tiles = { url: "", largest_zoom: 0, attribution: "" }
    const picture = new Picture(this.#find(".map"), { x_unit: unit, y_unit: unit, tiles, coasts: this.getAttribute("coasts") })
    const hands = new Hands(picture, this.#find(".tip"), () => {})
    this.#picture = picture
    system.addEventListener("change", () => this.#keep())
    this.#find("[name=in]").onclick = () => hands.zoom(ZOOM)
    this.#find("[name=out]").onclick = () => hands.zoom(1 / ZOOM)
    this.#find("[name=all]").onclick = () => picture.follow()
    this.#find(".buttons").onpointerdown = (/** @type {Event} */ event) => event.stopPropagation()
  }

  /** @param {string} kind */
  #names(kind) {
    return (this.getAttribute(kind) ?? "").split(/\s+/).filter((name) => name)
  }

  get #hulls() {
    const raised = [...this.#raised.values()].flatMap((hulls) => [...hulls.keys()])
    return [...new Set([...this.#names("hull"), ...raised.slice(0, MOST_RAISED)])]
  }

  #end() {
    for (const following of this.#followed.values()) following.abort()
    this.#followed.clear()
    this.#raised.clear()
    this.#own = null
  }

  /** Follow what is asked for now, once all that changes together has changed. */
  #change() {
    if (this.#changing) return
    this.#changing = true
    queueMicrotask(() => {
      this.#changing = false
      if (this.#picture === null) return
      if (this.isConnected) this.#follow()
      else this.#end()
    })
  }

  #follow() {
    for (const name of this.#raised.keys()) if (!this.#names("alarm").includes(name)) this.#raised.delete(name)
    const kinds = { alarm: this.#names("alarm"), hull: this.#hulls, prefix: this.#names("prefix"), fence: this.#names("fence") }
    const wanted = Object.entries(kinds).flatMap(([kind, names]) => names.map((name) => `${kind} ${name}`))
    for (const [key, following] of this.#followed) {
      if (wanted.includes(key)) continue
      following.abort()
      this.#followed.delete(key)
    }
    this.#keep()
    for (const key of wanted) if (!this.#followed.has(key)) this.#begin(key)
    this.#list()
  }

  /** What is in the picture, and how it looks. */
  #keep() {
    const alarmed = new Set([...this.#raised.values()].flatMap((hulls) => [...hulls.keys()]))
    const chosen = this.getAttribute("look") ?? ""
    const night = chosen === "night" || (chosen !== "day" && system.matches)
    const shaded = (/** @type {Look & {name: string}} */ { colour, ...rest }) => ({ ...rest, colour: lit(colour, night) })
    const look = (/** @type {Look[]} */ looks) => (/** @type {string} */ name, /** @type {number} */ row) => shaded({ name, ...looks[row % looks.length] })
    const hulls = this.#hulls.map(look(HULL_LOOKS)).map((each) => (alarmed.has(each.name) ? shaded({ ...each, ...ALARM_LOOK }) : each))
    this.#picture.keep(hulls, this.#names("fence").map(look(FENCE_LOOKS)), this.#names("prefix").map(look(HULL_LOOKS)))
  }

  /** @param {string} key */
  async #begin(key) {
    const [kind, name] = key.split(" ")
    const following = new AbortController()
    const { signal } = following
    const current = (/** @type {(...given: any[]) => void} */ act) => (/** @type {any[]} */ ...given) => signal.aborted || act(...given)
    const shown = {
      draw: current((message) => this.#picture.take(message)),
      raised: current((alarm, hulls) => {
        this.#raised.set(alarm, hulls)
        this.#change()
      }),
      tell: current((what, event) => this.#tell("dynhull-event", { kind: what, event })),
      onLost: current((lost) => this.#note((this.#lost = lost))),
    }
    this.#followed.set(key, following)
    try {
      await FOLLOW[/** @type {keyof typeof FOLLOW} */ (kind)](this.client, name, shown, signal)
    } catch (error) {
      if (signal.aborted) return
      this.#note(this.#lost, `${kind} ${name}: ${error instanceof Error ? error.message : error}`)
      this.#tell("dynhull-problem", { kind, name, error })
    }
  }

  /** @param {string} type @param {object} detail */
  #tell(type, detail) {
    this.dispatchEvent(new CustomEvent(type, { detail, bubbles: true, composed: true }))
  }

  /** @param {boolean} lost @param {string} [problem] */
  #note(lost, problem = "") {
    this.#find(".note").textContent = problem || (lost ? "Connecting. The map shows what it last received." : "")
  }

  /** The alarms that are raised. */
  #list() {
    const rows = [...this.#raised].flatMap(([alarm, hulls]) => [...hulls].map(([hull, value]) => `▲ ${alarm}: ${hull}${value === null ? "" : `, ${+value.toPrecision(6)}`}`))
    const items = rows.map((text) => Object.assign(document.createElement("li"), { textContent: text }))
    this.#find(".alarms").replaceChildren(...items)
  }
}

if (!customElements.get("dynhull-map")) customElements.define("dynhull-map", DynhullMap)
