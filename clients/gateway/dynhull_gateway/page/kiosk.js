// A screen in a room: nothing to press, large figures, and one prefix after the other, those first for which alarms are raised.
import { find, put } from "./dom.js"
import { count } from "./words/numbers.js"
const TURN_SECONDS = 20, TICK = 1000
const clock_format = new Intl.DateTimeFormat("en", {weekday: "short", year: "numeric", month: "short", day: "numeric", hour: "2-digit", minute: "2-digit",
  hourCycle: "h23", timeZoneName: "short"})
export class Kiosk {
  // `query` is that of the page: `kiosk` are the seconds for which each prefix is shown. Without prefixes those of the server are shown;
  // where there are hulls, these alone. `ask` is called with what is to be shown.
  constructor(state, query, ask) {
    this.state = state
    const seconds = +query.get("kiosk")
    this.milliseconds = 1000 * (seconds > 0 ? seconds : TURN_SECONDS)
    this.prefixes = query.has("prefix") ? query.getAll("prefix") : query.has("hull") ? [] : undefined
    this.others = query.has("fence") ? {hulls: []} : {hulls: [], fences: []}
    this.ask = ask
    this.turned = performance.now()
    find(".page").classList.add("kiosk")
    setInterval(() => this.tick(), TICK)
  }
  // The prefixes whose turns come: while alarms are raised for hulls below some of them, these.
  get round() {
    const all = this.prefixes ?? outermost(this.state.all_prefixes)
    const raised = this.state.alarms.filter(({state}) => state == "raised").map(({hull}) => hull)
    const urgent = all.filter(prefix => raised.some(hull => hull.startsWith(prefix)))
    return urgent.length ? urgent : all
  }
  tick() {
    put(find(".figures .clock"), clock_format.format(Date.now()))
    const {round, state: {prefixes}} = this, now = performance.now(), row = round.indexOf(prefixes[0]?.name)
    if (!round.length || row >= 0 && (prefixes.length == 1 && round.length == 1 || now - this.turned < this.milliseconds)) return
    this.turned = now
    this.ask({...this.others, prefixes: [round[(row + 1) % round.length]]})
  }
  // What has changed of the state of the page.
  show() {
    const {raised, figures: {moving, silent, silent_after}, hulls, prefixes} = this.state
    const names = [...prefixes.map(({name}) => `${name}*`), ...hulls.map(({name}) => name)]
    put(find(".figures .what"), names.join(", "))
    for (const [name, value] of [["raised", raised], ["moving", moving], ["silent", silent]]) put(find(`.figures .${name}`), count(value))
    put(find(".figures .after"), `Silent for ${silent_after} s`)
    find(".figures").classList.toggle("alarmed", raised > 0)
    find(".figures").classList.toggle("quiet", silent > 0)
  }
}
// Those that are not below another one.
function outermost(prefixes) {
  return prefixes.filter(prefix => !prefixes.some(other => other != prefix && prefix.startsWith(other)))
}
