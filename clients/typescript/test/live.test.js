import assert from "node:assert/strict"
import { readFile } from "node:fs/promises"
import { test } from "node:test"

import { Client, DynhullError, HullCopies, HullCopy } from "../src/index.js"
import { GrpcClient } from "../src/grpc/index.js"
import { fromJson } from "../src/json.js"

const url = process.env.DYNHULL_GATEWAY ?? ""
const server = process.env.DYNHULL_SERVER ?? ""
/** Both ways in. @type {Record<string, Client>} */
const ways = url ? { node: new Client(url), grpc: new GrpcClient(server) } : {}
const options = { skip: url ? false : "DYNHULL_GATEWAY names no gateway, and DYNHULL_SERVER no server" }

/** A test over each way in. @param {string} title @param {(client: Client, name: (what: string) => string) => Promise<void>} run */
function live(title, run) {
  if (!url) test(title, options, () => {})
  for (const [way, client] of Object.entries(ways)) test(`${title} (${way})`, () => run(client, (what) => `${way}/${what}`))
}

live("hulls are created, written, asked and deleted", async (client, name) => {
  const hull = name("all")
  const { revision, keyed, created } = await client.createHull(hull, { keyed: "int", existOk: true })
  assert.deepEqual([revision, keyed, typeof created], [0n, "int", "bigint"])
  const keys = [1, 9007199254740993n, 18446744073709551615n, 4n]
  const applied = await client.put(hull, keys, [[0, 0], [4, 0], [4, 3], [5e-324, 1e-320]])
  assert.deepEqual([applied.revision, applied.inserted, applied.hullChanged], [1n, 4, true])
  const found = await client.getHull(hull)
  assert.deepEqual(found.vertices, [[0, 0], [4, 0], [4, 3], [5e-324, 1e-320]])
  assert.deepEqual(found.vertexKeys, [1n, 9007199254740993n, 18446744073709551615n, 4n])
  assert.deepEqual((await client.locate(hull, [[1, 0.5], [2, 0], [9, 9]])).sides, [1, 0, -1])
  assert.deepEqual((await client.locate(hull, { keys: [1n] })).sides, [0])
  assert.deepEqual((await client.support(hull, [[1, 0]], { keys: true })).keys, [9007199254740993n])
  const { positions, present } = await client.positions(hull, [18446744073709551615n, 7n])
  assert.deepEqual([positions, present], [[[4, 3], [null, null]], [true, false]])
  assert.equal((await client.remove(hull, [4n, 5n])).missing, 1)
  assert.equal((await client.getMeasures(hull)).area, 6)
  assert.equal((await client.verify(hull)).equal, true)
  const past = await client.at(hull, 1)
  assert.deepEqual([past.revision, (await past.locate([[5e-324, 1e-320]])).sides], [1n, [0]])
  assert.deepEqual((await past.entities()).keys.length, 4)
  const all = []
  for await (const each of client.listHulls(name(""))) all.push(each.name)
  assert.ok(all.includes(hull))
  await client.deleteHull(hull)
  await assert.rejects(client.getHull(hull), { reason: "HULL_NOT_FOUND", status: 404 })
})

live("time spans are seconds or texts", async (client, name) => {
  const [hull, fence] = [name("spans"), name("spans")]
  await client.createHull(hull, { keyed: "str", maxAge: "1h", maxSkew: "500ms" })
  const { inserted } = await client.put(hull, ["a"], [[0, 0]], { ttl: "30d" })
  assert.equal(inserted, 1)
  const area = { center: [0, 0], radius: 1 }
  await client.createFence(fence, { area, subjects: hull, dwell: "1.5m", minDwell: "2s", maxEventAge: "7d" })
  const { dwell, minDwell, maxEventAge } = await client.getFence(fence)
  assert.deepEqual([dwell, minDwell, maxEventAge], [90, 2, 604800])
  const { times } = await client.series(hull, { last: "30m" })
  assert.ok(times.length > 0)
})

