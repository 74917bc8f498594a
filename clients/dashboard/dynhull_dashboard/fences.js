// Fences in the picture: areas, margins, names, and the subjects inside.
const ARC_STEPS = 96, NAME_FONT = "bold 13px helvetica", NAME_HEIGHT = 18, NAME_GAP = 9, LONGEST_NAME = 28
class Fences {
  constructor(plane) {
    this.plane = plane
    this.areas = new Map()
    this.inside = new Map()
  }
  source(name) {
    return this.plane.renderers.find(renderer => renderer.data_source.name == name)?.data_source
  }
  take(message) {
    const known = message.kind == "area" ? this.areas : this.inside
    known.set(message.fence, message)
  }
  keep(names) {
    for (const known of [this.areas, this.inside])
      for (const name of known.keys()) if (!names.includes(name)) known.delete(name)
  }
  draw() {
    for (const [name, area] of this.areas) this.draw_area(name, area)
    const places = this.places()
    for (const [name, inside] of this.inside) this.draw_inside(name, inside, places)
  }
  draw_area(name, {hulls, margin, xs, ys, margin_xs, margin_ys}) {
    const outlines = hulls.flatMap(hull => parts(this.source(`outline of ${hull}`)?.data ?? {x: [], y: []}))
    const around = margin ? outlines.slice(0, 1).map(({x, y}) => offset_outline(x, y, margin)) : []
    const rings = (more, outer, axis) => [...more, ...outer.map(each => [[Array.from(each[axis])]])]
    replace(this.source(`area of ${name}`), {xs: rings(xs, outlines, "x"), ys: rings(ys, outlines, "y")})
    replace(this.source(`margin of ${name}`), {xs: rings(margin_xs, around, "x"), ys: rings(margin_ys, around, "y")})
  }
  // By hull and key, where the hulls draw the subjects inside: the hulls are newer than what the fences know.
  places() {
    const places = new Map()
    for (const {hull, key} of this.inside.values())
      hull.forEach((name, row) => places.set(name, (places.get(name) ?? new Map()).set(key[row])))
    for (const [hull, keys] of places) {
      for (const kind of ["points", "vertices"]) {
        const drawn = this.source(`${kind} of ${hull}`)?.data
        drawn?.key.forEach((key, row) => keys.has(key) && keys.set(key, [drawn.x[row], drawn.y[row]]))
      }
    }
    return places
  }
  draw_inside(name, {hull, key, x, y}, places) {
    const placed = key.map((text, row) => places.get(hull[row]).get(text) ?? [x[row], y[row]])
    const source = this.source(`inside of ${name}`)
    const each = value => key.map(() => value)
    replace(source, {x: placed.map(([x]) => x), y: placed.map(([, y]) => y), hull, key,
      title: key.map(text => `${text}: `), label: each(""), side: each("left")}, ["label", "side"])
  }
  // The name above or below each area; where neither has room, in its middle, or not at all.
  place_names(frame, taken) {
    const {x_scale, y_scale, bbox} = frame
    const columns = {x: [], y: [], label: [], baseline: []}
    for (const name of this.areas.keys()) {
      const rings = ["margin", "area"].map(kind => this.source(`${kind} of ${name}`)?.data)
      const {xs, ys} = rings.find(each => each?.xs.length) ?? {xs: []}
      if (!xs.length) continue
      const x = [xs].flat(Infinity), y = [ys].flat(Infinity)
      const top = y.indexOf(y.reduce((one, two) => Math.max(one, two)))
      const low = y.indexOf(y.reduce((one, two) => Math.min(one, two)))
      const label = name.length > LONGEST_NAME ? `…${name.slice(1 - LONGEST_NAME)}` : name
      const width = text_width(label, NAME_FONT)
      const above = {x: x[top], y: y[top], baseline: "bottom", shift: -NAME_GAP}
      const below = {x: x[low], y: y[low], baseline: "top", shift: NAME_GAP + NAME_HEIGHT}
      const middle = {x: (Math.min(...x) + Math.max(...x)) / 2, y: (y[top] + y[low]) / 2, baseline: "middle",
        shift: NAME_HEIGHT / 2}
      for (const place of [above, below, middle]) {
        const across = x_scale.compute(place.x), bottom = y_scale.compute(place.y) + place.shift
        const box = {left: across - width / 2, right: across + width / 2, top: bottom - NAME_HEIGHT, bottom}
        if (!inside(box, bbox) || taken.some(other => overlap(box, other))) continue
        taken.push(box)
        columns.x.push(place.x)
        columns.y.push(place.y)
        columns.label.push(label)
        columns.baseline.push(place.baseline)
        break
      }
    }
    replace(this.source("names of fences"), columns)
  }
}
// Replaces the data of a source, unless it has the same: each change draws the picture again. The columns `kept` do not
// count, and stay as they are where the others do.
function replace(source, data, kept = []) {
  if (!source) return
  const compared = each => JSON.stringify(Object.keys(data).filter(name => !kept.includes(name)).map(name => each[name]))
  if (compared(source.data) != compared(data)) source.data = data
}
// The outline at a distance from a convex polygon whose vertices are counterclockwise.
// The rings of an outline: they are separated by NaN. None of an empty hull.
function parts({x, y}) {
  const rings = [{x: [], y: []}]
  for (let row = 0; row < x.length; row++) {
    if (Number.isNaN(x[row])) rings.push({x: [], y: []})
    else for (const [axis, value] of [["x", x[row]], ["y", y[row]]]) rings.at(-1)[axis].push(value)
  }
  return rings.filter(ring => ring.x.length)
}
function offset_outline(x, y, distance) {
  const outline = {x: [], y: []}
  let at = x.indexOf(Math.max(...x))
  for (let step = 0; step < ARC_STEPS; step++) {
    const angle = 2 * Math.PI * step / ARC_STEPS, across = Math.cos(angle), up = Math.sin(angle)
    const height = row => x[row] * across + y[row] * up
    for (let next = (at + 1) % x.length; height(next) > height(at); next = (at + 1) % x.length) at = next
    outline.x.push(x[at] + distance * across)
    outline.y.push(y[at] + distance * up)
  }
  return outline
}
