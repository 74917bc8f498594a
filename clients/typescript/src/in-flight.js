import { Batch } from "./batch.js"

/**
 * The batches of a writer that are not acknowledged, in their order: those under way, those that wait, and the last one, which
 * gathers while others are under way. What carries them takes one after the other; after a loss it begins again with the oldest.
 */
export class InFlight {
  /** The number of the last batch that was acknowledged. */
  sequence = 0n
  /** What the server said of it. @type {import("./client.js").Applied | null} */
  applied = null
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

  /** @param {number} batchRows rows of a batch at most */
  constructor(batchRows) {
    this.batchRows = batchRows
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

  /** @param {import("./batch.js").Rows} rows */
  add(rows) {
    for (let row = 0; row < rows.count; ) {
      let last = this.#batches.at(-1)
      const next = last && !last.sequence ? last.add(rows, row, this.batchRows) : row
      if (next === row) {
        if (last) this.#close(last)
        last = new Batch(rows)
        this.#batches.push(last)
        row = last.add(rows, row, this.batchRows)
      } else row = next
      if (last && last.rows === this.batchRows) this.#close(last)
    }
    this.rows += rows.count
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
    batch.applied = applied
    while (this.#oldest < this.#unsent && this.#batches[this.#oldest].applied) {
      const first = this.#batches[this.#oldest++]
      this.applied = first.applied
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
