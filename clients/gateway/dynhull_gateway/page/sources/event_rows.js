// The latest events of a fence, as rows of the list on the page.
import { count, plural } from "../words/numbers.js"
export const MOST_EVENTS = 100
const MOST_NAMED = 5
const CAUSES = {subject_moved: "it moved", area_moved: "the area moved", subject_appeared: "it is new", subject_removed: "it was removed",
  subject_expired: "its time ended", fence_created: "the fence is new", fence_changed: "the fence changed", time_passed: "time passed"}
export class EventRows {
  // Each row: what distinguishes it from all others, milliseconds since 1970 or null, the type, the key, words where there is no
  // single key, and why it happened. The newest is the first.
  rows = []
  constructor(fence) {
    this.fence = fence
    this.message = {kind: "events", fence, rows: []}
  }
  get last() {
    return this.rows[0]
  }
  add(event) {
    if (event.type == "lost") return this.skip(event.uid, event.first, event.last, "the server no longer had them")
    const key = event.key == null ? "" : String(event.key), at = event.time == null ? null : Number(event.time) / 1000
    const cause = Object.entries(CAUSES).filter(([name]) => event.cause.includes(name)).map(([, words]) => words).join(" and ")
    this.#append([`${event.uid} ${event.sequence}`, at, event.type, key, key ? "" : about(event), cause])
  }
  // A row for events that are not shown.
  skip(uid, first, last, cause) {
    const text = first < last ? `events ${count(first)} to ${count(last)}` : `event ${count(first)}`
    this.#append([`${uid} ${first}-${last}`, null, "lost", "", text, cause])
  }
  #append(row) {
    this.rows = [row, ...this.rows].slice(0, MOST_EVENTS)
    this.message = {kind: "events", fence: this.fence, rows: this.rows}
  }
}
// What an event without a key is about.
function about({type, hull, inside}) {
  if (type != "snapshot" && type != "closed") return hull
  const keys = inside.flatMap(({keys}) => keys)
  return `${plural(keys.length, "key")} inside${keys.length ? ": " : ""}${shortened(keys)}`
}
// The first of some names, and how many more there are.
export function shortened(names) {
  const more = names.length - MOST_NAMED
  return names.slice(0, MOST_NAMED).join(", ") + (more > 0 ? ` and ${count(more)} more` : "")
}
