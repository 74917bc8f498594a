// What the page shows, as a file: with the vertices that are drawn, of very many some.
export const SAVES = {PNG: save_picture, GeoJSON: save_shapes, CSV: save_vertices}
// The list of kinds below a button; Escape closes it, and the focus is where it was.
export class SaveMenu {
  // `save` is called with the kind that is chosen.
  constructor(button, list, save) {
    list.addEventListener("toggle", () => {
      const {left, bottom} = button.getBoundingClientRect()
      list.style.left = `${Math.max(0, Math.min(left, innerWidth - list.offsetWidth))}px`
      list.style.top = `${Math.max(0, Math.min(bottom, innerHeight - list.offsetHeight))}px`
    })
    for (const kind of list.children)
      kind.onclick = () => {
        list.hidePopover()
        save(kind.textContent)
      }
  }
}
// Without the tiles of a map, which are others' and which browsers do not give away.
function save_picture(picture, moment) {
  const {width, height} = picture.canvases[1], canvas = document.createElement("canvas"), context = canvas.getContext("2d")
  Object.assign(canvas, {width, height})
  picture.clear(context)
  context.fillStyle = picture.colours.paper
  context.fillRect(0, 0, width, height)
  if (picture.view.globe) picture.draw_globe(context, picture.view, "")
  else picture.draw_axes(context, picture.view)
  context.resetTransform()
  context.drawImage(picture.canvases[1], 0, 0)
  canvas.toBlob(content => download(content, `dynhull ${moment}.png`))
}
function save_shapes({hulls, many, fences}, moment) {
  const features = [
    ...[...hulls.values(), ...many.hulls].map(({name, vertices, corners, globe}) =>
      feature({hull: name, revision: vertices.revision}, globe ? vertices.rings.map(ring => [ring]) : corners?.length ? [[corners]] : [])),
    // Rings that are wound for the globe of the picture are the other way round.
    ...[...fences.values()].map(({name, area: {polygons, globe}}) =>
      feature({fence: name}, globe ? polygons.map(rings => rings.map(ring => [...ring].reverse())) : polygons)),
  ]
  save_text(JSON.stringify({type: "FeatureCollection", features}), "application/geo+json", `dynhull ${moment}.geojson`)
}
function feature(properties, polygons) {
  const [[[...ring] = []] = []] = polygons
  const geometry = ring.length == 1 ? {type: "Point", coordinates: ring[0]}
    : ring.length == 2 ? {type: "LineString", coordinates: ring}
    : polygons.length == 1 ? {type: "Polygon", coordinates: polygons[0].map(closed)}
    : {type: "MultiPolygon", coordinates: polygons.map(rings => rings.map(closed))}
  return {type: "Feature", properties, geometry}
}
function closed(ring) {
  return [...ring, ring[0]]
}
function save_vertices({hulls, many, view}, moment) {
  const rows = [...hulls.values(), ...many.hulls].flatMap(({name, vertices: {revision, keys, x, y}}) =>
    x.map((each, row) => [name, revision, keys?.[row] ?? "", each, y[row]]))
  const lines = [["hull", "revision", "key", ...view.globe ? ["longitude", "latitude"] : ["x", "y"]], ...rows]
  save_text(lines.map(cells => cells.map(quoted).join() + "\r\n").join(""), "text/csv", `dynhull ${moment}.csv`)
}
// A cell of CSV (RFC 4180).
function quoted(cell) {
  return /[",\r\n]/.test(cell) ? `"${cell.replaceAll('"', '""')}"` : cell
}
function save_text(text, type, name) {
  download(new Blob([text], {type}), name)
}
function download(content, name) {
  const link = document.createElement("a")
  link.href = URL.createObjectURL(content)
  link.download = name.replaceAll(":", "-")
  link.click()
  URL.revokeObjectURL(link.href)
}
