// Copies of hulls in a page and in Node, for benchmarks/typescript.py, which gives the module with `HullCopy` and
// `orient2d` of robust-predicates.

/** Points of a circle with doubles whose last digits are random. @param {number} count */
function circle(count) {
  return Array.from({ length: count }, (_, i) => {
    const angle = (2 * Math.PI * (i + Math.random() / 2)) / count
    return [Math.cos(angle), Math.sin(angle)]
  })
}

/** @param {any[]} vertices @param {number} revision */
function snapshot(vertices, revision = 1) {
  const absent = { vertexKeys: null, center: null, measures: null, changed: null, error: null }
  return { type: "snapshot", revision: BigInt(revision), points: vertices.length, vertices, ...absent }
}

/** The median of the nanoseconds that something takes, of `rounds`. @param {number} rounds @param {number} each @param {() => void} run */
function nanoseconds(rounds, each, run) {
  const times = Array.from({ length: rounds }, () => {
    const begun = performance.now()
    run()
    return ((performance.now() - begun) * 1e6) / each
  })
  return times.sort((a, b) => a - b)[rounds >> 1]
}

/**
 * @param {any} HullCopy
 * @param {(ax: number, ay: number, bx: number, by: number, cx: number, cy: number) => number} orient2d
 * @param {{vertices: number, points: number, events: number}} sizes
 */
export function measured(HullCopy, orient2d, { vertices: count, points: asked, events }) {
  const around = circle(count)
  const least = around.reduce((best, each, row) => (each[0] < around[best][0] ? row : best), 0)
  const hull = [...around.slice(least), ...around.slice(0, least)]
  const copy = new HullCopy()
  copy.update(snapshot(hull))
  const near = Array.from({ length: asked }, (_, row) => {
    const [a, part] = [row % count, Math.random()]
    const [p, q] = [hull[a], hull[(a + 1) % count]]
    return [p[0] + (q[0] - p[0]) * part, p[1] + (q[1] - p[1]) * part]
  })
  const apart = near.map(() => [4 * Math.random() - 2, 4 * Math.random() - 2])
  const alone = (/** @type {number[][]} */ points) => () => {
    let sum = 0
    points.forEach(([x, y], row) => {
      const [[ax, ay], [bx, by]] = [hull[row % count], hull[(row + 1) % count]]
      sum += orient2d(ax, ay, bx, by, x, y)
    })
    return sum
  }
  const change = (/** @type {number} */ row, /** @type {number} */ revision) => ({
    type: "change", revision: BigInt(revision), points: count, removed: [hull[row]], removedRows: [row], rotation: 0,
    added: [[hull[row][0], hull[row][1]]], addedRows: [row], addedKeys: null, renamedRows: null, renamedKeys: null,
    measures: null, cause: "batch", clock: null, center: null, changed: null,
  })
  let revision = 1
  const apply = () => {
    for (let i = 0; i < events; i++) copy.update(change((i * 7919) % count, ++revision))
  }
  const applyAndAsk = () => {
    for (let i = 0; i < events; i++) {
      copy.update(change((i * 7919) % count, ++revision))
      copy.side(near[i % asked])
    }
  }
  const locate = (/** @type {number[][]} */ points) => nanoseconds(7, asked, () => copy.locate(points))
  return {
    locate: locate(apart),
    beside: locate(near),
    predicate: nanoseconds(7, asked, alone(apart)),
    predicateBeside: nanoseconds(7, asked, alone(near)),
    events: 1e9 / nanoseconds(5, events, apply),
    eventsAsked: 1e9 / nanoseconds(5, events, applyAndAsk),
  }
}