live("refusals name the field, the row and the value", async (client, name) => {
  const hull = name("refused")
  await client.createHull(hull)
  const bad = client.apply(hull, { insert: [[0, 0], [1, /** @type {any} */ ("x")]] })
  await assert.rejects(bad, (error) => {
    assert.ok(error instanceof DynhullError)
    assert.deepEqual([error.reason, error.field, error.row, error.value], ["INVALID_FIELD", "insert", 1, '"x"'])
    return true
  })
  await assert.rejects(client.apply(hull, { delete: [[8, 8]] }), { reason: "POINT_MISSING" })
  const late = /** @type {any} */ ({ insert: [[0, 0]], times: ["9999-12-31T00:00:00Z"] })
  await assert.rejects(client.apply(hull, late), { reason: "INVALID_FIELD", status: 400, field: "times", row: 0 })
  const elsewhere = client instanceof GrpcClient ? new GrpcClient("grpc://127.0.0.1:1", { retries: 0 }) : new Client("http://127.0.0.1:1", { retries: 0 })
  await assert.rejects(elsewhere.getHull(hull), { reason: "UNREACHABLE" })
  const left = AbortSignal.timeout(50)
  await assert.rejects(client.getHull(hull, { minRevision: 1, signal: left }), { name: "TimeoutError" })
  await client.apply(hull, { insert: [[0, 0]] }) // for the gateway, which still waits for it
  for await (const event of client.watch(hull, { signal: AbortSignal.timeout(100) })) assert.equal(event.type, "snapshot")
})

live("a numbered batch is applied once, and a transfer whole", async (client, name) => {
  const [a, b] = [name("once/a"), name("once/b")]
  for (const hull of [a, b]) await client.createHull(hull, { keyed: "str" })
  const batch = { keys: ["k"], points: [[1, 1]], producer: "page", sequence: 1 }
  assert.equal((await client.apply(a, /** @type {any} */ (batch))).duplicate, false)
  assert.equal((await client.apply(a, /** @type {any} */ (batch))).duplicate, true)
  assert.equal(await client.lastSequence(a, "page"), 1n)
  const moved = await client.transfer({ [a]: { remove: ["k"] }, [b]: { keys: ["k"], points: [[2, 2]] } })
  assert.deepEqual([moved[a].deleted, moved[b].inserted], [1, 1])
})

live("a watch waits for its hull, follows it, and says that it is gone", async (client, name) => {
  const hull = name("watched")
  const copy = new HullCopy()
  await assert.rejects(client.watch(hull, { wait: false }).next(), { reason: "HULL_NOT_FOUND" })
  const watch = client.watch(hull, { copy, keys: true, measures: true })
  const first = watch.next()
  await client.createHull(hull, { keyed: "str" })
  assert.equal((await first).value?.type, "snapshot")
  await client.put(hull, ["a", "b", "c"], [[0, 0], [4, 0], [4, 3]])
  while (copy.revision < 1n) await watch.next()
  assert.deepEqual(copy.locate([[3, 1], [0, 0], [0, 1]]), Int8Array.of(1, 0, -1))
  await client.remove(hull, ["a"])
  while (copy.revision < 2n) await watch.next()
  assert.deepEqual([copy.vertices, copy.vertexKeys], [[[4, 0], [4, 3]], ["b", "c"]])
  await client.deleteHull(hull)
  let last
  do last = (await watch.next()).value
  while (last?.type !== "deleted")
  assert.throws(() => copy.area, { reason: "HULL_NOT_FOUND" })
  await watch.return()
})

