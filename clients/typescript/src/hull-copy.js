import { Chains } from "./chains.js"
import { ahead, area, ascent, gap, gapToLine, turn } from "./exact.js"
import { DynhullError } from "./errors.js"
import { Ring } from "./ring.js"

/**
 * @typedef {import("./exact.js").Point} Point
 * @typedef {import("./watch.js").HullEvent} HullEvent
 * @typedef {string | bigint} Key
 */

/** Making the chains takes as long as about one question without them for so many vertices. */
const CHAINED = 32

/**
 * A page's own copy of a hull that is watched: it answers without a call, and exactly, at the revision of the last event.
 *
 * Its verdicts are those of the library for every finite double. Without a hull, before the first snapshot and after a
 * deletion, questions throw HULL_NOT_FOUND; a copy of a geographic hull keeps its vertices, and the server answers
 * questions about it.
 *
 *     const copy = new HullCopy()
 *     for await (const event of client.watch("fleet", { copy })) draw(copy.vertices)
 */
export class HullCopy {
  #known = false
  /** Counter-clockwise from the smallest by x, then y. @type {Ring<Point>} */
  #vertices = new Ring([])
  /** @type {Ring<Key> | null} */
  #keys = null
  /** The row of the greatest vertex, once it was looked for. @type {number | null} */
  #greatest = null
  /** For many questions after an event. @type {Chains | null} */
  #chains = null
  /** How many sides were asked since the last event: as many as these pay for the chains. */
  #asked = 0
  #updated = -Infinity

  /**
   * @param {object} [options]
   * @param {number | null} [options.maxStaleness] seconds without an event after which questions throw STALE_COPY
   */
  constructor({ maxStaleness = null } = {}) {
    /** @type {number | null} */
    this.maxStaleness = maxStaleness
    /** The revision of the last event; 0 before the first. @type {bigint} */
    this.revision = 0n
    /** The number of points at that revision. */
    this.points = 0
    /** Longitude and latitude of the centre of a geographic hull. @type {Point | null} */
    this.center = null
  }

  /** Counter-clockwise from the smallest by x, then y. O(h) after an event. @returns {readonly Point[]} */
  get vertices() {
    return this.#vertices.rows
  }

  /** Their keys; null unless the watch has `keys: true`. O(h) after an event. @returns {readonly Key[] | null} */
  get vertexKeys() {
    return this.#keys?.rows ?? null
  }

  /**
   * Apply an event. O(√h) for each vertex that comes or goes.
   * @param {HullEvent} event
   */
  update(event) {
    if (event.type === "deleted") return this.clear()
    if (event.type === "snapshot") {
      this.#vertices = new Ring(event.vertices)
      this.#keys = event.vertexKeys && new Ring(event.vertexKeys)
      this.center = event.center
      this.#known = true
    } else if (event.type === "change") {
      this.#keys = changedKeys(this.#keys, this.#vertices.length, event)
      this.#vertices.edit(event, event.added)
    }
    if (event.type !== "snapshot" && event.center !== null) this.center = event.center
    this.revision = event.revision
    this.points = event.points
    this.#updated = performance.now()
    this.#greatest = this.#chains = null
    this.#asked = 0
  }

  /** Hold no hull, as after its deletion. */
  clear() {
    this.#vertices = new Ring([])
    this.#keys = this.center = this.#greatest = this.#chains = null
    this.#asked = 0
    this.revision = 0n
    this.points = 0
    this.#known = false
  }

