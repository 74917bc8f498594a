// What ends a feed, a replay and a track where files of the past are missing: prints the reasons.

import { GrpcClient } from "../../clients/typescript/src/grpc/index.js"
import { Client } from "../../clients/typescript/src/index.js"

const [url, name] = process.argv.slice(2)
const client = url.startsWith("grpc:") ? new GrpcClient(url) : new Client(url)

/** @param {AsyncIterable<unknown>} stream */
async function end(stream) {
  for await (const _ of stream) continue
}

const found = []
for (const read of [
  () => end(client.feed(name, { after: 0n })),
  () => end(client.replay(name, { start: 1 })),
  () => client.track(name, ["a"], { start: 1 }),
]) {
  try {
    await read()
    found.push("no error")
  } catch (error) {
    found.push(/** @type {any} */ (error).reason)
  }
}
console.log(JSON.stringify(found))
if (client instanceof GrpcClient) client.close()
