// Calls of the contract over a channel of @grpc/grpc-js, made of the contract's descriptors.

import { readFileSync } from "node:fs"

import { Client as Caller, Metadata, credentials, loadPackageDefinition, status } from "@grpc/grpc-js"
import { loadFileDescriptorSetFromBuffer } from "@grpc/proto-loader"

import { DynhullError } from "../errors.js"
import { named, retold } from "./names.js"

const CONTRACT = readFileSync(new URL("contract.binpb", import.meta.url))
const OPTIONS = { longs: String, enums: String, defaults: true, oneofs: true }
const MEGABYTES = 2 ** 20
// As of servers of dynhull: a ping each ten seconds, also without calls, so that a network that carries nothing is noticed.
const CHANNEL = {
  "grpc.keepalive_time_ms": 10_000,
  "grpc.keepalive_timeout_ms": 10_000,
  "grpc.max_receive_message_length": 1024 * MEGABYTES,
  "grpc.max_send_message_length": 1024 * MEGABYTES,
  // A connection that was refused is tried again soon.
  "grpc.initial_reconnect_backoff_ms": 100,
  "grpc.max_reconnect_backoff_ms": 5_000,
}
/** The statuses of HTTP that stand for those of gRPC. @type {Record<number, number>} */
const HTTP = { 1: 503, 2: 502, 3: 400, 4: 504, 5: 404, 6: 409, 7: 403, 8: 429, 9: 409, 10: 409, 11: 400, 12: 501, 13: 500, 14: 503, 16: 401 }

/** The three services of a server. */
export class Channel {
  /** @type {Map<string, {caller: any, method: string}>} by the name of the call */
  #calls = new Map()
  #callers
  #metadata = new Metadata()

  /**
   * @param {string} url `grpc://HOST:PORT`, or `grpcs://` with TLS
   * @param {{token?: string | null, rootCertificates?: Uint8Array | null}} options
   */
  constructor(url, { token = null, rootCertificates = null }) {
    const { protocol, host } = new URL(url)
    if (!["grpc:", "grpcs:"].includes(protocol) || !host) throw new RangeError(`${url}: must be grpc://HOST:PORT or grpcs://HOST:PORT`)
    this.url = url
    const secure = protocol === "grpcs:" ? credentials.createSsl(rootCertificates && Buffer.from(rootCertificates)) : credentials.createInsecure()
    const { dynhull } = /** @type {any} */ (loadPackageDefinition(loadFileDescriptorSetFromBuffer(CONTRACT, OPTIONS)))
    const services = [dynhull.v1.HullService, dynhull.v1.FenceService, dynhull.v1.AlarmService]
    this.#callers = services.map((Service) => new Service(host, secure, CHANNEL))
    services.forEach((Service, place) => {
      for (const method of Object.keys(Service.service)) this.#calls.set(method, { caller: this.#callers[place], method })
    })
    if (token !== null) this.#metadata.set("authorization", `Bearer ${token}`)
  }

