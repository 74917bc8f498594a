// A map of another server: square pictures in the Web Mercator projection, bent into the view of the globe in pieces.
/**
 * @typedef {import("./views.js").GlobeView} GlobeView
 * @typedef {[number, number, number]} Tile its zoom, column and row
 */
import { RADIAN, unit_vector } from "./views.js"
export const TILE_PIXELS = 256, MOST_TILES = 300, MOST_KEPT_TILES = 600, FEWEST_ZOOM = 2, MOST_PIECES = 16, OVERLAP_PIXELS = 0.6
export const TILE_RETRY_MILLISECONDS = 10_000
export class Tiles {
  /** By URL, the last used at the end. @type {Map<string, HTMLImageElement>} */
  pictures = new Map()
  failed = false  // whether the last picture could not be loaded
  /**
   * @param {{url: string, largest_zoom: number}} source `url` has {z}, {x} and {y}; without one there are no tiles
   * @param {() => void} changed called when a picture has come or cannot come
   */
  constructor({url, largest_zoom}, changed) {
    this.url = url
    this.largest_zoom = largest_zoom
    this.changed = changed
  }
  /** While the view moves no picture is requested. @param {CanvasRenderingContext2D} canvas @param {GlobeView} view @param {boolean} moving */
  draw(canvas, view, moving) {
    /** @type {Tile[]} */
    const wanted = []
    this.choose(view, [0, 0, 0], wanted)
    for (const tile of wanted) this.draw_tile(canvas, view, tile, !moving)
    for (const url of this.pictures.keys()) {
      if (this.pictures.size <= MOST_KEPT_TILES) break
      this.pictures.delete(url)
    }
  }
  /**
   * Adds the tiles in sight below a tile: the largest that have a pixel or more for each on the screen.
   * @param {GlobeView} view
   * @param {Tile} tile
   * @param {Tile[]} wanted
   */
  choose(view, [zoom, column, row], wanted) {
    const middle = tile_place(zoom, column + 0.5, row + 0.5), vector = unit_vector(...middle)
    if (zoom >= FEWEST_ZOOM) {
      const corners = QUARTERS.map(([across, down]) => unit_vector(...tile_place(zoom, column + across, row + down)))
      const reach = Math.max(...corners.map(corner => Math.hypot(...corner.map((each, axis) => each - vector[axis]))))
      if (!view.sees(vector, reach)) return
    }
    const width = tile_angle(zoom) * Math.cos(middle[1] * RADIAN) * view.scale
    const large = width > TILE_PIXELS * Math.SQRT2 && zoom < this.largest_zoom && wanted.length < MOST_TILES
    if (!large && zoom >= FEWEST_ZOOM) return void wanted.push([zoom, column, row])
    for (const [across, down] of QUARTERS) this.choose(view, [zoom + 1, 2 * column + across, 2 * row + down], wanted)
  }
  /** The picture of a tile, which is requested if it is not there; undefined until it has come. @param {Tile} tile @param {boolean} request */
  picture([zoom, column, row], request) {
    const url = this.url.replace("{z}", String(zoom)).replace("{x}", String(column)).replace("{y}", String(row))
    const known = this.pictures.get(url)
    if (known) this.pictures.delete(url)
    else if (!request) return
    const image = known ?? this.requested(url)
    this.pictures.set(url, image)
    return image.naturalWidth ? image : undefined
  }
  /** @param {string} url */
  requested(url) {
    const image = new Image()
    image.onload = () => this.settle(false)
    image.onerror = () => {
      this.settle(true)
      setTimeout(() => {
        if (this.pictures.get(url) == image) this.pictures.delete(url)
        this.changed()
      }, TILE_RETRY_MILLISECONDS)
    }
    image.src = url
    return image
  }
  /** @param {boolean} failed */
  settle(failed) {
    this.failed = failed
    this.changed()
  }
  /**
   * A tile, or until it has come its part of a larger one.
   * @param {CanvasRenderingContext2D} canvas
   * @param {GlobeView} view
   * @param {Tile} tile
   * @param {boolean} request
   */
  draw_tile(canvas, view, tile, request) {
    let image = this.picture(tile, request), [zoom, column, row] = tile, source = [0, 0, 1]
    while (!image && zoom > 0) {
      source = [(source[0] + column % 2) / 2, (source[1] + row % 2) / 2, source[2] / 2]
      zoom--
      column = Math.floor(column / 2)
      row = Math.floor(row / 2)
      image = this.picture([zoom, column, row], false)
    }
    if (image) bend(canvas, view, tile, image, source)
  }
}
export const QUARTERS = [[0, 0], [1, 0], [0, 1], [1, 1]]
/** The width of a tile at the equator, in radians. @param {number} zoom */
export function tile_angle(zoom) {
  return 2 * Math.PI / 2 ** zoom
}
/** @param {number} zoom @param {number} across @param {number} down @returns {[number, number]} */
export function tile_place(zoom, across, down) {
  const angle = tile_angle(zoom)
  return [(across * angle - Math.PI) / RADIAN, Math.atan(Math.sinh(Math.PI - down * angle)) / RADIAN]
}
/**
 * Draws part of a picture, a square, where a tile is: as parallelograms which are less than a pixel off.
 * @param {CanvasRenderingContext2D} canvas
 * @param {GlobeView} view
 * @param {Tile} tile
 * @param {HTMLImageElement} image
 * @param {number[]} part left, top and size, of the picture's size
 */
export function bend(canvas, view, [zoom, column, row], image, [left, top, size]) {
  const off = view.scale * tile_angle(zoom) ** 2 / 4, pieces = Math.max(1, Math.min(MOST_PIECES, Math.ceil(Math.sqrt(off))))
  const place = (/** @type {number} */ i, /** @type {number} */ j) => view.place(...tile_place(zoom, column + i / pieces, row + j / pieces))
  const grid = Array.from({length: pieces + 1}, (_, j) => Array.from({length: pieces + 1}, (_, i) => place(i, j)))
  const width = size * image.naturalWidth / pieces, height = size * image.naturalHeight / pieces
  for (let j = 0; j < pieces; j++)
    for (let i = 0; i < pieces; i++) {
      const [[x, y], [x1, y1], [x2, y2], [x3, y3]] = [grid[j][i], grid[j][i + 1], grid[j + 1][i], grid[j + 1][i + 1]]
      const right = [(x1 - x + x3 - x2) / 2, (y1 - y + y3 - y2) / 2], down = [(x2 - x + x3 - x1) / 2, (y2 - y + y3 - y1) / 2]
      const middle = [(x + x1 + x2 + x3) / 4, (y + y1 + y2 + y3) / 4]
      if (isNaN(middle[0])) continue  // partly on the other side
      // Neighbours overlap a little: otherwise their smooth edges would leave lines.
      const more = [right, down].map(side => OVERLAP_PIXELS / Math.max(1, Math.hypot(...side)))
      canvas.save()
      canvas.transform(right[0], right[1], down[0], down[1], middle[0], middle[1])
      canvas.drawImage(image, left * image.naturalWidth + i * width, top * image.naturalHeight + j * height, width, height,
        -0.5 - more[0], -0.5 - more[1], 1 + 2 * more[0], 1 + 2 * more[1])
      canvas.restore()
    }
}
