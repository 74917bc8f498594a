import { turnOf } from "./exact.js"

/** @typedef {import("./exact.js").Point} Point */

/**
 * One side of an outline from its smallest vertex to its greatest, by x, then y, in columns; and buckets of equal width in x, each
 * with the first vertex in it. The bucket of x is a product rounded twice, which never falls where x grows: it narrows a search and
 * decides nothing.
 */
class Chain {
  #xs
  #ys
  #firsts
  #scale

  /** @param {number} count @param {(i: number) => Point} at ascending */
  constructor(count, at) {
    this.#xs = new Float64Array(count)
    this.#ys = new Float64Array(count)
    for (let i = 0; i < count; i++) [this.#xs[i], this.#ys[i]] = at(i)
    const scale = count / (this.#xs[count - 1] - this.#xs[0])
    this.#scale = scale < Infinity ? scale : 0
    this.#firsts = new Uint32Array(count + 1)
    for (let i = 0, bucket = 0; bucket <= count; bucket++) {
      while (i < count && this.#bucket(this.#xs[i]) < bucket) i++
      this.#firsts[bucket] = i
    }
  }

  /** @param {number} x */
  #bucket(x) {
    const bucket = ((x - this.#xs[0]) * this.#scale) | 0
    return bucket < this.#xs.length ? bucket : this.#xs.length - 1
  }

  /** The turn from the edge over or under a point, which is not beyond the ends, to the point. @param {number} x @param {number} y */
  turn(x, y) {
    const [xs, ys, bucket] = [this.#xs, this.#ys, this.#bucket(x)]
    let low = Math.max(this.#firsts[bucket] - 1, 0)
    let high = Math.min(this.#firsts[bucket + 1], xs.length - 1)
    while (high - low > 1) {
      const middle = (low + high) >> 1
      if (xs[middle] < x || (xs[middle] === x && ys[middle] <= y)) low = middle
      else high = middle
    }
    return turnOf(xs[low], ys[low], xs[low + 1], ys[low + 1], x, y)
  }
}

/** Both sides of an outline that stays as it is, for many questions: O(h) to make. */
export class Chains {
  #lower
  #upper

  /**
   * @param {readonly Point[]} vertices two or more
   * @param {number} greatest the row of the greatest vertex
   */
  constructor(vertices, greatest) {
    const count = vertices.length
    this.#lower = new Chain(greatest + 1, (i) => vertices[i])
    this.#upper = new Chain(count - greatest + 1, (i) => vertices[i ? count - i : 0])
  }

  /** The side of a point between the smallest and the greatest vertex. @param {number} x @param {number} y @returns {-1 | 0 | 1} */
  side(x, y) {
    const below = this.#lower.turn(x, y)
    if (below < 0) return -1
    const above = this.#upper.turn(x, y)
    return above > 0 ? -1 : below && above ? 1 : 0
  }
}
