// The time lines: one small plot per quantity, all with the same time.
import { FONT } from "./dynhull/map/boxes.js"
import { FONT_PIXELS, MOST_RATIO, compact, ticks } from "./dynhull/map/picture.js"
const SHOWN_MILLISECONDS = 60 * 60_000, OPENING_MILLISECONDS = 10_000, LINE_LEFT = 46, LINE_TOP = 8, LINE_BOTTOM = 20, ROOM_ABOVE = 1.15
const TIME_STEPS = [1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600].map(seconds => 1000 * seconds), WHOLE_SERVER = ""
export class TimeLines {
  constructor(plots, neutral, percentile_dash) {
    this.plots = plots.map(element => ({element, columns: element.dataset.columns.split(" ")}))
    this.server_colour = neutral
    this.server_dashes = [[], percentile_dash]
    this.ahead = Infinity  // milliseconds of this page's clock before that of the times
    this.rows = new Map()
    this.looks = new Map()
    for (const {element} of this.plots) {
      new ResizeObserver(() => this.draw_soon()).observe(element)
      element.addEventListener("pointermove", event => element.title = this.at(element, event))
    }
  }
  keep(looks) {
    this.looks = new Map(looks.map(look => [look.name, look]))
    for (const name of this.rows.keys()) if (name != WHOLE_SERVER && !this.looks.has(name)) this.rows.delete(name)
    this.draw_soon()
  }
  // Shows where a moment of this page's clock is.
  mark(moment) {
    if (moment == this.moment) return
    this.moment = moment
    this.draw_soon()
  }
  take({kind: _, hull, ...columns}) {
    this.ahead = Math.min(this.ahead, Date.now() - columns.time.at(-1))
    const known = this.rows.get(hull) ?? Object.fromEntries(Object.keys(columns).map(name => [name, []]))
    this.rows.set(hull, known)
    for (const [name, values] of Object.entries(columns)) known[name].push(...values)
    const old = known.time.findIndex(time => time >= known.time.at(-1) - SHOWN_MILLISECONDS)
    for (const values of Object.values(known)) values.splice(0, old)
    this.draw_soon()
  }
  draw_soon() {
    this.awaited ??= requestAnimationFrame(() => {
      this.awaited = undefined
      for (const plot of this.plots) this.draw(plot)
    })
  }
  lines(columns) {
    return [...this.rows].flatMap(([name, rows]) => columns.flatMap((column, row) => {
      const look = name == WHOLE_SERVER ? {colour: this.server_colour, dash: this.server_dashes[row]} : this.looks.get(name)
      return rows[column] && look ? [{name: name || "whole server", column, times: rows.time, values: rows[column], ...look}] : []
    }))
  }
  span() {
    const times = [...this.rows.values()].flatMap(({time}) => time.length ? [time[0], time.at(-1)] : [])
    const end = times.length ? Math.max(...times) : Date.now()
    return [Math.min(end - OPENING_MILLISECONDS, ...times), end]
  }
  draw({element, columns}) {
    const {clientWidth, clientHeight} = element, pixels = Math.min(MOST_RATIO, devicePixelRatio)
    if (!clientWidth || !clientHeight) return
    if (element.width != Math.round(clientWidth * pixels)) element.width = clientWidth * pixels
    if (element.height != Math.round(clientHeight * pixels)) element.height = clientHeight * pixels
    const canvas = element.getContext("2d"), style = getComputedStyle(element), lines = this.lines(columns)
    const enlarged = parseFloat(style.fontSize) / FONT_PIXELS, ratio = pixels * enlarged
    const [width, height] = [clientWidth, clientHeight].map(each => each / enlarged)
    canvas.setTransform(ratio, 0, 0, ratio, 0, 0)
    canvas.clearRect(0, 0, width, height)
    const [begin, end] = this.span()
    const most = Math.max(0, ...lines.flatMap(({values}) => values.filter(value => value != null))) * ROOM_ABOVE || 1
    const across = time => LINE_LEFT + (time - begin) / (end - begin) * (width - LINE_LEFT - 4)
    const down = value => LINE_TOP + (height - LINE_TOP - LINE_BOTTOM) * (1 - value / most)
    canvas.font = `11px ${FONT}`
    canvas.fillStyle = style.getPropertyValue("--faint")
    canvas.strokeStyle = style.getPropertyValue("--grid")
    canvas.textAlign = "right"
    canvas.beginPath()
    for (const tick of ticks(0, most, 3)) {
      canvas.moveTo(LINE_LEFT, down(tick))
      canvas.lineTo(width, down(tick))
      canvas.fillText(compact(tick), LINE_LEFT - 5, down(tick) + 4)
    }
    canvas.stroke()
    canvas.textAlign = "center"
    const step = TIME_STEPS.find(each => (end - begin) / each <= (width - LINE_LEFT) / 60) ?? TIME_STEPS.at(-1)
    for (let tick = Math.ceil(begin / step) * step; tick <= end; tick += step)
      if (across(tick) > LINE_LEFT + 12 && across(tick) < width - 14) canvas.fillText(moment_text(tick), across(tick), height - 3)
    for (const {times, values, colour, dash} of lines) {
      canvas.beginPath()
      let pen = false
      values.forEach((value, row) => {
        if (value != null) canvas[pen ? "lineTo" : "moveTo"](across(times[row]), down(value))
        pen = value != null
      })
      canvas.strokeStyle = colour
      canvas.lineWidth = 2
      canvas.setLineDash(dash)
      canvas.stroke()
      canvas.setLineDash([])
    }
    const marked = this.moment - this.ahead
    if (marked >= begin && marked <= end) {
      canvas.fillStyle = style.getPropertyValue("--ink")
      canvas.fillRect(across(marked) - 0.5, LINE_TOP, 1, height - LINE_TOP - LINE_BOTTOM)
    }
    const last = lines.map(({name, column, values}) => `${name}${columns.length > 1 ? ` ${column}` : ""} ${shown_value(values.at(-1))}`)
    element.setAttribute("aria-label", `${element.dataset.name}: ${last.join(", ") || "nothing yet"}`)
  }
  // The figures at the pointer.
  at(element, {offsetX}) {
    const {columns} = this.plots.find(plot => plot.element == element), [begin, end] = this.span()
    const enlarged = parseFloat(getComputedStyle(element).fontSize) / FONT_PIXELS
    const time = begin + (offsetX / enlarged - LINE_LEFT) / (element.clientWidth / enlarged - LINE_LEFT - 4) * (end - begin)
    return this.lines(columns).map(({name, times, values}) => {
      const row = times.findLastIndex(each => each <= time)
      return `${name}: ${shown_value(values[row])}`
    }).join("\n")
  }
}
function shown_value(value) {
  return value == null ? "unknown" : value.toLocaleString("en", {maximumSignificantDigits: 6})
}
// Hours and minutes at full minutes, only the seconds between them.
function moment_text(time) {
  const text = new Date(time).toLocaleTimeString("en", {timeStyle: "medium", hourCycle: "h23"})
  return text.endsWith(":00") ? text.slice(0, 5) : text.slice(5)
}
