import { answered } from "../connection.js"
import { carryOverGrpc } from "./carrying.js"
import { Client } from "../client.js"
import { routed } from "./calls.js"
import { Channel, notSent } from "./channel.js"
import { Followed } from "./follow.js"
import { fenceConfig } from "./requests.js"
import { moment } from "./values.js"

/**
 * @typedef {object} GrpcOptions
 * @property {string | null} [token] sent as `authorization: Bearer`
 * @property {number} [timeout] seconds that an answer may take
 * @property {number} [retries] how often a read, or a numbered batch, is sent again when nobody answers
 * @property {Uint8Array | null} [rootCertificates] of `grpcs://`, in PEM; default: those of the system
 */

/** Calls of one server: what `Connection` is for a gateway. */
class GrpcConnection {
  #channel
  #followed
  #timeout
  #retries

  /** @param {Channel} channel @param {Followed} followed @param {GrpcOptions} options */
  constructor(channel, followed, { timeout = 30, retries = 3 }) {
    this.url = channel.url
    this.inFlight = 32
    this.#channel = channel
    this.#followed = followed
    this.#timeout = timeout
    this.#retries = retries
  }

  /**
   * Ask, and again when that is safe.
   * @param {string} path
   * @param {import("../connection.js").Call} [call]
   * @returns {Promise<any>}
   */
  ask(path, call = {}) {
    return answered(() => this.#once(path, call), this.#retries, call, notSent)
  }

  /** @param {string} path @param {import("../connection.js").Call} call */
  #once(path, { method = "GET", query = {}, body, idempotencyKey, signal = null }) {
    const { route, names } = routed(method, path)
    const given = Object.fromEntries(Object.entries(query).filter(([, value]) => value != null))
    const options = { signal, timeout: this.#timeout }
    return route({
      names,
      query: given,
      body: body ?? {},
      key: idempotencyKey,
      call: (name, request) => this.#channel.unary(name, request, options),
      parts: async (name, request) => {
        const parts = []
        for await (const part of this.#channel.stream(name, request, options)) parts.push(part)
        return parts
      },
    })
  }

  /**
   * What a hull knows of a producer.
   * @param {string} name
   * @param {string} producer
   * @param {AbortSignal | null} signal
   * @returns {Promise<import("../connection.js").Known>}
   */
  known(name, producer, signal) {
    const ask = async () => {
      const { lastSequence, uid } = await this.#channel.unary("GetProducer", { name, producer }, { signal, timeout: this.#timeout })
      return { sequence: BigInt(lastSequence), uid }
    }
    return answered(ask, this.#retries, { repeatable: true, signal }, notSent)
  }

  /** Send the batches of a writer. @param {string} name @param {import("../in-flight.js").InFlight} batches @param {import("../carrying.js").Carried} options */
  carry(name, batches, options) {
    return carryOverGrpc(this.#channel, name, batches, options)
  }

  /**
   * The events of a stream that ends: those of a fence between two moments.
   * @param {string} _
   * @param {import("../connection.js").Call} call
   */
  events(_, { body, signal }) {
    const { start, end, ...settings } = /** @type {any} */ (body)
    return this.#followed.between({ config: fenceConfig(settings), ...moment("start", start), ...moment("end", end) }, signal)
  }
}

/** A client of a server without a gateway between, in Node: the same calls, streams and writers. */
export class GrpcClient extends Client {
  #channel

  /**
   * @param {string} url `grpc://HOST:PORT`, or `grpcs://HOST:PORT` with TLS
   * @param {GrpcOptions} [options]
   */
  constructor(url, options = {}) {
    const channel = new Channel(url, options)
    const followed = new Followed(channel)
    super(url, { transport: { connection: new GrpcConnection(channel, followed, options), joined: followed } })
    this.#channel = channel
  }

  /** End all calls and streams. A program that has none ends without. */
  close() {
    this.#channel.close()
  }
}