live("many hulls are watched by one stream", async (client, name) => {
  const copies = new HullCopies()
  const watch = client.watchMany(name("many/"), { outlines: true, copies })
  for await (const event of watch) {
    if (event.type === "complete" && !copies.size) {
      await client.createHull(name("many/a"))
      await client.apply(name("many/a"), { insert: [[0, 0], [4, 0], [4, 3]] })
    } else if (copies.get(name("many/a"))?.revision === 1n) {
      assert.equal(copies.get(name("many/a"))?.area, 6)
      await client.deleteHull(name("many/a"))
    } else if (event.gone.length) break
  }
  assert.equal(copies.size, 0)
})

live("the other questions are answered", async (client, name) => {
  const [a, b] = [name("questions/a"), name("questions/b")]
  await client.createHull(a, { keyed: "str", quarantine: { maxGrowth: 2 } })
  await client.setQuarantine(a, { maxGrowth: 3 })
  await client.createHull(b)
  await client.put(a, ["a", "b", "c"], [[0, 0], [1, 0], [0, 1]])
  await client.apply(b, { insert: [[0.25, 1], [0.5, -1], [1, 3]] })
  await client.put(a, ["a"], [[99, 99]])
  const held = []
  for await (const each of client.listHeld(a)) held.push(each.key)
  assert.deepEqual(held, ["a"])
  assert.equal((await client.drop(a, ["a"])).dropped, 1)
  assert.equal((await client.release(a, ["b"])).released, 0)
  assert.equal((await client.waitForHull(a, { minRevision: 1 })).held, 0)
  assert.equal((await client.separate(a, b, { minRevision: 5 })).revision, 5n)
  assert.equal((await client.series(b)).times.length > 0, true)
  assert.equal((await client.phaseDiagram(b, [[0.25, 0]])).stable.length, 3)
  assert.equal((await client.frontier(b, { rates: [0.5] })).revision, 1n)
  await client.createHull(name("questions/globe"), { geographic: true, center: [8, 50] })
  assert.deepEqual((await client.recenter(name("questions/globe"), [9, 51])).center, [9, 51])
})

live("fences make events, which a consumer acknowledges", async (client, name) => {
  const [hull, fence] = [name("fenced"), name("fence")]
  await client.createHull(hull, { keyed: "str" })
  const made = await client.createFence(fence, { area: { center: [0, 0], radius: 3 }, subjects: hull, initial: "none" })
  assert.deepEqual([made.area, made.lastSequence], [{ center: [0, 0], radius: 3 }, 0n])
  await client.put(hull, ["a"], [[1, 1]])
  await client.put(hull, ["a"], [[9, 9]])
  const types = []
  for await (const event of client.watchFence(fence, { after: 0 })) {
    types.push([event.type, event.key, event.sequence, event.position])
    if (types.length === 2) break
  }
  assert.deepEqual(types, [["enter", "a", 1n, [1, 1]], ["exit", "a", 2n, [9, 9]]])
  assert.equal((await client.ackFence(fence, "page", 2n)).backlog, 0)
  assert.deepEqual((await client.fenceInside(fence)).subjects.flatMap((each) => each.keys), [])
  await client.deleteFence(fence)
})

