// All that a client follows, in one connection: a browser gives an origin six, those of its other tabs included.
//
// A connection that ends or falls silent is made again, and each subscription goes on after its last id. Who reads slowly
// does not hold the others back: what waits for him has a bound, beyond which he is subscribed anew once he has read it.

import { growing, path, pause, problem, target, unreachable } from "./connection.js"
import { DynhullError } from "./errors.js"
import { fromJson } from "./json.js"
import { parsed } from "./sse.js"

/**
 * @typedef {import("./connection.js").Connection} Connection
 * @typedef {import("./connection.js").Call} Call
 * @typedef {{type: string, data: any, id: string}} Message an event; the id is empty if it has none
 *
 * @typedef {object} Following
 * @property {AbortSignal | null} [signal] ends the stream
 * @property {boolean} [reconnect] whether to connect again; without, the stream ends with the error
 * @property {(lost: boolean) => void} [onLost] told when it is no longer, and when it is again, known what happens
 */

/** Characters of events that wait for a reader. */
const ROOM = 2 ** 22

class Subscription {
  /** Its name in the stream; empty while it has none. */
  name = ""
  /** Whether the stream knows it. */
  sent = false
  over = false
  /** @type {unknown} */
  error = null
  /** @type {{type: string, data: string, id: string}[]} */
  waiting = []
  characters = 0
  #lost = false
  #wake = () => {}

  /**
   * @param {string} target
   * @param {string} place
   * @param {Following} following
   */
  constructor(target, place, { reconnect = true, onLost = () => {} }) {
    this.target = target
    /** The id after which to go on. */
    this.place = place
    this.reconnect = reconnect
    this.onLost = onLost
  }

  get request() {
    return { path: this.target, ...(this.place && { last_event_id: this.place }) }
  }

