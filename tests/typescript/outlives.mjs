// A writer and a watch of one hull while its server is killed: prints a line for each step, and at the end what there is.

import { GrpcClient } from "../../clients/typescript/src/grpc/index.js"
import { Client, HullCopy } from "../../clients/typescript/src/index.js"

const [url, name] = process.argv.slice(2)
const client = url.startsWith("grpc:") ? new GrpcClient(url) : new Client(url)
await client.createHull(name, { keyed: "int" })
const copy = new HullCopy()
const watching = (async () => {
  for await (const { revision } of client.watch(name, { copy, rate: 100 })) {
    console.log("watch", revision)
    if (revision === end) return
  }
})()

/** @type {bigint | null} */
let end = null
const writer = client.writer(name, { batchRows: 7 })
const keys = new Set()
for (let i = 0; i < 600; i++) {
  const [key, angle] = [i % 500, i * 2.399963]
  keys.add(key)
  await writer.put([key], [[Math.cos(angle) * (i + 1), Math.sin(angle) * (i + 1)]])
  if (i % 3 === 0) await writer.flush().then(() => console.log("kept", writer.sequence))
}
await writer.flush()
end = writer.sequence + 1n
await writer.put([1], [[0, 0]]) // the watch sees it later than `end` is known
await writer.close()
await watching
console.log(JSON.stringify({ sequence: Number(writer.sequence), vertices: copy.vertices, keys: keys.size }))
