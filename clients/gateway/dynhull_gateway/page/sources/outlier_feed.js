// What stretches a hull: its inner convex layers, and the vertex that matters most. Asked while the viewer looks.
import { SQUARE_KILOMETRE, outline, position_text, shown, shown_place } from "../degrees.js"
import { number } from "../words/numbers.js"
import { thinned } from "./hull_state.js"
import { repeat } from "./repeating.js"
// The layers that are drawn; the first is the hull itself.
const LAYERS = 5, LOOK = 500
export class OutlierFeed {
  message = null  // for the picture
  words = ["", ""]  // a sentence, and what changes more often
  #revision = -1
  constructor({client, units}, hull) {
    this.client = client
    this.hull = hull
    this.unit = units.area
    this.closing = new AbortController()
    repeat(this.closing.signal, () => this.#look(this.closing.signal), () => LOOK)
  }
  close() {
    this.closing.abort()
  }
  async #look(signal) {
    const {name, followed, keyed, revision} = this.hull
    if (!followed) {
      this.#show([], null)
      this.#revision = -1
      return
    }
    if (revision == this.#revision) return
    try {
      const {layers, revision: first} = await this.client.layers(name, LAYERS, {signal})
      const influence = await this.client.influence(name, {keys: keyed, signal})
      this.#revision = Math.min(Number(first), Number(influence.revision))
      this.#show(layers.slice(1), influence)
    } catch (error) {
      if (!signal.aborted && !error.unknown) this.#show([], null, `${name}: ${error.message}`)  // otherwise what was last seen stays
      throw error
    }
  }
  #show(layers, influence, trouble = "") {
    const {name, center} = this.hull
    let found = {vertex: null, label: ""}
    this.words = [trouble || `${name} has no vertex that changes its area`, ""]
    if (influence?.areas.some(area => area)) {
      const row = influence.areas.indexOf(Math.max(...influence.areas)), key = influence.keys ? String(influence.keys[row]) : undefined
      const area = this.#area(influence.areas[row]), vertex = shown_place(influence.vertices[row], center)
      found = {vertex, label: key == undefined ? area : `${key}: ${area}`}
      const at = `${position_text(vertex, center)}, revision ${Number(influence.revision).toLocaleString("en")}`
      this.words = [`Without ${key ?? "its most influential vertex"}, ${name} would lose ${area}`, at]
    }
    const message = {kind: "outliers", hull: name, layers: layers.map(layer => this.#drawing(thinned(layer))), ...found}
    if (JSON.stringify(message) != JSON.stringify(this.message)) this.message = message
  }
  #area(area) {
    return this.hull.center ? `${number(area / SQUARE_KILOMETRE)} km²` : `${number(area)} ${this.unit}`
  }
  // The outline of a layer, in the form of a drawing of vertices.
  #drawing(corners) {
    const {center} = this.hull, places = shown(corners, center)
    return {x: places.map(([x]) => x), y: places.map(([, y]) => y), keys: null, rings: center && corners.length ? outline(corners, center) : null}
  }
}
