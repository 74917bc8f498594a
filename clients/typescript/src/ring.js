/**
 * A cyclic sequence in pieces: some rows of n are taken out, put in, or made the first in O(√n) time, and read as an array.
 *
 * About √n pieces of about √n rows: an edit moves the rows of one piece, and counts the pieces after it anew. Making another row
 * the first moves nothing.
 *
 * @template T
 */
export class Ring {
  /** All rows in order, since the last edit. @type {readonly T[] | null} */
  #rows
  /** In the order of their places, which begin somewhere. @type {T[][]} */
  #pieces = []
  /** The place of the first row of each piece. @type {number[]} */
  #begins = []
  /** The place of the first row. */
  #first = 0
  /** Rows of a piece, at most. */
  #most = 0
  /** How often pieces were searched since the last edit: an array is worth its while for as many as there are rows. */
  #asked = 0

  /** @param {readonly T[]} rows */
  constructor(rows) {
    this.#rows = rows
    this.length = rows.length
  }

  /** All rows, as an array that later edits leave as it is. O(n) after an edit, then O(1). @returns {readonly T[]} */
  get rows() {
    if (this.#rows === null) {
      const placed = /** @type {T[]} */ ([]).concat(...this.#pieces)
      this.#rows = this.#first ? placed.slice(this.#first).concat(placed.slice(0, this.#first)) : placed
    }
    return this.#rows
  }

  /** One row. O(log n). @param {number} row @returns {T} */
  at(row) {
    if (this.#rows !== null || ++this.#asked > this.length) return this.rows[row]
    const place = this.#first + row < this.length ? this.#first + row : this.#first + row - this.length
    const piece = this.#pieceOf(place)
    return this.#pieces[piece][place - this.#begins[piece]]
  }

  /** @param {number} row @param {T} value */
  set(row, value) {
    this.#cut()
    const place = (this.#first + row) % this.length
    const piece = this.#pieceOf(place)
    this.#pieces[piece][place - this.#begins[piece]] = value
  }

  /**
   * Take rows out, make another one of those that stay the first, and put rows in.
   * @param {{removedRows: readonly number[], rotation: number, addedRows: readonly number[]}} change `addedRows` ascend: where
   *   the added rows are in the end
   * @param {readonly T[]} added
   */
  edit({ removedRows, rotation, addedRows }, added) {
    if (!removedRows.length && !added.length && !rotation) return
    this.#cut()
    for (const row of [...removedRows].sort((a, b) => b - a)) this.#remove((this.#first + row) % this.length)
    if (this.length) this.#first = (this.#first + rotation) % this.length
    added.forEach((value, i) => this.#insert(addedRows[i], value))
  }

  /** Have pieces, and no array: that goes with the next edit. */
  #cut() {
    const { length } = this
    if (!this.#pieces.length || this.#pieces.length > 4 * Math.sqrt(length) + 4 || this.#most ** 2 < length) {
      const rows = this.rows
      this.#most = Math.max(16, Math.ceil(2 * Math.sqrt(length)))
      this.#pieces = []
      for (let from = 0; from < length || !from; from += this.#most >> 1) this.#pieces.push(rows.slice(from, from + (this.#most >> 1)))
      this.#first = 0
      this.#count(0)
    }
    this.#rows = null
    this.#asked = 0
  }

  /** Where pieces begin, from one on. @param {number} from */
  #count(from) {
    this.#begins.length = this.#pieces.length
    for (let piece = from; piece < this.#pieces.length; piece++) {
      this.#begins[piece] = piece ? this.#begins[piece - 1] + this.#pieces[piece - 1].length : 0
    }
  }

  /** The last piece that does not begin after a place. @param {number} place */
  #pieceOf(place) {
    let [low, high] = [0, this.#pieces.length]
    while (high - low > 1) {
      const middle = (low + high) >> 1
      if (this.#begins[middle] <= place) low = middle
      else high = middle
    }
    return low
  }

  /** @param {number} place */
  #remove(place) {
    const piece = this.#pieceOf(place)
    this.#pieces[piece].splice(place - this.#begins[piece], 1)
    if (!this.#pieces[piece].length && this.#pieces.length > 1) this.#pieces.splice(piece, 1)
    this.#count(piece)
    this.length--
    if (place < this.#first) this.#first--
    if (this.#first === this.length) this.#first = 0
  }

  /** @param {number} row @param {T} value */
  #insert(row, value) {
    let place = this.#first + row
    if (place > this.length) {
      place -= this.length // not after the first row
      this.#first++
    }
    const piece = this.#pieceOf(place)
    const rows = this.#pieces[piece]
    rows.splice(place - this.#begins[piece], 0, value)
    if (rows.length > this.#most) this.#pieces.splice(piece + 1, 0, rows.splice(rows.length >> 1))
    this.#count(piece)
    this.length++
  }
}