live("alarms are raised, acknowledged, muted and cleared", async (client, name) => {
  const [hull, alarm] = [name("alarmed"), name("alarm")]
  await client.createHull(hull, { keyed: "str" })
  const made = await client.createAlarm(alarm, { hull, when: "area > 5", clear: "area < 2" })
  assert.deepEqual([made.when, made.raised, made.lastSequence, made.statuses], ["area > 5", 0, 0n, []])
  const events = client.watchAlarm(alarm, { after: 0 })
  await client.put(hull, ["a", "b", "c"], [[0, 0], [4, 0], [4, 3]])
  const raised = /** @type {import("../src/watch.js").AlarmEvent} */ ((await events.next()).value)
  assert.deepEqual([raised.type, raised.sequence, raised.hull, raised.value, raised.bound], ["raised", 1n, hull, 6, 5])
  const { acknowledged } = await client.acknowledgeAlarm(alarm, hull)
  assert.equal(typeof acknowledged, "bigint")
  const until = 4102444800000000n
  assert.equal((await client.muteAlarm(alarm, hull, until)).mutedUntil, until)
  const [status] = (await client.getAlarm(alarm)).statuses
  assert.deepEqual([status.raised, status.acknowledged, status.mutedUntil], [true, acknowledged, until])
  assert.equal((await client.muteAlarm(alarm, hull, null)).mutedUntil, null)
  await client.remove(hull, ["a"])
  assert.equal((await events.next()).value?.type, "cleared")
  assert.equal((await client.ackAlarm(alarm, "page", 1n)).backlog, 1)
  await client.deleteAlarmConsumer(alarm, "page")
  const names = []
  for await (const each of client.listAlarms(alarm)) names.push(each.name)
  assert.deepEqual(names, [alarm])
  await client.deleteAlarm(alarm)
  assert.equal((await events.next()).value?.type, "closed")
  assert.deepEqual(await events.next(), { done: true, value: undefined })
  await assert.rejects(client.watchAlarm(alarm).next(), { reason: "ALARM_NOT_FOUND" })
})

live("the past is replayed, followed and asked", async (client, name) => {
  const hull = name("past")
  await client.createHull(hull, { keyed: "int", history: true })
  const large = 18446744073709551615n
  await client.put(hull, [1, 2, large], [[0, 0], [4, 0], [4, 3]])
  await client.put(hull, [large], [[1e-310, 5e-324]])
  await client.remove(hull, [2])
  const copy = new HullCopy()
  const seen = []
  for await (const event of client.replay(hull, { start: 1, copy, keys: true })) seen.push([event.type, event.revision, copy.vertices.length])
  assert.deepEqual(seen, [["snapshot", 1n, 3], ["change", 2n, 3], ["change", 3n, 2]])
  const track = (await client.track(hull, [large, 2], { start: 1 })).get(large)
  assert.deepEqual([track?.points, track?.revisions], [[[4, 3], [1e-310, 5e-324]], [1n, 2n]])
  const batches = []
  for await (const batch of client.feed(hull, { after: 0 })) {
    batches.push([batch.type, batch.revision, batch.keys, batch.points, batch.removed])
    if (batch.revision === 3n) break
  }
  assert.deepEqual(batches[1], ["batch", 2n, [large], [[1e-310, 5e-324]], undefined])
  assert.deepEqual(batches[2].at(-1), [2n])
  const all = []
  let position = ""
  for await (const batch of client.feedMany(hull, { begin: true })) {
    all.push(batch.revision)
    position = batch.position || position
    if (batch.revision === 3n) break
  }
  assert.deepEqual(all, [1n, 2n, 3n])
  assert.equal((await client.ackFeed(hull, "store", 2n)).after, 2n)
  for await (const { revision } of client.feed(hull, { consumer: "store" })) {
    assert.equal(revision, 3n)
    break
  }
  assert.equal((await client.ackFeedMany(hull, "all", position)).after, position)
  await client.put(hull, [2], [[1, 1]])
  for await (const { type, revision } of client.feedMany(hull, { consumer: "all" })) {
    if (type !== "batch") continue
    assert.equal(revision, 4n)
    break
  }
  const consumers = []
  for await (const each of client.listFeedConsumers(hull)) consumers.push([each.name, each.hull, each.prefix, each.backlog])
  assert.deepEqual(consumers.map((each) => each.slice(0, 3)), [["store", hull, null], ["all", null, hull]])
  await client.deleteFeedConsumer(hull, "store")
  await client.deleteFeedManyConsumer(hull, "all")
  assert.deepEqual(await client.listFeedConsumers(hull).next(), { done: true, value: undefined })
  const area = { exterior: [[3, -1], [5, -1], [5, 5], [3, 5]] }
  const crossed = []
  for await (const event of client.fenceEventsBetween({ area, subjects: hull, start: 1, end: 3, initial: "none" })) {
    crossed.push([event.type, event.key, event.sequence])
  }
  assert.deepEqual(crossed, [["exit", large, 1n], ["exit", 2n, 2n]])
  const kept = await client.history(hull)
  assert.deepEqual([kept.firstRevision <= 1n, kept.lastRevision, kept.history], [true, 4n, true])
  assert.equal((await client.setHistory(hull, "30d")).name, hull)
  assert.equal((await client.history(hull)).history, 2592000)
  assert.equal(await client.eraseHistory(hull, [5]), null)
})

