import assert from "node:assert/strict"
import { readFile } from "node:fs/promises"
import { test } from "node:test"

import { scaled } from "../src/exact.js"
import { HullCopy } from "../src/index.js"
import { fromJson } from "../src/json.js"
import { Ring } from "../src/ring.js"

/** @param {any} vertices */
function copyOf(vertices) {
  const copy = new HullCopy()
  copy.update({ type: "snapshot", revision: 1n, points: vertices.length, vertices, vertexKeys: null, center: null })
  return copy
}

const finite = (/** @type {number} */ value) => (Number.isFinite(value) ? value : null)

test("copies answer as the library does, for every finite double", async () => {
  const { hulls: cases } = fromJson(await readFile(new URL("cases.json", import.meta.url), "utf8"))
  assert.ok(cases.length > 20)
  for (const [place, known] of cases.entries()) {
    const copy = copyOf(known.vertices)
    const asked = (/** @type {string} */ what) => `case ${place}: ${what}`
    assert.deepEqual([...copy.locate(known.points)], known.sides, asked("locate"))
    assert.deepEqual(copy.contains(known.points), known.sides.map((/** @type {number} */ side) => side >= 0))
    assert.deepEqual([...copy.distance(known.points)].map(finite), known.distances, asked("distance"))
    assert.deepEqual(copy.tangents(known.points), known.tangents, asked("tangents"))
    if (known.vertices.length) assert.deepEqual(copy.support(known.directions), known.support, asked("support"))
    assert.equal(finite(copy.area), known.area, asked("area"))
  }
})

/** What integers say of a point. @param {number[][]} vertices @param {number[]} point */
function sideOf(vertices, [x, y]) {
  const turns = vertices.map(([ax, ay], row) => {
    const [bx, by] = vertices[(row + 1) % vertices.length]
    return (scaled(bx) - scaled(ax)) * (scaled(y) - scaled(ay)) - (scaled(by) - scaled(ay)) * (scaled(x) - scaled(ax))
  })
  return turns.some((turn) => turn < 0n) ? -1 : turns.includes(0n) ? 0 : 1
}

test("the first questions after an event and many answer alike: vertices close together, upright edges, extreme doubles", () => {
  const even = Array.from({ length: 35 }, (_, row) => row - 17)
  const crowded = [...Array.from({ length: 17 }, (_, row) => -(2 ** (16 - row))), ...Array.from({ length: 17 }, (_, row) => 2 ** row)]
  for (const scale of [1, 2 ** -1070, 2 ** -600, 2 ** 960]) {
    for (const xs of [even, crowded]) {
      const top = xs[0] ** 2 + 16
      const vertices = [...xs.map((x) => [x, x * x]), [-xs[0], top], [xs[0], top]].map(([x, y]) => [x * scale, y * scale])
      const middles = vertices.map(([x, y], row) => [x, y].map((each, axis) => each / 2 + vertices.at(row - 1)[axis] / 2))
      const near = [...vertices, ...middles].flatMap(([x, y]) => [0, -scale, scale].flatMap((step) => [[x + step, y], [x, y + step]]))
      const sides = near.map((point) => sideOf(vertices, point))
      assert.deepEqual(new Set(sides), new Set([-1, 0, 1]))
      assert.deepEqual([...copyOf(vertices).locate(near)], sides)
      assert.deepEqual(near.map((point) => copyOf(vertices).side(point)), sides)
    }
  }
})

test("questions without a hull, to an old copy, and about no point are refused", () => {
  const copy = new HullCopy()
  assert.throws(() => copy.locate([[0, 0]]), { reason: "HULL_NOT_FOUND" })
  copy.update({ type: "snapshot", revision: 1n, points: 0, vertices: [], vertexKeys: null, center: null })
  assert.throws(() => copy.support([[1, 0]]), { reason: "HULL_EMPTY" })
  assert.throws(() => copy.locate([[0, 0], [NaN, 1]]), /point 1 is not finite: \(NaN, 1\)/)
  copy.maxStaleness = 0
  assert.throws(() => copy.locate([[0, 0]]), { reason: "STALE_COPY" })
  copy.maxStaleness = null
  copy.update({ type: "snapshot", revision: 1n, points: 1, vertices: [[8, 50]], vertexKeys: null, center: [8, 50] })
  assert.throws(() => copy.locate([[8, 50]]), { reason: "HULL_UNSUITABLE" })
  copy.update({ type: "deleted", revision: 2n })
  assert.throws(() => copy.area, { reason: "HULL_NOT_FOUND" })
})

/** Numbers from 0 to 1, the same each time. @param {number} seed */
function dice(seed) {
  let state = seed
  return () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0
    return state / 2 ** 32
  }
}

/** What an edit leaves, row by row. @param {any[]} rows @param {any} change @param {any[]} added */
function edited(rows, { removedRows, rotation, addedRows }, added) {
  const kept = rows.filter((_, row) => !removedRows.includes(row))
  const turned = kept.slice(rotation).concat(kept.slice(0, rotation))
  const changed = []
  let [next, place] = [0, 0]
  while (changed.length < turned.length + added.length) changed.push(addedRows[place] === changed.length ? added[place++] : turned[next++])
  return changed
}

