// The past of hulls, played from a moment on.
import { DynhullError } from "../dynhull/errors.js"
import { HullCopy } from "../dynhull/hull-copy.js"
import { isoTime } from "../dynhull/json.js"
import { HullState, SAMPLE_SIZE } from "./hull_state.js"
import { Bell, repeat, rest } from "./repeating.js"
const PICTURE = 100, RETRY = 1000
// The moment that is shown. It begins to move once all hulls are there.
class PastClock {
  #begun
  // The moment to begin with, in milliseconds since 1970, and how many seconds of the past go by in one; 0 for none.
  constructor(begin, speed) {
    this.begin = begin
    this.speed = speed
  }
  // Never after now.
  get moment() {
    const passed = this.#begun == undefined ? 0 : this.speed * (performance.now() - this.#begun)
    return Math.min(this.begin + passed, Date.now())
  }
  start() {
    this.#begun ??= performance.now()
  }
  async reach(moment, signal) {
    while (this.moment < moment && !signal.aborted) await rest(PICTURE, signal)
  }
}
// A hull as it was, up to the moment of the clock.
class PastHull extends HullState {
  failure = null  // why it cannot be shown at this moment
  ready = false  // whether it is there, or cannot be
  #moved = new Bell()
  constructor(source, live, clock) {
    super(live.name)
    this.source = source
    this.kept = live.kept
    this.keyed = live.keyed
    this.clock = clock
    this.closing = new AbortController()
    const {signal} = this.closing
    this.#run(signal)
    repeat(signal, () => this.#ask_sample(signal), () => this.sample_pause, this.#moved)
  }
  close() {
    this.closing.abort()
  }
  // When its past begins, if that is later than the moment.
  get waits_for() {
    const {first} = this.kept
    return first != undefined && this.clock.moment < first ? first : undefined
  }
  // Whether its past is kept, but cannot be read.
  get is_hole() {
    return ["PAST_DAMAGED", "STORAGE_FAILED"].includes(this.failure?.reason)
  }
  // Whether it may be otherwise later at the same moment.
  get may_heal() {
    const {failure} = this
    return failure != null && (this.is_hole || !(failure instanceof DynhullError) || failure.passing || failure.unknown)
  }
  // Again where it ends: the hull may have moved on meanwhile, or a hole lies behind.
  async #run(signal) {
    while (!signal.aborted) {
      try {
        await this.#play(signal)
        this.failure = null
      } catch (error) {
        if (signal.aborted) return
        this.reset()
        this.failure = error
      }
      this.ready = true
      if (!this.clock.speed && !this.may_heal) return
      await rest(RETRY, signal)
    }
  }
  async #play(signal) {
    const {clock, kept} = this, copy = new HullCopy()
    try {
      await kept.ask(signal)
    } catch (error) {
      if (!error.unknown) throw error
    }
    let start = isoTime(BigInt(Math.round(1000 * clock.moment)))
    const first = this.waits_for
    if (first != undefined) {
      this.reset()
      this.failure = null
      this.ready = true
      if (!clock.speed) return
      await clock.reach(first, signal)
      start = kept.history.firstRevision
    }
    const every = clock.speed * PICTURE / 1000 || undefined, end = clock.speed ? undefined : start
    const view = {start, end, every, speed: clock.speed || undefined, measures: true, keys: this.keyed || undefined, copy, reconnect: false, signal}
    for await (const event of this.source.client.replay(this.name, view)) {
      this.ready = true
      if (event.type == "deleted") return this.reset()
      if (this.followed && event.changed != null) await clock.reach(Number(event.changed) / 1000, signal)
      if (signal.aborted) return
      this.failure = null
      this.take(event, copy)
      this.#moved.ring()
    }
  }
  async #ask_sample(signal) {
    const {revision} = this
    if (!this.followed || this.sample.revision == revision) return
    const sampled = await this.source.client.samplePoints(this.name, {size: SAMPLE_SIZE, keys: this.keyed, at: revision, signal})
    if (this.followed) this.take_sample(sampled)
  }
}
// What the page sees of the past: `number` is that of its request, which all messages have.
export class PastPlay {
  hulls = new Map()
  #drawn = new Map()
  constructor(source, {number, moment, speed}) {
    this.source = source
    this.number = number
    this.clock = new PastClock(moment, speed)
  }
  // Plays these hulls and no others.
  show(live) {
    const names = live.map(({name}) => name)
    for (const [name, hull] of this.hulls) {
      if (names.includes(name)) continue
      hull.close()
      this.hulls.delete(name)
      this.#drawn.delete(name)
    }
    for (const feed of live) if (!this.hulls.has(feed.name)) this.hulls.set(feed.name, new PastHull(this.source, feed, this.clock))
  }
  // The drawings that are new since the last call, and then their moment.
  *messages() {
    for (const [name, {drawings}] of this.hulls) {
      const before = this.#drawn.get(name) ?? []
      for (const drawn of drawings) if (!before.includes(drawn)) yield {kind: "past", number: this.number, drawn}
      this.#drawn.set(name, drawings)
    }
    const hulls = [...this.hulls.values()], ready = hulls.every(({ready}) => ready)
    if (ready) this.clock.start()
    const holes = hulls.filter(({is_hole}) => is_hole).map(({name}) => name)
    yield {kind: "past", number: this.number, moment: this.clock.moment, ready, holes}
  }
  close() {
    this.show([])
  }
}