test("whatever a client follows takes one connection", options, async () => {
  const name = (/** @type {string} */ what) => `node/${what}`
  const counted = /** @type {string[]} */ ([])
  const counting = new Client(url, { fetch: (input, init) => (counted.push(`${init?.method} ${input}`), fetch(input, init)) })
  const hulls = Array.from({ length: 12 }, (_, i) => name(`joined/${i}`))
  for (const hull of hulls) await counting.createHull(hull)
  counted.length = 0
  const watches = hulls.map((hull) => counting.watch(hull))
  const many = counting.watchMany(hulls, { outlines: true })
  const first = await Promise.all([...watches, many].map((each) => each.next()))
  assert.deepEqual(first.map((each) => each.value?.type), [...hulls.map(() => "snapshot"), "begin"])
  assert.deepEqual(counted, [`POST ${url}/streams`])
  const later = counting.watch(hulls[0])
  assert.equal((await later.next()).value?.type, "snapshot")
  assert.deepEqual(counted.slice(1).map((each) => each.replace(/streams\/[^/]+/, "streams/S")), [`PUT ${url}/streams/S/subscriptions/14`])
  for (const each of [...watches, many, later]) await each.return()
})

live("numbers at the ends of what they can be come back as they are", async (client, name) => {
  const { values } = fromJson(await readFile(new URL("cases.json", import.meta.url), "utf8"))
  const hull = name("values")
  await client.createHull(hull, { keyed: "int", ordering: "event_time" })
  for (const [step, { keys, points, times, sequence }] of values.batches.entries()) {
    const numbered = { producer: "cases", sequence: BigInt(sequence), maySkip: true }
    const { revision } = await client.put(hull, keys, points, { times: times.map(BigInt), ...numbered })
    assert.equal(revision, BigInt(step + 1))
    assert.equal(await client.lastSequence(hull, "cases"), BigInt(sequence))
    const found = await client.positions(hull, values.keys)
    const kept = points.map((/** @type {number[]} */ point) => point.map((each) => each + 0)) // -0 is 0 to a server
    assert.deepEqual(found.positions, [...kept, [null, null]])
    assert.deepEqual(found.times, [...times.map(BigInt), null])
    const all = await client.entities(hull)
    const sorted = all.keys.map(BigInt).sort((a, b) => (a < b ? -1 : 1))
    assert.deepEqual(sorted, keys.map(BigInt))
  }
})

