// The alarms of the server, and the rows that the page has of them.
import { number, span_text } from "../words/numbers.js"
import { Bell, repeat, rest } from "./repeating.js"
const LIST = 1000, READ = 1000, RETRY = 1000
// Each is followed. Of more alarms those with the first names are shown.
const MOST_ALARMS = 50, MOST_ROWS = 100
// An alarm that is cleared is seen for a while.
const CLEARED = 30_000
// Of the numbers on the globe, in metres and square metres.
const SIZES = {m: [1, " m"], km: [1e3, " km"], m2: [1, " m²"], km2: [1e6, " km²"]}
const STATES = ["raised", "acknowledged", "muted", "cleared"]  // in the order of the list
class AlarmFeed {
  alarm = null  // what is known of it; null before the first answer, and once it is deleted
  cleared = new Map()  // when it was cleared for hulls
  forbidden = false  // whether the token may not acknowledge or mute it, as was seen when somebody tried
  #bell = new Bell()
  constructor({client, asker}, name) {
    this.client = client
    this.asker = asker
    this.name = name
    this.closing = new AbortController()
    repeat(this.closing.signal, () => this.#read(this.closing.signal), () => READ, this.#bell)
    this.#follow(this.closing.signal)
  }
  close() {
    this.closing.abort()
  }
  // Somebody has acknowledged or muted it.
  read_now() {
    this.#bell.ring()
  }
  async #read(signal) {
    try {
      this.alarm = await this.asker.getAlarm(this.name, {signal})
    } catch (error) {
      if (error.status == 404) this.alarm = null
      throw error
    }
    for (const {hull, raised} of this.alarm.statuses) if (raised) this.cleared.delete(hull)
    for (const [hull, at] of this.cleared) if (at < Date.now() - CLEARED) this.cleared.delete(hull)
  }
  // It is read at once where something has happened.
  async #follow(signal) {
    while (!signal.aborted) {
      try {
        for await (const {type, hull} of this.client.watchAlarm(this.name, {signal})) {
          if (type == "cleared") this.cleared.set(hull, Date.now())
          this.#bell.ring()
        }
      } catch { /* reading it fails for the same reason */ }
      await rest(RETRY, signal)
    }
  }
}
export class AlarmList {
  feeds = new Map()
  constructor(source) {
    this.source = source
    this.closing = new AbortController()
    repeat(this.closing.signal, () => this.#list(this.closing.signal), () => LIST)
  }
  close() {
    this.closing.abort()
    for (const feed of this.feeds.values()) feed.close()
  }
  // Does something about an alarm; returns why not, empty where it was done.
  async acknowledge(name, hull) {
    return this.#change(name, asker => asker.acknowledgeAlarm(name, hull))
  }
  // For so many seconds, 0 for no longer.
  async mute(name, hull, seconds) {
    return this.#change(name, asker => asker.muteAlarm(name, hull, seconds ? new Date(Date.now() + 1000 * seconds) : null))
  }
  async #change(name, act) {
    const feed = this.feeds.get(name)
    try {
      await act(this.source.asker)
      feed?.read_now()
      return ""
    } catch (error) {
      if (error.status != 403) return `${name}: ${error.message}`
      if (feed) feed.forbidden = true
      return `${error.message}. Start the dashboard with a --token that may write ${name}`
    }
  }
  async #list(signal) {
    const names = []
    for await (const {name} of this.source.asker.listAlarms(this.source.prefix, {signal})) if (names.push(name) == MOST_ALARMS) break
    for (const [name, feed] of this.feeds) {
      if (names.includes(name)) continue
      feed.close()
      this.feeds.delete(name)
    }
    for (const name of names) if (!this.feeds.has(name)) this.feeds.set(name, new AlarmFeed(this.source, name))
  }
  // For how many hulls alarms are raised that nobody takes care of, and that are not muted.
  get raised() {
    return this.#all.filter(({state}) => state == "raised").length
  }
  // Those that nobody takes care of first, then by time.
  get rows() {
    const order = row => STATES.indexOf(row.state)
    return this.#all.sort((one, two) => order(one) - order(two) || two.since - one.since).slice(0, MOST_ROWS)
  }
  get #all() {
    return [...this.feeds.values()].filter(({alarm}) => alarm).flatMap(rows_of)
  }
}
function rows_of({alarm, cleared, forbidden}) {
  const same = {alarm: alarm.name, rule: condition_text(alarm), may: !forbidden}
  const raised = alarm.statuses.filter(({raised}) => raised).map(status => ({
    ...same, hull: status.hull, state: state_of(status), value: value_text(alarm.when, status.value),
    since: Number(status.since ?? alarm.created) / 1000, muted: status.mutedUntil == null ? null : Number(status.mutedUntil) / 1000}))
  return [...raised, ...[...cleared].map(([hull, at]) => ({...same, hull, state: "cleared", value: "", since: at, muted: null}))]
}
function state_of({mutedUntil, acknowledged}) {
  if (mutedUntil != null && Number(mutedUntil) / 1000 > Date.now()) return "muted"
  return acknowledged == null ? "raised" : "acknowledged"
}
// What raises and clears an alarm.
function condition_text({when, clear, for: held}) {
  return `${when}${held ? ` for ${span_text(held)}` : ""}${clear ? `, clear ${clear}` : ""}`
}
// A value in the unit of its rule.
function value_text(when, value) {
  if (when.startsWith("silent")) return `${number(Math.round(value))} s`
  const [size, unit] = SIZES[when.split(" ").at(-1)] ?? [1, ""]
  return number(value / size) + unit
}
