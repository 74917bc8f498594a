// What a map follows: each of these runs until its signal is aborted, and tells what there is to draw.

import { pause } from "../connection.js"
import { DynhullError } from "../errors.js"
import { HullCopy } from "../hull-copy.js"
import { areaMessage, insideMessage, outlineMessage } from "./messages.js"

/**
 * @typedef {import("../client.js").Client} Client
 * @typedef {import("../hull-copy.js").Key} Key
 *
 * @typedef {object} Shown what a map does with what comes
 * @property {(message: object) => void} draw
 * @property {(alarm: string, hulls: Map<string, number | null>) => void} raised for which hulls an alarm is raised, with the measures
 * @property {(kind: string, event: object) => void} tell
 * @property {(lost: boolean) => void} onLost
 */

/** Of one of many hulls. */
const MOST_VERTICES = 64
const MOST_MARKS = 500
const READ_SECONDS = 1

/**
 * @param {Client} client @param {string} name @param {Shown} shown @param {AbortSignal} signal
 * @param {boolean} [keys] whether the vertices have names
 * @returns {Promise<void>}
 */
export async function followHull(client, name, shown, signal, keys = true) {
  const copy = new HullCopy()
  try {
    for await (const event of client.watch(name, { copy, keys, signal, onLost: shown.onLost })) {
      const { revision, vertices, vertexKeys, center } = copy
      if (event.type !== "progress") shown.draw(outlineMessage(name, revision, vertices, vertexKeys, center !== null))
      shown.tell("hull", { hull: name, ...event })
    }
  } catch (error) {
    if (!keys || !(error instanceof DynhullError) || error.reason !== "HULL_UNSUITABLE") throw error
    await followHull(client, name, shown, signal, false)
  }
}

/** @param {Client} client @param {string} prefix @param {Shown} shown @param {AbortSignal} signal */
export async function followPrefix(client, prefix, { draw, tell, onLost }, signal) {
  const known = new Set()
  let unseen = new Set()
  const drop = (/** @type {string} */ hull) => {
    known.delete(hull)
    draw({ kind: "outline", within: prefix, hull, gone: true, x: [] })
  }
  for await (const event of client.watchMany(prefix, { outlines: true, maxVertices: MOST_VERTICES, signal, onLost })) {
    if (event.type === "begin") unseen = new Set(known)
    for (const { hull, revision, vertices, geographic } of event.hulls) {
      known.add(hull)
      unseen.delete(hull)
      draw({ ...outlineMessage(hull, revision, vertices ?? [], null, geographic), kind: "outline", within: prefix })
    }
    for (const hull of event.unchanged) unseen.delete(hull)
    for (const hull of [...event.gone, ...(event.type === "complete" ? unseen : [])]) drop(hull)
    tell("prefix", { prefix, ...event })
  }
}

/** @param {Client} client @param {string} name @param {Shown} shown @param {AbortSignal} signal */
export async function followFence(client, name, { draw, tell, onLost }, signal) {
  const fence = await client.getFence(name, { signal })
  draw(areaMessage(fence, await isOnGlobe(client, fence, signal)))
  const marking = mark(client, fence, draw, signal)
  for await (const event of client.watchFence(name, { after: fence.lastSequence, signal, onLost })) tell("fence", event)
  await marking
}

/**
 * The subjects inside, where they are. Their moves are no events of the fence, so they are read.
 * @param {Client} client @param {import("../client.js").Fence} fence @param {Shown["draw"]} draw @param {AbortSignal} signal
 */
async function mark(client, fence, draw, signal) {
  while (!signal.aborted && !fence.otherHull) {
    try {
      draw(insideMessage(fence.name, await marksOf(client, fence.name, signal)))
    } catch (error) {
      if (!(error instanceof DynhullError)) return
    }
    await pause(READ_SECONDS, signal).catch(() => {})
  }
}

/** @param {Client} client @param {string} name @param {AbortSignal} signal */
async function marksOf(client, name, signal) {
  const { subjects } = await client.fenceInside(name, { signal })
  const marks = []
  for (const { hull, keys } of subjects) {
    const some = keys.slice(0, MOST_MARKS - marks.length)
    if (!some.length) break
    const { positions } = await client.positions(hull, some, { signal })
    for (const [row, [x, y]] of positions.entries()) {
      if (x !== null && y !== null) marks.push({ hull, key: some[row], place: /** @type {const} */ ([x, y]) })
    }
  }
  return marks
}

/** @param {Client} client @param {string} name @param {Shown} shown @param {AbortSignal} signal @returns {Promise<void>} */
export async function followAlarm(client, name, shown, signal) {
  const { raised, tell, onLost } = shown
  const alarm = await client.getAlarm(name, { signal })
  const there = alarm.statuses.filter((status) => status.raised)
  let hulls = new Map(there.map((status) => [status.hull, status.value]))
  raised(name, hulls)
  for await (const event of client.watchAlarm(name, { after: alarm.lastSequence, signal, onLost })) {
    if (event.type === "raised") hulls.set(event.hull, event.value)
    else if (event.type === "cleared") hulls.delete(event.hull)
    else if (event.type === "closed") hulls.clear()
    else if (event.type === "snapshot") hulls = new Map(event.raised.map((hull) => [hull, null]))
    tell("alarm", event)
    raised(name, hulls)
    if (event.type === "lost" || event.type === "replaced") return followAlarm(client, name, shown, signal)
  }
}

/** @param {Client} client @param {import("../client.js").Fence} fence @param {AbortSignal} signal */
async function isOnGlobe(client, fence, signal) {
  const name = fence.subjects ?? fence.subjectPrefix ?? fence.otherHull ?? ""
  for await (const hull of client.listHulls(name, { signal })) return hull.geographic
  return false
}