  /** Seconds since the last event; infinite before the first. */
  get age() {
    return (performance.now() - this.#updated) / 1000
  }

  /**
   * 1 inside, 0 on the boundary, -1 outside. Exact. O(log h).
   * @param {Point} point
   * @returns {-1 | 0 | 1}
   */
  side(point) {
    this.#require([point])
    return this.#side(point)
  }

  /**
   * The side of each point. Exact. O(log h) each.
   * @param {readonly Point[]} points
   * @returns {Int8Array}
   */
  locate(points) {
    this.#require(points)
    const sides = new Int8Array(points.length)
    for (let row = 0; row < sides.length; row++) sides[row] = this.#side(points[row])
    return sides
  }

  /**
   * Which points are inside or on the boundary. Exact. O(log h) each.
   * @param {readonly Point[]} points
   * @returns {boolean[]}
   */
  contains(points) {
    this.#require(points)
    return points.map((point) => this.#side(point) >= 0)
  }

  /**
   * The vertex farthest in each direction; of two, the smaller one by x, then y. Exact. O(log h) each.
   * @param {readonly Point[]} directions
   * @returns {Point[]}
   */
  support(directions) {
    this.#require(directions)
    if (!this.#vertices.length) throw refusal("HULL_EMPTY", "a hull without points has no extreme points")
    directions.forEach((direction, row) => {
      if (!direction[0] && !direction[1]) throw new RangeError(`direction ${row} is (0, 0)`)
    })
    return directions.map((direction) => this.#extreme(direction))
  }

  /**
   * The distance of each point, the exact value rounded once: 0 inside and on the boundary, infinite from a hull without
   * points. O(h) each.
   * @param {readonly Point[]} points
   * @returns {Float64Array}
   */
  distance(points) {
    this.#require(points)
    return Float64Array.from(points, (point) => this.#distance(point))
  }

  /**
   * The left and the right tangent point seen from each point; null for a point that is not outside. Of two vertices on
   * the way, the farther. Exact. O(h) each.
   * @param {readonly Point[]} points
   * @returns {([Point, Point] | null)[]}
   */
  tangents(points) {
    this.#require(points)
    return points.map((point) => {
      if (!this.#vertices.length || this.#side(point) >= 0) return null
      return [this.#tangent(point, 1), this.#tangent(point, -1)]
    })
  }

  /** The area, the exact value rounded once. O(h). */
  get area() {
    this.#require([])
    return area(this.vertices)
  }

  /** The length of the boundary; two vertices count twice. O(h). */
  get perimeter() {
    this.#require([])
    const { vertices } = this
    return vertices.reduce((sum, vertex, i) => sum + Math.hypot(...away(vertices.at(i - 1) ?? vertex, vertex)), 0)
  }

  /** Least x, least y, greatest x, greatest y; null without points. O(h). */
  get bounds() {
    this.#require([])
    if (!this.vertices.length) return null
    const [xs, ys] = [0, 1].map((axis) => this.vertices.map((vertex) => vertex[axis]))
    const low = (/** @type {number[]} */ values) => values.reduce((a, b) => Math.min(a, b))
    const high = (/** @type {number[]} */ values) => values.reduce((a, b) => Math.max(a, b))
    return /** @type {const} */ ([low(xs), low(ys), high(xs), high(ys)])
  }

  /** @param {Point} point @returns {-1 | 0 | 1} */
  #side(point) {
    const vertices = this.#vertices
    const count = vertices.length
    if (!count) return -1
    const greatest = this.#last()
    if (compared(point, vertices.at(0)) < 0 || compared(point, vertices.at(greatest)) > 0) return -1
    if (count === 1) return 0
    if (this.#chains === null && ++this.#asked * CHAINED > count) this.#chains = new Chains(this.vertices, greatest)
    if (this.#chains !== null) return this.#chains.side(point[0], point[1])
    // The edges below and above the point: the last of each chain that does not begin after it.
    const low = this.#edge(0, greatest, 1, point)
    const high = this.#edge(greatest, count, -1, point)
    const below = turn(vertices.at(low), vertices.at(low + 1), point)
    const above = turn(vertices.at(high), vertices.at(high + 1 < count ? high + 1 : 0), point)
    return below < 0 || above < 0 ? -1 : below && above ? 1 : 0
  }

  /** The row of the greatest vertex by x, then y: up to it the vertices ascend, and from it on they descend. */
  #last() {
    if (this.#greatest !== null) return this.#greatest
    const vertices = this.#vertices
    let [low, high] = [0, vertices.length - 1]
    while (low < high) {
      const middle = (low + high) >> 1
      if (compared(vertices.at(middle), vertices.at(middle + 1)) < 0) low = middle + 1
      else high = middle
    }
    return (this.#greatest = low)
  }

  /**
   * The edge of a chain that has a point in its range; chains ascend (1) or descend (-1).
   * @param {number} first
   * @param {number} last
   * @param {1 | -1} order
   * @param {Point} point
   */
  #edge(first, last, order, point) {
    const vertices = this.#vertices
    let [low, high] = [first, last]
    while (high - low > 1) {
      const middle = (low + high) >> 1
      if (order * compared(vertices.at(middle), point) <= 0) low = middle
      else high = middle
    }
    return low
  }

  /** @param {Point} direction @returns {Point} */
  #extreme(direction) {
    const vertices = this.#vertices
    const count = vertices.length
    let [low, high] = direction[1] > 0 ? [this.#last(), count] : [0, this.#last()]
    // Along a chain the vertices ascend in the direction, and then descend.
    const at = (/** @type {number} */ i) => vertices.at(i % count)
    while (low < high) {
      const middle = (low + high) >> 1
      if (ascent(at(middle), at(middle + 1), direction) > 0) low = middle + 1
      else high = middle
    }
    const level = at(low + 1)
    return ascent(at(low), level, direction) === 0 && compared(level, at(low)) < 0 ? level : at(low)
  }

  /** @param {Point} point */
  #distance(point) {
    const { vertices } = this
    const count = vertices.length
    if (!count) return Infinity
    if (this.#side(point) >= 0) return 0
    for (let i = 0; i < count; i++) {
      const [a, b] = [vertices[i], vertices[(i + 1) % count]]
      if (turn(a, b, point) < 0 && ahead(a, b, point) > 0 && ahead(b, a, point) > 0) return gapToLine(point, a, b)
    }
    // Without a foot on an edge, a vertex is nearest: that from which no edge leads towards the point.
    const nearest = vertices.find((vertex, i) => {
      const next = vertices[(i + 1) % count]
      const last = vertices[(i + count - 1) % count]
      return (count === 1 || ahead(vertex, next, point) <= 0) && (count === 1 || ahead(vertex, last, point) <= 0)
    })
    if (nearest === undefined) throw new Error("a hull without a nearest point")
    return gap(point, nearest)
  }

  /** @param {Point} point @param {1 | -1} side @returns {Point} */
  #tangent(point, side) {
    return this.vertices.reduce((best, vertex) => {
      const over = side * turn(point, best, vertex)
      return over > 0 || (over === 0 && ahead(best, point, vertex) < 0) ? vertex : best
    })
  }

  /** @param {readonly Point[]} points */
  #require(points) {
    if (!this.#known) throw refusal("HULL_NOT_FOUND", "the copy holds no hull: it has received none, or it was deleted")
    if (this.center !== null) throw refusal("HULL_UNSUITABLE", "the server answers questions about a geographic hull")
    if (this.maxStaleness !== null && this.age > this.maxStaleness) {
      throw refusal("STALE_COPY", `the copy was updated ${this.age.toPrecision(3)} s ago`)
    }
    for (let row = 0; row < points.length; row++) {
      const [x, y] = points[row]
      if (!Number.isFinite(x) || !Number.isFinite(y)) throw new RangeError(`point ${row} is not finite: (${x}, ${y})`)
    }
  }
}

/** @param {Point} a @param {Point} b */
function compared(a, b) {
  return a[0] - b[0] || a[1] - b[1]
}

/** @param {Point} a @param {Point} b @returns {[number, number]} */
function away(a, b) {
  return [b[0] - a[0], b[1] - a[1]]
}

/** @param {string} reason @param {string} detail */
function refusal(reason, detail) {
  return new DynhullError({ reason, detail })
}

/**
 * The keys after a change; those of a copy that had none are all among the renamed ones.
 * @param {Ring<Key> | null} keys
 * @param {number} count
 * @param {Extract<HullEvent, {type: "change"}>} change
 */
function changedKeys(keys, count, change) {
  if (change.addedKeys === null || change.renamedKeys === null || change.renamedRows === null) return null
  const changed = keys ?? new Ring(new Array(count).fill(""))
  changed.edit(change, change.addedKeys)
  for (const [place, row] of change.renamedRows.entries()) changed.set(row, change.renamedKeys[place])
  return changed
}
