import { Reads } from "./reads.js"

/**
 * @template {keyof Reads} M
 * @typedef {Reads[M] extends (name: string, ...rest: infer R) => infer A ? (...rest: R) => A : never} WithoutName
 */

/**
 * A hull as it was at one revision: the reading methods of Client, without the name.
 *
 * @typedef {{info: import("./client.js").HullInfo, revision: bigint} & {[M in keyof Reads]: WithoutName<M>}} Past
 */

/**
 * @param {string} name
 * @param {import("./client.js").HullInfo} info the hull at that revision
 * @param {(what: string, call: import("./connection.js").Call) => Promise<any>} ask
 * @returns {Past}
 */
export function pastOf(name, info, ask) {
  const reads = new Reads((_, what, call) => ask(what, { ...call, query: { ...call.query, at: info.revision, at_uid: info.uid } }))
  const methods = Object.getOwnPropertyNames(Reads.prototype).filter((method) => method !== "constructor")
  const bound = methods.map((method) => {
    const read = /** @type {any} */ (reads)[method]
    return [method, (/** @type {any[]} */ ...rest) => read.call(reads, name, ...rest)]
  })
  return { info, revision: info.revision, ...Object.fromEntries(bound) }
}
