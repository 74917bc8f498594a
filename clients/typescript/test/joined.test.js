import assert from "node:assert/strict"
import { createServer } from "node:http"
import { test } from "node:test"

import { Connection } from "../src/connection.js"
import { Joined } from "../src/joined.js"

/**
 * @typedef {import("node:http").ServerResponse} Response
 * @typedef {Record<string, {path: string, last_event_id?: string}>} Subscriptions
 */

/**
 * What follows streams of a server, which is asked for them by `open`, and for changes by `change`.
 * @param {import("node:test").TestContext} t
 * @param {{open: (response: Response, given: Subscriptions, count: number) => void,
 *   change?: (response: Response, method: string, name: string) => void}} answers
 * @param {number} silence the seconds without a word after which it connects anew: longer than any pause of a busy machine
 */
async function joined(t, { open, change = (response) => response.writeHead(204).end() }, silence = 120) {
  let count = 0
  const server = createServer(async (request, response) => {
    let body = ""
    for await (const piece of request) body += piece
    if (request.url === "/streams") open(response, JSON.parse(body).subscriptions, count++)
    else change(response, request.method ?? "", request.url?.split("/").pop() ?? "")
  })
  t.after(() => {
    server.closeAllConnections()
    server.close()
  })
  await new Promise((resolve) => server.listen(0, "127.0.0.1", () => resolve(null)))
  const { port } = /** @type {import("node:net").AddressInfo} */ (server.address())
  return new Joined(new Connection(`http://127.0.0.1:${port}`, {}), silence)
}

const begin = (/** @type {Response} */ response, /** @type {string} */ text) =>
  response.writeHead(200, { "Content-Type": "text/event-stream" }).write(`event: stream\ndata: {"stream":"s"}\n\n${text}`)

const lastOf = (/** @type {Subscriptions} */ given) => Object.entries(given).map(([name, each]) => [name, each.last_event_id])[0]

test("a stream that is cut, refused for now, or silent goes on after its last id", async (t) => {
  let refused = 0
  const streams = await joined(t, {
    open(response, given) {
      const [name, last] = lastOf(given)
      if (last === undefined) {
        begin(response, `event: e\nid: ${name} h:1\ndata: 1\n\nid: ${name} h:2\n\n`)
        setTimeout(() => response.destroy(), 20)
      } else if (last === "h:2" && !refused) {
        refused++
        response.writeHead(503, { "Content-Type": "text/html" }).end("<h1>Bad Gateway</h1>")
      } else if (last === "h:2") {
        begin(response, `event: e\nid: ${name} h:3\ndata: 2\n\n`) // and nothing more: not a comment
      } else {
        begin(response, `event: e\nid: ${name}\ndata: 3\n\n`)
      }
    },
  }, 0.5)
  const states = /** @type {boolean[]} */ ([])
  const seen = []
  for await (const event of streams.follow("/x", {}, { onLost: (lost) => states.push(lost) })) {
    seen.push([event.data, event.id])
    if (seen.length === 3) break
  }
  assert.deepEqual([seen, refused], [[[1, "h:1"], [2, "h:3"], [3, ""]], 1])
  // Twice, or more often where this machine falls silent itself.
  assert.ok(states.length >= 4 && states.length % 2 === 0 && states.every((lost, place) => lost === (place % 2 === 0)), String(states))
})

test("a problem ends a stream alone, and so does its signal", async (t) => {
  const gone = '{"title":"Gone","status":410,"detail":"it was replaced","reason":"FENCE_REPLACED"}'
  const streams = await joined(t, {
    open(response, given) {
      const [bad, good] = Object.keys(given)
      begin(response, `event: problem\nid: ${bad}\ndata: ${gone}\n\nevent: e\nid: ${good}\ndata: 1\n\n`)
    },
  })
  const ending = new AbortController()
  const [bad, good] = ["/bad", "/good"].map((path) => streams.follow(path, {}, { signal: ending.signal }))
  const refused = assert.rejects(bad.next(), { reason: "FENCE_REPLACED", message: "it was replaced" })
  assert.equal((await good.next()).value?.data, 1)
  await refused
  const waiting = good.next()
  ending.abort()
  assert.deepEqual(await waiting, { done: true, value: undefined })
})

