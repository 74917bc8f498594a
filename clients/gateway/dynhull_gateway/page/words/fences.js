// Fences in a few words.
import { count, plural, span_text } from "./numbers.js"
// The area; `unit` is that of lengths, behind a space: kilometres are said of many metres.
export function area_text({area}, unit = "") {
  const parts = [area].flat(), {hull, center, radius} = parts[0]
  const short = value => `${+value.toPrecision(6)}`
  if (hull != undefined) return `hull ${hull}`
  if (radius != undefined) {
    const length = unit == " m" && radius >= 1000 ? `${short(radius / 1000)} km` : short(radius) + unit
    return `circle around (${center.map(short).join(", ")}), radius ${length}`
  }
  const holes = parts.flatMap(part => part.holes ?? []), rings = [...parts.map(part => part.exterior), ...holes]
  const corners = rings.reduce((sum, ring) => sum + ring.length, 0)
  return [parts.length > 1 ? `${count(parts.length)} polygons` : "polygon", plural(corners, "corner"), ...holes.length ? [plural(holes.length, "hole")] : []].join(", ")
}
export function subjects_text({subjects, subjectPrefix, otherHull}) {
  return subjectPrefix != null ? `${subjectPrefix}*` : subjects ?? `hull ${otherHull}`
}
// The settings that are not the usual ones. `described` has the name, the kind and the usual value of each.
export function settings_text(fence, described) {
  const camel = name => name.replace(/_([a-z])/g, (_, letter) => letter.toUpperCase())
  const found = described.map(each => [each, fence[camel(each.name)] ?? null]).filter(([{usual}, value]) => value != usual)
  const expected = fence.expected?.length ? [`expects ${plural(fence.expected.length, "key")}`] : []
  return [...found.map(([{name, kind}, value]) => setting_text(name.replaceAll("_", " "), kind, value)), ...expected].join(", ")
}
function setting_text(name, kind, value) {
  if (kind == "choice") return `${value}`
  if (kind == "flag") return name
  return `${name} ${kind == "span" ? span_text(value) : kind == "number" ? +(+value).toPrecision(6) : value}`
}
