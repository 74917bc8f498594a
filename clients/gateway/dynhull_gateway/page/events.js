// The list of events, newest first.
import { cell, find } from "./dom.js"
import { MOST_EVENTS } from "./sources/event_rows.js"
const EVENT_WORDS = {enter: "★ enter", exit: "☆ exit", cross: "⤭ cross", dwell: "⧗ dwell", transfer: "⇄ transfer",
  begin: "★ begin", cease: "☆ cease", snapshot: "≡ snapshot", closed: "✕ closed", lost: "⚠ lost"}
export class Events {
  // `look_for` is called with a key that the viewer clicks.
  constructor(look_for) {
    this.look_for = look_for
    this.rows = new Map()
    this.shown = new Map()
    this.until = Infinity  // the moment shown
    const zone = new Intl.DateTimeFormat("en", {timeZoneName: "short"}).formatToParts().find(({type}) => type == "timeZoneName")
    find(".events .zone").textContent = zone.value
    find(".events .scroll").addEventListener("keydown", event => this.choose(event))
  }
  // The keys in the list are one stop of the Tab key, not a hundred: arrows move between them.
  choose(event) {
    const step = {ArrowDown: 1, ArrowUp: -1}[event.key]
    const buttons = [...document.querySelectorAll(".events tbody button")]
    const next = buttons[buttons.indexOf(document.activeElement) + step]
    if (!step || !next) return
    event.preventDefault()
    next.focus()
  }
  take({fence, rows}) {
    this.rows.set(fence, rows)
    this.show_soon()
  }
  keep(names) {
    for (const name of this.rows.keys()) if (!names.includes(name)) this.rows.delete(name)
    this.show_soon()
  }
  end_at(until) {
    if (until == this.until) return
    this.until = until
    this.show_soon()
  }
  show_soon() {
    this.awaited ??= requestAnimationFrame(() => {
      this.awaited = undefined
      this.show()
    })
  }
  show() {
    const today = new Date().toDateString()
    if (this.today != today) {  // other rows have their date
      this.today = today
      this.shown.clear()
      find(".events tbody").replaceChildren()
    }
    const rows = [...this.rows].flatMap(([fence, rows]) => {
      let at = Number.MAX_VALUE  // lost events have no time: they stay before what came after them
      return rows.map(row => ({row, fence, at: at = Math.min(at, row[1] ?? at)}))
    })
    // Of one fence they are in order already, and stay so: sorting is stable.
    const newest = rows.filter(({at}) => at <= this.until).sort((one, two) => two.at - one.at).slice(0, MOST_EVENTS)
    const items = newest.map(({row, fence}) => [`${fence} ${row[0]}`, row, fence])
    const wanted = new Set(items.map(([id]) => id))
    for (const [id, element] of this.shown) {
      if (wanted.has(id)) continue
      element.remove()
      this.shown.delete(id)
    }
    // Only new rows move: what the viewer reads, selects or has focused stays.
    const body = find(".events tbody")
    let next = body.firstElementChild
    for (const [id, row, fence] of items) {
      const known = this.shown.get(id)
      if (known && known == next) next = next.nextElementSibling
      else {
        const element = known ?? this.element(row, fence)
        this.shown.set(id, element)
        body.insertBefore(element, next)
      }
    }
    find(".events .none").hidden = items.length > 0
  }
  element([, at, type, key, text, cause], fence) {
    const row = document.createElement("tr"), time = document.createElement("time")
    if (at != null) {
      const moment = new Date(at)
      time.dateTime = time.title = moment.toISOString()
      time.textContent = moment.toLocaleTimeString("en", {timeStyle: "medium", hourCycle: "h23"})
      if (moment.toDateString() != this.today) {
        const date = document.createElement("small")
        date.textContent = moment.toLocaleDateString("en", {day: "numeric", month: "short"})
        time.prepend(date)
      }
    }
    row.className = type
    row.append(cell("when", time), cell("type", EVENT_WORDS[type] ?? type), cell("subject", key ? this.button(key) : text),
      cell("fence", fence), cell("cause", cause))
    return row
  }
  button(key) {
    const button = document.createElement("button")
    button.type = "button"
    button.textContent = key
    button.tabIndex = -1
    button.title = "Find this key in the picture"
    button.onclick = () => this.look_for(key)
    return button
  }
}
