// The page: what it shows of hulls, fences and alarms, and what the viewer asks for.
import { Client } from "./dynhull/client.js"
import { Hands, ZOOM_STEP } from "./dynhull/map/hands.js"
import { Picture, read_extent } from "./dynhull/map/picture.js"
import { Alarms } from "./alarms.js"
import { find, put, settings } from "./dom.js"
import { Drawers } from "./drawers.js"
import { Events } from "./events.js"
import { Finder, show_lines } from "./finder.js"
import { FullScreen } from "./full_screen.js"
import { lit as lit_at, shades } from "./dynhull/map/looks.js"
import { FENCE_LOOKS, INSIDE, LOOKS, MEAN, NEUTRAL, PERCENTILE, key, symbol } from "./looks.js"
import { Kiosk } from "./kiosk.js"
import { Night } from "./night.js"
import { Picker, best_match } from "./picker.js"
import { Recorder } from "./recorder.js"
import { SAVES, SaveMenu } from "./saving.js"
import { Sound } from "./sound.js"
import { ServerMetrics } from "./sources/server_metrics.js"
import { Viewer } from "./sources/viewer.js"
import { TimeBar, moment_of, text_of } from "./time_bar.js"
import { TimeLines } from "./time_lines.js"
// While the slider is dragged, the past is asked for now and then.
const ASK_MILLISECONDS = 150
// Seconds: verifying a large hull takes long, and what the page asks for each second must not wait.
const PATIENT = 3600, IMPATIENT = 5
const SAID = ["description", "table", "many_table", "fence_table", "outliers"], PAGE = ""
const query = new URLSearchParams(location.search)
const state = {hulls: [], prefixes: [], fences: [], offered: [], offered_fences: [], kept: [], alarms: [], raised: 0, figures: {}, all_prefixes: [], alarm_trouble: "", banner: "", sought: "", found: [], outliers: [],
  places: []}
