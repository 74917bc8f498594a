// A writer with several batches under way, while what it writes to is killed: prints a line for each batch that is acknowledged,
// and at the end what it has written.

import { GrpcClient } from "../../clients/typescript/src/grpc/index.js"
import { Client } from "../../clients/typescript/src/index.js"

const [url, name] = process.argv.slice(2)
const client = url.startsWith("grpc:") ? new GrpcClient(url) : new Client(url)
await client.createHull(name, { keyed: "int" })
const writer = client.writer(name, { batchRows: 20, inFlight: 8, producer: "pipelined" })
const kept = new Map()
let said = 0n
for (let row = 0; row < 12_000; row++) {
  kept.set(row, [Math.cos(row) * row, Math.sin(row) * row])
  await writer.put([row], [kept.get(row)])
  if (row % 50 === 7) {
    kept.delete(row - 3)
    await writer.remove([row - 3])
  }
  if (writer.sequence > said) console.log("kept", (said = writer.sequence))
}
await writer.close()
console.log(JSON.stringify({ sequence: Number(writer.sequence), kept: [...kept] }))
