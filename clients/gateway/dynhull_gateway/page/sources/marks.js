// The subjects inside a fence, as marks in the picture: at most MOST_MARKED.
import { shown_place } from "../degrees.js"
export const MOST_MARKED = 500
const COLUMNS = ["hull", "key", "x", "y"]
export class Marks {
  center = null  // of the hulls of a fence on the globe, around which they are drawn
  #marks = new Map()
  constructor(fence) {
    this.fence = fence
    this.#write()
  }
  get count() {
    return this.#marks.size
  }
  // These subjects and no others.
  replace(marks) {
    const before = JSON.stringify(this.message)
    this.#marks = new Map(marks.map(mark => [`${mark.hull} ${mark.key}`, mark]))
    const kept = this.message
    this.#write()
    if (JSON.stringify(this.message) == before) this.message = kept
  }
  // Who enters, and no longer who leaves: sooner than by the next reading.
  take({type, hull, previousHull, key, position}) {
    if (type == "exit" || type == "transfer") this.#marks.delete(`${previousHull || hull} ${key}`)
    if ((type == "enter" || type == "transfer") && position && this.count < MOST_MARKED) {
      const [x, y] = shown_place(position, this.center)
      this.#marks.set(`${hull} ${key}`, {hull, key: String(key), x, y})
    }
    this.#write()
  }
  // Sorted, whether events or a reading brought them.
  #write() {
    const marks = [...this.#marks].sort(([one], [two]) => one < two ? -1 : one > two ? 1 : 0).map(([, mark]) => mark)
    this.message = {kind: "inside", fence: this.fence, ...Object.fromEntries(COLUMNS.map(name => [name, marks.map(mark => mark[name])]))}
  }
}
