// What the server has kept of the past of a hull.
const MOST_ERASURES = 100
export class Kept {
  history = null  // what is there
  trouble = null  // why there is none
  #times = new Map()  // when the revisions were committed at which erasures begin and end
  constructor({asker, address}, name) {
    this.asker = asker
    this.address = address
    this.name = name
  }
  // The oldest moment that can be shown, in milliseconds since 1970; undefined where none is kept.
  get first() {
    const {history, firstTime} = this.history ?? {}
    return history == null || firstTime == null ? undefined : Math.ceil(Number(firstTime) / 1000)  // not before it
  }
  // The last erasure after which this revision may lack keys.
  erased(revision) {
    return this.history?.erasures.findLast(({firstRevision, lastRevision}) => firstRevision <= revision && revision <= lastRevision)
  }
  // From when to when keys were erased, in milliseconds since 1970.
  get spans() {
    const ends = (this.history?.erasures ?? []).map(each => [each.firstRevision, each.lastRevision].map(end => this.#times.get(end)))
    return ends.filter(([begin, end]) => begin && end).map(span => span.map(time => Number(time) / 1000))
  }
  // What to say to who wants to go back further than the page does; empty where nothing is to be done.
  get words() {
    if (this.trouble) return this.trouble.reason == "HULL_UNSUITABLE" ? `${this.trouble.message}.` : ""
    if (!this.history || this.history.history != null) return ""
    return `${this.name} keeps no past. Keep it: dynhull history set ${this.name} 30d --address ${this.address}`
  }
  get message() {
    return {hull: this.name, known: Boolean(this.history ?? this.trouble), first: this.first ?? null, erased: this.spans, words: this.words}
  }
  async ask(signal) {
    try {
      const history = await this.asker.history(this.name, {signal})
      await this.#ask_times(history, signal)
      this.history = history
      this.trouble = null
    } catch (error) {
      if (signal.aborted) return
      this.history = null
      this.trouble = error
      throw error
    }
  }
  // When the revisions were committed between which keys were erased: that does not change.
  async #ask_times({erasures, firstRevision}, signal) {
    const ends = new Set(erasures.slice(-MOST_ERASURES).flatMap(each => [each.firstRevision, each.lastRevision]))
    for (const end of this.#times.keys()) if (!ends.has(end)) this.#times.delete(end)
    for (const end of ends) {
      if (this.#times.has(end)) continue
      try {
        const {info} = await this.asker.at(this.name, end < firstRevision ? firstRevision : end, {signal})
        this.#times.set(end, info.changed)
      } catch { /* a segment is away */ }
    }
  }
}
