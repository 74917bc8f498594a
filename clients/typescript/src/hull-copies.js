import { HullCopy } from "./hull-copy.js"

/**
 * Copies of many hulls that are watched with their outlines, by name: a Map that `Client.watchMany` updates.
 *
 *     const copies = new HullCopies()
 *     for await (const _ of client.watchMany("fleet/", { outlines: true, copies })) draw(copies)
 *
 * @extends {Map<string, HullCopy>}
 */
export class HullCopies extends Map {
  /** Names that have not come since the stream began, once more. @type {Set<string> | null} */
  #unseen = null

  /**
   * Apply an event.
   * @param {import("./watch.js").Hulls} event
   */
  update(event) {
    if (event.type === "begin") this.#unseen = new Set(this.keys())
    for (const hull of event.hulls) {
      const copy = this.get(hull.hull) ?? new HullCopy()
      const { revision, points, center, measures, changed, error } = hull
      const vertices = hull.vertices ?? []
      copy.update({ type: "snapshot", revision, points, vertices, vertexKeys: null, center, measures, changed, error })
      this.set(hull.hull, copy)
      this.#unseen?.delete(hull.hull)
    }
    for (const name of event.unchanged) this.#unseen?.delete(name)
    for (const name of event.gone) this.#drop(name)
    if (event.type === "complete") {
      for (const name of this.#unseen ?? []) this.#drop(name)
      this.#unseen = null
    }
  }

  /** @param {string} name */
  #drop(name) {
    this.get(name)?.clear()
    this.delete(name)
  }
}
