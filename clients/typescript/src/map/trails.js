// Where keys have been within the last minute.
/**
 * @typedef {import("./views.js").Point} Point
 * @typedef {[number, number, number][]} Trail moments, with x and y
 */
export const RECORDED_MILLISECONDS = 5 * 60_000, TRAIL_MILLISECONDS = 60_000, TRAIL_STEP = 1000, TRAIL_ALPHA = 0.45, MOST_TRAILS = 2_000
export class Trails {
  /** The trails of the keys of each hull. @type {Map<string, Map<string, Trail>>} */
  hulls = new Map()
  shown = false  // of all keys; the one that is looked for always has its trail
  /**
   * A drawing of a hull that arrived at a moment. Positions are kept as long as the recording goes back.
   * @param {import("./hulls.js").Drawing & {kind: string, hull: string}} drawing
   * @param {number} at
   */
  take({kind, hull, keys, x, y}, at) {
    if (!keys) return
    const known = this.hulls.get(hull) ?? new Map()
    this.hulls.set(hull, known)
    keys.forEach((key, row) => {
      const trail = known.get(key) ?? []
      known.set(key, trail)
      const last = trail.at(-1)
      if (last && (at - last[0] < TRAIL_STEP || last[1] == x[row] && last[2] == y[row])) return
      trail.push([at, x[row], y[row]])
      while (trail[0][0] < at - RECORDED_MILLISECONDS - TRAIL_MILLISECONDS) trail.shift()
    })
    if (kind == "points" && known.size > 2 * MOST_TRAILS) this.thin(known, at)
  }
  /** Keys that have not been seen for longer than the recording go. @param {Map<string, Trail>} known @param {number} at */
  thin(known, at) {
    for (const [key, trail] of known) if (trail[trail.length - 1][0] < at - RECORDED_MILLISECONDS) known.delete(key)
    for (const key of [...known.keys()].slice(0, Math.max(0, known.size - 2 * MOST_TRAILS))) known.delete(key)
  }
  /** @param {string[]} names */
  keep(names) {
    for (const name of this.hulls.keys()) if (!names.includes(name)) this.hulls.delete(name)
  }
  /** @param {CanvasRenderingContext2D} canvas @param {import("./picture.js").Picture} picture */
  draw(canvas, {view, hulls, sought, now}) {
    const until = now()
    canvas.globalAlpha = TRAIL_ALPHA
    canvas.lineWidth = 1.5
    for (const [name, trails] of this.hulls) {
      const hull = hulls.get(name)
      if (!hull || view.globe && !hull.globe) continue
      canvas.beginPath()
      for (const key of this.shown ? trails.keys() : [sought]) {
        const here = hull.place_of(key), trail = trails.get(key)
        if (here && trail) trace_back(canvas, view, here, trail, until)
      }
      canvas.strokeStyle = hull.look.colour
      canvas.stroke()
    }
    canvas.globalAlpha = 1
  }
}
/**
 * From where the key is to where it was a minute before.
 * @param {CanvasRenderingContext2D} canvas
 * @param {import("./views.js").View} view
 * @param {Point} here
 * @param {Trail} trail
 * @param {number} until
 */
export function trace_back(canvas, view, here, trail, until) {
  let place = view.place(...here), pen = !isNaN(place[0])
  canvas.moveTo(...place)
  for (let row = trail.length - 1; row >= 0 && trail[row][0] > until - TRAIL_MILLISECONDS; row--) {
    if (trail[row][0] > until) continue
    place = view.place(trail[row][1], trail[row][2])
    if (pen) canvas.lineTo(...place)
    else canvas.moveTo(...place)
    pen = !isNaN(place[0])
  }
}