live("a writer gathers, waits for room, and stops where the server refuses", async (client, name) => {
  const hull = name("writer")
  await client.createHull(hull, { keyed: "int" })
  const writer = client.writer(hull, { batchRows: 500, room: 1000 })
  for (let i = 0; i < 5000; i++) await writer.put([i % 700], [[i, i % 13]])
  await writer.remove([0])
  await writer.flush()
  assert.equal((await client.getHull(hull)).info.points, 699)
  assert.equal(writer.sequence, await client.lastSequence(hull, writer.producer))
  const bad = { reason: "INVALID_FIELD", field: "times", row: 1, value: '"yesterday"' }
  await assert.rejects(writer.put([1, 2], [[1, 1], [2, 2]], [new Date(), "yesterday"]), bad)
  await assert.rejects(writer.put([1, -2], [[1, 1], [2, 2]]), { field: "keys", row: 1, value: "-2" })
  const refused = { ttl: -1, only: "new", times: [1n, 10n ** 20n], expireTimes: [1n, Date.now()] }
  for (const [option, value] of Object.entries(refused)) {
    const field = option.replace("T", "_t")
    await assert.rejects(writer.put([1, 2], [[1, 1], [2, 2]], /** @type {any} */ ({ [option]: value })), { reason: "INVALID_FIELD", field })
  }
  await assert.rejects(writer.put([1, 2], [[1, 1], [2, NaN]]), { field: "points", row: 1 })
  const { applied } = await writer.put([2], [[2, 2]])
  await writer.flush() // nothing of what was bad was added
  assert.deepEqual([(await applied).points, (await applied).moved], [699, 1])
  const wrong = await writer.put(["a key of another kind"], [[1, 1]])
  const after = await writer.put([2], [[3, 3]])
  await assert.rejects(writer.flush(), { name: "DynhullError" })
  await assert.rejects(writer.put([2], [[2, 2]]), { name: "DynhullError" })
  await assert.rejects(wrong.applied, { name: "DynhullError" })
  await assert.rejects(after.applied, { name: "DynhullError" })
  await assert.rejects(writer.close(), { name: "DynhullError" })
  assert.deepEqual((await client.positions(hull, [2])).positions, [[2, 2]])
})

live("a writer keeps every position of a key, or the last of a batch, as the Python SDK's does", async (client, name) => {
  const { writers } = fromJson(await readFile(new URL("cases.json", import.meta.url), "utf8"))
  for (const [place, { coalesce, ordering, calls, revisions, kept }] of writers.entries()) {
    const hull = name(`kept/${place}`)
    await client.createHull(hull, { keyed: "str", ordering })
    const writer = client.writer(hull, { coalesce })
    const outcomes = []
    for (const { keys, points, times, only } of calls) {
      const columns = { ...(times && { times: times.map(BigInt) }), ...(only && { only }) }
      outcomes.push(await writer.put(keys, points, columns))
    }
    await writer.close()
    const found = await Promise.all(outcomes.map(async ({ applied }) => Number((await applied).revision)))
    assert.deepEqual(found, revisions, `case ${place}`)
    assert.equal(writer.sequence, BigInt(revisions.at(-1)))
    assert.deepEqual((await client.positions(hull, Object.keys(kept))).positions, Object.values(kept), `case ${place}`)
  }
  const bad = /** @type {any} */ ({ coalesce: "first" })
  assert.throws(() => client.writer("kept", bad), /coalesce must be null or "last", got first/)
})

live("of two writers with one name at the same time, one is refused", async (client, name) => {
  const hull = name("shared")
  await client.createHull(hull, { keyed: "int" })
  const [one, two] = [1, 2].map(() => client.writer(hull, { producer: "shared" }))
  await two.put([100], [[1, 1]])
  await two.flush()
  for (let key = 0; key < 5; key++) {
    await one.put([key], [[key, key * key]])
    await one.flush()
  }
  const { applied } = await two.put([101], [[2, 2]])
  await assert.rejects(applied, { reason: "PRODUCER_IN_USE" })
  await assert.rejects(two.put([101], [[2, 2]]), { reason: "PRODUCER_IN_USE" })
  await one.put([5], [[5, 25]])
  await one.close()
  assert.deepEqual((await client.positions(hull, [100, 5, 101])).present, [true, true, false])
})

