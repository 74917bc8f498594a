import assert from "node:assert/strict"
import { createServer } from "node:http"
import { test } from "node:test"

import { Connection } from "../src/connection.js"
import { follow, parsed } from "../src/sse.js"

const TEXT = 'retry: 1000\n\n: \n\nevent: a\nid: x:1\ndata: {"ü":1}\n\nid: x:2\n\ndata: one\ndata: two\n\nevent: never\ndata: whole'

test("streams are read the same wherever they are cut", async () => {
  const bytes = new TextEncoder().encode(TEXT)
  for (const ends of ["\n", "\r\n"]) {
    const all = ends === "\n" ? bytes : new TextEncoder().encode(TEXT.replaceAll("\n", ends))
    for (let cut = 0; cut <= all.length; cut++) {
      const stream = new ReadableStream({
        start(controller) {
          controller.enqueue(all.slice(0, cut))
          controller.enqueue(all.slice(cut))
          controller.close()
        },
      })
      const events = []
      for await (const event of parsed(stream, () => {})) events.push(event)
      assert.deepEqual(events, [
        { type: "a", data: '{"ü":1}', id: "x:1" },
        { type: "", data: "", id: "x:2" },
        { type: "message", data: "one\ntwo", id: null },
      ])
    }
  }
})

/**
 * A connection to a server that answers by what a request has seen last.
 * @param {import("node:test").TestContext} t
 * @param {(response: import("node:http").ServerResponse, last: string | undefined) => void} answer
 */
async function serving(t, answer) {
  const server = createServer((request, response) => answer(response, request.headers["last-event-id"]?.toString()))
  t.after(() => {
    server.closeAllConnections()
    server.close()
  })
  await new Promise((resolve) => server.listen(0, "127.0.0.1", () => resolve(null)))
  const { port } = /** @type {import("node:net").AddressInfo} */ (server.address())
  return new Connection(`http://127.0.0.1:${port}`, {})
}

const begin = (/** @type {import("node:http").ServerResponse} */ response, /** @type {string} */ text) =>
  response.writeHead(200, { "Content-Type": "text/event-stream" }).write(text)

test("a stream that is cut, refused for now, or silent goes on after its last id", async (t) => {
  let refused = 0
  const connection = await serving(t, (response, last) => {
    if (last === undefined) {
      begin(response, "id: h:1\nevent: e\ndata: 1\n\nid: h:2\n\n")
      setTimeout(() => response.destroy(), 20)
    } else if (last === "h:2" && !refused) {
      refused++
      response.writeHead(503, { "Content-Type": "text/html" }).end("<h1>Bad Gateway</h1>")
    } else if (last === "h:2") {
      begin(response, "event: e\ndata: 2\nid: h:3\n\n") // and nothing more: not a comment
    } else {
      begin(response, "event: e\ndata: 3\n\n")
    }
  })
  const states = /** @type {boolean[]} */ ([])
  const seen = []
  for await (const event of follow(connection, "/x", {}, { silence: 0.5, onLost: (lost) => states.push(lost) })) {
    seen.push(event.data)
    if (seen.length === 3) break
  }
  assert.deepEqual([seen, refused], [[1, 2, 3], 1])
  assert.deepEqual(states, [true, false, true, false])
})

test("a problem ends a stream, and so does its signal", async (t) => {
  const gone = 'event: problem\ndata: {"title":"Gone","status":410,"detail":"it was replaced","reason":"FENCE_REPLACED"}\n\n'
  let asked = 0
  const connection = await serving(t, (response) => begin(response, asked++ ? ": \n\n" : gone))
  await assert.rejects(follow(connection, "/x", {}, {}).next(), { reason: "FENCE_REPLACED", message: "it was replaced" })
  const signal = AbortSignal.timeout(50)
  assert.deepEqual(await follow(connection, "/x", {}, { signal }).next(), { done: true, value: undefined })
})
