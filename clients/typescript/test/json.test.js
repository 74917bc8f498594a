import assert from "node:assert/strict"
import { test } from "node:test"

import { fromJson, fromWire, isoTime, micros, toJson } from "../src/json.js"

test("numbers go and come as they are", () => {
  const keys = [1, 9007199254740993n, 18446744073709551615n]
  assert.equal(toJson({ keys, points: [[-0, 5e-324], [1e300, 0.1]] }), '{"keys":[1,9007199254740993,18446744073709551615],"points":[[-0.0,5e-324],[1e+300,0.1]]}')
  assert.deepEqual(fromJson(toJson(keys)), keys)
  assert.ok(Object.is(fromJson("[-0.0]")[0], -0))
  assert.deepEqual(fromJson('{"a":[12345678901234567890],"b":0.12345678901234567,"c":"[1234567890123456789]"}'), {
    a: [12345678901234567890n], b: 0.12345678901234567, c: "[1234567890123456789]",
  })
})

test("answers have the names of JavaScript, and bigint where numbers are large", () => {
  const answer = { revision: 3, keys: [1, 2], hull_changed: true, last_sequence: 7, vertices: [[0, 1]], times: ["1970-01-01T00:00:01Z", null] }
  assert.deepEqual(fromWire({ ...answer, inside: [{ hull: "a_b", keys: ["k"], revision: 1 }] }), {
    revision: 3n, keys: [1n, 2n], hullChanged: true, lastSequence: 7n, vertices: [[0, 1]], times: [1000000n, null],
    inside: [{ hull: "a_b", keys: ["k"], revision: 1n }],
  })
})

test("times are microseconds", () => {
  assert.equal(micros("2026-11-29T03:36:01.726435Z"), 1795923361726435n)
  assert.equal(micros("2026-11-29T04:36:01.7+01:00"), 1795923361700000n)
  assert.equal(isoTime(1795923361726435n), "2026-11-29T03:36:01.726435Z")
  assert.equal(isoTime(-1n), "1969-12-31T23:59:59.999999Z")
  assert.equal(isoTime(new Date(5)), "1970-01-01T00:00:00.005000Z")
  for (const time of [0n, -1500000n, 253402300799999999n]) assert.equal(micros(isoTime(time)), time)
  assert.throws(() => micros("2026-11-29T03:36:01"), /no time with a zone/)
})
