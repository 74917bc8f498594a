// One fence, followed until it is closed.
import { shown_place } from "../degrees.js"
import { EventRows, MOST_EVENTS } from "./event_rows.js"
import { area_of, corner_count } from "./fence_area.js"
import { MOST_MARKED, Marks } from "./marks.js"
import { Bell, repeat } from "./repeating.js"
const READ = 1000, MARK = 200, RETRY = 1000
// Of more subjects inside, none is marked: their keys alone would be megabytes.
const MOST_INSIDE = 10_000
// A watch that is further behind begins again with the newest events.
const MOST_BEHIND = 5_000
export class FenceFeed {
  fence = null  // its settings and counts; null while unknown, and while there is no fence of this name
  trouble = null  // why it could not be read the last time
  deleted = false
  inside = null  // the subjects inside, all at one moment; null while unknown, or too many
  #uid = ""  // of the fence that is followed, and its last sequence
  #seen = 0
  #moved = new Bell()
  #known = new Bell()
  constructor(source, name) {
    this.source = source
    this.name = name
    this.area = area_of(name, null)
    this.marks = new Marks(name)
    this.events = new EventRows(name)
    this.closing = new AbortController()
    const {signal} = this.closing
    repeat(signal, () => this.#read(signal), () => READ)
    repeat(signal, () => this.#mark(signal), () => MARK, this.#moved)
    this.#follow(signal)
  }
  close() {
    this.closing.abort()
  }
  get inside_count() {
    return this.inside ? this.inside.reduce((sum, {keys}) => sum + keys.length, 0) : this.fence?.inside ?? 0
  }
  // What follows a length: metres on the globe, nothing in a plane.
  get unit() {
    return this.marks.center ? " m" : ""
  }
  get corners() {
    return this.fence ? corner_count(this.fence) : 0
  }
  get messages() {
    return [this.area.message, this.marks.message, this.events.message]
  }
  async #read(signal) {
    try {
      const fence = await this.source.asker.getFence(this.name, {signal})
      if (!this.fence || drawn(fence) != drawn(this.fence)) {
        const center = await this.#center(fence, signal)
        this.marks.center = center
        this.area = area_of(this.name, fence, center)
      }
      if (!this.fence) this.#known.ring()
      this.fence = fence
      this.trouble = null
      this.deleted = false
    } catch (error) {
      if (signal.aborted) return
      this.trouble = error
      if (error.status == 404) this.#forget()
      throw error
    }
  }
  // The centre of the hulls of a fence on the globe; null for one in the plane.
  async #center({subjects, area}, signal) {
    const name = subjects ?? area.hull
    if (name == null) return null
    const {info} = await this.source.asker.getHull(name, {signal})
    return info.center
  }
  // There is no fence of this name. Its events stay on the page.
  #forget() {
    this.deleted ||= this.fence != null
    this.fence = this.inside = null
    this.area = area_of(this.name, null)
    this.marks.replace([])
  }
  // A watch survives lost connections, and ends when the fence is deleted or it is behind.
  async #follow(signal) {
    while (!signal.aborted) {
      try {
        if (this.fence) await this.#watch(this.fence, signal)
      } catch { /* reading the fence fails for the same reason, which the page shows */ }
      await this.#known.rest(RETRY, signal)
    }
  }
  async #watch({uid, firstSequence, lastSequence}, signal) {
    const before = uid == this.#uid ? this.#seen : 0, [first, last] = [Number(firstSequence), Number(lastSequence)]
    this.#uid = uid
    this.#seen = Math.max(before, first - 1, last - MOST_EVENTS)
    if (0 < before && before < this.#seen) this.events.skip(uid, before + 1, this.#seen, "there were too many to show")
    const own = new AbortController(), ended = AbortSignal.any([signal, own.signal])
    try {
      for await (const event of this.source.client.watchFence(this.name, {after: this.#seen, signal: ended})) {
        if (event.type == "replaced") return
        this.events.add(event)
        this.marks.take(event)
        this.#seen = Number(event.type == "lost" ? event.last : event.sequence)
        this.#moved.ring()
        if (event.type == "closed" || Number(this.fence?.lastSequence ?? 0) - this.#seen > MOST_BEHIND) return
      }
    } finally {
      own.abort()
    }
  }
  // Reads who is inside, and where.
  async #mark(signal) {
    const {fence} = this
    if (fence && fence.lastSequence && !this.events.last) return  // its events are listed first, then who is inside
    if (!fence || fence.otherHull != null || fence.inside > MOST_INSIDE) {
      this.inside = null
      return this.marks.replace([])
    }
    const {sequence, subjects} = await this.source.client.fenceInside(this.name, {signal})
    const marks = await this.#positions(subjects, signal)
    if (!this.fence || Number(sequence) < this.#seen) return  // the events say more
    this.inside = subjects
    this.marks.replace(marks)
  }
  async #positions(subjects, signal) {
    const marks = []
    for (const {hull, keys} of subjects) {
      const some = keys.slice(0, MOST_MARKED - marks.length)
      if (!some.length) break
      const {positions, present} = await this.source.client.positions(hull, some, {signal})
      for (const [row, key] of some.entries()) {
        if (!present[row]) continue
        const [x, y] = shown_place(positions[row], this.marks.center)
        marks.push({hull, key: String(key), x, y})
      }
    }
    return marks
  }
}
// What the picture shows: settings, and the centre of the hulls, which stays as long as the fence.
function drawn({uid, area, otherHull, margin, near}) {
  return JSON.stringify([uid, area, otherHull, margin, near])
}
