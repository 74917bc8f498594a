// The bar below the picture: which moment is shown, how far one can go back, and what is missing there.
import { put } from "./dom.js"
import { isoTime } from "./dynhull/json.js"
const LEAST_STEP = 0.1, MOST_STEPS = 1000, MOST_HOLES = 1000
export const moment_format = new Intl.DateTimeFormat("en", {year: "numeric", month: "short", day: "numeric", hour: "2-digit", minute: "2-digit",
  second: "2-digit", hourCycle: "h23", timeZoneName: "short"})
const clock_format = new Intl.DateTimeFormat("en", {hour: "2-digit", minute: "2-digit", second: "2-digit", hourCycle: "h23", timeZoneName: "short"})
export class TimeBar {
  constructor(recorder, form) {
    this.recorder = recorder
    this.hulls = []  // what is kept of each, with its colour
    this.known = false  // whether that is known of all
    this.holes = []  // moments at which something was missing
    this.wanted = undefined  // the moment of the link, until it is known what the server has kept
    this.missed = ""
    const at = name => form.querySelector(name)
    this.form = form
    this.button = at(".pause")
    this.slider = at("[type=range]")
    this.field = at("[type=datetime-local]")
    this.strip = at("canvas")
    this.oldest = at(".oldest")
    this.output = at("[role=timer]")
    this.why = at(".why")
    this.back = at(".live")
    this.button.onclick = () => recorder.toggle()
    this.back.onclick = () => {
      recorder.go_live()
      this.button.focus()  // the other one has nothing to do any more
    }
    at("select").onchange = ({target}) => recorder.speed = +target.value
    this.slider.oninput = () => recorder.go(this.slider.value - this.slider.step / 2 < this.leftmost ? recorder.earliest : Date.now() + 1000 * this.slider.value)
    this.field.onchange = () => this.field.value && recorder.go(new Date(this.field.value).getTime())
    this.update()
    setInterval(() => this.update(), 1000)
  }
  // What the server has kept of the hulls on the page.
  keep(hulls) {
    this.hulls = hulls
    this.known = hulls.every(({known}) => known)
    this.recorder.kept = hulls.reduce((least, {first}) => first == null ? least : Math.min(least ?? Infinity, first), undefined)
    this.form.classList.toggle("kept", this.recorder.kept != undefined)
    if (this.wanted != undefined && hulls.length && this.known) this.reach(this.wanted)
    this.update()
  }
  // Shows the moment of the link, if it is kept.
  reach(moment) {
    this.wanted = undefined
    if (moment >= this.recorder.earliest) this.recorder.go(moment)
    else this.missed = `The link is of ${moment_format.format(moment)}, which is not kept.`
  }
  update() {
    const {live, moment, earliest, paused_at, past} = this.recorder, now = Date.now()
    const seconds = Math.max(1, (now - earliest) / 1000), step = Math.max(LEAST_STEP, Math.floor(seconds / MOST_STEPS))
    if (!live) {
      this.wanted = undefined
      this.missed = ""
    }
    this.leftmost = +this.slider.min  // whoever went there may be told of it when the bar has grown
    this.slider.step = step
    this.slider.min = -Math.ceil(seconds / step) * step
    if (!this.slider.matches(":active")) this.slider.value = live ? 0 : (moment - now) / 1000
    if (document.activeElement != this.field) {
      this.field.min = local_text(earliest)
      this.field.max = local_text(now)
      this.field.value = local_text(moment)
    }
    this.button.textContent = paused_at == undefined ? "Pause" : "Play"
    this.back.disabled = live
    const text = live ? "Live" : `${moment_format.format(moment)}, ${ago(now - moment)}${past && !past.ready ? ", reading" : ""}`
    put(this.output, text)
    this.slider.setAttribute("aria-valuetext", text)
    put(this.oldest, this.reach_words())
    put(this.why, live && !this.missed ? "" : [this.missed, ...this.hulls.map(({words}) => words)].filter(Boolean).join(" "))
    if (past?.holes.length && this.holes.at(-1) != moment) this.holes = [...this.holes.slice(1 - MOST_HOLES), moment]
    this.draw(earliest, now)
  }
  // How far one can go back, and why not further.
  reach_words() {
    const {kept, began, recorded} = this.recorder
    if (kept != undefined) return `Kept since ${moment_format.format(kept)}`
    if (!this.known) return ""
    const reach = recorded == began ? `to ${clock_format.format(began)}, when this page was opened` : "for five minutes"
    return `Back ${reach}: what it shows keeps no past`
  }
  // A line a hull, as far as its past goes back: thin where keys were erased, with marks where it could not be read.
  draw(begin, end) {
    const {strip} = this, {clientWidth: width, clientHeight: height} = strip
    strip.hidden = this.recorder.kept == undefined
    if (strip.hidden || !width) return
    strip.width = width * devicePixelRatio
    strip.height = height * devicePixelRatio
    const canvas = strip.getContext("2d"), kept = this.hulls.filter(({first}) => first != null), high = height / kept.length
    canvas.scale(devicePixelRatio, devicePixelRatio)
    const across = moment => (moment - begin) / (end - begin) * width
    const bar = (from, to, top, high) => canvas.fillRect(across(from), top, Math.max(1, across(to) - across(from)), high)
    kept.forEach(({first, erased, colour}, row) => {
      canvas.fillStyle = colour
      bar(first, end, row * high, high - 1)
      for (const [from, to] of erased) {
        canvas.clearRect(across(from), row * high, Math.max(1, across(to) - across(from)), high)
        bar(from, to, row * high + (high - 1) / 2 - 0.5, 1)
      }
    })
    canvas.fillStyle = getComputedStyle(strip).getPropertyValue("--alarm")
    for (const hole of this.holes) canvas.fillRect(across(hole) - 1, 0, 2, height)
  }
}
// A moment as it is in a link: to the microsecond, as revisions have it.
export function text_of(moment) {
  return isoTime(BigInt(Math.round(1000 * moment)))
}
// And back, in milliseconds since 1970; undefined for what is no moment.
export function moment_of(text) {
  const whole = Date.parse(text ?? ""), [, parts = ""] = /\.\d{3}(\d+)/.exec(text) ?? []
  return isNaN(whole) ? undefined : whole + +`.${parts}0`
}
// As a field for a local date and time has it.
function local_text(moment) {
  return new Date(moment - 60_000 * new Date(moment).getTimezoneOffset()).toISOString().slice(0, 19)
}
function ago(milliseconds) {
  const [size, unit] = [[86_400_000, "d"], [3_600_000, "h"], [60_000, "min"]].find(([size]) => milliseconds >= 2 * size) ?? [1000, "s"]
  return `${Math.round(milliseconds / size)} ${unit} ago`
}
