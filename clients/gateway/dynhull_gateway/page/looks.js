// Colours, line styles and markers that distinguish the hulls on a page, with or without colour vision.
import { FENCE_LOOKS, HULL_LOOKS } from "./dynhull/map/looks.js"
export { FENCE_LOOKS }
// Colours come again with another line and another marker.
const AGAIN = [[[2, 2], "diamond"], [[16, 3, 2, 3], "hex"], [[6, 2], "inverted_triangle"], [[3, 6], "square"]]
export const LOOKS = [...HULL_LOOKS, ...AGAIN.map(([dash, marker], row) => ({colour: HULL_LOOKS[row].colour, dash, marker}))]
// Series of the whole server belong to no hull.
export const NEUTRAL = "#7d8590", MEAN = {colour: NEUTRAL, dash: []}, PERCENTILE = {colour: NEUTRAL, dash: [6, 3]}
export const INSIDE = {colour: FENCE_LOOKS[0].colour, dash: [], marker: "star"}
const MARKERS = {
  circle: '<circle cx="20" cy="8" r="5"/>',
  square: '<rect x="15.5" y="3.5" width="9" height="9"/>',
  triangle: '<path d="M20 2.5l5.5 10h-11z"/>',
  diamond: '<path d="M20 2l4.5 6-4.5 6-4.5-6z"/>',
  inverted_triangle: '<path d="M20 13.5l5.5-10h-11z"/>',
  star: '<path d="M20 1.5l1.9 4.3 4.7.5-3.5 3.1 1 4.6-4.1-2.4-4.1 2.4 1-4.6-3.5-3.1 4.7-.5z"/>',
  hex: '<path d="M20 2.5l5 2.8v5.4l-5 2.8-5-2.8V5.3z"/>',
}
// The marker alone as SVG.
export function symbol({colour, marker}) {
  return `<svg viewBox="12 0 16 16" fill="${colour}" aria-hidden="true">${MARKERS[marker]}</svg>`
}
// The line and the marker of a hull as SVG, for a legend.
export function key({colour, dash, marker}) {
  return `<svg viewBox="0 0 40 16" fill="${colour}" aria-hidden="true"><path d="M0 8h40" stroke="${colour}" `
    + `stroke-width="2" stroke-dasharray="${dash.join(" ")}"/>${MARKERS[marker] ?? ""}</svg>`
}
