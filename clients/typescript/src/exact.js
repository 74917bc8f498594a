// Exact signs and rounded values of expressions in doubles: of every finite double, also where products overflow or
// vanish. robust-predicates decides the usual ones, integers the others.

import { orient2d } from "robust-predicates"

/** @typedef {readonly [number, number]} Point */

// Between these magnitudes no product in an orientation overflows, and none loses digits because it is too small.
const LARGE = 2 ** 500
const SMALL = 2 ** -400
// The place of the last digit of the smallest double: every finite double is an integer times 2 ** -LOWEST.
const LOWEST = 1074
// Of a sum of two products of differences, the relative error is less than this.
const ERROR = 2 ** -50

const bytes = new DataView(new ArrayBuffer(8))

/**
 * A double as an integer in units of 2 ** -1074.
 * @param {number} value a finite number
 * @returns {bigint}
 */
export function scaled(value) {
  bytes.setFloat64(0, value)
  const bits = bytes.getBigUint64(0)
  const exponent = Number((bits >> 52n) & 0x7ffn)
  const fraction = bits & 0xfffffffffffffn
  const magnitude = exponent ? (fraction | 0x10000000000000n) << BigInt(exponent - 1) : fraction
  return bits >> 63n ? -magnitude : magnitude
}

/**
 * The double that is nearest to a quotient, times a power of two; the even one of two.
 * @param {bigint} numerator
 * @param {bigint} denominator positive
 * @param {number} exponent the power of two
 * @returns {number} infinite if it is beyond every double
 */
export function rounded(numerator, denominator, exponent) {
  if (numerator === 0n) return 0
  const negative = numerator < 0n
  let top = negative ? -numerator : numerator
  let bottom = denominator
  // The quotient has 54 or 55 binary digits, or fewer if its last one has the place of the smallest double.
  let shift = Math.max(55 - (lengthOf(top) - lengthOf(bottom)), 0)
  shift = Math.min(shift, LOWEST + 1 + exponent)
  let place = exponent - shift
  if (shift >= 0) top <<= BigInt(shift)
  else bottom <<= BigInt(-shift)
  let quotient = top / bottom
  let rest = top % bottom !== 0n
  const excess = Math.max(lengthOf(quotient) - 53, -LOWEST - place, 0)
  if (excess) {
    const cut = BigInt(excess)
    const left = quotient & ((1n << cut) - 1n)
    const half = 1n << (cut - 1n)
    quotient >>= cut
    place += excess
    if (left > half || (left === half && (rest || quotient & 1n))) quotient += 1n
    rest = false
  }
  // Twice, since the power alone may be too small for a double.
  const value = Number(quotient) * 2 ** Math.max(place, -LOWEST) * (place < -LOWEST ? 2 ** (place + LOWEST) : 1)
  return negative ? -value : value
}

/** @param {bigint} value */
function lengthOf(value) {
  return value.toString(2).length
}

/**
 * The sign of the turn from a over b to c: 1 to the left, -1 to the right, 0 on a line.
 * @param {Point} a
 * @param {Point} b
 * @param {Point} c
 * @returns {-1 | 0 | 1}
 */
export function turn(a, b, c) {
  return turnOf(a[0], a[1], b[0], b[1], c[0], c[1])
}

/**
 * The same, of coordinates.
 * @param {number} ax
 * @param {number} ay
 * @param {number} bx
 * @param {number} by
 * @param {number} cx
 * @param {number} cy
 * @returns {-1 | 0 | 1}
 */
export function turnOf(ax, ay, bx, by, cx, cy) {
  const certain = certainSign((bx - ax) * (cy - ay), (ay - by) * (cx - ax))
  if (certain) return certain
  if (usual(ax) && usual(ay) && usual(bx) && usual(by) && usual(cx) && usual(cy)) {
    // The library's y axis points down: its sign is the other one.
    return /** @type {-1 | 0 | 1} */ (-Math.sign(orient2d(ax, ay, bx, by, cx, cy)) || 0)
  }
  const [left, low] = [scaled(ax), scaled(ay)]
  return signOf((scaled(bx) - left) * (scaled(cy) - low) - (scaled(by) - low) * (scaled(cx) - left))
}

/**
 * The sign of the scalar product of b - a and a direction.
 * @param {Point} a
 * @param {Point} b
 * @param {Point} direction
 * @returns {-1 | 0 | 1}
 */
