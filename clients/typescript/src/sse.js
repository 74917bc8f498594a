// Server-sent events of a gateway, without end: connected again when a connection ends or falls silent.
//
// EventSource cannot send a token, gives up on some answers, and does not notice a network that carries nothing.
// A library's parser forgets an id that comes without data, and that is where a stream goes on.

import { growing, pause, problem, unreachable } from "./connection.js"
import { DynhullError } from "./errors.js"
import { fromJson } from "./json.js"

/**
 * @typedef {import("./connection.js").Connection} Connection
 * @typedef {import("./connection.js").Call} Call
 * @typedef {{type: string, data: any}} Message
 *
 * @typedef {object} Following
 * @property {AbortSignal | null} [signal] ends the stream
 * @property {number} [silence] seconds without anything, a comment included, after which the connection is made anew
 * @property {boolean} [reconnect] whether to connect again; without, the stream ends with the error
 * @property {(lost: boolean) => void} [onLost] told when it is no longer, and when it is again, known what happens
 */

/** Gateways send a comment each 15 seconds. */
const SILENCE = 45

/**
 * The events of a stream, from one connection to the next.
 * @param {Connection} connection
 * @param {string} path
 * @param {Call["query"]} query
 * @param {Following} following
 * @param {string} [place] where to go on
 * @returns {AsyncGenerator<Message, void, undefined>}
 */
export async function* follow(connection, path, query, following, place = "") {
  const { signal = null, silence = SILENCE, reconnect = true, onLost = () => {} } = following
  let pauses = growing()
  let lost = false
  const tell = (/** @type {boolean} */ now) => {
    if (now !== lost) onLost((lost = now))
  }
  while (!signal?.aborted) {
    const own = new AbortController()
    const abort = () => own.abort(signal?.reason)
    signal?.addEventListener("abort", abort)
    try {
      const watched = watch(silence, own)
      const stream = await connection.open(path, { query, signal: own.signal }, place)
      for await (const { type, data, id } of parsed(stream, watched.seen)) {
        place = id ?? place
        if (type === "") continue
        if (type === "problem") throw problem(fromJson(data))
        pauses = growing()
        tell(type === "unavailable")
        if (type !== "unavailable" && type !== "available") yield { type, data: fromJson(data) }
      }
      throw unreachable(connection.url, "the stream has ended")
    } catch (error) {
      if (signal?.aborted) return
      const passes = !(error instanceof DynhullError) || error.passing || error.unknown
      if (!passes || !reconnect) throw error
      tell(true)
    } finally {
      own.abort()
      signal?.removeEventListener("abort", abort)
    }
    await pause(pauses.next().value, signal).catch(() => {})
  }
}

/**
 * Abort what has said nothing for too long.
 * @param {number} seconds
 * @param {AbortController} controller
 */
function watch(seconds, controller) {
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  let timer
  const seen = () => {
    clearTimeout(timer)
    if (!controller.signal.aborted) timer = setTimeout(() => controller.abort(), seconds * 1000)
  }
  controller.signal.addEventListener("abort", () => clearTimeout(timer))
  seen()
  return { seen }
}

/**
 * The events in a stream, and ids that come alone, with an empty type.
 * @param {ReadableStream<Uint8Array>} stream
 * @param {() => void} seen called whenever something comes
 * @returns {AsyncGenerator<{type: string, data: string, id: string | null}>}
 */
export async function* parsed(stream, seen) {
  const reader = stream.getReader()
  const decoder = new TextDecoder()
  let rest = ""
  /** @type {string | null} */
  let id = null
  /** @type {string[]} */
  let data = []
  let type = ""
  try {
    for (;;) {
      const { done, value } = await reader.read()
      if (done) return
      seen()
      const lines = (rest + decoder.decode(value, { stream: true })).split("\n")
      rest = /** @type {string} */ (lines.pop())
      for (const line of lines) {
        const [, field, text] = /^([^:]*):? ?(.*?)\r?$/s.exec(line) ?? ["", "", ""]
        if (line === "" || line === "\r") {
          if (data.length) yield { type: type || "message", data: data.join("\n"), id }
          else if (id !== null) yield { type: "", data: "", id }
          ;[type, data, id] = ["", [], null]
        } else if (field === "event") type = text
        else if (field === "data") data.push(text)
        else if (field === "id") id = text
      }
    }
  } finally {
    await reader.cancel().catch(() => {})
  }
}
