// The moments of the picture to go back to. Of the last minutes it keeps what came, as text: of what is old and
// much, every other drawing. What is older the server plays, as far as it has kept it.
import { NOBODY, NO_AREA } from "./dynhull/map/fences.js"
import { NOTHING, NO_OUTLIERS } from "./dynhull/map/hulls.js"
import { RECORDED_MILLISECONDS } from "./dynhull/map/trails.js"
const MOST_TEXT = 60_000_000, TICK = 100
export class Recorder {
  // `show` is given messages, whether they come now or are shown again; `ask` what is to be played, or null.
  constructor(show, changed, ask) {
    this.show = show
    this.changed = changed
    this.ask = ask
    this.kept = undefined  // the oldest moment that the server has kept
    this.past = undefined  // what it plays: the number of the request, the moment, and whether that is there
    this.number = 0
    this.tracks = new Map()  // by what is drawn: moments and texts, in order
    this.length = 0
    this.lag = 0  // milliseconds between the moment shown and now, while it is moving
    this.paused_at = undefined
    this.pace = 1
    this.began = Date.now()
    setInterval(() => this.tick(), TICK)
  }
  get live() {
    return this.paused_at == undefined && this.lag == 0 && !this.past
  }
  get moment() {
    return this.past?.moment ?? this.paused_at ?? Date.now() - this.lag
  }
  get recorded() {
    return Math.max(this.began, Date.now() - RECORDED_MILLISECONDS)
  }
  get earliest() {
    return Math.min(this.recorded, this.kept ?? Infinity)
  }
  get speed() {
    return this.pace
  }
  set speed(pace) {
    this.pace = pace
    if (this.past && this.paused_at == undefined) this.go_back(this.moment, pace)
  }
  take(message, text) {
    const subject = message.within ?? message.fence ?? message.hull, now = Date.now()
    const name = `${message.kind} of ${subject}${message.within == undefined ? "" : ` ${message.hull}`}`
    const track = this.tracks.get(name) ?? {name, moments: [], texts: [], subject}
    this.tracks.set(name, track)
    track.moments.push(now)
    track.texts.push(text)
    this.length += text.length
    // The last one before the earliest moment stays: it is what was to be seen then.
    while (track.moments.length > 1 && track.moments[1] < now - RECORDED_MILLISECONDS) this.drop(track, 0)
    if (this.length > MOST_TEXT) this.thin()
    if (this.live) this.show(message)
  }
  drop(track, row) {
    track.moments.splice(row, 1)
    this.length -= track.texts.splice(row, 1)[0].length
  }
  thin() {
    for (const track of this.tracks.values())
      for (let row = Math.floor(track.moments.length / 2); row > 0; row -= 2) this.drop(track, row)
  }
  keep(names) {
    for (const [name, track] of this.tracks) {
      if (names.includes(track.subject)) continue
      for (const text of track.texts) this.length -= text.length
      this.tracks.delete(name)
    }
  }
  // Shows the picture as it was at a moment.
  go(moment) {
    this.paused_at = Math.max(this.earliest, Math.min(Date.now(), moment))
    if (this.paused_at < this.recorded) return this.go_back(this.paused_at, 0)
    this.leave_past()
    this.show_from(-Infinity, this.paused_at)
    this.changed()
  }
  // Has the server play from a moment on. What it does not play disappears, but for the areas of fences.
  go_back(moment, speed) {
    if (!this.past)
      for (const [{texts}, message] of [...this.tracks.values()].map(track => [track, JSON.parse(track.texts.at(-1))]))
        if (message.kind != "area") this.show(message.kind == "events" ? message : emptied(JSON.parse(texts[0])))
    this.past = {number: ++this.number, moment, speed, ready: false, holes: []}
    this.ask({number: this.number, moment, speed})
    this.changed()
  }
  leave_past() {
    if (!this.past) return
    this.past = undefined
    this.ask(null)
  }
  // A part of the past that the server plays.
  take_past({number, drawn, said, ...what}) {
    if (number != this.past?.number) return
    if (drawn) this.show(drawn)
    for (const [name, text] of Object.entries(said ?? {})) this.show({kind: `said ${name}`, name, said: text})
    if (what.moment == undefined) return
    Object.assign(this.past, what)
    if (this.paused_at == undefined && this.past.moment >= this.recorded) {
      this.paused_at = this.past.moment
      this.leave_past()
      this.show_from(0, this.paused_at)  // what is not recorded yet stays as it was played
      this.play()
    }
    this.changed()
  }
  pause() {
    this.go(this.moment)
  }
  play() {
    if (this.paused_at == undefined) return
    const moment = this.paused_at
    this.paused_at = undefined
    if (this.past) return this.go_back(moment, this.speed)
    this.lag = Math.max(0, Date.now() - moment)
    this.shown = this.moment
    this.changed()
  }
  toggle() {
    if (this.paused_at == undefined) this.pause()
    else this.play()
  }
  go_live() {
    this.paused_at = undefined
    this.lag = 0
    this.leave_past()
    this.show_from(-Infinity, Infinity)
    this.changed()
  }
  tick() {
    if (this.past) return
    if (this.paused_at == undefined && this.lag > 0) {
      this.lag = Math.min(this.lag - TICK * (this.speed - 1), Date.now() - this.recorded)
      if (this.lag <= TICK) return this.go_live()
      const until = this.moment
      this.show_from(this.shown, until)
      this.shown = until
    }
    if (!this.live) this.changed()
  }
  // Of each track the last message of an interval, where there is one.
  show_from(after, until) {
    for (const {moments, texts} of this.tracks.values()) {
      const row = moments.findLastIndex(moment => moment <= until)
      if (row >= 0 && moments[row] > after) this.show(JSON.parse(texts[row]))
      else if (row < 0 && after == -Infinity && moments.length) this.show(emptied(JSON.parse(texts[0])))
    }
  }
}
// What was to be seen before the first message.
function emptied(message) {
  const said = Array.isArray(message.said) ? [] : message.said && ""
  return {...message, ...NOTHING, ...NO_OUTLIERS, ...NO_AREA, ...NOBODY, rows: [], said, hull: message.fence ? [] : message.hull}
}
