// The gateway's calls, each as a call of the contract: the client asks both in the same words.

import { DynhullError } from "../errors.js"
import * as answers from "./answers.js"
import * as requests from "./requests.js"
import { finites, keysOf, keysOrNull, moment, packKeys, packNumbers, packPoints, pointsOf, timesOf, timestamp } from "./values.js"

/**
 * @typedef {object} Asked
 * @property {string[]} names in the path
 * @property {any} query
 * @property {any} body
 * @property {string | undefined} key the Idempotency-Key
 * @property {(method: string, request: object) => Promise<any>} call
 * @property {(method: string, request: object) => Promise<any[]>} parts all answers of a stream
 *
 * @typedef {(asked: Asked) => Promise<any>} Route
 */

/** A question about a hull. @param {string} method @param {(body: any) => object} request @param {(answer: any, asked: Asked) => any} decode @returns {Route} */
const question = (method, request, decode) => async (asked) => {
  const { names: [name], query, body, call } = asked
  return decode(await call(method, { ...requests.reading(name, query), ...request(body) }), asked)
}

/** The hull that an answer has. @param {string} method @param {(asked: Asked) => object} request @returns {Route} */
const changed = (method, request) => async (asked) => {
  return answers.hullOf((await asked.call(method, { name: asked.names[0], ...request(asked) })).hull)
}

/** Nothing. @param {string} method @param {(names: string[], query: any) => object} request @returns {Route} */
const gone = (method, request) => async ({ names, query, call }) => void (await call(method, request(names, query)))

/** A page of a list. @param {string} method @param {string} rows @param {(row: any) => any} decode @param {string} [as] @returns {Route} */
const list = (method, rows, decode, as = rows) => async ({ query, call }) => {
  const page = await call(method, { prefix: query.prefix ?? "", pageToken: query.after ?? "" })
  return { [as]: page[rows].map(decode), next: page.nextPageToken || null }
}

/** What is created, or is there already with the same settings. @param {Asked} asked @param {() => Promise<any>} create @param {() => Promise<any>} existing */
async function created({ body }, create, existing) {
  try {
    return await create()
  } catch (error) {
    const there = error instanceof DynhullError && /_EXISTS$/.test(error.reason)
    const found = there && body.exist_ok ? await existing() : null
    if (found === null) throw error
    return found
  }
}

/** Whether two answers say the same. @param {object} left @param {object} right */
function same(left, right) {
  const text = (/** @type {object} */ value) => JSON.stringify(value, (_, each) => (typeof each === "bigint" ? String(each) : each))
  return text(left) === text(right)
}

/** @param {any[]} parts */
function joined(parts) {
  const times = parts.some((part) => part.times) ? parts.flatMap((part) => timesOf(part.times)) : null
  const accuracies = parts.some((part) => part.accuracies) ? parts.flatMap((part) => answers.numbersOf(part.accuracies) ?? []) : null
  const [keys, points] = [parts.flatMap((part) => keysOf(part.keys)), parts.flatMap((part) => pointsOf(part.positions))]
  return { revision: BigInt(parts[0]?.revision ?? 0), keys, points, times, accuracies }
}

