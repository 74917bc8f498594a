// The page: what the server says about it, and what the viewer asks for.
const find = selector => document.querySelector(selector)
const write = (selector, text) => { if (find(selector).textContent != text) find(selector).textContent = text }
const MOST_OFFERED = 20, RETRY_MILLISECONDS = 1000
const SILENCE = "The dashboard does not answer. Check that dynhull dashboard still runs. The page shows what it last "
  + "received, and reconnects by itself."
const SAID = ["description", "table", "many_table", "fence_table", "outliers"], PAGE = "", ALL_OF = "*"
const settings = find(".page").dataset
const state = {hulls: [], prefixes: [], fences: [], offered: [], offered_fences: [], kept: [], alarms: [], raised: 0, alarm_trouble: "", banner: "", sought: "", found: [], outliers: [],
  places: []}
const is_dark = matchMedia("(prefers-color-scheme: dark)"), on_dark = JSON.parse(settings.onDark)
const lit = colour => is_dark.matches ? on_dark[colour] ?? colour : colour
const picture = new Picture(find(".map"), {
  x_unit: settings.xUnit, y_unit: settings.yUnit, tiles: {url: settings.tiles, largest_zoom: +settings.largestZoom, attribution: settings.attribution},
  coasts: "vendor/",
})
const events = new Events(key => seek(key))
const alarms = new Alarms(find(".alarms"), ask)
const recorder = new Recorder(show_drawing, () => {
  picture.live = recorder.live
  time_lines.mark(recorder.live ? undefined : recorder.moment)
  events.end_at(recorder.past ? recorder.moment : Infinity)
  time_bar?.update()
  show_found()
  picture.draw_soon()
}, ask_past)
let time_bar = null, socket, asking
time_bar = new TimeBar(recorder, find(".time"))
const time_lines = new TimeLines([...document.querySelectorAll("canvas.line")], lit(settings.neutral),
  settings.percentileDash.split(" ").map(Number))
picture.now = () => recorder.moment

