// A writer in Node, for benchmarks/typescript.py: prints the acknowledged rows a second.

import { GrpcClient } from "../clients/typescript/src/grpc/index.js"
import { Client } from "../clients/typescript/src/index.js"

const [url, hull, seconds] = process.argv.slice(2)
const client = url.startsWith("grpc:") ? new GrpcClient(url) : new Client(url)
const writer = client.writer(hull)
const keys = Array.from({ length: 1000 }, (_, key) => key)
let rows = 0
const begun = performance.now()
while (performance.now() - begun < Number(seconds) * 1000) {
  await writer.put(keys, keys.map(() => [Math.random(), Math.random()]))
  rows += keys.length
}
await writer.flush()
console.log(rows / ((performance.now() - begun) / 1000))
process.exit()