  /** End all calls. */
  close() {
    for (const caller of this.#callers) /** @type {Caller} */ (caller).close()
  }

  /**
   * @param {string} method
   * @param {object} request
   * @param {{signal?: AbortSignal | null, timeout: number}} options
   * @returns {Promise<any>}
   */
  unary(method, request, { signal, timeout }) {
    const { caller } = /** @type {any} */ (this.#calls.get(method))
    return new Promise((resolve, reject) => {
      if (signal?.aborted) return reject(signal.reason)
      const deadline = Date.now() + timeout * 1000
      const call = caller[method](request, this.#metadata, { deadline }, (/** @type {any} */ error, /** @type {any} */ answer) => {
        signal?.removeEventListener("abort", abort)
        if (error) reject(signal?.aborted ? signal.reason : problemOf(error, this.url))
        else resolve(answer)
      })
      const abort = () => call.cancel()
      signal?.addEventListener("abort", abort)
    })
  }

  /**
   * @param {string} method
   * @param {AbortSignal | null} signal
   * @param {(answer: any) => void} take what it throws ends the call
   * @returns {Duplex}
   */
  duplex(method, signal, take) {
    const { caller } = /** @type {any} */ (this.#calls.get(method))
    signal?.throwIfAborted()
    const call = caller[method](this.#metadata)
    const abort = () => call.cancel()
    signal?.addEventListener("abort", abort)
    /** @type {Promise<void>} */
    const ended = new Promise((resolve, reject) => {
      call.on("data", (/** @type {any} */ answer) => {
        try {
          take(answer)
        } catch (error) {
          reject(error)
          call.cancel()
        }
      })
      call.on("error", (/** @type {any} */ error) => reject(signal?.aborted ? signal.reason : problemOf(error, this.url)))
      call.on("end", () => resolve())
    })
    const done = () => signal?.removeEventListener("abort", abort)
    ended.then(done, done)
    return { write: (request) => call.write(request), end: () => call.end(), cancel: abort, ended }
  }

  /**
   * @param {string} method
   * @param {object} request
   * @param {{signal?: AbortSignal | null, timeout?: number}} [options]
   * @returns {AsyncGenerator<any, void, undefined>}
   */
  async *stream(method, request, { signal, timeout } = {}) {
    const { caller } = /** @type {any} */ (this.#calls.get(method))
    signal?.throwIfAborted()
    const call = caller[method](request, this.#metadata, timeout === undefined ? {} : { deadline: Date.now() + timeout * 1000 })
    const abort = () => call.cancel()
    signal?.addEventListener("abort", abort)
    try {
      for await (const answer of call) yield answer
    } catch (error) {
      throw signal?.aborted ? signal.reason : problemOf(error, this.url)
    } finally {
      signal?.removeEventListener("abort", abort)
      call.cancel()
    }
  }
}

/**
 * A stream in both directions.
 * @typedef {object} Duplex
 * @property {(request: object) => void} write
 * @property {() => void} end say that there is no more to write
 * @property {() => void} cancel
 * @property {Promise<void>} ended rejects with what ended it otherwise
 */

/** Whether nothing of a call was sent, because there was no connection. @param {DynhullError} error */
export function notSent(error) {
  const { details = "" } = /** @type {{details?: string}} */ (error.cause ?? {})
  return error.reason === "UNREACHABLE" && details.startsWith("No connection established")
}

/** @param {any} error @param {string} url */
function problemOf(error, url) {
  const { reason, metadata } = reasonOf(error.metadata?.get("grpc-status-details-bin")[0])
  const detail = retold(error.details || error.message, metadata)
  if (!reason && (error.code === status.UNAVAILABLE || error.code === status.CANCELLED)) {
    return new DynhullError({ reason: "UNREACHABLE", detail: `no answer from ${url}: ${detail}` }, error)
  }
  if (!reason && error.code === status.DEADLINE_EXCEEDED) return new DynhullError({ reason: "DEADLINE", detail }, error)
  const numbers = { row: numberOf(metadata.row), expected: numberOf(metadata.expected), applied: numberOf(metadata.applied) }
  const { field, value = null } = metadata
  const said = { reason: reason || "REFUSED", detail, status: HTTP[error.code] ?? 500, field: field ? named(field).split("/")[0] : null, value, ...numbers }
  return new DynhullError(said, error)
}

/** @param {string | undefined} text */
function numberOf(text) {
  if (text === undefined || !/^\d+$/.test(text)) return null
  const number = Number(text)
  return Number.isSafeInteger(number) ? number : BigInt(text)
}

/**
 * The google.rpc.ErrorInfo in a google.rpc.Status: few fields, so they are read without their descriptors.
 * @param {Buffer | undefined} bytes
 * @returns {{reason: string, metadata: Record<string, string>}}
 */
export function reasonOf(bytes) {
  for (const [field, detail] of bytes ? fields(bytes) : []) {
    if (field !== 3) continue
    const { 1: type, 2: value } = Object.fromEntries(fields(detail))
    if (!String(type).endsWith("/google.rpc.ErrorInfo") || !value) continue
    const info = fields(value)
    const metadata = info.filter(([number]) => number === 3).map(([, entry]) => {
      const { 1: name, 2: text } = Object.fromEntries(fields(entry))
      return [String(name ?? ""), String(text ?? "")]
    })
    return { reason: String(Object.fromEntries(info)[1] ?? ""), metadata: Object.fromEntries(metadata) }
  }
  return { reason: "", metadata: {} }
}

/** The fields with bytes in a message. @param {Buffer} bytes @returns {[number, Buffer][]} */
function fields(bytes) {
  /** @type {[number, Buffer][]} */
  const found = []
  let at = 0
  const varint = () => {
    let [value, scale] = [0, 1]
    for (;;) {
      const byte = bytes[at++]
      value += (byte & 127) * scale
      scale *= 128
      if (byte < 128) return value
    }
  }
  while (at < bytes.length) {
    const tag = varint()
    if ((tag & 7) === 0) varint()
    else if ((tag & 7) === 2) {
      const length = varint()
      found.push([tag >> 3, bytes.subarray(at, (at += length))])
    } else break // no other kinds are in these messages
  }
  return found
}