const night = new Night(find("[name=look]"), query.get("look"), change_look)
const lit = colour => lit_at(colour, night.is_now)
const picture = new Picture(find(".map"), {x_unit: settings.units.x, y_unit: settings.units.y, tiles: settings.tiles, coasts: `${settings.files}/vendor/`})
const finder = new Finder(picture, query.get("key") ?? "", sought => {
  ask({sought})
  keep_in_address("key", sought ? [sought] : [])
})
const events = new Events(key => finder.seek(key))
const alarms = new Alarms(find(".alarms"), ask)
const sound = new Sound(find("[name=sound]"), query.has("sound"), find(".silenced"), wanted => keep_in_address("sound", wanted ? ["1"] : []))
const kiosk = query.has("kiosk") ? new Kiosk(state, query, ask) : undefined
let time_bar, asking, keeping, viewer, unreached = false
const recorder = new Recorder(show_drawing, () => {
  picture.live = recorder.live
  time_lines.mark(recorder.live ? undefined : recorder.moment)
  events.end_at(recorder.past ? recorder.moment : Infinity)
  time_bar?.update()
  keep_moment()
  show_found()
  picture.draw_soon()
}, ask_past)
const time_lines = new TimeLines([...document.querySelectorAll("canvas.line")], lit(NEUTRAL), PERCENTILE.dash)
time_bar = new TimeBar(recorder, find(".time"))
time_bar.wanted = moment_of(query.get("at"))
picture.now = () => recorder.moment
// All that the page follows comes in one stream, that of one client.
function begin(token) {
  viewer?.close()
  const to = timeout => new Client(settings.gateway, {token, timeout, retries: 0})
  const source = {...settings, client: to(PATIENT), asker: to(IMPATIENT)}
  const metrics = settings.metrics ? new ServerMetrics(settings.metrics, `${settings.gateway}/dashboard/metrics`) : undefined
  viewer = new Viewer(source, metrics, new URLSearchParams(location.search), take, tell_reached)
}
function ask(change) {
  viewer.take(change)
}
function ask_past(past) {
  clearTimeout(asking)
  if (past) asking = setTimeout(() => ask({past}), ASK_MILLISECONDS)
  else ask({past})
}
// Whether the gateway has answered. Once it does again, what waits to connect need not wait longer, and a page of another version loads.
async function tell_reached(reached) {
  if (reached && unreached) {
    dispatchEvent(new Event("online"))
    const version = await fetch(`${settings.gateway}/dashboard/version`).then(answer => answer.text()).catch(() => settings.version)
    if (version != settings.version) location.reload()
  }
  unreached = !reached
}
// The address follows, so that the page shows the same when it is loaded again.
function keep_in_address(noun, values) {
  const query = new URLSearchParams(location.search)
  query.delete(noun)
  for (const value of values) query.append(noun, value)
  history.replaceState(null, "", `?${query}`)
}
// The moment at which the picture stands still; while the slider is dragged, now and then.
function keep_moment() {
  keeping ??= setTimeout(() => {
    keeping = undefined
    const {paused_at} = recorder, at = paused_at == undefined ? null : text_of(paused_at)
    if (time_bar.wanted == undefined && at != new URLSearchParams(location.search).get("at")) keep_in_address("at", at == null ? [] : [at])
  }, ASK_MILLISECONDS)
}
function take(message) {
  if (message.kind == "page") {
    for (const name of SAID)
      if (message[name] != undefined) record({kind: `said ${name}`, hull: PAGE, name, said: message[name]})
    return update(message)
  }
  if (message.kind == "past") return recorder.take_past(message)
  if (message.kind == "lines") return time_lines.take(message)
  if (message.kind == "vertices" || message.kind == "points") picture.trails.take(message, Date.now())
  record(message)
}
function record(message) {
  recorder.take(message, JSON.stringify(message))
}
function show_said({name, said}) {
  if (name == "description") put(find("#description"), said)
  else if (name == "outliers") show_lines(".outliers", said)
  else find({table: ".of_hulls", many_table: ".of_many", fence_table: ".of_fences"}[name]).innerHTML = said  // names are escaped
}
function show_found() {
  finder.show(recorder.live ? state.found : state.sought ? picture.found_words() : [])
}
// Now, or once more at a later time.
function show_drawing(message) {
  if (message.said != undefined) show_said(message)
  else if (message.kind == "events") events.take(message)
  else picture.take(message)
}
// What has changed of what is said about the page.
function update({kind: _, ...changes}) {
  Object.assign(state, changes)
  if (changes.alarms || changes.raised != undefined || changes.alarm_trouble != undefined)
    alarms.show(state.alarms, state.raised, state.alarm_trouble)
  if (changes.alarms) {
    picture.alarmed = [...new Set(state.alarms.filter(({state}) => state == "raised").map(({hull}) => hull))]
    picture.draw_soon()
  }
  if (changes.raised != undefined) sound.take(state.raised)
  kiosk?.show()
  if (changes.kept || changes.hulls)
    time_bar.keep(state.kept.map(each => ({...each, colour: lit(state.hulls.find(({name}) => name == each.hull)?.colour)})))
  if (changes.hulls || changes.fences || changes.prefixes) show_picked()
  for (const picker of pickers) if (changes[picker.offered]) picker.offer()
  for (const [name, selector] of [["banner", ".banner"], ["note", ".note"], ["fence_hint", ".hint"]])
    if (changes[name] != undefined) put(find(selector), changes[name])
  if (changes.refused != undefined) show_token(changes.refused)
  find(".page").classList.toggle("keyed", Boolean(state.keyed || state.sought))
  if (changes.places || changes.sought != undefined) {
    picture.places = state.places.map(([x, y, colour, disk]) => [x, y, lit(colour), disk])
    picture.sought = state.sought
    picture.draw_soon()
  }
  if (changes.found) show_found()
}
// Whoever has given a token goes on at the map.
function show_token(refused) {
  const form = find(".token"), typed = form.contains(document.activeElement)
  form.hidden = !refused
  if (typed && !refused) find(".map").focus()
}
function show_picked() {
  const [hulls, fences, prefixes] = [state.hulls, state.fences, state.prefixes].map(looks => looks.map(({name}) => name))
  show_looks()
  recorder.keep([PAGE, ...hulls, ...fences, ...prefixes])
  events.keep(fences)
  find(".page").classList.toggle("fenced", fences.length > 0)
  find(".page").classList.toggle("overview", prefixes.length > 0 && !hulls.length)
  for (const picker of pickers) picker.show()
}
// The colours are those of the page, which may become dark.
function show_looks() {
  const [hulls, fences, prefixes] = [state.hulls, state.fences, state.prefixes].map(looks => looks.map(look => ({...look, colour: lit(look.colour)})))
  picture.keep(hulls, fences, prefixes)
  time_lines.keep(hulls)
  time_lines.server_colour = lit(NEUTRAL)
}
function change_look() {
  keep_in_address("look", night.chosen ? [night.chosen] : [])
  show_looks()
  picture.draw_all()
}
const pickers = [
  {form: ".hulls", noun: "hull", most: LOOKS.length, offered: "offered", picked: {hull: "hulls", prefix: "prefixes"}},
  {form: ".fences", noun: "fence", most: FENCE_LOOKS.length, offered: "offered_fences", picked: {fence: "fences"}},
].map(each => new Picker(each, state, ask, keep_in_address))
find("[name=verify]").onclick = () => ask({verify: true})
new SaveMenu(find("[popovertarget=saves]"), find("#saves"), kind => SAVES[kind](picture, new Date(recorder.moment).toISOString()))
new FullScreen(find("[name=full]"), document.documentElement)
find(".token").onsubmit = event => {
  event.preventDefault()
  const field = find(".token input")
  begin(field.value.trim())
  field.value = ""
}
const hands = new Hands(picture, find(".tip"), () => recorder.toggle())
const tick = (name, checked, change) => {
  const box = find(`[name=${name}]`)
  box.checked = checked
  box.onchange = () => {
    change(box.checked)
    picture.draw_all()
  }
}
tick("all_names", false, checked => picture.labels.all = checked)
tick("trails", false, checked => picture.trails.shown = checked)
picture.outliers = Boolean(query.get("outliers"))
tick("outliers", picture.outliers, checked => {
  picture.outliers = checked
  ask({outliers: checked})
  keep_in_address("outliers", checked ? ["1"] : [])
})
tick("same_scale", picture.plane.same_scale, checked => {
  picture.plane.same_scale = checked
  picture.follow()
})
for (const [name, does] of [["in", () => hands.zoom(ZOOM_STEP)], ["out", () => hands.zoom(1 / ZOOM_STEP)], ["all", () => picture.follow()]]) {
  const button = find(`.map [name=${name}]`)
  button.onclick = does
  button.onpointerdown = button.ondblclick = event => event.stopPropagation()
}
find(".map .buttons").onkeydown = event => event.stopPropagation()
find(".time").onsubmit = event => event.preventDefault()
find(".attribution").textContent = settings.tiles.attribution
const symbols = [symbol(INSIDE), key(MEAN), key(PERCENTILE)]
document.querySelectorAll(".symbol").forEach((each, row) => each.innerHTML = symbols[row])
const sheet = new CSSStyleSheet()
sheet.replaceSync(shades().map(([colour, day, night]) => `[fill="${colour}"] { fill: light-dark(${day}, ${night}); } [stroke="${colour}"] { stroke: light-dark(${day}, ${night}); }`).join(" "))
document.adoptedStyleSheets.push(sheet)
new Drawers(find(".page"), query.get("drawers"), open => keep_in_address("drawers", open))
picture.wanted = read_extent(query.get("view"))
picture.moved_to = extent => keep_in_address("view", extent ? [extent.map(each => +each.toPrecision(12)).join()] : [])
Object.assign(globalThis, {sound, picture, recorder, time_bar, time_lines, events, best_match})  // for who looks in by the console
begin(null)
