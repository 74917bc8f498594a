// Figures as the page shows them.
export const UNKNOWN = "-"
export function number(value, digits = 6) {
  if (value == null || isNaN(value)) return UNKNOWN
  const size = Math.abs(value)
  return size >= 1000 && size < 1e15 ? count(Math.round(value)) : `${+value.toPrecision(digits)}`
}
export function count(value) {
  return Number(value).toLocaleString("en")
}
export function plural(value, noun) {
  return `${count(value)} ${noun}${value == 1 ? "" : "s"}`
}
const SPANS = [[86_400, "d"], [3600, "h"], [60, "m"], [1, "s"]]
// A time span in the largest unit that needs no fraction.
export function span_text(seconds) {
  const [size, unit] = SPANS.find(([size]) => seconds % size == 0) ?? [0.001, "ms"]
  return `${+(seconds / size).toPrecision(6)}${unit}`
}
export function escaped(text) {
  return String(text).replace(/[&<>"']/g, letter => `&#${letter.charCodeAt()};`)
}
