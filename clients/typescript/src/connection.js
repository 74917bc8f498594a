import { carryOverHttp } from "./carrying.js"
import { DynhullError } from "./errors.js"
import { fromJson, toJson } from "./json.js"
import { parsed } from "./sse.js"

/**
 * @typedef {object} ConnectionOptions
 * @property {string | null} [token] sent as `Authorization: Bearer`, kept in memory only
 * @property {number} [timeout] seconds that an answer may take
 * @property {number} [retries] how often a read, or a numbered batch, is sent again when nobody answers
 * @property {number} [silence] seconds without anything, a comment included, after which a stream is connected anew
 * @property {typeof globalThis.fetch} [fetch] another fetch
 *
 * @typedef {object} Known
 * @property {bigint} sequence the number of the last batch of a producer that was applied; 0 if there is none
 * @property {string} uid the uid of the hull
 *
 * @typedef {string | number | bigint | boolean | null | undefined} Value
 *
 * @typedef {object} Call
 * @property {string} [method]
 * @property {Record<string, Value | readonly Value[]>} [query]
 * @property {unknown} [body]
 * @property {string} [idempotencyKey]
 * @property {boolean} [repeatable] whether it may be sent again if it is not known what became of it
 * @property {AbortSignal | null} [signal]
 */

/** The first pause before something is tried again, and the longest, in seconds. */
export const PAUSES = { first: 0.25, last: 15 }

const JSON_TYPE = "application/json"

/**
 * What a call brings, tried again after growing pauses where that is safe.
 * @template T
 * @param {() => Promise<T>} once
 * @param {number} retries
 * @param {Call} call
 * @param {(error: DynhullError) => boolean} [notSent] whether nothing of it has reached the other side
 * @returns {Promise<T>}
 */
export async function answered(once, retries, call, notSent = () => false) {
  const pauses = growing()
  for (let tries = 0; ; tries++) {
    try {
      return await once()
    } catch (error) {
      if (!(error instanceof DynhullError)) throw error
      const again = error.passing || notSent(error) || (call.repeatable && error.unknown)
      if (!again || tries >= retries) throw error
      await pause(pauses.next().value, call.signal)
    }
  }
}

/** Calls of one gateway. */
export class Connection {
  #token
  #timeout
  #retries
  #fetch

  /**
   * @param {string} url
   * @param {ConnectionOptions} options
   */
  constructor(url, { token = null, timeout = 30, retries = 3, fetch = globalThis.fetch.bind(globalThis) }) {
    this.url = url.replace(/\/+$/, "")
    /** Batches of a writer that are under way: browsers have six connections to an origin. */
    this.inFlight = 3
    this.#token = token
    this.#timeout = timeout
    this.#retries = retries
    this.#fetch = fetch
  }

  /**
   * Ask, and again when that is safe.
   * @param {string} path
   * @param {Call} [call]
   * @returns {Promise<any>} what the answer's JSON has
   */
  ask(path, call = {}) {
    return answered(() => this.#once(path, call), this.#retries, call)
  }

  /**
   * What a hull knows of a producer.
   * @param {string} name
   * @param {string} producer
   * @param {AbortSignal | null} signal
   * @returns {Promise<Known>}
   */
  async known(name, producer, signal) {
    const read = { repeatable: true, signal }
    const { last_sequence: sequence } = await this.ask(path`/hulls/${name}/producers/${producer}`, read)
    const { hulls: [first] } = await this.ask("/hulls", { query: { prefix: name, limit: 1 }, ...read })
    return { sequence: BigInt(sequence), uid: first?.name === name ? first.uid : "" }
  }

  /** Send the batches of a writer. @param {string} name @param {import("./in-flight.js").InFlight} batches @param {import("./carrying.js").Carried} options */
  carry(name, batches, options) {
    const { producer, signal } = options
    const ask = (/** @type {string} */ path, /** @type {Call} */ call) => this.ask(path, call)
    const last = async () => (await this.known(name, producer, signal)).sequence
    return carryOverHttp({ ask, last }, name, batches, options)
  }

  /**
   * Open a stream of events.
   * @param {string} path
   * @param {Call} call
   * @returns {Promise<ReadableStream<Uint8Array>>}
   */
  async open(path, call) {
    const headers = { Accept: "text/event-stream", ...(call.body !== undefined && { "Content-Type": JSON_TYPE }) }
    const response = await this.#send(path, call, headers, call.signal ?? undefined)
    if (!response.ok || response.body === null) throw await problemOf(response)
    return response.body
  }

  /**
   * The events of a stream that ends.
   * @param {string} path
   * @param {Call} call
   * @returns {AsyncGenerator<{type: string, data: any}, void, undefined>}
   */
  async *events(path, call) {
    for await (const { type, data } of parsed(await this.open(path, call), () => {})) yield { type, data: fromJson(data || "null") }
  }

  /** @param {string} path @param {Call} call */
  async #once(path, call) {
    const late = AbortSignal.timeout(this.#timeout * 1000)
    const signal = call.signal ? AbortSignal.any([call.signal, late]) : late
    const headers = {
      Accept: JSON_TYPE,
      ...(call.body !== undefined && { "Content-Type": JSON_TYPE }),
      ...(call.idempotencyKey && { "Idempotency-Key": call.idempotencyKey }),
    }
    try {
      const response = await this.#send(path, call, headers, signal)
      if (!response.ok) throw await problemOf(response)
      const text = await response.text()
      return text ? fromJson(text) : null
    } catch (error) {
      if (error instanceof DynhullError || call.signal?.aborted) throw error
      if (late.aborted) {
        const detail = `${path}: no answer within ${this.#timeout} s`
        throw new DynhullError({ reason: "DEADLINE", detail }, error)
      }
      throw unreachable(this.url, error)
    }
  }

  /**
   * @param {string} path
   * @param {Call} call
   * @param {Record<string, string>} headers
   * @param {AbortSignal | undefined} signal
   */
  async #send(path, { method = "GET", query = {}, body }, headers, signal) {
    const all = this.#token === null ? headers : { ...headers, Authorization: `Bearer ${this.#token}` }
    try {
      return await this.#fetch(this.url + target(path, query), {
        method,
        headers: all,
        ...(body !== undefined && { body: toJson(body) }),
        ...(signal && { signal }),
        cache: "no-store",
      })
    } catch (error) {
      if (signal?.aborted) throw error
      throw unreachable(this.url, error)
    }
  }
}

