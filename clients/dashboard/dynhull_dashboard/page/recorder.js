// The last minutes of the picture, to go back to. It keeps what the server sent, as text: of what is old and much, every
// other drawing.
const RECORDED_MILLISECONDS = 5 * 60_000, MOST_TEXT = 60_000_000, TICK = 100
class Recorder {
  // `show` is given messages, whether they come now or are shown again.
  constructor(show, changed) {
    this.show = show
    this.changed = changed
    this.tracks = new Map()  // by what is drawn: moments and texts, in order
    this.length = 0
    this.lag = 0  // milliseconds between the moment shown and now, while it is moving
    this.paused_at = undefined
    this.speed = 1
    this.began = Date.now()
    setInterval(() => this.tick(), TICK)
  }
  get live() {
    return this.paused_at == undefined && this.lag == 0
  }
  get moment() {
    return this.paused_at ?? Date.now() - this.lag
  }
  get earliest() {
    return Math.max(this.began, Date.now() - RECORDED_MILLISECONDS)
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
    this.show_from(-Infinity, this.paused_at)
    this.changed()
  }
  pause() {
    this.go(this.moment)
  }
  play() {
    if (this.paused_at == undefined) return
    this.lag = Math.max(0, Date.now() - this.paused_at)
    this.paused_at = undefined
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
    this.show_from(-Infinity, Infinity)
    this.changed()
  }
  tick() {
    if (this.paused_at == undefined && this.lag > 0) {
      this.lag = Math.min(this.lag - TICK * (this.speed - 1), Date.now() - this.earliest)
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
  return {...message, ...NOTHING, ...NO_OUTLIERS, ...NO_AREA, ...NOBODY, rows: [], hull: message.fence ? [] : message.hull}
}
class TimeBar {
  constructor(recorder, form) {
    this.recorder = recorder
    const at = name => form.querySelector(name)
    this.button = at(".pause")
    this.slider = at("input")
    this.output = at("[role=timer]")
    this.back = at(".live")
    this.button.onclick = () => recorder.toggle()
    this.back.onclick = () => recorder.go_live()
    at("select").onchange = ({target}) => recorder.speed = +target.value
    this.slider.oninput = () => recorder.go(Date.now() + 1000 * this.slider.value)
    this.update()
    setInterval(() => this.update(), 1000)
  }
  update() {
    const {live, moment, earliest, paused_at} = this.recorder
    this.slider.min = -Math.max(1, Math.ceil((Date.now() - earliest) / 1000))
    if (document.activeElement != this.slider || !this.slider.matches(":active")) this.slider.value = live ? 0 : (moment - Date.now()) / 1000
    this.button.textContent = paused_at == undefined ? "Pause" : "Play"
    this.back.disabled = live
    const time = new Date(moment).toLocaleTimeString("en", {timeStyle: "medium", hourCycle: "h23"})
    const text = live ? "Live" : `${time}, ${Math.round((Date.now() - moment) / 1000)} s ago`
    if (this.output.textContent != text) this.output.textContent = text
    this.slider.setAttribute("aria-valuetext", text)
  }
}