live("a writer of a hull that is another one is refused", async (client, name) => {
  const hull = name("another")
  await client.createHull(hull, { keyed: "int" })
  const first = client.writer(hull, { producer: "p" })
  assert.equal(first.uid, "")
  await first.put([1], [[1, 1]])
  await first.flush()
  assert.equal(first.uid, (await client.getHull(hull)).info.uid)
  const second = client.writer(hull, { producer: "p", uid: first.uid, acknowledged: first.sequence })
  await second.put([2], [[2, 2]])
  await second.close()
  const ahead = client.writer(hull, { producer: "p", uid: first.uid, acknowledged: 9n })
  await ahead.put([3], [[3, 3]])
  await assert.rejects(ahead.flush(), { reason: "RESTORED", expected: 3n, message: /led back/ })
  await client.deleteHull(hull)
  await client.createHull(hull, { keyed: "int" })
  const third = client.writer(hull, { producer: "p", uid: first.uid })
  const { applied } = await third.put([4], [[4, 4]])
  await assert.rejects(applied, { reason: "RESTORED", expected: 1n, message: /another one/ })
  await first.put([5], [[5, 5]])
  await assert.rejects(first.flush(), { reason: "RESTORED" })
  assert.equal((await client.getHull(hull)).info.points, 0)
})

live("a writer with the name of an earlier one goes on after its last batch", async (client, name) => {
  const hull = name("resumed")
  await client.createHull(hull, { keyed: "int" })
  const first = client.writer(hull, { producer: "resumed", batchRows: 3 })
  for (let key = 0; key < 10; key++) await first.put([key], [[key, key * key]])
  await first.close()
  await assert.rejects(first.put([1], [[1, 1]]), { reason: "CLOSED" })
  const second = client.writer(hull, { producer: "resumed", batchRows: 3 })
  for (let key = 10; key < 20; key++) await second.put([key], [[key, key * key]])
  await second.flush()
  assert.equal(second.sequence, await client.lastSequence(hull, "resumed"))
  assert.equal((await client.getHull(hull)).info.points, 20)
  assert.ok(second.sequence > first.sequence)
})

live("a writer that is told to stop stops", async (client, name) => {
  const hull = name("stopped")
  await client.createHull(hull, { keyed: "int" })
  const stop = new AbortController()
  const writer = client.writer(hull, { signal: stop.signal, batchRows: 2, inFlight: 2 })
  const stopped = new Error("stopped")
  const writing = (async () => {
    for (let key = 0; ; key++) await writer.put([key], [[key, key]])
  })()
  while (writer.sequence < 3n) await new Promise((resolve) => setImmediate(resolve))
  stop.abort(stopped)
  await assert.rejects(writing, stopped)
  await assert.rejects(writer.flush(), stopped)
  await assert.rejects(writer.put([1], [[1, 1]]), stopped)
  assert.ok((await client.lastSequence(hull, writer.producer)) >= writer.sequence)
})

live("a writer moves points, and puts keys under conditions", async (client, name) => {
  const [points, keyed] = [name("moved"), name("conditions")]
  await client.createHull(points)
  const mover = client.writer(points, { missing: "count" })
  await mover.insert([[0, 0], [4, 0], [4, 3]])
  await mover.move([[0, 0]], [[0, 3]])
  const { applied } = await mover.delete([[7, 7], [4, 3]])
  await mover.close()
  assert.deepEqual((await client.getHull(points)).vertices, [[0, 3], [4, 0]])
  assert.equal((await applied).missing, 1)
  const strict = client.writer(points)
  await strict.delete([[7, 7]])
  await assert.rejects(strict.flush(), { name: "DynhullError" })
  await client.createHull(keyed, { keyed: "str" })
  const writer = client.writer(keyed)
  await writer.put(["a", "b"], [[0, 0], [4, 0]], { accuracies: [0.5, 2] })
  await writer.put(["a", "c"], [[9, 9], [4, 3]], { only: "absent" })
  await writer.put(["d"], [[1, 1]], { ttl: "50ms" })
  await writer.put(["e"], [[1, 2]], { expireTimes: [new Date(Date.now() - 1000)] })
  await writer.flush()
  const found = await client.positions(keyed, ["a", "b", "c"])
  assert.deepEqual(found.positions, [[0, 0], [4, 0], [4, 3]])
  assert.deepEqual(found.accuracies, [0.5, 2, 0])
  for await (const { points: left } of client.watch(keyed)) if (left === 3) break
  assert.deepEqual((await client.positions(keyed, ["d", "e"])).present, [false, false])
  await assert.rejects(writer.put(["x", 5], [[0, 0], [1, 1]]), { field: "keys", row: 1, value: "5" })
  await assert.rejects(writer.put(["x"], [[0, 0]], { accuracies: [-1] }), { field: "accuracies", row: 0 })
  await writer.close()
})