  /** What its owner's function throws ends this stream, and no other. @param {boolean} now */
  tell(now) {
    if (now === this.#lost) return
    this.#lost = now
    try {
      this.onLost(now)
    } catch (error) {
      this.reconnect = false
      this.error = error
      this.wake()
    }
  }

  wake = () => this.#wake()

  /** @returns {Promise<void>} */
  news() {
    return new Promise((resolve) => (this.#wake = resolve))
  }
}

/** The streams of one gateway, joined to one. */
export class Joined {
  #connection
  #silence
  /** @type {Map<string, Subscription>} */
  #followed = new Map()
  #number = 0
  #running = false
  /** The name of the stream; empty while there is none. */
  #stream = ""
  #controller = new AbortController()

  /**
   * @param {Connection} connection
   * @param {number} silence seconds without anything, after which the connection is made anew
   */
  constructor(connection, silence) {
    this.#connection = connection
    this.#silence = silence
  }

  /**
   * The events of a stream, from one connection to the next.
   * @param {string} path
   * @param {Call["query"]} query
   * @param {Following} following
   * @param {string} [place] where to go on
   * @returns {AsyncGenerator<Message, void, undefined>}
   */
  async *follow(path, query, following, place = "") {
    const { signal } = following
    const own = new Subscription(target(path, query), place, following)
    let pauses = growing()
    const abort = () => {
      this.#leave(own) // though nobody may ask for the next event
      own.wake()
    }
    signal?.addEventListener("abort", abort)
    try {
      while (!signal?.aborted) {
        const message = own.waiting.shift()
        if (message !== undefined) {
          own.characters -= message.data.length
          pauses = growing()
          yield { ...message, data: fromJson(message.data) }
        } else if (own.over) {
          return
        } else if (own.error !== null) {
          const { error } = own
          if (!own.reconnect || !passes(error)) throw error
          own.tell(true)
          await pause(pauses.next().value, signal).catch(() => {})
          own.error = null
        } else if (own.name === "") {
          this.#enter(own)
        } else {
          await own.news()
        }
      }
    } finally {
      signal?.removeEventListener("abort", abort)
      this.#leave(own)
    }
  }

  /** @param {Subscription} own */
  #enter(own) {
    own.name = String(++this.#number)
    own.sent = false
    this.#followed.set(own.name, own)
    if (this.#stream) this.#subscribe(own)
    if (!this.#running) this.#run()
  }

  /** Without anybody who follows something, there is no stream. @param {Subscription} own */
  #forget(own) {
    this.#followed.delete(own.name)
    own.name = ""
    if (!this.#followed.size) this.#controller.abort()
  }

  /** @param {Subscription} own */
  #leave(own) {
    const { name } = own
    if (name === "") return
    this.#forget(own)
    if (this.#followed.size && own.sent && this.#stream) {
      const call = { method: "DELETE", signal: this.#controller.signal }
      this.#connection.ask(path`/streams/${this.#stream}/subscriptions/${name}`, call).catch(() => {})
    }
  }

  /** @param {Subscription} own */
  async #subscribe(own) {
    const [stream, name] = [this.#stream, own.name]
    const call = { method: "PUT", body: own.request, repeatable: true, signal: this.#controller.signal }
    own.sent = true
    try {
      await this.#connection.ask(path`/streams/${stream}/subscriptions/${name}`, call)
    } catch (error) {
      if (this.#stream !== stream || own.name !== name) return
      const lost = passes(error) || /** @type {DynhullError} */ (error).reason === "STREAM_NOT_FOUND"
      if (lost) this.#controller.abort()
      else this.#fail(own, error)
    }
  }

  /** @param {Subscription} own @param {unknown} error */
  #fail(own, error) {
    this.#forget(own)
    own.error = error
    own.wake()
  }

  async #run() {
    this.#running = true
    let pauses = growing()
    await pause(0) // what is followed from the same moment goes along
    while (this.#followed.size) {
      const controller = (this.#controller = new AbortController())
      /** @type {unknown} */
      let ended
      try {
        const seen = silenceOf(this.#silence, controller)
        for await (const message of parsed(await this.#open(controller.signal), seen)) {
          if (message.type === "stream") pauses = growing()
          this.#take(message)
        }
        ended = unreachable(this.#connection.url, "the stream has ended")
      } catch (error) {
        ended = error
      }
      controller.abort()
      this.#stream = ""
      this.#lose(ended)
      if (this.#followed.size) {
        this.#controller = new AbortController()
        await pause(pauses.next().value, this.#controller.signal).catch(() => {})
      }
    }
    this.#running = false
  }

  /** @param {AbortSignal} signal */
  #open(signal) {
    const subscriptions = Object.fromEntries([...this.#followed].map(([name, own]) => [name, own.request]))
    for (const own of this.#followed.values()) own.sent = true
    return this.#connection.open("/streams", { method: "POST", body: { subscriptions }, signal })
  }

  /** @param {unknown} error */
  #lose(error) {
    for (const own of [...this.#followed.values()]) {
      own.sent = false
      if (own.reconnect && passes(error)) own.tell(true)
      else this.#fail(own, error)
    }
  }

  /** @param {{type: string, data: string, id: string | null}} message */
  #take({ type, data, id }) {
    if (id === null) return this.#takeOwn(type, data)
    const [name, place = ""] = id.split(" ")
    const own = this.#followed.get(name)
    if (own === undefined) return
    if (type === "problem") return this.#fail(own, problem(fromJson(data)))
    if (type === "over") {
      this.#forget(own)
      own.over = true
    } else if (type !== "") {
      if (own.waiting.length && own.characters + data.length > ROOM) return this.#leave(own)
      own.waiting.push({ type, data, id: place })
      own.characters += data.length
      own.tell(false)
    }
    own.place = place || own.place
    own.wake()
  }

  /** What is about all. @param {string} type @param {string} data */
  #takeOwn(type, data) {
    if (type === "stream") {
      this.#stream = fromJson(data).stream
      for (const own of this.#followed.values()) if (!own.sent) this.#subscribe(own)
    }
    for (const own of this.#followed.values()) own.tell(type === "unavailable")
  }
}

/** Whether it may be otherwise later. @param {unknown} error */
function passes(error) {
  return !(error instanceof DynhullError) || error.passing || error.unknown
}

/**
 * Abort what has said nothing for too long; what is returned says that something has come.
 * @param {number} seconds
 * @param {AbortController} controller
 */
function silenceOf(seconds, controller) {
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  let timer
  const seen = () => {
    clearTimeout(timer)
    if (!controller.signal.aborted) timer = setTimeout(() => controller.abort(), seconds * 1000)
  }
  controller.signal.addEventListener("abort", () => clearTimeout(timer))
  seen()
  return seen
}
