// Calls, streams and writers that are aborted at each of their first turns: prints what ended otherwise than with the reason.

import { GrpcClient } from "../../clients/typescript/src/grpc/index.js"
import { Client, HullCopy } from "../../clients/typescript/src/index.js"

const [url, name] = process.argv.slice(2)
const TURNS = 24
const PATIENCE = 20_000 // milliseconds
const area = { center: /** @type {const} */ ([0, 0]), radius: 5 }
/** @type {[string, unknown][]} */
const wrong = []
let now = ""
process.on("unhandledRejection", (error) => wrong.push([now, error]))

const client = url.startsWith("grpc:") ? new GrpcClient(url) : new Client(url)
const [fence, alarm] = [`${name}/fence`, `${name}/alarm`]
await client.createHull(name, { keyed: "str", history: true })
await client.createFence(fence, { area, subjects: name })
await client.createAlarm(alarm, { hull: name, when: "area > 1" })
await client.put(name, ["a", "b", "c"], [[0, 0], [4, 0], [4, 3]])

/** @param {(signal: AbortSignal) => AsyncIterable<unknown>} follow */
const all = (follow) => async (/** @type {AbortSignal} */ signal) => {
  for await (const _ of follow(signal)) await null
}

/** @type {Record<string, (signal: AbortSignal) => Promise<unknown>>} */
const steps = {
  watch: all((signal) => client.watch(name, { signal, copy: new HullCopy() })),
  "watch of what is not there": all((signal) => client.watch(`${name}/none`, { signal })),
  watchMany: all((signal) => client.watchMany(name, { signal, outlines: true })),
  watchFence: all((signal) => client.watchFence(fence, { signal, after: 0n })),
  watchAlarm: all((signal) => client.watchAlarm(alarm, { signal, after: 0n })),
  feed: all((signal) => client.feed(name, { signal, after: 0n })),
  feedMany: all((signal) => client.feedMany(name, { signal, begin: true })),
  replay: all((signal) => client.replay(name, { signal, start: 1 })),
  fenceEventsBetween: all((signal) => client.fenceEventsBetween({ area, subjects: name, signal })),
  listHulls: all((signal) => client.listHulls(name, { signal })),
  waitForHull: (signal) => client.waitForHull(`${name}/none`, { signal }),
  locate: (signal) => client.locate(name, [[1, 1]], { signal }),
  entities: (signal) => client.entities(name, { signal }),
  put: (signal) => client.put(name, ["a"], [[1, 1]], { signal }),
  async writer(signal) {
    const writer = client.writer(name, { signal, batchRows: 1 })
    for (let row = 0; row < 5; row++) await writer.put(["a"], [[row, 0]])
    await writer.close()
  },
  async "what a batch has changed"(signal) {
    const { applied } = await client.writer(name, { signal }).put(["a"], [[1, 0]])
    await applied
  },
  async "what nobody waits for"(signal) {
    await client.writer(name, { signal }).put(["a"], [[1, 0]])
  },
}

for (const [what, step] of Object.entries(steps)) {
  for (const wait of [() => null, () => new Promise((resolve) => setImmediate(resolve))]) {
    for (let turns = 0; turns < TURNS; turns++) {
      now = `${what}, turn ${turns}`
      const [stop, reason] = [new AbortController(), new Error("aborted")]
      const ended = step(stop.signal).then(() => undefined, (error) => error) // some end before
      for (let turn = 0; turn < turns; turn++) await wait()
      stop.abort(reason)
      const late = new Promise((resolve) => setTimeout(resolve, PATIENCE, "it goes on").unref())
      const error = await Promise.race([ended, late])
      if (error !== undefined && error !== reason) wrong.push([now, error])
    }
  }
}
console.log(wrong)
process.exit()
