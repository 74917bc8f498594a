// One hull, followed until it is closed.
import { HullCopy } from "../dynhull/hull-copy.js"
import { SQUARE_KILOMETRE } from "../degrees.js"
import { HullState, SAMPLE_SIZE } from "./hull_state.js"
import { Kept } from "./kept.js"
import { Bell, repeat, rest } from "./repeating.js"
import { KeySearch } from "./search.js"
const MAX_RATE = 10, RETRY = 1000, TICK = 1000, SEARCH = 200, VERIFY = 30_000, KEPT = 2000
const LONGEST_SECONDS = 3600, LOST = {reason: "LOST", status: 0, message: "Connection lost"}
export class HullFeed extends HullState {
  constructor(source, name) {
    super(name)
    this.source = source
    this.lines = []  // rows of the time lines that nobody has taken
    this.kept = new Kept(source, name)
    this.search = new KeySearch(source, name)
    this.failure = this.lost = null
    this.verify_bell = new Bell()
    this.closing = new AbortController()
    const {signal} = this.closing
    this.follow(signal)
    this.count(signal)
    repeat(signal, () => this.ask_sample(signal), () => this.sample_pause)
    repeat(signal, () => this.followed && this.verify(signal), () => this.followed ? VERIFY : RETRY, this.verify_bell)
    repeat(signal, () => this.followed && this.kept.ask(signal), () => KEPT)
    repeat(signal, () => this.search.ask(this.copy, signal), () => SEARCH, this.search.bell)
  }
  // The hull is missing: nothing is known of it, nor of its keys.
  reset() {
    super.reset()
    this.verified = undefined  // the last verification, and its time
    this.keyed = true  // until the server says otherwise
    this.copy = new HullCopy()
    this.search?.forget()
  }
  verify_now() {
    this.verify_bell.ring()
  }
  close() {
    this.closing.abort()
  }
  // Why it is not up to date at the moment; null where it is.
  get trouble() {
    return this.failure ?? this.lost
  }
  get live() {
    return this.followed && !this.trouble
  }
  // A watch survives lost connections, but ends when the hull is deleted: then another one begins.
  async follow(signal) {
    while (!signal.aborted) {
      const copy = this.copy = new HullCopy(), onLost = lost => this.lost = lost ? LOST : null
      try {
        const view = {rate: MAX_RATE, measures: true, keys: this.keyed || undefined, wait: false, copy, signal, onLost}
        for await (const event of this.source.client.watch(this.name, view)) {
          if (event.type == "deleted") break
          const first = !this.followed
          this.failure = null
          this.take(event, copy)
          if (first) this.verify_bell.ring()
        }
        if (!signal.aborted) this.reset()
      } catch (error) {
        if (signal.aborted) return
        if (error.reason == "HULL_UNSUITABLE" && this.keyed) {
          this.keyed = false
          continue
        }
        this.failure = error
        if (error.status == 404) this.reset()
      }
      await rest(RETRY, signal)
    }
  }
  // Begins the time lines with what the server has kept, then adds a row every second.
  async count(signal) {
    await this.begin_lines(signal)
    let before = this.revision, then = performance.now()
    while (!signal.aborted) {
      await rest(TICK, signal)
      const {revision, live} = this, now = performance.now()
      // After a gap, or when another hull took the name, the difference is not the work of the last second.
      this.rate = live && 0 < before && before <= revision ? 1000 * (revision - before) / (now - then) : NaN
      before = live ? revision : 0
      then = now
      this.lines.push(live ? [Date.now(), this.points, this.vertices, this.shown_area, this.rate] : [Date.now(), NaN, NaN, NaN, NaN])
    }
  }
  // Once there is the hull, and again while the server has no answer, however long that takes: a page that is loaded when all are busy
  // is to have the last hour, too.
  async begin_lines(signal) {
    while (!signal.aborted) {
      if (this.followed)
        try {
          return this.lines.push(...past_rows(await this.source.asker.series(this.name, {last: LONGEST_SECONDS, signal}), Date.now()))
        } catch (error) {
          if (error.status == 501) return  // of an earlier version
          await rest(RETRY, signal)
        }
      await rest(TICK / 10, signal)
    }
  }
  async ask_sample(signal) {
    if (!this.followed || this.sample.revision == this.revision) return
    this.take_sample(await this.source.client.samplePoints(this.name, {size: SAMPLE_SIZE, keys: this.keyed, signal}))
  }
  async verify(signal) {
    const outcome = await this.source.client.verify(this.name, {signal})
    this.verified = {outcome, at: Date.now()}
  }
}
// Rows of time in milliseconds, points, vertices, area and rate, each a point of a line. Where a hull was unchanged for long, its
// line is level: there is a row before the change, too. The last row is of `now`, whatever the server's clock says.
export function* past_rows({interval, times, since, geographic, points, vertices, areas, rates}, now) {
  const apart = 1000 * (interval || LONGEST_SECONDS), least = Number(since) / 1000
  const moments = times.map(time => Math.max(Number(time) / 1000, least)), ahead = now - moments.at(-1)
  let before
  for (const [row, moment] of moments.entries()) {
    const time = moment + ahead, figures = [points[row], vertices[row], geographic ? areas[row] / SQUARE_KILOMETRE : areas[row]]
    if (before && time - before[0] > 2 * apart) yield [time - apart, ...before[1], 0]
    yield [time, ...figures, rates[row] ?? NaN]
    before = [time, figures]
  }
}