test("a ring after edits has the rows that it should have", () => {
  const roll = dice(41)
  const below = (/** @type {number} */ most) => Math.floor(roll() * most)
  const some = (/** @type {number} */ of, /** @type {number} */ most) => {
    const chosen = new Set(Array.from({ length: of ? below(most) : 0 }, () => below(of)))
    return [...chosen].sort((a, b) => a - b)
  }
  for (const size of [0, 1, 2, 17, 700]) {
    let expected = Array.from({ length: size }, (_, row) => row)
    const ring = new Ring(expected)
    for (let step = 0; step < 1500; step++) {
      const grows = step % 500 < 250 ? 4 : 2
      const removedRows = some(expected.length, step % 97 ? 6 - grows : expected.length)
      const left = expected.length - removedRows.length
      const added = Array.from({ length: below(grows + 1) }, (_, row) => 1e6 + 10 * step + row)
      const addedRows = some(left + added.length, 1e3).slice(0, added.length)
      while (addedRows.length < added.length) addedRows.push(left + addedRows.length)
      const change = { removedRows, rotation: left && step % 3 === 0 ? below(left + 1) : 0, addedRows: [...new Set(addedRows)] }
      if (change.addedRows.length < added.length) continue
      const before = ring.rows
      const kept = [...before]
      expected = edited(expected, change, added)
      ring.edit(change, added)
      if (expected.length && step % 5 === 0) {
        const row = below(expected.length)
        expected[row] = -step
        ring.set(row, -step)
      }
      assert.equal(ring.length, expected.length)
      for (let asked = 0; asked < 5 && expected.length; asked++) {
        const row = below(expected.length)
        assert.equal(ring.at(row), expected[row], `size ${size}, step ${step}, row ${row}`)
      }
      if (step % 4 === 0) assert.deepEqual(ring.rows, expected, `size ${size}, step ${step}`)
      assert.deepEqual(before, kept, "an array that was read changed")
    }
  }
})

test("a copy after changes answers as one that begins there", () => {
  const roll = dice(7)
  const place = (/** @type {number} */ angle) => /** @type {[number, number]} */ ([Math.cos(angle), Math.sin(angle)])
  const ordered = (/** @type {number[]} */ angles) => {
    const all = angles.map(place)
    const least = all.reduce((best, each, row) => (each[0] < all[best][0] || (each[0] === all[best][0] && each[1] < all[best][1]) ? row : best), 0)
    return all.slice(least).concat(all.slice(0, least))
  }
  let angles = Array.from({ length: 300 }, () => roll() * 2 * Math.PI).sort((a, b) => a - b)
  const copy = copyOf(ordered(angles))
  for (let step = 0; step < 400; step++) {
    const before = ordered(angles)
    const gone = Math.floor(roll() * angles.length)
    angles = angles.filter((_, row) => row !== gone).concat(roll() * 2 * Math.PI).sort((a, b) => a - b)
    const after = ordered(angles)
    const is = (/** @type {any} */ one) => (/** @type {any} */ other) => one[0] === other[0] && one[1] === other[1]
    const removedRows = before.flatMap((each, row) => (after.some(is(each)) ? [] : [row]))
    const addedRows = after.flatMap((each, row) => (before.some(is(each)) ? [] : [row]))
    const kept = before.filter((_, row) => !removedRows.includes(row))
    const rotation = kept.findIndex(is(after.filter((_, row) => !addedRows.includes(row))[0]))
    copy.update({
      type: "change", revision: BigInt(step + 2), points: 300, removed: removedRows.map((row) => before[row]), removedRows, rotation,
      added: addedRows.map((row) => after[row]), addedRows, addedKeys: null, renamedRows: null, renamedKeys: null,
      measures: null, cause: "batch", clock: null, center: null, changed: null,
    })
    const fresh = copyOf(after)
    const near = Array.from({ length: 20 }, () => {
      const [a, b] = [after[Math.floor(roll() * after.length)], after[Math.floor(roll() * after.length)]]
      return /** @type {[number, number]} */ ([(a[0] + b[0]) / 2, (a[1] + b[1]) / 2])
    })
    const asked = [...near, ...after.slice(0, 5), [0, 0], [-2, 0]].map((each) => /** @type {[number, number]} */ (each))
    assert.deepEqual(asked.map((point) => copy.side(point)), [...fresh.locate(asked)], `step ${step}`)
    assert.deepEqual(copy.support(near), fresh.support(near), `step ${step}`)
    if (step % 7 === 0) {
      assert.deepEqual(copy.vertices, after)
      assert.deepEqual(copy.tangents([[3, 1]]), fresh.tangents([[3, 1]]))
      assert.equal(copy.area, fresh.area)
    }
  }
})

test("changes are applied to vertices and keys", () => {
  const copy = new HullCopy()
  const square = /** @type {any} */ ([[0, 0], [4, 0], [4, 4], [0, 4]])
  copy.update({ type: "snapshot", revision: 1n, points: 4, vertices: square, vertexKeys: ["a", "b", "c", "d"], center: null })
  copy.update({
    type: "change", revision: 2n, points: 4, removed: [[0, 0]], removedRows: [0], rotation: 2, added: [[-1, 5]],
    addedRows: [0], addedKeys: ["a"], renamedRows: [2], renamedKeys: ["z"], measures: null, cause: "batch", clock: null,
    center: null, changed: null,
  })
  assert.deepEqual(copy.vertices, [[-1, 5], [0, 4], [4, 0], [4, 4]])
  assert.deepEqual(copy.vertexKeys, ["a", "d", "z", "c"])
  assert.equal(copy.revision, 2n)
})
