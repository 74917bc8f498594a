// The key that the viewer looks for in a hull: nothing is asked while there is none.
import { shown_place } from "../degrees.js"
import { Bell } from "./repeating.js"
const MOST_KEY_BYTES = 255, LARGEST_KEY = 2n ** 64n - 1n
export const PENDING = {state: "pending"}, MISSING = {state: "missing"}
const SEEN = ["left", "inside", "boundary", "vertex"]
// Whether there is a position; and whether the hull holds the key.
export const is_seen = ({state}) => SEEN.includes(state)
export const is_present = sighting => is_seen(sighting) && sighting.state != "left"
export class KeySearch {
  bell = new Bell()
  #wanted = ""
  #last = PENDING
  constructor({client}, name) {
    this.client = client
    this.name = name
  }
  // The last answer about the key.
  find(key) {
    if (key != this.#wanted) {
      this.#wanted = key
      this.#last = PENDING
      if (key) this.bell.ring()
    }
    return this.#last
  }
  // The hull was deleted.
  forget() {
    this.#last = PENDING
  }
  // `copy` is the hull as it is followed with its keys.
  async ask(copy, signal) {
    const wanted = this.#wanted
    if (!wanted || !copy.vertexKeys) return
    const key = copy.vertexKeys.length ? as_key(wanted, typeof copy.vertexKeys[0] == "bigint") : undefined
    const found = key == undefined ? undefined : await this.#where(key, copy, signal)
    if (this.#wanted == wanted) this.#last = found ?? (is_seen(this.#last) ? {...this.#last, state: "left"} : MISSING)
  }
  async #where(key, copy, signal) {
    const {positions: [position], present: [present], accuracies, revision} = await this.client.positions(this.name, [key], {signal})
    const {sides: [side]} = await this.client.locate(this.name, {keys: [key]}, {minRevision: revision, signal})
    if (!present || side < 0) return
    const is_corner = copy.vertexKeys?.includes(key) || copy.vertices.some(([x, y]) => x == position[0] && y == position[1])
    return {state: side ? "inside" : is_corner ? "vertex" : "boundary", place: shown_place(position, copy.center), revision: Number(revision),
      accuracy: accuracies?.[0] ?? 0}
  }
}
// The key as the hull has it; undefined for text that cannot be one of its keys.
function as_key(text, integers) {
  const bytes = new TextEncoder().encode(text).length
  if (!bytes || bytes > MOST_KEY_BYTES || !text.isWellFormed()) return
  if (!integers) return text
  return /^\s*\d+\s*$/.test(text) && BigInt(text) <= LARGEST_KEY ? BigInt(text) : undefined
}
