// How the batches of a writer go over gRPC: a stream of them, and one of acknowledgements.

import { endianness } from "node:os"

import { inUse } from "../carrying.js"
import { DynhullError } from "../errors.js"
import { appliedOf } from "./answers.js"
import { conditionOf } from "./requests.js"
import { duration, packKeys, packTimes } from "./values.js"

/** The size up to which batches share a message: beyond that, the cost of a message does not count. */
const MESSAGE_BYTES = 2 ** 16

/**
 * Send what there is until everything is acknowledged.
 * @param {import("./channel.js").Channel} channel
 * @param {string} name
 * @param {import("../in-flight.js").InFlight} batches
 * @param {import("../carrying.js").Carried} options
 * @returns {Promise<void>}
 */
export async function carryOverGrpc(channel, name, batches, { producer, inFlight, maySkip, uid, signal }) {
  let [begun, closed] = [false, false]
  let several = 0 // batches of a message, once the server has said that it takes several
  const send = () => {
    while (!closed) {
      const taken = takes(batches, inFlight, several)
      if (!taken.length) break
      const first = begun ? {} : { name, producer, acceptResults: true, maySkip, uid }
      const numbered = taken.map((batch) => ({ batch: messageOf(batch), sequence: String(batch.sequence) }))
      call.write({ ...first, ...(several ? { batches: numbered } : numbered[0]) })
      begun = true
    }
    if (batches.empty && !closed) {
      closed = true // a call that stays open would keep a program from ending
      call.end()
    }
  }
  const call = channel.duplex("Stream", signal, (answer) => {
    if (answer.maxBatches) several = answer.maxBatches
    for (const { result, sequence } of answer.results.length ? answer.results : answer.result ? [answer] : []) {
      acknowledge(batches, producer, BigInt(sequence), /** @type {any} */ (appliedOf(result)))
    }
    send()
  })
  batches.onMore = send
  try {
    send()
    await call.ended
  } finally {
    batches.onMore = () => {}
    if (!closed) call.cancel()
  }
  if (!closed) throw new DynhullError({ reason: "UNREACHABLE", detail: "the server ended the stream" })
}

/**
 * The batches of the next message. While others are under way, small ones wait until there are as many as those, or as
 * many as a message takes: then messages grow as long as batches come faster than they are acknowledged.
 * @param {import("../in-flight.js").InFlight} batches
 * @param {number} inFlight
 * @param {number} several
 */
function takes(batches, inFlight, several) {
  const { underWay } = batches
  const most = Math.min(Math.max(several, 1), inFlight - underWay)
  let [count, bytes, full] = [0, 0, false]
  for (; count < most; count++) {
    const batch = batches.peek(count)
    if (batch === null || (count && !batch.sequence)) break
    full = bytes + batch.size > MESSAGE_BYTES
    if (full && count) break
    bytes += batch.size
  }
  if (several && !full && count < Math.min(underWay, most)) return []
  const taken = []
  while (taken.length < count) taken.push(/** @type {import("../batch.js").Batch} */ (batches.take()))
  return taken
}

/**
 * @param {import("../in-flight.js").InFlight} batches
 * @param {string} producer
 * @param {bigint} sequence
 * @param {import("../client.js").Applied} applied
 */
function acknowledge(batches, producer, sequence, applied) {
  const batch = batches.oldest
  if (batch === null || batch.sequence !== sequence) {
    throw new DynhullError({ reason: "REFUSED", detail: `batch ${sequence} of ${producer} was acknowledged in place of ${batch?.sequence}` })
  }
  if (applied.duplicate && batch.sent === 1) throw inUse(producer, sequence)
  batches.acknowledge(batch, applied)
}

/** @param {import("../batch.js").Batch} batch */
function messageOf({ op, conditions, keys, coordinates, destinations, times, expireTimes, accuracies }) {
  const stamps = times.length ? packTimes("times", times) : null
  const { missing } = conditions
  if (op === "remove") return { removes: packKeys("remove", keys), ...(missing === "raise" && { missingKeys: "MISSING_KEY_POLICY_REFUSE" }) }
  const points = { packed: packed(coordinates) }
  if (op === "put") {
    const errors = accuracies.length ? { values: [...accuracies.values] } : null
    const ends = expireTimes.length ? packTimes("expire_times", expireTimes) : null
    const rules = { condition: conditionOf(conditions.only), ttl: duration(conditions.ttl, "ttl") }
    return { puts: { keys: packKeys("keys", keys), points, times: stamps, expireTimes: ends, accuracies: errors, ...rules } }
  }
  if (op === "insert") return { inserts: points, insertTimes: stamps }
  const counted = missing === "count" ? { missingPoints: "MISSING_POINT_POLICY_COUNT" } : {}
  if (op === "delete") return { deletes: points, ...counted }
  return { moves: { origins: points, destinations: { packed: packed(destinations) } }, ...counted }
}

/** The doubles of a column as messages have them, little end first. @param {import("../batch.js").Column} column */
function packed({ values }) {
  const bytes = Buffer.from(values.buffer, values.byteOffset, values.byteLength)
  return endianness() === "LE" ? bytes : Buffer.from(bytes).swap64()
}