live("refusals name what is at fault as calls do", async (client, name) => {
  const [keyed, plain] = [name("refusals/keyed"), name("refusals/plain")]
  await client.createHull(keyed, { keyed: "str" })
  await client.createHull(plain)
  const area = { center: [0, 0], radius: 1 }
  /** @type {[() => Promise<unknown>, string, number | null, RegExp][]} */
  const refused = [
    [() => client.put(keyed, ["a", "b", "a"], [[0, 0], [1, 1], [2, 2]]), "keys", 2, /^\/keys\/2: a batch names a key once, and \/keys\/0 is the same/],
    [() => client.put(keyed, ["a", "b"], [[0, 0]]), "points", null, /^\/points: must /],
    [() => client.put(keyed, ["a", "b"], [[0, 0], [1, NaN]]), "points", 1, /^\/points\/1/],
    [() => client.put(keyed, ["a", ""], [[0, 0], [1, 1]]), "keys", 1, /^\/keys\/1: /],
    [() => client.put(keyed, ["a", "b"], [[0, 0], [1, 1]], { accuracies: [1, -1] }), "accuracies", 1, /^\/accuracies\/1: must /],
    [() => client.put(keyed, ["a"], [[0, 0]], { ttl: -1 }), "ttl", null, /^\/ttl: must be /],
    [() => client.put(keyed, ["a"], [[0, 0]], { ttl: "soon" }), "ttl", null, /^\/?ttl: /],
    [() => client.createHull(name("refusals/new"), { maxAge: "soon" }), "max_age", null, /^\/?max_age: /],
    [() => client.writer(keyed).put(["a"], [[0, 0]], { ttl: "soon" }), "ttl", null, /^\/ttl: /],
    [() => client.feedMany("", { position: "soon" }).next(), "position", null, /^\/position: must be /],
    [() => client.remove(keyed, ["zz"], { missing: "raise" }), "remove", 0, /^\/remove\/0: no such key/],
    [() => client.apply(plain, { delete: [[7, 7]] }), "delete", 0, /^\/delete\/0: no such point/],
    [() => client.apply(plain, { move: { origins: [[7, 7]], destinations: [[8, 8]] } }), "move", 0, /^\/move\/origins\/0: no such point/],
    [() => client.createHull(name("refusals/new"), { maxAge: -1 }), "max_age", null, /^\/max_age: must be /],
    [() => client.createHull(name("refusals/new"), { keyed: "str", quarantine: { maxSpeed: -1 } }), "quarantine", null, /^\/quarantine\/max_speed: must be /],
    [() => client.createFence(name("refusals/fence"), { area: { ...area, radius: -1 }, subjects: keyed }), "area", null, /^\/area\/radius: must be /],
    [() => client.createFence(name("refusals/fence"), { area, subjects: keyed, margin: -1 }), "margin", null, /^\/margin: must be /],
    [() => client.createAlarm(name("refusals/alarm"), { hull: keyed, when: "area >" }), "when", null, /^\/when: at position 7: /],
    [() => client.support(keyed, [[1, 0], [0, 0]]), "directions", 1, /^\/directions\/1: has no direction/],
    [() => client.layers(keyed, 0), "count", null, /^\/?count: must be /],
  ]
  for (const [call, field, row, message] of refused) await assert.rejects(call, { name: "DynhullError", field, row, message }, field)
  assert.deepEqual([(await client.getHull(keyed)).info.revision, (await client.getHull(plain)).info.revision], [0n, 0n])
})
