// All hulls of a prefix, followed until it is closed.
import { outline, shown } from "../degrees.js"
import { rest } from "./repeating.js"
// States of a hull a second, and its vertices: of many hulls each is small in the picture.
const MAX_RATE = 2, MOST_VERTICES = 24, RETRY = 1000
// Edges of hulls that are smaller than this, in degrees, are straight in the picture, but near a pole.
const STRAIGHT = 1, POLAR = 80
export class ManyFeed {
  complete = false  // whether all that there are have arrived
  failure = null
  lost = false
  hulls = new Map()  // the newest states, the last changed at the end
  #new = []  // messages that nobody has taken
  #unseen = new Set()  // what has not come since all began anew
  constructor({client}, prefix) {
    this.client = client
    this.prefix = prefix
    this.closing = new AbortController()
    this.#follow(this.closing.signal)
  }
  close() {
    this.closing.abort()
  }
  get trouble() {
    return this.failure ?? (this.lost ? {message: "Connection lost"} : null)
  }
  // The hulls that have changed last, the newest first.
  newest(most) {
    return [...this.hulls.values()].slice(-most).reverse()
  }
  // The outlines since the last call.
  drain() {
    return this.#new.splice(0)
  }
  async #follow(signal) {
    const onLost = lost => this.lost = lost
    while (!signal.aborted) {
      try {
        const view = {outlines: true, maxVertices: MOST_VERTICES, rate: MAX_RATE, signal, onLost}
        for await (const event of this.client.watchMany(this.prefix, view)) this.#take(event)
      } catch (error) {
        if (signal.aborted) return
        this.failure = error
      }
      await rest(RETRY, signal)
    }
  }
  #take({type, hulls, gone, unchanged}) {
    this.failure = null
    if (type == "begin") this.#unseen = new Set(this.hulls.keys())
    for (const hull of hulls) {
      // What comes later has moved just now, whatever the server's clock says.
      hull.moved = this.complete ? Date.now() : Number(hull.changed ?? 0) / 1000
      this.hulls.delete(hull.hull)  // to the end
      this.hulls.set(hull.hull, hull)
      this.#unseen.delete(hull.hull)
      this.#new.push({...drawing(hull), within: this.prefix})
    }
    for (const name of unchanged) this.#unseen.delete(name)
    for (const name of [...gone, ...type == "complete" ? this.#unseen : []]) this.#drop(name)
    if (type == "complete") {
      this.complete = true
      this.#unseen.clear()
    }
  }
  #drop(hull) {
    if (this.hulls.delete(hull)) this.#new.push({kind: "outline", within: this.prefix, hull, revision: 0, x: [], y: [], rings: null, gone: true})
  }
}
function drawing({hull, revision, vertices, geographic, center}) {
  const corners = shown(vertices ?? [], center), x = corners.map(([x]) => x), y = corners.map(([, y]) => y)
  const spread = values => Math.max(...values) - Math.min(...values)
  const straight = corners.length && Math.max(spread(x), spread(y)) < STRAIGHT && Math.abs(y[0]) < POLAR
  // Rings say that it is on the globe; great circles take long.
  const rings = !geographic ? null : straight || !center || !corners.length ? [corners] : outline(vertices, center)
  return {kind: "outline", hull, revision: Number(revision), x, y, keys: null, rings}
}
