// Server-sent events of a gateway.
//
// EventSource cannot send a token, gives up on some answers, and does not notice a network that carries nothing.
// A library's parser forgets an id that comes without data, and that is where a stream goes on.

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