test("streams join and leave one connection, which is opened anew where it is not known any more", async (t) => {
  /** @type {string[]} */
  const seen = []
  let known = true
  const streams = await joined(t, {
    open(response, given, count) {
      seen.push(`open ${Object.values(given).map((each) => each.path)}`)
      begin(response, Object.keys(given).map((name) => `event: e\nid: ${name} x:${count}\ndata: ${count}\n\n`).join(""))
    },
    change(response, method, name) {
      seen.push(`${method} ${name}`)
      if (known) return response.writeHead(204).end()
      known = true
      const problem = '{"title":"Not Found","status":404,"detail":"no stream","reason":"STREAM_NOT_FOUND"}'
      response.writeHead(404, { "Content-Type": "application/problem+json" }).end(problem)
    },
  })
  const ending = new AbortController()
  const following = { signal: ending.signal }
  const [a, b, c, d] = ["/a", "/b", "/c", "/d"].map((path) => streams.follow(path, { f: null, n: ["x", "y"] }, following))
  assert.deepEqual((await Promise.all([a.next(), b.next()])).map((each) => each.value?.data), [0, 0])
  void c.next()
  while (!seen.includes("PUT 3")) await new Promise((resolve) => setTimeout(resolve, 5))
  await b.return()
  while (!seen.includes("DELETE 2")) await new Promise((resolve) => setTimeout(resolve, 5))
  known = false
  assert.equal((await d.next()).value?.data, 1)
  assert.deepEqual(seen.slice(0, 4), ["open /a?n=x&n=y,/b?n=x&n=y", "PUT 3", "DELETE 2", "PUT 4"])
  assert.equal(seen[4], "open /a?n=x&n=y,/c?n=x&n=y,/d?n=x&n=y")
  ending.abort()
})

test("what waits for a slow reader has a bound, and he misses nothing", async (t) => {
  const text = "x".repeat(2 ** 20)
  let opened = 0
  /** @type {Promise<unknown> | undefined} */
  let closed
  const streams = await joined(t, {
    open(response, given) {
      const [name, last = "x:0"] = lastOf(given)
      opened++
      closed ??= new Promise((resolve) => response.on("close", resolve))
      begin(response, "")
      for (let n = Number(last.slice(2)) + 1; n <= 12; n++) {
        response.write(`event: e\nid: ${name} x:${n}\ndata: ${JSON.stringify({ n, text })}\n\n`)
      }
    },
  })
  const seen = []
  for await (const { data } of streams.follow("/x", {}, {})) {
    seen.push(data.n)
    if (data.n === 1) await closed
    if (data.n === 12) break
  }
  assert.deepEqual(seen, Array.from({ length: 12 }, (_, i) => i + 1))
  assert.ok(opened > 1)
})

test("a stream in which nothing is followed any more is closed, also if its last subscription ends by itself", async (t) => {
  const closed = /** @type {Promise<void>[]} */ ([])
  const streams = await joined(t, {
    open(response, given) {
      const [name] = lastOf(given)
      closed.push(new Promise((resolve) => response.on("close", () => resolve())))
      const refused = given[String(name)].path === "/refused"
      begin(response, refused ? `event: problem\nid: ${name}\ndata: {"reason":"UNAUTHENTICATED","detail":"no"}\n\n` : `event: over\nid: ${name}\ndata: {}\n\n`)
      // What is said meanwhile keeps the stream from falling silent.
      const saying = setInterval(() => response.write(":\n\n"), 50)
      response.on("close", () => clearInterval(saying))
    },
  })
  assert.deepEqual(await streams.follow("/ended", {}, {}).next(), { done: true, value: undefined })
  await closed[0]
  await assert.rejects(streams.follow("/refused", {}, {}).next(), { reason: "UNAUTHENTICATED" })
  await closed[1]
  assert.deepEqual(await streams.follow("/ended", {}, {}).next(), { done: true, value: undefined })
  await closed[2]
})

test("what onLost throws ends its own stream, and no other", async (t) => {
  const streams = await joined(t, {
    open(response, given, count) {
      const events = Object.keys(given).map((name) => `event: e\nid: ${name} h:${count}\ndata: ${count}\n\n`)
      begin(response, events.join(""))
      if (count === 0) setTimeout(() => response.destroy(), 20)
    },
  })
  const wrong = new Error("wrong")
  const throws = (/** @type {boolean} */ lost) => {
    if (lost) throw wrong
  }
  const failing = (async () => {
    for await (const _ of streams.follow("/x", {}, { onLost: throws }));
  })()
  const seen = []
  const other = (async () => {
    for await (const { data } of streams.follow("/y", {}, {})) {
      seen.push(data)
      if (data === 1) break
    }
  })()
  await assert.rejects(failing, wrong)
  await other
  assert.deepEqual(seen, [0, 1])
})
