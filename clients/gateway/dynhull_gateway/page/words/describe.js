// The picture, fences, and where a key is, in words.
import { axes, position_text } from "../degrees.js"
import { shortened } from "../sources/event_rows.js"
import { is_seen } from "../sources/search.js"
import { area_text, subjects_text } from "./fences.js"
import { count } from "./numbers.js"
const SHAPES = {1: "a single point", 2: "a segment"}
const SENTENCES = {
  pending: (key, hull) => `Looking for ${key} in ${hull}`,
  missing: (key, hull) => `${hull} has no key ${key}`,
  left: (key, hull) => `${key} has left ${hull}. Last position`,
  inside: (key, hull) => `${key} is inside ${hull}`,
  boundary: (key, hull) => `${key} is on the boundary of ${hull}, between two vertices`,
  vertex: (key, hull) => `${key} is a vertex of ${hull}`,
}
const EVENTS = {enter: "entered", exit: "left", cross: "passed through", dwell: "stayed", missing: "is missing", arrived: "arrived late",
  transfer: "changed hulls"}
// One sentence for each hull and each prefix, up to three for each fence.
export function describe(hulls, fences = [], many = []) {
  return [...hulls.map(about_hull), ...many.map(({prefix, hulls}) => `${prefix}*: the outlines of ${count(hulls.size)} hulls.`), ...fences.map(about_fence)].join(" ")
}
function about_hull({name, bounds, vertices, poles, points, center, revision}) {
  if (!bounds) return `${name}: nothing drawn.`
  const [left, bottom, right, top] = bounds.map(each => +each.toPrecision(6)), [x, y] = axes(center)
  const shape = SHAPES[vertices] ?? `a convex polygon with ${count(vertices)} vertices`
  return `${name}: ${shape}${poles.map(pole => ` with the ${pole} pole inside`).join("")} around ${count(points)} points, `
    + `${x} from ${left} to ${right}, ${y} from ${bottom} to ${top}, at revision ${count(revision)}.`
}
function about_fence(feed) {
  const {name, fence, deleted, unit, events: {last}} = feed
  if (!fence) return `Fence ${name}: ${deleted ? "deleted" : "nothing drawn"}.`
  const margin = fence.margin ? `, margin ${+fence.margin.toPrecision(6)}${unit}` : ""
  const area = `Fence ${name}: ${area_text(fence, unit)}${margin}. ${about_inside(feed)}.`
  const [, , type, key, , cause] = last ?? []
  return EVENTS[type] ? `${area} Last event: ${key} ${EVENTS[type]}${cause ? `, since ${cause}` : ""}.` : area
}
function about_inside({fence, inside, inside_count}) {
  if (fence.otherHull != null) {
    const together = fence.near ? "near each other" : "intersecting"
    return `${[fence.area].flat()[0].hull} and ${fence.otherHull} are ${fence.inside ? together : "apart"}`
  }
  const keys = (inside ?? []).flatMap(({keys}) => keys)
  return `${count(inside_count)} of ${count(fence.subjectCount)} keys of ${subjects_text(fence)} inside${keys.length ? `: ${shortened(keys)}` : ""}`
}
// Where a key is: a sentence, and the coordinates, which change more often.
export function describe_key(key, {name, trouble, keyed, center}, sighting) {
  if (trouble?.status == 404) return [`There is no hull ${name}`, ""]
  if (!keyed) return [`The points of ${name} have no keys`, ""]
  const within = sighting.accuracy ? ` ± ${+sighting.accuracy.toPrecision(8)}${center ? " m" : ""}` : ""
  const at = is_seen(sighting) ? `${position_text(sighting.place, center)}${within}, revision ${count(sighting.revision)}` : ""
  return [SENTENCES[sighting.state](key, name), at]
}
