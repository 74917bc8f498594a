const find = selector => document.querySelector(selector)
const write = (selector, text) => { if (find(selector).textContent != text) find(selector).textContent = text }
const MOST_OFFERED = 20
let socket
function follow(plane, labels) {
  const shown = new WebSocket(`${location.origin.replace(/^http/, "ws")}${location.pathname.replace(/\/$/, "")}/hulls?`
    + new URLSearchParams(plane.tags.map(name => ["hull", name])))
  socket?.close()
  socket = shown
  shown.onmessage = ({data}) => {
    const {source, revision, x, y, keys} = JSON.parse(data)
    const drawn = labels.source(source)
    const key = keys ?? x.map(() => "")
    const title = key.map(name => name && `${name}: `)
    if (!drawn) return
    drawn.data = {x, y, revision: x.map(() => revision), title, key, label: x.map(() => ""), side: x.map(() => "left")}
    labels.place()
  }
  shown.onclose = () => shown == socket && setTimeout(follow, 1000, plane, labels)
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
function start_picker(model) {
  const field = find(".picker [list]")
  const names = () => model.legend.map(([name]) => name)
  const remove = removed => model.picked = names().filter(name => name != removed)
  const add = () => {
    if (field.value && !names().includes(field.value)) model.picked = [...names(), field.value]
    field.value = ""
  }
  const show = () => {
    const full = model.legend.length >= find(".page").dataset.mostHulls
    find(".picker ul").replaceChildren(...model.legend.map(each => chip(each, remove)))
    field.disabled = full
    field.placeholder = full ? "Remove a hull to pick another" : "Pick hulls"
  }
  const offer = () => find("#offered").replaceChildren(...model.offered.map(name => new Option(name, name)))
  field.addEventListener("change", () => model.offered.includes(field.value) && add())
  find(".picker").addEventListener("submit", event => { event.preventDefault(); add() })
  model.properties.legend.change.connect(show)
  model.properties.offered.change.connect(offer)
  show()
  offer()
}
function start_finder(model, plane, labels) {
  const field = find(".finder input")
  const look = () => model.sought = field.value
  const offer = () => {
    const sources = plane.tags.flatMap(name => [`vertices of ${name}`, `points of ${name}`])
    const keys = sources.flatMap(name => labels.source(name)?.data.key ?? [])
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
}
function start_text(model) {
  const update = () => {
    write(".banner", model.banner)
    write(".note", model.note)
    write("#description", model.description)
  }
  for (const name of ["banner", "note", "description"]) model.properties[name].change.connect(update)
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
  start_picker(model)
  start_text(model)
  const labels = new Labels(plane)
  start_finder(model, plane, labels)
  follow(plane, labels)
  plane.properties.tags.change.connect(() => follow(plane, labels))
  page.on_event("connection_lost", () => {
    write(".banner", "The dashboard does not answer. Check that dynhull dashboard still runs. The page shows what it "
      + "last received, and reconnects by itself.")
    reload_when_back()
  })
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () =>
    Bokeh.index.roots.forEach(view => view.request_paint?.()))
})
