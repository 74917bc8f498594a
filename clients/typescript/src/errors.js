/**
 * What a server's answer, or the lack of one, says.
 *
 * @typedef {object} Said
 * @property {string} reason such as HULL_NOT_FOUND: for programs; UNREACHABLE if nobody answers, DEADLINE if not in time
 * @property {string} detail for people
 * @property {number} [status] the HTTP status; 0 without an answer
 * @property {string | null} [field] the field at fault
 * @property {number | bigint | null} [row] its row
 * @property {string | null} [value] the value at fault
 * @property {number | bigint | null} [expected] of SEQUENCE_GAP, the number that was expected
 * @property {number | bigint | null} [applied] rows that were applied before
 */

/** A request that was refused, or not answered. `reason` says why. */
export class DynhullError extends Error {
  /**
   * @param {Said} said
   * @param {unknown} [cause]
   */
  constructor(said, cause) {
    super(said.detail, cause === undefined ? undefined : { cause })
    this.name = "DynhullError"
    /** For programs. */
    this.reason = said.reason
    /** The HTTP status; 0 without an answer. */
    this.status = said.status ?? 0
    this.field = said.field ?? null
    this.row = said.row ?? null
    this.value = said.value ?? null
    this.expected = said.expected ?? null
    this.applied = said.applied ?? null
  }

  /** Whether the same request may be answered later, and has changed nothing. */
  get passing() {
    return NOT_BEGUN.has(this.reason)
  }

  /** Whether it is not known if the request was carried out: reads and numbered batches may be sent again. */
  get unknown() {
    return this.reason === "UNREACHABLE" || (UNDECIDED.has(this.status) && !this.passing)
  }
}

/**
 * What a request has that no server would take.
 * @param {string} field
 * @param {number | null} row
 * @param {unknown} value
 * @param {string} detail
 */
export function invalid(field, row, value, detail) {
  const shown = typeof value === "bigint" ? String(value) : JSON.stringify(value) ?? String(value)
  const place = row === null ? field : `${field}/${row}`
  return new DynhullError({ reason: "INVALID_FIELD", status: 400, field, row, value: shown, detail: `/${place}: ${detail}` })
}

const NOT_BEGUN = new Set(["DRAINING", "STARTING", "TOO_MANY_CALLS"])
// The gateway has no answer of the server, or a proxy none of the gateway.
const UNDECIDED = new Set([502, 503, 504])
