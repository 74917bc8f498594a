import assert from "node:assert/strict"
import { test } from "node:test"

import { ahead, ascent, rounded, scaled, turn } from "../src/exact.js"

const bytes = new DataView(new ArrayBuffer(8))
let state = 41

/** A number below 2 ** 32, the same in each run. */
function draw() {
  state = (Math.imul(state, 1664525) + 1013904223) >>> 0
  return state
}

/** A finite double of any size. @returns {number} */
function anyDouble() {
  bytes.setUint32(0, draw())
  bytes.setUint32(4, draw())
  const value = bytes.getFloat64(0)
  return Number.isFinite(value) ? value : anyDouble()
}

/** @returns {import("../src/exact.js").Point} */
const anyPoint = () => [anyDouble(), anyDouble()]
const sign = (/** @type {bigint} */ value) => (value > 0n ? 1 : value < 0n ? -1 : 0)

test("every finite double is an integer in units, and comes back", () => {
  for (const value of [0, 5e-324, -5e-324, 2 ** -1022, Number.MAX_VALUE, 0.1, ...Array.from({ length: 2000 }, anyDouble)]) {
    assert.equal(rounded(scaled(value), 1n, -1074), value)
  }
})

test("quotients are rounded once, to even", () => {
  for (let i = 0; i < 2000; i++) {
    const [a, b] = [draw() * 2 ** 21 + 1, draw() * 2 ** 20 + 1]
    assert.equal(rounded(BigInt(a), BigInt(b), 0), a / b)
    assert.equal(rounded(BigInt(a), 1n, -1100 - (i % 60)), a * 2 ** -1000 * 2 ** (-100 - (i % 60)))
  }
  assert.equal(rounded(2n ** 53n + 1n, 1n, 0), 2 ** 53)
  assert.equal(rounded(2n ** 53n + 3n, 1n, 0), 2 ** 53 + 4)
  assert.equal(rounded(1n, 1n, 1024), Infinity)
  assert.equal(rounded(-1n, 1n, -1075), -0)
  assert.equal(rounded(-1n, 2n, -1074), -0)
})

test("signs are those of integers", () => {
  const places = [[0, 0], [1e-320, 0], [5e-324, 1], [1e308, -1e308], [0.1, 0.2], [0.30000000000000004, 0.1]]
  const point = (/** @type {number} */ i) =>
    i % 3 ? /** @type {import("../src/exact.js").Point} */ (places[draw() % places.length]) : anyPoint()
  for (let i = 0; i < 5000; i++) {
    const [a, b, c] = [point(i), point(i + 1), point(i + draw())]
    const [ax, ay, bx, by, cx, cy] = [...a, ...b, ...c].map(scaled)
    assert.equal(turn(a, b, c), sign((bx - ax) * (cy - ay) - (by - ay) * (cx - ax)))
    assert.equal(ahead(a, b, c), sign((bx - ax) * (cx - ax) + (by - ay) * (cy - ay)))
    assert.equal(ascent(a, b, c), sign((bx - ax) * cx + (by - ay) * cy))
  }
})
