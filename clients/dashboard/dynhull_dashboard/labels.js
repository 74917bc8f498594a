// The names beside vertices and subjects of fences: as many as fit without overlap. Hovering shows the others.
const LABEL_HEIGHT = 15, LABEL_GAP = 3, VERTEX_LABEL_OFFSET = 8, RING_RADIUS = 15, MARK_RADIUS = 5
const LABEL_FONT = "12px helvetica", FOUND_LABEL_FONT = `bold ${LABEL_FONT}`
const ruler = document.createElement("canvas").getContext("2d")
function text_width(text, font) {
  ruler.font = font
  return ruler.measureText(text).width
}
// The box of a text whose left or right end is at x.
function label_box(x, bottom, width, side) {
  const left = side == "left" ? x : x - width
  return {left: left - LABEL_GAP, right: left + width + LABEL_GAP, top: bottom - LABEL_HEIGHT, bottom, side}
}
function inside(box, frame) {
  return box.left >= frame.left && box.right <= frame.right && box.top >= frame.top && box.bottom <= frame.bottom
}
function overlap(one, two) {
  return one.left < two.right && two.left < one.right && one.top < two.bottom && two.top < one.bottom
}
function shown_names(plane, kind) {
  return plane.tags.filter(tag => tag[0] == kind).map(tag => tag[1])
}
class Labels {
  constructor(plane, fences) {
    this.plane = plane
    this.fences = fences
    this.shown = new Set()
    for (const range of [plane.x_range, plane.y_range])
      for (const end of ["start", "end"]) range.properties[end].change.connect(() => this.place_soon())
    for (const size of ["inner_width", "inner_height"]) plane.properties[size].change.connect(() => this.place_soon())
    this.found = this.source("found")
    this.found.properties.data.change.connect(() => this.place_soon())
  }
  source(name) {
    return this.plane.renderers.find(renderer => renderer.data_source.name == name)?.data_source
  }
  place_soon() {
    this.awaited ??= requestAnimationFrame(() => {
      this.awaited = undefined
      this.place()
    })
  }
  place() {
    const frame = Bokeh.index.get_by_id(this.plane.id)?.frame
    if (!frame) return this.place_soon()
    const taken = this.found_boxes(frame)
    this.fences.place_names(frame, taken)
    const marks = shown_names(this.plane, "fence").map(name => this.source(`inside of ${name}`))
    const vertices = shown_names(this.plane, "hull").map(name => this.source(`vertices of ${name}`))
    const sources = [...marks, ...vertices].filter(source => source)
    for (const mark of marks) if (mark) taken.push(...this.mark_boxes(mark, frame))
    const names = sources.flatMap(source => this.names(source, frame))
    // Names that are shown come first: otherwise they would come and go while the hull moves.
    names.sort((one, two) => this.shown.has(two.id) - this.shown.has(one.id))
    const empty = source => ({label: source.data.key.map(() => ""), side: source.data.key.map(() => "left")})
    const labels = new Map(sources.map(source => [source, empty(source)]))
    this.shown.clear()
    for (const {source, row, id, boxes} of names) {
      if (this.shown.has(id)) continue  // a vertex, and a subject inside
      const box = boxes.find(each => inside(each, frame.bbox) && !taken.some(other => overlap(each, other)))
      if (!box) continue
      taken.push(box)
      this.shown.add(id)
      const {label, side} = labels.get(source)
      label[row] = source.data.key[row]
      side[row] = box.side
    }
    for (const [source, placed] of labels)
      if (["label", "side"].some(column => placed[column].some((text, row) => text != source.data[column][row])))
        source.data = {...source.data, ...placed}
  }
  // The name of each vertex, and the boxes that it can have: first towards the middle of the hull.
  names(source, {x_scale, y_scale}) {
    const {x, y, key, hull} = source.data
    if (key.length > find(".page").dataset.mostLabels) return []
    const across = [...x_scale.v_compute(x)], down = y_scale.v_compute(y)
    const middle = (Math.min(...across) + Math.max(...across)) / 2
    return key.flatMap((text, row) => {
      if (!text) return []
      const width = text_width(text, LABEL_FONT), bottom = down[row] - VERTEX_LABEL_OFFSET
      const boxes = [label_box(across[row], bottom, width, "left"), label_box(across[row], bottom, width, "right")]
      return [{source, row, id: `${text} of ${hull[row]}`, boxes: across[row] > middle ? boxes.reverse() : boxes}]
    })
  }
  mark_boxes({data: {x, y}}, {x_scale, y_scale}) {
    const across = x_scale.v_compute(x), down = y_scale.v_compute(y)
    return Array.from(across, (left, row) => ({left: left - MARK_RADIUS, right: left + MARK_RADIUS,
      top: down[row] - MARK_RADIUS, bottom: down[row] + MARK_RADIUS}))
  }
  found_boxes({x_scale, y_scale}) {
    const {x, y, label, side} = this.found.data
    return Array.from(label).flatMap((text, row) => {
      const across = x_scale.compute(x[row]), down = y_scale.compute(y[row])
      const ring = {left: across - RING_RADIUS, right: across + RING_RADIUS, top: down - RING_RADIUS,
        bottom: down + RING_RADIUS}
      return [ring, label_box(across, down - RING_RADIUS, text_width(text, FOUND_LABEL_FONT), side[row])]
    })
  }
}
