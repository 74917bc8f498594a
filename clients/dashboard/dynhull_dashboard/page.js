const find = selector => document.querySelector(selector)
const write = (selector, text) => { if (find(selector).textContent != text) find(selector).textContent = text }
const MOST_OFFERED = 20
let socket
function follow(plane, labels, fences, events) {
  const shown = new WebSocket(`${location.origin.replace(/^http/, "ws")}${location.pathname.replace(/\/$/, "")}/hulls?`
    + new URLSearchParams(plane.tags))
  if (socket) end(socket)
  socket = shown
  shown.onmessage = ({data}) => {
    if (shown != socket) return
    const message = JSON.parse(data)
    if (message.kind == "events") return events.take(message)
    if (message.kind) fences.take(message)
    else draw_hull(labels, message)
    fences.draw()
    labels.place()
  }
  shown.onclose = () => shown == socket && setTimeout(follow, 1000, plane, labels, fences, events)
}
// A browser complains of a socket that is closed before it is open.
function end(old) {
  if (old.readyState == WebSocket.CONNECTING) old.onopen = () => old.close()
  else old.close()
}
function draw_hull(labels, {source, revision, x, y, keys, rings}) {
  const drawn = labels.source(source)
  const each = value => x.map(() => value)
  const key = keys ?? each("")
  const title = key.map(name => name && `${name}: `)
  const hull = each(source.replace(/^(vertices|points) of /, ""))
  if (drawn) drawn.data = {x, y, revision: each(revision), title, key, hull, label: each(""), side: each("left")}
  const outline = labels.source(source.replace(/^vertices of /, "outline of "))
  if (outline && outline != drawn) outline.data = rings ? {x: joined(rings, 0), y: joined(rings, 1)} : {x, y}
}
// One column of several rings: Bokeh ends a ring at NaN.
function joined(rings, axis) {
  return rings.flatMap((ring, i) => i ? [NaN, ...ring[axis]] : ring[axis])
}
function chip([name, key], remove) {
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
// The chips and the field of a picker. `names` are the properties of the model that it shows and changes.
function start_picker(model, {form, noun, most, offered, picked, legend}) {
  const field = find(`${form} [list]`)
  const names = () => model[legend].map(([name]) => name)
  const remove = removed => model[picked] = names().filter(name => name != removed)
  const add = () => {
    if (field.value && !names().includes(field.value)) model[picked] = [...names(), field.value]
    field.value = ""
  }
  const show = () => {
    const full = model[legend].length >= most
    find(`${form} ul`).replaceChildren(...model[legend].map(each => chip(each, remove)))
    field.disabled = full
    field.placeholder = full ? `Remove a ${noun} to pick another` : `Pick ${noun}s`
  }
  const offer = () => field.list.replaceChildren(...model[offered].map(name => new Option(name, name)))
  field.addEventListener("change", () => model[offered].includes(field.value) && add())
  find(form).addEventListener("submit", event => { event.preventDefault(); add() })
  model.properties[legend].change.connect(show)
  model.properties[offered].change.connect(offer)
  show()
  offer()
}
function start_finder(model, plane, labels) {
  const field = find(".finder input")
  const look = () => model.sought = field.value
  const offer = () => {
    const hulls = shown_names(plane, "hull").flatMap(name => [`vertices of ${name}`, `points of ${name}`])
    const inside = shown_names(plane, "fence").map(name => `inside of ${name}`)
    const keys = [...hulls, ...inside].flatMap(name => labels.source(name)?.data.key ?? [])
    const names = keys.filter(key => key && key.startsWith(field.value))
    const offered = [...new Set(names)].sort().slice(0, MOST_OFFERED)
    find("#keys").replaceChildren(...offered.map(key => new Option(key, key)))
  }
  const show = () => {
    const lines = model.found.map(([sentence, place]) => {
      const line = document.createElement("li"), numbers = document.createElement("span")
      numbers.textContent = place
      line.append(sentence, place && ": ", numbers)
      return line
    })
    find(".finder ul").replaceChildren(...lines)
    write("#found", model.found.map(([sentence]) => sentence).join(". "))
  }
  field.value = model.sought
  field.addEventListener("focus", offer)
  field.addEventListener("input", () => field.value ? offer() : look())
  field.addEventListener("change", look)
  find(".finder").addEventListener("submit", event => { event.preventDefault(); look() })
  model.properties.found.change.connect(show)
  show()
  return key => {
    field.value = key
    look()
  }
}
function start_text(model) {
  const update = () => {
    write(".banner", model.banner)
    write(".note", model.note)
    write("#description", model.description)
    write(".hint", model.fence_hint)
    find(".page").classList.toggle("fenced", model.legend_fences.length > 0)
  }
  for (const name of ["banner", "note", "description", "fence_hint", "legend_fences"]) model.properties[name].change.connect(update)
  const box = find("[name=same_scale]")
  box.checked = model.same_scale
  box.onchange = () => model.same_scale = box.checked
  update()
}
// A restarted dashboard does not know this page: load it again.
async function reload_when_back() {
  try {
    await fetch(location.href, {method: "HEAD"})
    location.reload()
  } catch {
    setTimeout(reload_when_back, 1000)
  }
}
document.addEventListener("DOMContentLoaded", function start() {
  const [page] = window.Bokeh?.documents ?? []
  const plane = page?.get_model_by_name("plane")
  if (!plane) return void setTimeout(start, 50)
  const model = page.get_model_by_name("page")
  const {mostHulls, mostFences} = find(".page").dataset
  start_picker(model, {form: ".hulls", noun: "hull", most: mostHulls, offered: "offered", picked: "picked",
    legend: "legend"})
  start_picker(model, {form: ".fences", noun: "fence", most: mostFences, offered: "offered_fences",
    picked: "picked_fences", legend: "legend_fences"})
  start_text(model)
  const fences = new Fences(plane)
  const labels = new Labels(plane, fences)
  const events = new Events(start_finder(model, plane, labels))
  const begin = () => {
    fences.keep(shown_names(plane, "fence"))
    events.keep(shown_names(plane, "fence"))
    follow(plane, labels, fences, events)
  }
  begin()
  plane.properties.tags.change.connect(begin)
  page.on_event("connection_lost", () => {
    write(".banner", "The dashboard does not answer. Check that dynhull dashboard still runs. The page shows what it "
      + "last received, and reconnects by itself.")
    reload_when_back()
  })
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () =>
    Bokeh.index.roots.forEach(view => view.request_paint?.()))
})
