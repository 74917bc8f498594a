/** @typedef {{colour: string, dash: number[], marker?: string}} Look */

/**
 * Colours, line styles and markers of hulls: Okabe and Ito, "Color Universal Design" (2002). @type {Look[]}
 */
export const HULL_LOOKS = [
  { colour: "#0072B2", dash: [], marker: "circle" },
  { colour: "#D55E00", dash: [8, 3], marker: "square" },
  { colour: "#009E73", dash: [2, 3], marker: "triangle" },
  { colour: "#CC79A7", dash: [10, 3, 2, 3], marker: "diamond" },
  { colour: "#E69F00", dash: [14, 4], marker: "inverted_triangle" },
  { colour: "#56B4E9", dash: [5, 2, 5, 6], marker: "hex" },
]
const FENCE_COLOUR = "#9b5de5"
/** @type {Look[]} */
export const FENCE_LOOKS = [[], [8, 3], [2, 3], [10, 3, 2, 3], [14, 4], [5, 2, 5, 6]].map((dash) => ({ colour: FENCE_COLOUR, dash }))
/** Of a hull for which an alarm is raised. @type {Look} */
export const ALARM_LOOK = { colour: "#D0342C", dash: [], marker: "square" }
/** @type {Record<string, string>} */
const BY_DAY = { "#D55E00": "#B24E00", "#009E73": "#007A59", "#CC79A7": "#A83E77", "#E69F00": "#8A6000", "#56B4E9": "#0B7285", "#9b5de5": "#7F3BD6", "#7d8590": "#656C76" }
/** @type {Record<string, string>} */
const BY_NIGHT = { "#0072B2": "#3D9BE0", "#D55E00": "#EE7A2E", "#009E73": "#1FB98A", "#9b5de5": "#BB8CFF", "#7d8590": "#9AA5B1", "#D0342C": "#FF8A80" }

/**
 * The shade of a colour that stands out, 4.5 to 1, from a light or a dark page.
 * @param {string} colour
 * @param {boolean} night
 */
export function lit(colour, night) {
  return (night ? BY_NIGHT : BY_DAY)[colour] ?? colour
}

/** All colours that have shades: each with the one by day and the one by night. */
export function shades() {
  return [...new Set([...Object.keys(BY_DAY), ...Object.keys(BY_NIGHT)])].map((colour) => [colour, lit(colour, false), lit(colour, true)])
}