/** @type {Record<string, Route>} */
const HULLS = {
  "GET /hulls": list("ListHulls", "hulls", answers.hullOf),
  "POST /hulls": (asked) => {
    const { body, call } = asked
    const config = requests.hullConfig(body)
    const create = async () => answers.hullOf((await call("CreateHull", { name: body.name, config })).hull)
    return created(asked, create, async () => {
      const { hull } = await call("GetHull", { name: body.name, view: "HULL_VIEW_BASIC" })
      const wanted = { keyed: body.keyed ?? null, ordering: body.ordering ?? "arrival", geographic: body.geographic ?? false, shards: body.shards ?? null }
      const { keyed, ordering, geographic, shards, window } = answers.settingsOf(hull.config)
      const windows = [window?.maxAge ?? null, window?.maxPoints ?? null, window?.maxSkew ?? null]
      const asWanted = same(windows, [body.max_age ?? null, body.max_points ?? null, body.max_skew ?? null])
      return asWanted && same({ keyed, ordering, geographic, shards }, wanted) ? answers.hullOf(hull) : null
    })
  },
  "DELETE /hulls/*": gone("DeleteHull", ([name]) => ({ name })),
  "POST /hulls/*/recenter": changed("Recenter", ({ body }) => ({ center: requests.center(body.center) })),
  "POST /hulls/*/reshard": changed("Reshard", ({ body }) => body),
  "PUT /hulls/*/quarantine": changed("SetQuarantine", ({ body }) => ({ quarantine: requests.rules(body) })),
  "PUT /hulls/*/history": changed("SetHistory", ({ body }) => ({ history: requests.history(body.history, body.history_bytes) })),
  "GET /hulls/*/history": async ({ names: [name], call }) => answers.historyOf(await call("GetHistory", { name })),
  "POST /hulls/*/history/erase": async ({ names: [name], body, call }) => {
    return answers.erasureOf((await call("EraseHistory", { name, keys: packKeys("keys", body.keys) })).erasure)
  },
  "GET /hulls/*/held": async ({ names: [name], query, call }) => {
    const page = await call("ListHeld", { ...requests.reading(name, query), pageToken: query.after ?? "" })
    return { held: answers.heldOf(page), next: page.nextPageToken || null }
  },
  "GET /hulls/*/producers/*": async ({ names: [name, producer], call }) => {
    return { lastSequence: BigInt((await call("GetProducer", { name, producer })).lastSequence) }
  },
  "POST /hulls/*/points": async ({ names: [name], query, body, key, call }) => {
    const request = { name, batch: requests.batch(body), ...requests.numbering(key, query) }
    return answers.appliedOf((await call("Apply", request)).result)
  },
  "POST /transfers": async ({ query, body, key, call }) => {
    const names = Object.keys(body.batches)
    const batches = names.map((name) => ({ name, batch: requests.batch(body.batches[name]) }))
    const { results } = await call("ApplyTogether", { batches, ...requests.numbering(key, query) })
    return { results: Object.fromEntries(names.map((name, row) => [name, answers.appliedOf(results[row])])) }
  },
}

const FULL = () => ({ view: "HULL_VIEW_FULL", includeKeys: true })
const POINTS = (/** @type {any} */ body) => ({ points: packPoints("points", body.points) })

/** @type {Record<string, Route>} */
const QUESTIONS = {
  "GET /hulls/*": question("GetHull", FULL, answers.wholeHullOf),
  "POST /hulls/*/locate": question("Locate", requests.aboutPoints, ({ revision, sides, keysRevision }, { body }) => ({
    revision: BigInt(revision),
    sides: [...new Int8Array(sides)],
    keysRevision: body.keys_of ? BigInt(keysRevision) : null,
  })),
  "POST /hulls/*/distance": question("Distance", requests.aboutPoints, ({ revision, distances, keysRevision }, { body }) => ({
    revision: BigInt(revision),
    distances: finites(distances),
    keysRevision: body.keys_of ? BigInt(keysRevision) : null,
  })),
  "POST /hulls/*/count": question("Count", POINTS, ({ revision, counts }) => ({ revision: BigInt(revision), counts: counts.map(Number) })),
  "POST /hulls/*/support": question(
    "Support",
    ({ directions, keys }) => ({ directions: packPoints("directions", directions), includeKeys: keys }),
    ({ revision, vertices, keys }, { body }) => ({
      revision: BigInt(revision),
      vertices: pointsOf(vertices),
      keys: keysOrNull(keys, body.keys),
    }),
  ),
  "POST /hulls/*/tangents": question("Tangents", POINTS, ({ revision, left, right }) => ({
    revision: BigInt(revision),
    tangents: answers.pairsOf(left, right),
  })),
  "POST /hulls/*/intersect-lines": question(
    "IntersectLines",
    ({ origins, targets }) => ({ origins: packPoints("origins", origins), targets: packPoints("targets", targets) }),
    ({ revision, entries, exits }) => ({ revision: BigInt(revision), crossings: answers.pairsOf(entries, exits) }),
  ),
  "POST /hulls/*/positions": question(
    "GetPositions",
    ({ keys }) => ({ keys: packKeys("keys", keys) }),
    ({ revision, positions, present, times, accuracies }) => ({
      revision: BigInt(revision),
      positions: pointsOf(positions),
      present: [...present].map(Boolean),
      times: times && timesOf(times),
      accuracies: answers.numbersOf(accuracies),
    }),
  ),
  "GET /hulls/*/entities": async ({ names: [name], query, parts }) => joined(await parts("ReadEntities", requests.reading(name, query))),
  "GET /hulls/*/sample": async ({ names: [name], query, call }) => {
    const request = { ...requests.reading(name, query), sampleSize: query.size ?? 1000 }
    const { revision, points, keys } = await call("SamplePoints", request)
    return { revision: BigInt(revision), points: pointsOf(points), keys: keysOrNull(keys, query.keys) }
  },
  "GET /hulls/*/layers": async ({ names: [name], query, call }) => {
    const { revision, vertexCounts, vertices, vertexKeys } = await call("GetLayers", { ...requests.reading(name, query), layerCount: query.count })
    const [points, keys] = [pointsOf(vertices), keysOrNull(vertexKeys, query.keys)]
    let end = 0
    const ranges = vertexCounts.map((/** @type {number} */ count) => [end, (end += count)])
    const cut = (/** @type {any[]} */ rows) => ranges.map((/** @type {number[]} */ range) => rows.slice(...range))
    return { revision: BigInt(revision), layers: cut(points), keys: keys && cut(keys) }
  },
  "GET /hulls/*/influence": async ({ names: [name], query, call }) => {
    const { revision, vertices, areas, vertexKeys } = await call("GetInfluence", requests.reading(name, query))
    return { revision: BigInt(revision), vertices: pointsOf(vertices), areas: finites(areas), keys: keysOrNull(vertexKeys, query.keys) }
  },
  "GET /hulls/*/measures": question("GetMeasures", () => ({}), answers.allMeasuresOf),
  "GET /hulls/*/verification": question("Verify", () => ({}), answers.verificationOf),
  "GET /hulls/*/series": async ({ names: [name], query, call }) => {
    return answers.seriesOf(await call("GetSeries", { name, last: requests.duration(query.last, "last") }))
  },
  "GET /hulls/*/separation": async ({ names: [name], query, call }) => {
    const { other: otherName, min_revision = 0, other_min_revision = 0 } = query
    const revisions = { minRevision: String(min_revision), otherMinRevision: String(other_min_revision) }
    return answers.separationOf(await call("Separate", { name, otherName, ...revisions }))
  },
  "POST /hulls/*/phase-diagram": question(
    "PhaseDiagram",
    ({ entries }) => ({ entries: packPoints("entries", entries) }),
    ({ revision, stable, energiesAboveHull, left, right, leftShares, rightShares }) => ({
      revision: BigInt(revision),
      stable: pointsOf(stable),
      energiesAboveHull: finites(energiesAboveHull),
      phases: answers.pairsOf(left, right),
      shares: leftShares.map((/** @type {number} */ share, /** @type {number} */ row) => finites([share, rightShares[row]])),
    }),
  ),
  "POST /hulls/*/frontier": question(
    "Frontier",
    ({ points, rates }) => ({ points: packPoints("points", points), rates: packNumbers("rates", rates)?.values }),
    ({ revision, efficient, turningRates, dominated, tangencies, sharpeRatios }) => ({
      revision: BigInt(revision),
      efficient: pointsOf(efficient),
      turningRates: finites(turningRates),
      dominated,
      tangencies: pointsOf(tangencies),
      sharpeRatios: finites(sharpeRatios),
    }),
  ),
  "GET /hulls/*/tracks": tracks,
}

