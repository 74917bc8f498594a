import assert from "node:assert/strict"
import { test } from "node:test"

import { geoDistance, geoInterpolate } from "d3-geo"

import { areaMessage } from "../src/map/messages.js"
import { offset_hull_on_globe } from "../src/map/offset.js"

const EARTH_RADIUS = 6371008.8
/** @param {object} area @param {number} margin @param {boolean} globe @returns {any[]} */
const around = (area, margin, globe = false) => areaMessage(/** @type {any} */ ({ name: "yard", area, margin }), globe).around

/** The distance of a place from the border of a ring, of which some places are taken. @param {any} place @param {any[]} ring */
function toRing(place, ring) {
  const from = (/** @type {any} */ at) => (parts.globe ? EARTH_RADIUS * geoDistance(place, at) : Math.hypot(at[0] - place[0], at[1] - place[1]))
  const between = (/** @type {any} */ a, /** @type {any} */ b) => (parts.globe ? geoInterpolate(a, b) : (/** @type {number} */ t) => [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])])
  return Math.min(...ring.flatMap((a, row) => {
    const at = between(a, ring[(row + 1) % ring.length])
    return Array.from({ length: parts.count + 1 }, (_, step) => from(at(step / parts.count)))
  }))
}
const parts = { count: 2000, globe: false }

test("the margin of an area in a plane is drawn at its distance", () => {
  const square = [[0, 0], [8, 0], [8, 6], [0, 6]]
  const hole = [[2, 2], [2, 5], [6, 5], [6, 2]]
  const [[outer, inner]] = around({ exterior: square, holes: [hole] }, 1)
  for (const [ring, border] of [[outer, square], [inner, hole]]) {
    assert.ok(ring.length >= 4)
    for (const place of ring) assert.ok(Math.abs(toRing(place, border) - 1) < 1e-2, `${place}`)
  }
  assert.ok(outer.every((/** @type {number[]} */ [x, y]) => x < 0 || x > 8 || y < 0 || y > 6))
  assert.equal(around({ exterior: square, holes: [hole] }, 2)[0].length, 1, "a hole that the margin fills is no more")
  const [[circle]] = around({ center: [3, 4], radius: 5 }, 2)
  for (const [x, y] of circle) assert.ok(Math.abs(Math.hypot(x - 3, y - 4) - 7) < 1e-2)
  assert.deepEqual(around({ exterior: square }, 0), [])
  assert.deepEqual(around({ hull: "fleet" }, 3), [], "the map draws that of a hull from its outline")
})

test("the margin of an area on the globe is drawn at its distance in metres", () => {
  parts.globe = true
  const areas = [
    [[8, 49], [10, 49], [10, 51], [8, 51]],
    [[179, -1], [-179, -1], [-179, 1], [179, 1]],
    [[0, 89], [120, 89], [-120, 89]],
  ]
  for (const exterior of areas) {
    const whole = [around({ exterior }, 20_000, true)[0][0], offset_hull_on_globe(/** @type {any} */ (exterior), 20_000)[0][0]]
    for (const ring of whole) {
      assert.ok(ring.length > 10)
      for (const place of ring) assert.ok(Math.abs(toRing(place, exterior) - 20_000) < 400, `${place} of ${exterior[0]}`)
    }
  }
  parts.globe = false
  assert.deepEqual(around({ exterior: [[0, -80], [120, -80], [-120, -80], [0, 80]] }, 1000, true), [], "nearly a hemisphere")
  const [[alone]] = offset_hull_on_globe([[8, 50]], 10_000)
  for (const place of alone) assert.ok(Math.abs(geoDistance(place, [8, 50]) * EARTH_RADIUS - 10_000) < 1)
})

test("the margin around an area of many corners is drawn around some of them", () => {
  const exterior = Array.from({ length: 50_000 }, (_, row) => [Math.cos(row / 7957.75), Math.sin(row / 7957.75)])
  const [[ring]] = around({ exterior }, 0.5)
  assert.ok(ring.length > 100 && ring.length < 5000)
  for (const [x, y] of ring) assert.ok(Math.abs(Math.hypot(x, y) - 1.5) < 1e-2)
})
