// The tables of hulls, of fences and of prefixes as HTML. On a narrow page their rows are cards.
import { SQUARE_KILOMETRE } from "../degrees.js"
import { key } from "../looks.js"
import { area_hulls } from "../sources/fence_area.js"
import { about_fence, about_hull, about_many, about_past } from "./advice.js"
import { area_text, settings_text, subjects_text } from "./fences.js"
import { UNKNOWN, count, escaped, number } from "./numbers.js"
const HULL_HEADINGS = ["Revision", "Points", "Vertices", "Area", "Batches/s"], RATE_DIGITS = 3
const MANY_HEADINGS = ["Revision", "Points", "Vertices", "Area", "Changed"], MOST_ROWS = 12
const FENCE_HEADINGS = {Area: "words", Subjects: "words", Inside: "", Events: "", Consumers: "words"}, MOST_CONSUMERS = 3
const NOW = 2000, SECONDS_UP_TO = 120_000, CONNECTION_LOST = "Connection lost"
// `area_unit`: of hulls in a plane; areas on the globe have their own.
export function hull_table(shown, {connected, area_unit}) {
  return table_of_hulls(shown, area_unit, "Live hull against Chan's algorithm", feed => {
    const problem = connected ? about_hull(feed) : CONNECTION_LOST
    return problem ? bad(problem) : verified(feed.verified)
  })
}
// The same of hulls as they were.
export function past_table(shown, {area_unit}) {
  return table_of_hulls(shown, area_unit, "The past", hull => {
    const problem = about_past(hull)
    return problem ? bad(problem) : "As it was"
  })
}
function table_of_hulls(shown, area_unit, last, state) {
  if (!shown.length) return ""
  const plane = shown.some(({feed}) => !feed.center), headings = HULL_HEADINGS.map(with_unit(plane && area_unit))
  const rows = shown.map(({feed, look}) =>
    row(key(look) + escaped(feed.name), cells(headings, hull_figures(feed)), `<td class="state">${state(feed)}</td>`))
  return table(["Hull", ...headings, last].map(name => heading(name)), rows)
}
function with_unit(unit) {
  return name => name == "Area" && unit ? `Area (${escaped(unit)})` : name
}
function hull_figures(feed) {
  const {followed, drawn, vertices, revision, points, shown_area, center, rate} = feed
  if (!followed) return HULL_HEADINGS.map(() => UNKNOWN)
  const corners = drawn.x.length == vertices ? count(vertices) : `${count(vertices)} (${count(drawn.x.length)} drawn)`
  return [count(revision), count(points), corners, number(shown_area) + (center ? " km²" : ""), number(rate, RATE_DIGITS)]
}
// A table for each prefix, the last changed first.
export function many_table(shown, {connected, area_unit}) {
  return shown.map(({feed, look}) => {
    const problem = connected ? about_many(feed) : CONNECTION_LOST, hulls = feed.hulls.size == 1 ? "1 hull" : `${count(feed.hulls.size)} hulls`
    const words = feed.hulls.size > MOST_ROWS ? `the last ${MOST_ROWS} that changed of ${hulls}` : `${hulls}, the last changed first`
    const rows = feed.newest(MOST_ROWS), headings = MANY_HEADINGS.map(with_unit(rows.some(({geographic}) => !geographic) && area_unit))
    const caption = `<caption>${key(look)} ${escaped(feed.prefix)}*: ${problem ? bad(problem) : words}</caption>`
    return table(["Hull", ...headings].map(name => heading(name)), rows.map(hull => row(escaped(hull.hull), cells(headings, many_figures(hull)))), caption)
  }).join("")
}
function many_figures({revision, points, vertexCount, measures, geographic, changed}) {
  const area = measures?.area, shown = geographic ? `${number(area / SQUARE_KILOMETRE)} km²` : number(area)
  return [count(revision), count(points), count(vertexCount), shown, changed == null ? UNKNOWN : since(Date.now() - Number(changed) / 1000)]
}
// `hulls` are those in the picture; `described` has the settings of fences.
export function fence_table(shown, hulls, {connected, described}) {
  const classes = {Fence: "words", ...FENCE_HEADINGS, Settings: "words"}
  const rows = shown.map(({feed, look}) => {
    const {fence} = feed, problem = connected ? about_fence(feed) : CONNECTION_LOST
    const figures = fence ? fence_figures(feed) : Object.keys(FENCE_HEADINGS).map(() => UNKNOWN)
    const state = problem || !fence ? bad(problem || CONNECTION_LOST)
      : escaped([settings_text(fence, described), hidden(fence, hulls)].filter(Boolean).join(". "))
    return row(key(look) + escaped(feed.name), cells(Object.keys(FENCE_HEADINGS), figures.map(escaped), Object.values(FENCE_HEADINGS)), `<td class="state">${state}</td>`)
  })
  return rows.length ? table(Object.entries(classes).map(([name, kind]) => heading(name, kind)), rows) : ""
}
function fence_figures(feed) {
  const {fence, unit, area, corners} = feed, {consumers} = fence
  const drawn = area.drawn < corners ? ` (${count(area.drawn)} drawn)` : ""
  const some = consumers.slice(0, MOST_CONSUMERS).map(({name, backlog, lost}) => `${name}: ${count(backlog)} waiting${lost ? `, ${count(lost)} lost` : ""}`)
  const more = consumers.length > some.length ? [`${count(consumers.length - some.length)} more`] : []
  return [area_text(fence, unit) + drawn, subjects_text(fence), inside_text(feed), count(fence.lastSequence), [...some, ...more].join(", ") || "none"]
}
function inside_text({fence, inside_count, marks}) {
  if (fence.otherHull != null) return fence.inside ? fence.near ? "near" : "intersecting" : "apart"
  const inside = `${count(inside_count)} of ${count(fence.subjectCount)}`
  return marks.count >= inside_count ? inside : `${inside} (${count(marks.count)} drawn)`
}
// Which hulls to pick to see the area; empty where it is in the picture.
function hidden(fence, hulls) {
  const names = area_hulls(fence).filter(name => !hulls.includes(name))
  return names.length ? `Pick ${names.join(" and ")} above to see the area` : ""
}
function table(headings, rows, caption = "") {
  return `<table${caption && ' class="many"'}>${caption}<thead><tr>${headings.join("")}</tr></thead>${rows.join("")}</table>`
}
function heading(name, kind) {
  return `<th scope="col"${kind == undefined ? "" : ` class="${kind}"`}>${name}</th>`
}
function row(name, cells, state = "") {
  return `<tr><th scope="row">${name}</th>${cells}${state}</tr>`
}
function cells(headings, figures, kinds = []) {
  return headings.map((name, row) => `<td data-heading="${name}"${kinds[row] ? ` class="${kinds[row]}"` : ""}>${figures[row]}</td>`).join("")
}
function bad(problem) {
  return `<span class="bad">✗ ${escaped(problem)}</span>`
}
function verified(last) {
  if (!last) return "… not verified yet"
  const {outcome, at} = last, revision = count(outcome.revision)
  return outcome.whole ? `<span class="good">✓ equal</span> at revision ${revision}, ${ago(Date.now() - at)}`
    : `<span class="bad">✗ different</span> at revision ${revision}: ${difference(outcome)}`
}
function difference({difference, keysEqual, fenceDifferences}) {
  const place = at => at == null ? "missing" : `(${at.join(", ")})`
  if (difference) return `vertex ${difference.row} is ${place(difference.live)}, recomputed ${place(difference.recomputed)}`
  return keysEqual ? `the fence ${escaped(fenceDifferences[0].fence)}` : "the points are not the positions of the keys"
}
function ago(milliseconds) {
  if (milliseconds < NOW) return "just now"
  return milliseconds < SECONDS_UP_TO ? `${Math.round(milliseconds / 1000)} s ago` : `${Math.round(milliseconds / 60_000)} min ago`
}
function since(milliseconds) {
  const seconds = Math.max(0, milliseconds / 1000)
  const [length, unit] = [[86_400, "d"], [3600, "h"], [60, "min"]].find(([length]) => seconds >= length) ?? [1, "s"]
  return `${Math.round(seconds / length)} ${unit} ago`
}
