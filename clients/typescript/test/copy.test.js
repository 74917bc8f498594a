import assert from "node:assert/strict"
import { readFile } from "node:fs/promises"
import { test } from "node:test"

import { HullCopy } from "../src/index.js"
import { fromJson } from "../src/json.js"

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
