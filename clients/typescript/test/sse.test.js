import assert from "node:assert/strict"
import { test } from "node:test"

import { parsed } from "../src/sse.js"

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
