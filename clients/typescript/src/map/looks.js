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