export function ascent(a, b, direction) {
  const certain = certainSign((b[0] - a[0]) * direction[0], (b[1] - a[1]) * direction[1])
  if (certain) return certain
  const rise = (scaled(b[0]) - scaled(a[0])) * scaled(direction[0])
  return signOf(rise + (scaled(b[1]) - scaled(a[1])) * scaled(direction[1]))
}

/**
 * The sign of a sum of two products of differences, 0 if their rounding leaves it open.
 * @param {number} left
 * @param {number} right
 * @returns {-1 | 0 | 1}
 */
function certainSign(left, right) {
  const sum = left + right
  const size = Math.abs(left) + Math.abs(right)
  // Below, digits may have been lost because a product is too small.
  const certain = Math.abs(sum) > size * ERROR && size > 2 ** -900 && size < Infinity
  return certain ? (sum > 0 ? 1 : -1) : 0
}

/**
 * The area of a polygon with corners counter-clockwise: the exact value, rounded once.
 * @param {readonly Point[]} corners
 * @returns {number}
 */
export function area(corners) {
  if (corners.length < 3) return 0
  const [ox, oy] = corners[0].map(scaled)
  const places = corners.map(([x, y]) => [scaled(x) - ox, scaled(y) - oy])
  let twice = 0n
  for (let i = 2; i < places.length; i++) {
    twice += places[i - 1][0] * places[i][1] - places[i - 1][1] * places[i][0]
  }
  return rounded(twice, 1n, -2 * LOWEST - 1)
}

/** @param {number} value */
function usual(value) {
  const size = Math.abs(value)
  return size === 0 || (size > SMALL && size < LARGE)
}

/** @param {bigint} value @returns {-1 | 0 | 1} */
function signOf(value) {
  return value > 0n ? 1 : value < 0n ? -1 : 0
}

/**
 * The sign of the scalar product of b - a and c - a: 1 where c is ahead of a, seen towards b.
 * @param {Point} a
 * @param {Point} b
 * @param {Point} c
 * @returns {-1 | 0 | 1}
 */
export function ahead(a, b, c) {
  const certain = certainSign((b[0] - a[0]) * (c[0] - a[0]), (b[1] - a[1]) * (c[1] - a[1]))
  if (certain) return certain
  const [ax, ay] = a.map(scaled)
  return signOf((scaled(b[0]) - ax) * (scaled(c[0]) - ax) + (scaled(b[1]) - ay) * (scaled(c[1]) - ay))
}

/**
 * The distance of two points, rounded once.
 * @param {Point} p
 * @param {Point} q
 * @returns {number} infinite if it is beyond every double
 */
export function gap(p, q) {
  const [dx, dy] = [scaled(q[0]) - scaled(p[0]), scaled(q[1]) - scaled(p[1])]
  return root(dx * dx + dy * dy, 1n, -LOWEST)
}

/**
 * The distance of a point from the line through two others, rounded once.
 * @param {Point} p
 * @param {Point} a
 * @param {Point} b another one
 * @returns {number} infinite if it is beyond every double
 */
export function gapToLine(p, a, b) {
  const [ax, ay] = a.map(scaled)
  const [ux, uy] = [scaled(b[0]) - ax, scaled(b[1]) - ay]
  const cross = ux * (scaled(p[1]) - ay) - uy * (scaled(p[0]) - ax)
  return root(cross * cross, ux * ux + uy * uy, -LOWEST)
}

/**
 * The double that is nearest to the square root of a quotient, times a power of two.
 * @param {bigint} numerator not negative
 * @param {bigint} denominator positive
 * @param {number} exponent the power of two
 * @returns {number}
 */
function root(numerator, denominator, exponent) {
  if (numerator === 0n) return 0
  // The root has at least 56 digits, and one more that says whether there are others.
  const half = BigInt(Math.max(57 - ((lengthOf(numerator) - lengthOf(denominator)) >> 1), 0))
  const top = numerator << (2n * half)
  const whole = top / denominator
  const found = floorRoot(whole)
  const more = found * found !== whole || whole * denominator !== top
  return rounded((found << 1n) | (more ? 1n : 0n), 1n, exponent - Number(half) - 1)
}

/** @param {bigint} value positive */
function floorRoot(value) {
  let found = 1n << BigInt((lengthOf(value) + 1) >> 1)
  for (;;) {
    const next = (found + value / found) >> 1n
    if (next >= found) return found
    found = next
  }
}
