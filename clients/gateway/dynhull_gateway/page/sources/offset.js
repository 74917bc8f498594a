// The outline at a distance from polygons: their edges moved outwards, with arcs around the corners.
const ARC = Math.PI / 48, ALMOST = 1 - 1e-6
// Of each polygon the rings at the distance; a hole becomes narrower, or disappears. What is nearer to any of the polygons, as at
// corners that point inwards and where polygons overlap, is left out.
export function offset_rings(polygons, distance) {
  const edges = polygons.flat().flatMap(edges_of), least = distance * ALMOST
  const is_free = place => edges.every(edge => distance_to(place, edge) >= least)
  return polygons.map(rings => rings.map((ring, row) => {
    const moved = offset_ring((signed_area(ring) > 0) == (row == 0) ? ring : [...ring].reverse(), distance)
    return moved.filter(place => is_free(place) && !polygons.some(other => other != rings && is_inside(place, other)))
  }).filter(ring => ring.length > 2)).filter(rings => rings.length)
}
// A ring that has the area at its left, moved to its right.
function offset_ring(ring, distance) {
  const edges = edges_of(ring).filter(([[x, y], [x1, y1]]) => x != x1 || y != y1)
  const angles = edges.map(([[x, y], [x1, y1]]) => Math.atan2(y1 - y, x1 - x) - Math.PI / 2)
  return edges.flatMap(([start], row) => {
    const before = angles.at(row - 1), turn = wrapped(angles[row] - before)
    const at = angle => [start[0] + distance * Math.cos(angle), start[1] + distance * Math.sin(angle)]
    if (turn > 0) {
      const steps = Math.max(1, Math.ceil(turn / ARC))
      return Array.from({length: steps + 1}, (_, step) => at(before + turn * step / steps))
    }
    // Both lines meet there, if the corner is not too sharp.
    const half = before + turn / 2, far = distance / Math.max(Math.cos(turn / 2), 0.01)
    return [[start[0] + far * Math.cos(half), start[1] + far * Math.sin(half)]]
  })
}
function edges_of(ring) {
  return ring.map((place, row) => [place, ring[(row + 1) % ring.length]])
}
function wrapped(angle) {
  return angle - 2 * Math.PI * Math.round(angle / (2 * Math.PI))
}
function signed_area(ring) {
  return edges_of(ring).reduce((sum, [[x, y], [x1, y1]]) => sum + (x - ring[0][0]) * (y1 - ring[0][1]) - (x1 - ring[0][0]) * (y - ring[0][1]), 0)
}
function distance_to([x, y], [[x0, y0], [x1, y1]]) {
  const [across, up] = [x1 - x0, y1 - y0], size = across * across + up * up
  const along = size ? Math.max(0, Math.min(1, ((x - x0) * across + (y - y0) * up) / size)) : 0
  return Math.hypot(x - x0 - along * across, y - y0 - along * up)
}
function is_inside([x, y], rings) {
  return rings.flatMap(edges_of).reduce((inside, [[x0, y0], [x1, y1]]) =>
    (y0 > y) != (y1 > y) && x < x0 + (y - y0) / (y1 - y0) * (x1 - x0) ? !inside : inside, false)
}