/** @type {Route} */
async function tracks({ names: [name], query, call, parts }) {
  const { keyed } = answers.hullOf((await call("GetHull", { name, view: "HULL_VIEW_BASIC" })).hull)
  const keys = /** @type {string[]} */ (query.key).map((key) => (keyed === "int" ? BigInt(key) : key))
  const range = { ...moment("start", query.from, "from"), ...moment("end", query.to, "to") }
  const request = { name, ...range, keys: packKeys("key", keys), every: requests.duration(query.every, "every") }
  /** @type {Map<string | bigint, {times: any[], points: any[], revisions: bigint[], eventTimes: any[] | null}>} */
  const found = new Map()
  for (const part of await parts("Track", request)) {
    const [times, points, eventTimes] = [timesOf(part.times), pointsOf(part.positions), part.eventTimes && timesOf(part.eventTimes)]
    part.keyIndices.forEach((/** @type {number} */ index, /** @type {number} */ row) => {
      const way = found.get(keys[index]) ?? /** @type {any} */ ({ times: [], points: [], revisions: [], eventTimes: eventTimes && [] })
      found.set(keys[index], way)
      way.times.push(times[row])
      way.points.push(points[row])
      way.revisions.push(BigInt(part.revisions[row]))
      way.eventTimes?.push(eventTimes?.[row])
    })
  }
  return { tracks: [...found].map(([key, way]) => ({ key, ...way })) }
}

