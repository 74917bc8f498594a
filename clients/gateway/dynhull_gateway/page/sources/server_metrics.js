// Rates and delays of the whole server, from its metrics page for Prometheus, which the dashboard passes on.
import { repeat } from "./repeating.js"
const POLL = 1000, PERCENTILE = 0.99, COUNTED = ["insert", "delete", "move"]
const SAMPLE = /^([a-z_]+)(?:\{(.*)\})? (\S+)/
export class ServerMetrics {
  lines = []  // rows of the time lines that nobody has taken
  error = null  // why the last request failed
  #before
  constructor(url, at) {
    this.url = url
    this.closing = new AbortController()
    repeat(this.closing.signal, () => this.#poll(at, this.closing.signal), () => POLL)
  }
  close() {
    this.closing.abort()
  }
  async #poll(at, signal) {
    let now
    try {
      const answer = await fetch(at, {signal}), {text, error = null} = await answer.json()
      this.error = error
      if (text != undefined) now = scraped(text, performance.now() / 1000)
    } catch {
      return  // the dashboard does not answer, which the page says
    }
    this.lines.push([Date.now(), ...now && this.#before ? rates(this.#before, now) : [NaN, NaN, NaN]])
    this.#before = now
  }
}
// The server's counters at one moment, in seconds.
export function scraped(text, at) {
  const found = {at, updates: 0, batches: 0, seconds: 0, buckets: new Map()}
  for (const line of text.split("\n")) {
    const [, name, labels = "", value] = SAMPLE.exec(line) ?? []
    if (name == "dynhull_updates_total" && COUNTED.some(each => labels.includes(`"${each}"`))) found.updates += +value
    else if (name == "dynhull_batch_duration_seconds_count") found.batches = +value
    else if (name == "dynhull_batch_duration_seconds_sum") found.seconds = +value
    else if (name == "dynhull_batch_duration_seconds_bucket") {
      const bound = /le="([^"]*)"/.exec(labels)[1]
      found.buckets.set(bound == "+Inf" ? Infinity : +bound, +value)
    }
  }
  return found
}
// Updates per second, and the mean and the 99th percentile of the milliseconds to the acknowledgement. The delays are NaN where there
// were no batches; all three are NaN where the server has restarted.
export function rates(before, now) {
  const batches = now.batches - before.batches
  if (batches < 0) return [NaN, NaN, NaN]
  const updates = (now.updates - before.updates) / (now.at - before.at)
  if (!batches) return [updates, NaN, NaN]
  const buckets = [...now.buckets].map(([bound, many]) => [bound, many - (before.buckets.get(bound) ?? 0)]).sort(([one], [two]) => one - two)
  return [updates, 1000 * (now.seconds - before.seconds) / batches, 1000 * quantile(buckets, PERCENTILE)]
}
// As Prometheus's `histogram_quantile`: linear within a bucket, the largest finite bound in the last one.
function quantile(buckets, share) {
  const wanted = share * buckets.at(-1)[1]
  let low = 0, below = 0
  for (const [bound, many] of buckets) {
    if (many >= wanted) return bound == Infinity ? low : low + (bound - low) * (wanted - below) / (many - below)
    low = bound
    below = many
  }
  return NaN
}
