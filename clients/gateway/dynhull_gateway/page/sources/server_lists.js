// The server's hulls and fences to pick from, and whether it answers.
import { DynhullError } from "../dynhull/errors.js"
import { Bell, repeat } from "./repeating.js"
const POLL = 1000
// Too many to pick from; --prefix narrows the list.
const MOST_LISTED = 300
export class ServerList {
  by_name = new Map()  // the first MOST_LISTED, by name, and of more as many that begin with what is typed
  #typed = ""
  #bell = new Bell()
  listed = false  // whether the list has arrived once
  error = null  // why the server did not answer the last request
  // `ask` lists what begins with a prefix; `told` is called after each answer, with whether there was one.
  constructor(prefix, ask, told = () => {}) {
    this.prefix = prefix
    this.closing = new AbortController()
    repeat(this.closing.signal, () => this.#poll(ask, told, this.closing.signal), () => POLL, this.#bell)
  }
  close() {
    this.closing.abort()
  }
  // What the viewer types: where there are too many names, those that begin with it are listed, too.
  set typed(letters) {
    this.#typed = letters
    if (this.by_name.size >= MOST_LISTED) this.#bell.ring()
  }
  get names() {
    return [...this.by_name.keys()]
  }
  async #poll(ask, told, signal) {
    const found = new Map()
    const list = async (prefix, most) => {
      for await (const each of ask(prefix, {signal})) {
        if (found.size == most) break
        found.set(each.name, each)
      }
    }
    try {
      await list(this.prefix, MOST_LISTED)
      if (found.size == MOST_LISTED && this.#typed.length > this.prefix.length && this.#typed.startsWith(this.prefix)) await list(this.#typed, 2 * MOST_LISTED)
      Object.assign(this, {by_name: found, listed: true, error: null})
    } catch (error) {
      if (signal.aborted || !(error instanceof DynhullError)) throw error
      this.error = error
    }
    told(this.error == null)
  }
  // The one with the most points, in a list; an empty list where there are none.
  largest() {
    return [...this.by_name.values()].sort((one, two) => two.points - one.points).slice(0, 1).map(({name}) => name)
  }
  // What the names of several begin with, up to one of their slashes.
  prefixes() {
    const counts = new Map()
    for (const name of this.names)
      for (const {index} of name.matchAll(/\//g)) counts.set(name.slice(0, index + 1), (counts.get(name.slice(0, index + 1)) ?? 0) + 1)
    return [...counts].filter(([, many]) => many > 1).map(([prefix]) => prefix).sort()
  }
}