/** @type {Record<string, Route>} */
const FENCES = {
  "GET /feed/consumers": list("ListFeedConsumers", "consumers", answers.feedConsumerOf),
  "PUT /hulls/*/feed/consumers/*": async ({ names: [name, consumer], body, call }) => {
    const request = { name, consumer, revision: String(body.revision), uid: body.uid }
    return answers.feedConsumerOf((await call("AckFeed", request)).consumer)
  },
  "PUT /feed/consumers/*": async ({ names: [consumer], query, body, call }) => {
    const request = { prefix: query.prefix, consumer, position: Buffer.from(body.position, "hex") }
    return answers.feedConsumerOf((await call("AckFeed", request)).consumer)
  },
  "DELETE /hulls/*/feed/consumers/*": gone("DeleteFeedConsumer", ([name, consumer]) => ({ name, consumer })),
  "DELETE /feed/consumers/*": gone("DeleteFeedConsumer", ([consumer], { prefix }) => ({ prefix, consumer })),
  "GET /fences": list("ListFences", "fences", answers.fenceOf),
  "POST /fences": (asked) => {
    const { body, call } = asked
    const config = requests.fenceConfig(body)
    const create = async () => answers.fenceOf((await call("CreateFence", { name: body.name, config })).fence)
    return created(asked, create, async () => {
      const { fence } = await call("GetFence", { name: body.name })
      const has = answers.fenceSettingsOf(fence.config)
      return same(has, { ...has, ...given(body) }) ? answers.fenceOf(fence) : null
    })
  },
  "PUT /fences/*": async ({ names: [name], body, call }) => {
    return answers.fenceOf((await call("ReplaceFence", { name, config: requests.fenceConfig(body) })).fence)
  },
  "GET /fences/*": async ({ names: [name], call }) => answers.fenceOf((await call("GetFence", { name })).fence),
  "DELETE /fences/*": gone("DeleteFence", ([name]) => ({ name })),
  "GET /fences/*/inside": async ({ names: [name], parts }) => {
    const all = await parts("ReadInside", { name })
    return { sequence: BigInt(all[0]?.sequence ?? 0), subjects: all.flatMap((part) => part.subjects.map(answers.subjectsOf)) }
  },
  "PUT /fences/*/consumers/*": async ({ names: [name, consumer], body, call }) => {
    const request = { name, consumer, sequence: String(body.sequence), uid: body.uid }
    return answers.consumerOf((await call("AckFence", request)).consumer)
  },
  "DELETE /fences/*/consumers/*": gone("DeleteConsumer", ([name, consumer]) => ({ name, consumer })),
}

/** The settings in a body, by their names in answers. @param {any} body */
function given({ name: _, exist_ok: __, ...body }) {
  const camel = (/** @type {string} */ each) => each.replace(/_([a-z])/g, (_, letter) => letter.toUpperCase())
  return Object.fromEntries(Object.entries(body).map(([field, value]) => [camel(field), value]))
}

/** @type {Record<string, Route>} */
const ALARMS = {
  "GET /alarms": list("ListAlarms", "alarms", (alarm) => answers.alarmOf(alarm)),
  "POST /alarms": async ({ body, call }) => answers.alarmOf((await call("CreateAlarm", { name: body.name, rule: requests.alarmRule(body) })).alarm),
  "GET /alarms/*": async ({ names: [name], call }) => {
    const { alarm, statuses } = await call("GetAlarm", { name })
    return answers.alarmOf(alarm, statuses)
  },
  "DELETE /alarms/*": gone("DeleteAlarm", ([name]) => ({ name })),
  "POST /alarms/*/acknowledge": async ({ names: [name], body, call }) => {
    return answers.statusOf((await call("AcknowledgeAlarm", { name, hull: body.hull })).status)
  },
  "POST /alarms/*/mute": async ({ names: [name], body, call }) => {
    return answers.statusOf((await call("MuteAlarm", { name, hull: body.hull, muteTime: timestamp(body.until, "until") })).status)
  },
  "PUT /alarms/*/consumers/*": async ({ names: [name, consumer], body, call }) => {
    const request = { name, consumer, sequence: String(body.sequence), uid: body.uid }
    return answers.consumerOf((await call("AckAlarm", request)).consumer)
  },
  "DELETE /alarms/*/consumers/*": gone("DeleteAlarmConsumer", ([name, consumer]) => ({ name, consumer })),
}

const ROUTES = Object.entries({ ...HULLS, ...QUESTIONS, ...FENCES, ...ALARMS }).map(([words, route]) => {
  const [method, path] = words.split(" ")
  return { method, pattern: new RegExp(`^${path.replaceAll("*", "([^/]+)")}$`), route }
})

/**
 * The route of a call of the gateway, and the names in its path.
 * @param {string} method
 * @param {string} path
 * @returns {{route: Route, names: string[]}}
 */
export function routed(method, path) {
  for (const { method: own, pattern, route } of ROUTES) {
    const found = own === method ? pattern.exec(path) : null
    if (found) return { route, names: found.slice(1).map(decodeURIComponent) }
  }
  throw new RangeError(`no call of the contract is ${method} ${path}`)
}
