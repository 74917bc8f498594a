// Types alone: what a strict program is told, and what it is warned of.
import { Client, DynhullError, HullCopy, type Writer } from "dynhull"
import { GrpcClient } from "dynhull/grpc"
import type { DynhullMap } from "dynhull/map"

export async function fleet(signal: AbortSignal, map: DynhullMap): Promise<Int8Array> {
  const grpc = new GrpcClient("grpc://127.0.0.1:50051", { timeout: 5 })
  const client: Client = signal.aborted ? grpc : new Client("http://127.0.0.1:8080", { token: "token" })
  const { revision }: { revision: bigint } = await client.put("fleet", ["a", "b"], [[0, 0], [4, 0]], { signal })
  const writer: Writer = client.writer("fleet")
  await writer.put([1n, 2, "c"], [[0, 0], [1, 1], [2, 2]])
  const copy = new HullCopy({ maxStaleness: 60 })
  for await (const event of client.watch("fleet", { copy, signal })) {
    if (event.type === "change" && event.revision > revision) break
  }
  for await (const { key, position } of client.watchFence("yard", { consumer: "page" })) {
    const shown: string | bigint | null = key
    console.log(shown, position?.[0])
  }
  map.client = client
  try {
    // @ts-expect-error a hull has a name
    await client.getHull(1)
    // @ts-expect-error revisions are bigint
    const half: number = (await client.getHull("fleet")).info.revision
    console.log(half)
  } catch (error) {
    if (error instanceof DynhullError && error.reason === "HULL_NOT_FOUND") console.log(error.field)
  }
  return copy.locate([[1, 1]])
}
