// What the page says, and advises, where a hull, a fence or the server cannot be shown.
const TOO_OLD = "This server has no fences: it is older than they are. Update it with pip install --upgrade dynhull"
export const SILENCE = "The dashboard does not answer. Check that dynhull dashboard still runs. The page shows what it last "
  + "received, and reconnects by itself."
const is_missing = error => error?.status == 404, is_invalid = error => error?.status == 400 || error?.status == 422
const is_unknown = error => is_missing(error) || is_invalid(error)
const is_unsupported = error => error?.status == 501
export const is_unauthenticated = error => error?.status == 401
// For the banner: why the server does not answer, and what to do.
export function about_server(address, error) {
  const cause = error.message.replace(/\.+$/, "")
  if (error.reason == "UNREACHABLE" && !error.status) return SILENCE
  if (is_unauthenticated(error)) return `${address} refuses the dashboard: ${cause}. Start the dashboard with a --token that the server knows, or give one here.`
  if (error.status == 403) return `${address} refuses the dashboard: ${cause}. Start the dashboard with a --token that may read.`
  return `No connection to ${address}: ${cause}. Check that the server runs (dynhull serve) and that the `
    + "dashboard's --address names it. The page shows what it last received, and reconnects by itself."
}
// For the banner: why the time lines of the whole server are empty, and what to do; empty where they are not.
export function about_metrics(metrics) {
  return metrics?.error == null ? "" : `No metrics from ${metrics.url}: ${metrics.error}. Check that the server runs with `
    + "--metrics-port, and that the dashboard's --metrics has that port."
}
// For the table: why a hull cannot be followed, and what to do; empty where it can.
export function about_hull({trouble, followed}) {
  if (!trouble) return followed ? "" : "Waiting for the first event"
  if (is_missing(trouble)) return "No such hull. Check the name, or create the hull: it appears here by itself"
  return trouble.status == 403 ? `${trouble.message}. Start the dashboard with a --token that may read this hull` : trouble.message
}
// For the table: why a hull cannot be shown as it was, or not all of it; empty where all can be.
export function about_past({waits_for, failure, followed, kept, revision}) {
  if (waits_for != undefined) return "Its past begins later"
  if (failure?.status == 403) return `${failure.message}. Start the dashboard with a --token that may read its past`
  if (failure) return failure.message
  if (!followed) return "Reading the past"
  const erasure = kept.erased(revision)
  return erasure ? `Keys were erased from this past on ${new Date(Number(erasure.time) / 1000).toISOString().slice(0, 10)} (UTC)` : ""
}
// For the table: why a fence cannot be followed, and what to do; empty where it can.
export function about_fence({trouble, fence, deleted}) {
  if (!trouble) return fence ? "" : "Waiting for the server"
  if (is_missing(trouble) && deleted) return "Deleted. Remove it above, or create it again: it appears here by itself"
  if (is_unknown(trouble)) return "No such fence. Check the name, or create the fence: it appears here by itself"
  if (trouble.status == 403) return `${trouble.message}. Start the dashboard with a --token that may read this fence`
  return is_unsupported(trouble) ? TOO_OLD : trouble.message
}
// Below the tables: why there are no fences to pick, and what to do; empty where there are.
export function about_fences(address, {error, listed, by_name, prefix}, shown) {
  if (error) return is_unsupported(error) && !shown ? `${TOO_OLD}.` : ""
  if (!listed || by_name.size || shown) return ""
  const begin = prefix ? ` whose names begin with ${prefix}` : ""
  return `The server has no fences${begin} yet. Make one: dynhull fences create ${prefix}NAME --area HULL `
    + `--subjects KEYED_HULL --address ${address}`
}
// For the table of a prefix: why its hulls cannot be followed; empty where they can.
export function about_many({trouble, complete}) {
  return trouble?.message ?? (complete ? "" : "Waiting for the server")
}
// What to do where a hull is not there.
function in_place_of(name, {names}) {
  const prefix = name.replace(/\/+$/, "") + "/"
  return names.some(each => each.startsWith(prefix)) ? `Others begin with that name: pick ${prefix}* above to see them all.`
    : "Check the name, or pick another hull above. One that is made with this name appears here by itself."
}
// For the picture: why it is empty, and what to do; empty where it is not, or where the banner says it.
export function about_picture(address, hull_list, hulls, fences, many) {
  const {error, listed, by_name, prefix} = hull_list
  if (error || !listed || hulls.some(({bounds}) => bounds) || many.some(({hulls}) => hulls.size)) return ""
  if (fences.some(({area}) => area.bounds)) return ""
  const nothing = many.find(({complete}) => complete)
  if (nothing) return `No hull has a name that begins with ${nothing.prefix} yet. Those that are made appear here by themselves.`
  const unknown = fences.find(({trouble}) => is_unknown(trouble))
  if (!hulls.length && unknown) return `The server has no fence ${unknown.name}. Check the name, or pick another fence above.`
  const empty = hulls.find(({trouble, followed}) => !trouble && followed)
  if (empty) return `${empty.name} has no points yet. Add some: dynhull load ${empty.name} FILE.csv --address ${address}`
  const missing = hulls.find(({trouble}) => is_unknown(trouble))
  if (missing) return `The server has no hull ${missing.name}. ${in_place_of(missing.name, hull_list)}`
  if (hulls.length || many.length) return ""
  if (by_name.size) return "Pick a hull above."
  const begin = prefix ? ` whose names begin with ${prefix}` : ""
  return `The server has no hulls${begin} yet. Make one: dynhull load ${prefix}NAME FILE.csv --address ${address}`
}