/**
 * A part of a path: a slash in a name is written %2F.
 * @param {TemplateStringsArray} texts
 * @param {string[]} names
 */
export function path(texts, ...names) {
  return String.raw({ raw: texts }, ...names.map(encodeURIComponent))
}

/**
 * A path with its query; what is null is left out.
 * @param {string} path
 * @param {Call["query"]} [query]
 */
export function target(path, query = {}) {
  const given = Object.entries(query).flatMap(([name, value]) => [value].flat().map((each) => [name, each]))
  const search = new URLSearchParams(given.filter(([, value]) => value != null).map(([name, value]) => [String(name), String(value)]))
  return search.size ? `${path}?${search}` : path
}

/**
 * Growing pauses in seconds, no two callers alike.
 * @returns {Generator<number, never>}
 */
export function* growing() {
  for (let seconds = PAUSES.first; ; seconds = Math.min(2 * seconds, PAUSES.last)) yield seconds * (0.5 + Math.random())
}

/**
 * Wait; shorter if the page is shown again or the network is back.
 * @param {number} seconds
 * @param {AbortSignal | null} [signal]
 * @returns {Promise<void>}
 */
export function pause(seconds, signal) {
  return new Promise((resolve, reject) => {
    if (signal?.aborted) return reject(signal.reason)
    const end = (/** @type {() => void} */ then) => () => {
      clearTimeout(timer)
      signal?.removeEventListener("abort", abort)
      for (const [target, name] of WAKERS) target.removeEventListener(name, wake)
      then()
    }
    const abort = end(() => reject(signal?.reason))
    const wake = end(resolve)
    const timer = setTimeout(wake, seconds * 1000)
    signal?.addEventListener("abort", abort)
    for (const [target, name] of WAKERS) target.addEventListener(name, wake)
  })
}

/** What says that a sleeping page is there again. @type {[EventTarget, string][]} */
const WAKERS =
  typeof document === "undefined"
    ? []
    : [
        [document, "visibilitychange"],
        [globalThis, "online"],
      ]

/** @param {string} url @param {unknown} cause */
export function unreachable(url, cause) {
  const said = cause instanceof Error ? cause.message : String(cause)
  return new DynhullError({ reason: "UNREACHABLE", detail: `no answer from ${url}: ${said}` }, cause)
}

/** @param {Response} response */
async function problemOf(response) {
  const text = await response.text()
  const type = response.headers.get("Content-Type") ?? ""
  if (!type.startsWith("application/problem+json")) {
    // A proxy's page: the server behind it may be back soon.
    const reason = response.status >= 500 ? "UNREACHABLE" : "REFUSED"
    return new DynhullError({ reason, status: response.status, detail: `${response.status} ${response.statusText}` })
  }
  return problem(fromJson(text))
}

/**
 * The error that problem details describe.
 * @param {any} said
 */
export function problem(said) {
  return new DynhullError({ ...said, reason: said.reason ?? "REFUSED" })
}
