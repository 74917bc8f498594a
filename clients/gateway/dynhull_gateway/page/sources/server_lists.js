// The server's hulls and fences to pick from, and whether it answers.
import { DynhullError } from "../dynhull/errors.js"
import { repeat } from "./repeating.js"
const POLL = 1000
// Too many to pick from; --prefix narrows the list.
const MOST_LISTED = 300
export class ServerList {
  by_name = new Map()  // the first MOST_LISTED, by name
  listed = false  // whether the list has arrived once
  error = null  // why the server did not answer the last request
  // `ask` lists what begins with a prefix; `told` is called after each answer, with whether there was one.
  constructor(prefix, ask, told = () => {}) {
    this.prefix = prefix
    this.closing = new AbortController()
    repeat(this.closing.signal, () => this.#poll(ask, told, this.closing.signal), () => POLL)
  }
  close() {
    this.closing.abort()
  }
  get names() {
    return [...this.by_name.keys()]
  }
  async #poll(ask, told, signal) {
    const found = new Map()
    try {
      for await (const each of ask(this.prefix, {signal})) {
        if (found.size == MOST_LISTED) break
        found.set(each.name, each)
      }
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
