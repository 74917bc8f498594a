import { Batch, runsOf } from "./batch.js"

/**
 * The batches of a writer that are not acknowledged, in their order: those under way, those that wait, and the last one, which
 * gathers while others are under way. What carries them takes one after the other; after a loss it begins again with the oldest.
 */
export class InFlight {
  /** The number of the last batch that was acknowledged. */
  sequence = 0n
  /** The greatest number that was sent. */
  greatest = 0n
  /** Rows that are not acknowledged. */
  rows = 0
  /** Called when batches were acknowledged, and when there is more to send. */
  onAcknowledged = () => {}
  onMore = () => {}
  /** @type {Batch[]} */
  #batches = []
  // In the batches: the oldest that is not acknowledged, and the first that is to be sent.
  #oldest = 0
  #unsent = 0

  /**
   * @param {number} batchRows rows of a batch at most
   * @param {boolean} [coalesces] whether the last position of a key in a batch replaces the ones before it
   */
  constructor(batchRows, coalesces = false) {
    this.batchRows = batchRows
    this.coalesces = coalesces
  }

  /** Whether everything is acknowledged. */
  get empty() {
    return this.#oldest === this.#batches.length
  }

  /** How many batches are under way. */
  get underWay() {
    return this.#unsent - this.#oldest
  }

  /** How many batches are not acknowledged. */
  get batches() {
    return this.#batches.length - this.#oldest
  }

  /** @param {import("./batch.js").Rows} rows @returns {Batch} the one that has the last of them */
  add(rows) {
    const coalesces = this.coalesces && rows.op === "put" && rows.conditions.only !== "absent" // of new keys, the first position counts
    let last = this.#batches.at(-1)
    for (const run of runsOf(rows, coalesces, this.batchRows)) {
      if (!last || last.sequence || !last.admits(rows, run, this.batchRows)) {
        if (last) this.#close(last)
        last = new Batch(rows, coalesces)
        this.#batches.push(last)
      }
      last.add(rows, run)
      if (last.rows === this.batchRows) this.#close(last)
    }
    this.rows += rows.count
    return /** @type {Batch} */ (last) // a call without rows is a run, too
  }

  /** Have the batch that gathers sent although others are under way. */
  hurry() {
    const last = this.#batches.at(-1)
    if (last && !this.empty) this.#close(last)
  }

  /** The batch that is to be sent next, which stays there; null if none is yet. @param {number} [after] how many before it */
  peek(after = 0) {
    const batch = this.#batches[this.#unsent + after]
    return batch && (batch.sequence || !this.underWay) ? batch : null
  }

  /** The batch that is to be sent next: it is under way from now on. */
  take() {
    while (this.#batches[this.#unsent]?.applied) this.#unsent++ // acknowledged before an older one that was lost
    const batch = this.peek()
    if (batch === null) return null
    this.#close(batch)
    batch.sent++
    if (batch.sequence > this.greatest) this.greatest = batch.sequence
    this.#unsent++
    return batch
  }

  /** Whether all batches before one are acknowledged. @param {Batch} batch */
  isOldest(batch) {
    return this.#batches[this.#oldest] === batch
  }

  /** The oldest batch under way. */
  get oldest() {
    return this.underWay ? this.#batches[this.#oldest] : null
  }

  /** @param {Batch} batch @param {import("./client.js").Applied} applied */
  acknowledge(batch, applied) {
    batch.acknowledge(applied)
    while (this.#oldest < this.#unsent && this.#batches[this.#oldest].applied) {
      const first = this.#batches[this.#oldest++]
      this.sequence = first.sequence
      this.rows -= first.rows
    }
    if (2 * this.#oldest > this.#batches.length) {
      this.#batches.splice(0, this.#oldest)
      this.#unsent -= this.#oldest
      this.#oldest = 0
    }
    this.onAcknowledged()
  }

  /** None of what is left is sent any more. @param {unknown} error why */
  abandon(error) {
    for (const batch of this.#batches.splice(this.#oldest)) if (!batch.applied) batch.abandon(error)
    this.#unsent = this.#oldest
    this.rows = 0
  }

  /** What was under way is to be sent again. */
  rewind() {
    this.#unsent = this.#oldest
  }

  /** The number that the next batch gets. */
  #next = 1n

  /** Go on after the last batch of an earlier writer. @param {bigint} sequence */
  begin(sequence) {
    this.sequence = sequence
    let number = sequence
    for (const batch of this.#batches) if (batch.sequence) batch.sequence = ++number
    this.#next = number + 1n
  }

  /** @param {Batch} batch */
  #close(batch) {
    if (!batch.sequence) batch.close(this.#next++)
  }
}