function connect() {
  const address = new URL(`live${location.search}`, location.href)
  address.protocol = address.protocol.replace("http", "ws")
  socket = new WebSocket(address)
  socket.onopen = () => {
    time_lines.clear()
    recorder.ask_again()
  }
  socket.onmessage = ({data}) => take(JSON.parse(data), data)
  socket.onclose = () => {
    write(".banner", SILENCE)
    setTimeout(connect, RETRY_MILLISECONDS)
  }
}
function ask(change) {
  if (socket.readyState == WebSocket.OPEN) socket.send(JSON.stringify(change))
}
// While the slider is dragged, now and then.
function ask_past(past) {
  clearTimeout(asking)
  if (past) asking = setTimeout(() => ask({past}), ASK_MILLISECONDS)
  else ask({past})
}
// The address follows, so that the page shows the same when it is loaded or connects again.
function keep_in_address(noun, values) {
  const query = new URLSearchParams(location.search)
  query.delete(noun)
  for (const value of values) query.append(noun, value)
  history.replaceState(null, "", `?${query}`)
}
function take(message, text) {
  if (message.kind == "page") {
    for (const name of SAID)
      if (message[name] != undefined) record({kind: `said ${name}`, hull: PAGE, name, said: message[name]})
    return update(message)
  }
  if (message.kind == "past") return recorder.take_past(message)
  if (message.kind == "lines") return time_lines.take(message)
  if (message.kind == "vertices" || message.kind == "points") picture.trails.take(message, Date.now())
  if (message.kind == "many") {
    const known = picture.many.prefixes.get(message.prefix)?.hulls.keys() ?? []
    for (const outline of told_apart(message, known)) record(outline)
  } else recorder.take(message, text)
}
// What the page says of the moment that it shows.
function record(message) {
  recorder.take(message, JSON.stringify(message))
}
function show_said({name, said}) {
  if (name == "description") write("#description", said)
  else if (name == "outliers") show_lines(".outliers", said)
  else find({table: ".of_hulls", many_table: ".of_many", fence_table: ".of_fences"}[name]).innerHTML = said  // the server has escaped the names
}
function show_found() {
  const found = recorder.live ? state.found : state.sought ? picture.found_words() : []
  show_lines(".found", found)
  write("#found", found.map(([sentence]) => sentence).join(". "))
}
// Now, or once more at a later time.
function show_drawing(message) {
  if (message.said != undefined) show_said(message)
  else if (message.kind == "events") events.take(message)
  else picture.take(message)
}
// What has changed of what the server says about the page.
function update({kind: _, ...changes}) {
  if (changes.version && changes.version != settings.version) return location.reload()
  Object.assign(state, changes)
  if (changes.alarms || changes.raised != undefined || changes.alarm_trouble != undefined)
    alarms.show(state.alarms, state.raised, state.alarm_trouble)
  if (changes.kept || changes.hulls)
    time_bar.keep(state.kept.map(each => ({...each, colour: lit(state.hulls.find(({name}) => name == each.hull)?.colour)})))
  if (changes.hulls || changes.fences || changes.prefixes) {
    const hulls = state.hulls.map(({name}) => name), fences = state.fences.map(({name}) => name)
    show_looks()
    recorder.keep([PAGE, ...hulls, ...fences, ...state.prefixes.map(({name}) => name)])
    events.keep(fences)
    find(".page").classList.toggle("fenced", fences.length > 0)
    find(".page").classList.toggle("overview", state.prefixes.length > 0 && !hulls.length)
    for (const picker of pickers) picker.show()
  }
  for (const picker of pickers) if (changes[picker.offered]) picker.offer()
  write(".banner", state.banner)
  for (const [name, selector] of [["note", ".note"], ["fence_hint", ".hint"]])
    if (changes[name] != undefined) write(selector, changes[name])
  find(".page").classList.toggle("keyed", Boolean(state.keyed || state.sought))
  if (changes.places || changes.sought != undefined) {
    picture.places = state.places.map(([x, y, colour, disk]) => [x, y, lit(colour), disk])
    picture.sought = state.sought
    picture.draw_soon()
  }
  if (changes.found) show_found()
}
// The colours are those of the page, which may become dark.
function show_looks() {
  const [hulls, fences, prefixes] = [state.hulls, state.fences, state.prefixes].map(looks => looks.map(look => ({...look, colour: lit(look.colour)})))
  picture.keep(hulls, fences, prefixes)
  time_lines.keep(hulls)
  time_lines.server_colour = lit(settings.neutral)
}
is_dark.addEventListener("change", show_looks)
function chip({name, key}, remove) {
  const item = document.createElement("li"), line = document.createElement("span")
  const button = document.createElement("button")
  line.innerHTML = key
  button.type = "button"
  button.textContent = "✕"
  button.ariaLabel = `Remove ${name}`
  button.onclick = () => remove(name)
  item.append(line, name, button)
  return item
}
// What is meant by some letters: the name itself, else the first name of which a part begins with them, else the first that
// has them; without any, a name that does not exist yet. All hulls of a prefix are meant by one that ends with a slash.
function best_match(letters, offered) {
  const prefixed = /[/*]$/.test(letters), names = offered.filter(name => prefixed || !name.endsWith(ALL_OF))
  const begins = name => name.startsWith(letters) || /[._/-]/.test(name) && name.split(/[._/-]/).some(part => part.startsWith(letters))
  return [name => name == letters, begins, name => name.includes(letters)].map(fits => letters && names.find(fits)).find(name => name) ?? (letters.endsWith("/") ? letters + ALL_OF : letters)
}
// The chips and the field of a picker. `picked` is what it shows and changes, of the state of the page, by the noun that it
// has in the address. Of several the last has prefixes, which are shown with an asterisk.
class Picker {
  constructor({form, noun, most, offered, picked}) {
    Object.assign(this, {form: find(form), noun, most, offered, picked: Object.entries(picked)})
    this.field = find(`${form} [list]`)
    this.field.addEventListener("change", () => state[offered].includes(this.field.value) && this.add())
    this.form.addEventListener("submit", event => { event.preventDefault(); this.add() })
    this.show()
  }
  get names() {
    return this.looks.map(({name}) => name)
  }
  get looks() {
    return this.picked.flatMap(([, names], row) => row ? state[names].map(look => ({...look, name: look.name + ALL_OF})) : state[names])
  }
  add() {
    const name = best_match(this.field.value, state[this.offered])
    if (name && !this.names.includes(name)) this.pick([...this.names, name])
    this.field.value = ""
  }
  pick(names) {
    const [one, many] = [names.filter(name => !name.endsWith(ALL_OF)), names.filter(name => name.endsWith(ALL_OF)).map(name => name.slice(0, -1))]
    ask(Object.fromEntries(this.picked.map(([, asked], row) => [asked, row ? many : one])))
    this.picked.forEach(([noun], row) => keep_in_address(noun, row ? many : one.length ? one : [""]))
  }
  show() {
    const full = this.names.length >= this.most
    const remove = removed => this.pick(this.names.filter(name => name != removed))
    this.form.querySelector("ul").replaceChildren(...this.looks.map(each => chip(each, remove)))
    this.field.disabled = full
    this.field.placeholder = full ? `Remove a ${this.noun} to pick another` : `Pick ${this.noun}s`
  }
  offer() {
    this.field.list.replaceChildren(...state[this.offered].map(name => new Option(name, name)))
  }
}
const pickers = [
  new Picker({form: ".hulls", noun: "hull", most: settings.mostHulls, offered: "offered", picked: {hull: "hulls", prefix: "prefixes"}}),
  new Picker({form: ".fences", noun: "fence", most: settings.mostFences, offered: "offered_fences", picked: {fence: "fences"}}),
]
const finder = find(".finder input")
function seek(key) {
  finder.value = key
  ask({sought: key})
  keep_in_address("key", key ? [key] : [])
}
function offer_keys() {
  const drawn = [...picture.hulls.values()].flatMap(({vertices, points}) => [...vertices.keys ?? [], ...points.keys ?? []])
  const inside = [...picture.fences.values()].flatMap(fence => fence.inside.key)
  const names = [...drawn, ...inside].filter(key => key.startsWith(finder.value))
  const offered = [...new Set(names)].sort().slice(0, MOST_OFFERED)
  find("#keys").replaceChildren(...offered.map(key => new Option(key, key)))
}
// Sentences, each with what changes more often.
function show_lines(selector, sentences) {
  const lines = sentences.map(([sentence, place]) => {
    const line = document.createElement("li"), numbers = document.createElement("span")
    numbers.textContent = place
    line.append(sentence, place && ": ", numbers)
    return line
  })
  find(selector).replaceChildren(...lines)
}
finder.value = new URLSearchParams(location.search).get("key") ?? ""
finder.addEventListener("focus", offer_keys)
finder.addEventListener("input", () => finder.value ? offer_keys() : seek(""))
finder.addEventListener("change", () => seek(finder.value))
find(".finder").addEventListener("submit", event => { event.preventDefault(); seek(finder.value) })
find(".verify button").onclick = () => ask({verify: ""})
find("[name=save]").onchange = ({target}) => {
  SAVES[target.value](picture, new Date(recorder.moment).toISOString())
  target.value = ""
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
picture.outliers = Boolean(new URLSearchParams(location.search).get("outliers"))
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
picture.wanted = read_extent(new URLSearchParams(location.search).get("view"))
picture.moved_to = extent => keep_in_address("view", extent ? [extent.map(each => +each.toPrecision(12)).join()] : [])
connect()
