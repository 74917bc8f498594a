import assert from "node:assert/strict"
import { test } from "node:test"

import { rowsOf } from "../src/batch.js"
import { carryOverGrpc } from "../src/grpc/carrying.js"
import { InFlight } from "../src/in-flight.js"

/** A channel whose messages are kept, and what answers them. */
function channel() {
  /** @type {any[]} */
  const messages = []
  /** @type {any} */
  const there = { messages }
  there.duplex = (/** @type {string} */ _, /** @type {null} */ __, /** @type {(answer: any) => void} */ take) => {
    const ended = new Promise((resolve) => (there.end = resolve))
    there.take = take
    return { write: (/** @type {any} */ message) => messages.push(message), end: there.end, ended }
  }
  return there
}

/** Rows of as many keys. @param {number} first @param {number} count */
function puts(first, count) {
  const keys = Array.from({ length: count }, (_, row) => first + row)
  return rowsOf("put", { keys, points: keys.map((key) => [key, 1]) })
}

const HUGE = { revision: 1, pointCount: 1, heldRows: [], hullChanged: true, duplicate: false, clockTime: null }
const answer = (/** @type {number} */ sequence, more = {}) => ({ result: { ...HUGE, ...more }, sequence, results: [], maxBatches: 0 })

test("batches that no message takes two of are all under way", async () => {
  const [there, batches] = [channel(), new InFlight(2000)]
  for (let batch = 0; batch < 8; batch++) batches.add(puts(batch * 2000, 2000)) // 48 kB each, of 64
  const options = { producer: "p", uid: "u", inFlight: 4, maySkip: false, signal: null }
  const carried = carryOverGrpc(there, "fleet", batches, options)
  assert.equal(there.messages.length, 4) // until the server says that it takes several in a message
  there.take({ results: [], result: null, maxBatches: 64 })
  there.take({ results: [1, 2, 3].map((sequence) => answer(sequence)), result: null, maxBatches: 0 })
  assert.equal(there.messages.length, 7)
  for (let sequence = 4; sequence <= 8; sequence++) there.take(answer(sequence))
  await carried
  assert.deepEqual(there.messages.map(({ name, uid }) => [name, uid]), [["fleet", "u"], ...new Array(7).fill([undefined, undefined])])
  assert.equal(batches.empty, true)
})

test("small batches share a message, as many as are under way", async () => {
  const [there, batches] = [channel(), new InFlight(10)]
  const options = { producer: "p", uid: "", inFlight: 16, maySkip: false, signal: null }
  batches.add(puts(0, 10))
  const carried = carryOverGrpc(there, "fleet", batches, options)
  there.take({ results: [], result: null, maxBatches: 64 })
  for (let batch = 1; batch < 8; batch++) {
    batches.add(puts(batch * 10, 10))
    batches.onMore()
  }
  assert.deepEqual(there.messages.map(({ batches: several }) => several?.length ?? 1), [1, 1, 2, 4])
  for (let sequence = 1; sequence <= 8; sequence++) there.take(answer(sequence))
  await carried
})

test("what another writer with the same name has written is not taken for one's own", async () => {
  const [there, batches] = [channel(), new InFlight(10)]
  const { outcome } = batches.add(puts(0, 1))
  void carryOverGrpc(there, "fleet", batches, { producer: "p", uid: "", inFlight: 16, maySkip: false, signal: null })
  assert.throws(() => there.take(answer(1, { duplicate: true })), { reason: "PRODUCER_IN_USE" })
  const why = new Error("given up")
  batches.abandon(why)
  await assert.rejects(outcome.applied, why)
  assert.deepEqual([batches.empty, batches.rows], [true, 0])
})
