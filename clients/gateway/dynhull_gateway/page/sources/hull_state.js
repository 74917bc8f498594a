// A hull at one revision, as it is drawn and described: now, or as it was.
import { box_around } from "../dynhull/map/views.js"
import { SQUARE_KILOMETRE, outline, poles, shown } from "../degrees.js"
export const SAMPLE_SIZE = 2_000
// No eye distinguishes more vertices.
export const MOST_DRAWN = 2_000
// A few points are sampled as often as the hull is drawn; among many, no viewer misses one that is late.
const FEW_POINTS_MILLISECONDS = 100, MANY_POINTS_MILLISECONDS = 2_000
export class HullState {
  constructor(name) {
    this.name = name
    this.rate = NaN  // batches per second, over the last second
    this.reset()
  }
  // Nothing is known of it.
  reset() {
    this.followed = false  // whether an event has arrived since the hull was last missing
    this.revision = this.points = this.vertices = this.moved = 0  // when, in milliseconds since 1970
    this.area = NaN  // of a geographic hull in square metres
    this.bounds = undefined
    this.center = null  // of a geographic hull
    this.poles = []
    this.drawn = drawing("vertices", this.name, 0, [])
    this.sample = drawing("points", this.name, 0, [])
  }
  // As it is shown: of a geographic hull in square kilometres.
  get shown_area() {
    return this.center ? this.area / SQUARE_KILOMETRE : this.area
  }
  get sample_pause() {
    return this.points <= SAMPLE_SIZE ? FEW_POINTS_MILLISECONDS : MANY_POINTS_MILLISECONDS
  }
  get drawings() {
    return [this.drawn, this.sample]
  }
  // An event that has its measures, and the copy that it has updated.
  take(event, copy) {
    this.followed = event.type != "deleted"
    if (event.changed != null) this.moved = Number(event.changed) / 1000
    else if (event.revision > this.revision) this.moved = Date.now()
    this.revision = Number(event.revision)
    this.points = event.points ?? 0
    if (event.type == "progress" || event.type == "deleted") return
    this.vertices = copy.vertices.length
    this.area = event.measures?.area ?? NaN
    this.center = copy.center
    const some = thinned(copy.vertices), rings = this.center && some.length ? outline(some, this.center) : null
    this.bounds = some.length ? box_around(rings ? rings.flat() : copy.vertices) : undefined
    this.poles = rings ? poles(rings) : []
    this.drawn = drawing("vertices", this.name, this.revision, shown(some, this.center), copy.vertexKeys && thinned(copy.vertexKeys), rings)
  }
  // Some of its points; those that are vertices are drawn as such.
  take_sample({points, keys, revision}) {
    const {x, y} = this.drawn, corners = new Set(x.map((each, row) => `${each} ${y[row]}`))
    const places = shown(points, this.center), rows = [...places.keys()].filter(row => !corners.has(places[row].join(" ")))
    this.sample = drawing("points", this.name, Number(revision), rows.map(row => places[row]), keys && rows.map(row => keys[row]))
  }
}
// All vertices, or every k-th where there are more than are drawn.
export function thinned(rows) {
  const step = Math.max(1, Math.ceil(rows.length / MOST_DRAWN))
  return step == 1 ? rows : rows.filter((_, row) => row % step == 0)
}
function drawing(kind, hull, revision, places, keys = null, rings = null) {
  return {kind, hull, revision, x: places.map(([x]) => x), y: places.map(([, y]) => y), keys: keys?.map(String) ?? null, rings}
}
