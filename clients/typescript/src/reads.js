import { fromWire } from "./json.js"

/**
 * @typedef {import("./exact.js").Point} Point
 * @typedef {import("./hull-copy.js").Key} Key
 * @typedef {import("./writer.js").AnyKey} AnyKey
 * @typedef {import("./watch.js").Measures} Measures
 * @typedef {(name: string, what: string, call: import("./connection.js").Call) => Promise<any>} Ask
 * @typedef {[number | null, number | null]} MaybePoint
 *
 * @typedef {object} Reading
 * @property {bigint | number} [minRevision] a revision to wait for
 * @property {AbortSignal | null} [signal]
 *
 * @typedef {object} AboutKeys positions of keys instead of points
 * @property {readonly AnyKey[]} keys
 * @property {string} [keysOf] the hull that has them
 * @property {bigint | number} [keysMinRevision]
 */

/** The questions about a hull. Answers name their revision. */
export class Reads {
  #ask

  /** @param {Ask} ask */
  constructor(ask) {
    this.#ask = ask
  }

  /**
   * A hull with its vertices, counter-clockwise, and its measures.
   * @param {string} name
   * @param {Reading} [options]
   * @returns {Promise<{info: import("./client.js").HullInfo, vertices: Point[], vertexKeys: Key[] | null, measures: Measures}>}
   */
  getHull(name, options) {
    return this.#read(name, "", options)
  }

  /**
   * The side of each point, or of each key's position: 1 inside, 0 on the boundary, -1 outside. Exact.
   * @param {string} name
   * @param {readonly Point[] | AboutKeys} about
   * @param {Reading & {layer?: number}} [options]
   * @returns {Promise<{revision: bigint, sides: (-1 | 0 | 1)[], keysRevision: bigint | null}>}
   */
  locate(name, about, options) {
    return this.#post(name, "/locate", aboutPoints(about), options)
  }

  /**
   * The distance of each point, or of each key's position: 0 inside; null from a hull without points.
   * @param {string} name
   * @param {readonly Point[] | AboutKeys} about
   * @param {Reading & {layer?: number}} [options]
   * @returns {Promise<{revision: bigint, distances: (number | null)[], keysRevision: bigint | null}>}
   */
  distance(name, about, options) {
    return this.#post(name, "/distance", aboutPoints(about), options)
  }

  /**
   * How often the hull has each point.
   * @param {string} name
   * @param {readonly Point[]} points
   * @param {Reading} [options]
   * @returns {Promise<{revision: bigint, counts: number[]}>}
   */
  count(name, points, options) {
    return this.#post(name, "/count", { points }, options)
  }

  /**
   * The vertex farthest in each direction.
   * @param {string} name
   * @param {readonly Point[]} directions
   * @param {Reading & {layer?: number, keys?: boolean}} [options]
   * @returns {Promise<{revision: bigint, vertices: Point[], keys: Key[] | null}>}
   */
  support(name, directions, { keys = false, ...options } = {}) {
    return this.#post(name, "/support", { directions, keys }, options)
  }

  /**
   * The left and the right tangent point seen from each point; null where it is not outside.
   * @param {string} name
   * @param {readonly Point[]} points
   * @param {Reading & {layer?: number}} [options]
   * @returns {Promise<{revision: bigint, tangents: [MaybePoint, MaybePoint][]}>}
   */
  tangents(name, points, options) {
    return this.#post(name, "/tangents", { points }, options)
  }

  /**
   * Where the lines through pairs of points enter and leave the hull; null where they miss it.
   * @param {string} name
   * @param {readonly Point[]} origins
   * @param {readonly Point[]} targets
   * @param {Reading & {layer?: number}} [options]
   * @returns {Promise<{revision: bigint, crossings: [MaybePoint, MaybePoint][]}>}
   */
  intersectLines(name, origins, targets, options) {
    return this.#post(name, "/intersect-lines", { origins, targets }, options)
  }

  /**
   * The positions of keys; null where a key is not there.
   * @param {string} name
   * @param {readonly AnyKey[]} keys
   * @param {Reading} [options]
   * @returns {Promise<{revision: bigint, positions: MaybePoint[], present: boolean[], times: (bigint | null)[] | null}>}
   */
  positions(name, keys, options) {
    return this.#post(name, "/positions", { keys }, options)
  }

  /**
   * All keys with their positions.
   * @param {string} name
   * @param {Reading} [options]
   * @returns {Promise<{revision: bigint, keys: Key[], points: Point[], times: (bigint | null)[] | null}>}
   */
  entities(name, options) {
    return this.#read(name, "/entities", options)
  }

  /**
   * At most `size` points, to draw.
   * @param {string} name
   * @param {Reading & {size?: number, keys?: boolean}} [options]
   * @returns {Promise<{revision: bigint, points: Point[], keys: Key[] | null}>}
   */
  samplePoints(name, options) {
    return this.#read(name, "/sample", options)
  }

  /**
   * The outermost convex layers.
   * @param {string} name
   * @param {number} count
   * @param {Reading & {keys?: boolean}} [options]
   * @returns {Promise<{revision: bigint, layers: Point[][], keys: Key[][] | null}>}
   */
  layers(name, count, options) {
    return this.#read(name, "/layers", { count, ...options })
  }

  /**
   * The area that goes with each vertex.
   * @param {string} name
   * @param {Reading & {keys?: boolean}} [options]
   * @returns {Promise<{revision: bigint, vertices: Point[], areas: number[], keys: Key[] | null}>}
   */
  influence(name, options) {
    return this.#read(name, "/influence", options)
  }

  /**
   * All measures.
   * @param {string} name
   * @param {Reading & {layer?: number}} [options]
   * @returns {Promise<Measures & {revision: bigint, minBox: Point[], minPerimeterBox: Point[],
   *   minCircle: {center: MaybePoint, radius: number | null}, labelPoint: MaybePoint, geographic: boolean}>}
   */
  getMeasures(name, options) {
    return this.#read(name, "/measures", options)
  }

  /**
   * Whether the hull is what Chan's algorithm computes from its points, vertex by vertex.
   * @param {string} name
   * @param {Reading} [options]
   * @returns {Promise<{revision: bigint, equal: boolean, points: number, vertices: number, whole: boolean}>}
   */
  verify(name, options) {
    return this.#read(name, "/verification", options)
  }

  /**
   * @param {string} name
   * @param {string} what
   * @param {Reading & Record<string, any>} [options]
   */
  async #read(name, what, options = {}) {
    return fromWire(await this.#ask(name, what, called(options)))
  }

  /**
   * @param {string} name
   * @param {string} what
   * @param {object} body
   * @param {Reading & Record<string, any>} [options]
   */
  async #post(name, what, body, options = {}) {
    return fromWire(await this.#ask(name, what, { method: "POST", body, ...called(options) }))
  }
}

/** @param {Reading & Record<string, any>} options */
function called({ signal = null, minRevision, ...query }) {
  return { signal, query: { min_revision: minRevision, ...query } }
}

/** @param {readonly Point[] | AboutKeys} about */
function aboutPoints(about) {
  if (Array.isArray(about)) return { points: about }
  const { keys, keysOf = null, keysMinRevision = 0 } = /** @type {AboutKeys} */ (about)
  return { keys, keys_of: keysOf, keys_min_revision: keysMinRevision }
}
