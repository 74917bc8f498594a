// How the batches of a writer go over HTTP: one a call, several calls side by side.

import { DynhullError } from "./errors.js"
import { fromWire, isoTime } from "./json.js"
import { path } from "./connection.js"

/**
 * @typedef {import("./batch.js").Batch} Batch
 * @typedef {import("./in-flight.js").InFlight} InFlight
 *
 * @typedef {object} Carried
 * @property {string} producer
 * @property {number} inFlight
 * @property {boolean} maySkip
 * @property {string} uid of the hull
 * @property {AbortSignal | null} signal
 *
 * @typedef {object} Ways
 * @property {(path: string, call: import("./connection.js").Call) => Promise<any>} ask
 * @property {() => Promise<bigint>} last the number of the producer's last batch that was applied
 */

/**
 * Send what there is until everything is acknowledged. Calls may overtake each other: a batch that arrives before the one before
 * it is refused, since its number leaves a gap, and goes again when that is acknowledged.
 * @param {Ways} ways
 * @param {string} name
 * @param {InFlight} batches
 * @param {Carried} options
 */
export async function carryOverHttp(ways, name, batches, options) {
  // Numbers that may be skipped hide that a batch was overtaken.
  const most = options.maySkip ? 1 : options.inFlight
  let first = most
  while (!batches.empty) {
    const { failure, overtaken } = await round(ways, name, batches, options, first, most)
    batches.rewind()
    if (failure) throw failure
    first = overtaken ? 1 : most
  }
}

/**
 * @param {Ways} ways
 * @param {string} name
 * @param {InFlight} batches
 * @param {Carried} options
 * @param {number} limit calls side by side until one is answered,
 * @param {number} most and from then on
 */
async function round({ ask, last }, name, batches, { producer, maySkip, signal }, limit, most) {
  /** @type {Set<Promise<void>>} */
  const calls = new Set()
  /** @type {{sequence: bigint, error: unknown} | null} of the oldest batch that failed */
  let failed = null
  let overtaken = false
  const post = async (/** @type {Batch} */ batch) => {
    const early = !batches.isOldest(batch)
    const call = { method: "POST", query: { may_skip: maySkip || undefined }, body: bodyOf(batch), signal }
    try {
      const applied = fromWire(await ask(path`/hulls/${name}/points`, { ...call, idempotencyKey: `${producer}:${batch.sequence}` }))
      // A gateway may have sent it twice itself. But numbers beyond all that were sent are those of another writer.
      if (applied.duplicate && batch.sent === 1 && (await last()) > batches.greatest) throw inUse(producer, batch.sequence)
      batches.acknowledge(batch, applied)
      limit = most
    } catch (error) {
      if (early && error instanceof DynhullError && error.reason === "SEQUENCE_GAP") overtaken = true
      else if (failed === null || batch.sequence < failed.sequence) failed = { sequence: batch.sequence, error }
    }
  }
  const fill = () => {
    while (failed === null && !overtaken && calls.size < limit) {
      const batch = batches.take()
      if (batch === null) return
      const call = post(batch).finally(() => calls.delete(call))
      calls.add(call)
    }
  }
  batches.onMore = fill
  try {
    for (fill(); calls.size; fill()) await Promise.race(calls)
  } finally {
    batches.onMore = () => {}
  }
  return { failure: /** @type {{error: unknown} | null} */ (failed)?.error, overtaken }
}

/** @param {string} producer @param {bigint} sequence */
export function inUse(producer, sequence) {
  const detail = `batch ${sequence} of producer ${producer} had been applied before it was sent: another writer uses the same name`
  return new DynhullError({ reason: "PRODUCER_IN_USE", status: 409, detail })
}

/** @param {Batch} batch */
function bodyOf({ op, conditions, keys, coordinates, destinations, times, expireTimes, accuracies }) {
  const points = pairs(coordinates)
  const timed = {
    ...(times.length && { times: times.map(isoTime) }),
    ...(expireTimes.length && { expire_times: expireTimes.map(isoTime) }),
    ...(accuracies.length && { accuracies: [...accuracies.values] }),
  }
  const body = { ...conditions, ...timed }
  if (op === "put") return { ...body, keys, points }
  if (op === "remove") return { ...body, remove: keys }
  return { ...body, [op]: op === "move" ? { origins: points, destinations: pairs(destinations) } : points }
}

/** @param {import("./batch.js").Column} column */
function pairs({ values }) {
  const points = new Array(values.length / 2) // Array.from takes five times as long
  for (let row = 0; row < points.length; row++) points[row] = [values[2 * row], values[2 * row + 1]]
  return points
}
