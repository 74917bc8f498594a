// Work that is repeated in the background.
import { DynhullError } from "../dynhull/errors.js"
// What is repeated costs the server time, some of it in proportion to the points. A pause of this many times its duration
// keeps it below a twentieth of that time. After one long delay the figures must not stand still: no pause is longer than
// this many of the least ones.
const PAUSE_FACTOR = 19, LONGEST_PAUSE = 5
// Ends a pause.
export class Bell {
  #rung = false
  #wake = () => {}
  ring() {
    this.#rung = true
    this.#wake()
  }
  async rest(milliseconds, signal) {
    if (!this.#rung && !signal.aborted)
      await new Promise(resolve => {
        const wake = this.#wake = () => {
          clearTimeout(timer)
          signal.removeEventListener("abort", wake)
          resolve()
        }
        const timer = setTimeout(wake, milliseconds)
        signal.addEventListener("abort", wake)
      })
    this.#rung = false
  }
}
// Repeats `work` until the signal, with a pause in between that is longer after work that took long; what is refused is shown
// where it is told.
export async function repeat(signal, work, least, bell = new Bell()) {
  while (!signal.aborted) {
    const begun = performance.now()
    try {
      await work()
    } catch (error) {
      if (!signal.aborted && !(error instanceof DynhullError)) console.error(error)
    }
    await bell.rest(pause_after(performance.now() - begun, least()), signal)
  }
}
// The pause after work of that duration, in milliseconds.
export function pause_after(took, least) {
  return Math.min(Math.max(least, PAUSE_FACTOR * took), LONGEST_PAUSE * least)
}
export function rest(milliseconds, signal) {
  return new Bell().rest(milliseconds, signal)
}
