// The field for keys, and where the key is.
import { find, put } from "./dom.js"
const MOST_OFFERED = 20
export class Finder {
  // `sought` is called with a key, or with an empty text for none.
  constructor(picture, key, sought) {
    this.picture = picture
    this.sought = sought
    this.field = find(".finder input")
    this.field.value = key
    this.field.addEventListener("focus", () => this.offer())
    this.field.addEventListener("input", () => this.field.value ? this.offer() : this.seek(""))
    this.field.addEventListener("change", () => this.seek(this.field.value))
    find(".finder").addEventListener("submit", event => { event.preventDefault(); this.seek(this.field.value) })
  }
  seek(key) {
    this.field.value = key
    this.sought(key)
  }
  offer() {
    const {hulls, fences} = this.picture
    const drawn = [...hulls.values()].flatMap(({vertices, points}) => [...vertices.keys ?? [], ...points.keys ?? []])
    const inside = [...fences.values()].flatMap(fence => fence.inside.key)
    const names = [...drawn, ...inside].filter(key => key.startsWith(this.field.value))
    find("#keys").replaceChildren(...[...new Set(names)].sort().slice(0, MOST_OFFERED).map(key => new Option(key, key)))
  }
  show(found) {
    show_lines(".found", found)
    put(find("#found"), found.map(([sentence]) => sentence).join(". "))
  }
}
// Sentences, each with what changes more often.
export function show_lines(selector, sentences) {
  const lines = sentences.map(([sentence, place]) => {
    const line = document.createElement("li"), numbers = document.createElement("span")
    numbers.textContent = place
    line.append(sentence, place && ": ", numbers)
    return line
  })
  find(selector).replaceChildren(...lines)
}
