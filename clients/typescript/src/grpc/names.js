// Fields of the contract under the names that they have in calls of this package.

/** @type {Record<string, string>} */
const FIELDS = {
  "batch.inserts": "insert",
  "batch.insert_times": "times",
  "batch.deletes": "delete",
  "batch.moves.origins": "move/origins",
  "batch.moves.destinations": "move/destinations",
  "batch.puts.keys": "keys",
  "batch.puts.points": "points",
  "batch.puts.times": "times",
  "batch.puts.ttl": "ttl",
  "batch.puts.expire_times": "expire_times",
  "batch.puts.accuracies": "accuracies",
  "batch.removes": "remove",
  "batch.releases": "release",
  "batch.drops": "drop",
  "config.identity": "keyed",
  "config.max_points": "point_limit",
  "config.frame": "geographic",
  "config.subject_hull": "subjects",
  "config.near_distance": "near",
  "config.report_crosses": "crosses",
  "config.hull_area.without_self": "without_self",
  "config.hull_area.layer": "layer",
  "rule.hold": "for",
  layer_count: "count",
  sample_size: "size",
}
const IN_SEVERAL = /^batches\[(\d+)\]\.(batch\..*)$/
const AREA = /^config\.(?:hull|circle|polygon)_area(.*)$/
const SETTING = /^(?:config\.window|config|rule)\.(.*)$/
/** Of other rows, in what an error says. */
const OTHER = /\b(?:batch\.)?((?:puts|moves)\.\w+|inserts|deletes|removes|releases|drops) row (\d+)/g

/**
 * The name of a field in calls: its parts with slashes between.
 * @param {string} field
 * @returns {string}
 */
export function named(field) {
  if (Object.hasOwn(FIELDS, field)) return FIELDS[field]
  const several = IN_SEVERAL.exec(field)
  if (several) return `batches/${several[1]}/${named(several[2])}`
  const area = AREA.exec(field)
  if (area) return slashes(`area${area[1].replace(/^\.polygons\[0\]/, "")}`)
  return slashes(SETTING.exec(field)?.[1] ?? field)
}

/** @param {string} field */
function slashes(field) {
  return field.replace(/\[(\d+)\]/g, "/$1").replaceAll(".", "/")
}

/**
 * What an error says, with these names.
 * @param {string} detail
 * @param {{field?: string, row?: string, value?: string}} about
 */
export function retold(detail, { field, row, value = "" }) {
  const plain = detail.replace(OTHER, (_, other, place) => `/${named(`batch.${other}`)}/${place}`)
  if (!field) return plain
  const place = row === undefined ? field : `${field}[${row}]`
  const begins = [`${place} is ${value}: `, `${place} is '${value}': `].find((each) => plain.startsWith(each))
  return begins ? `/${named(field)}${row === undefined ? "" : `/${row}`}: ${plain.slice(begins.length)}` : plain
}
