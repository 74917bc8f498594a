// What is on the page: the hulls, fences and prefixes that are picked, and what the page has not been given of them yet.
import { FENCE_LOOKS, LOOKS, key } from "../looks.js"
import { about_fences, about_metrics, about_picture, about_server } from "../words/advice.js"
import { fence_table, hull_table, many_table, past_table } from "../words/cards.js"
import { describe, describe_key } from "../words/describe.js"
import { AlarmList } from "./alarm_list.js"
import { disk, hulls_of } from "./fence_area.js"
import { FenceFeed } from "./fence_feed.js"
import { HullFeed } from "./hull_feed.js"
import { ManyFeed } from "./many_feed.js"
import { OutlierFeed } from "./outlier_feed.js"
import { PastPlay } from "./past_play.js"
import { is_present } from "./search.js"
import { ServerList } from "./server_lists.js"
// Text changes slower than the picture: nobody reads ten times a second.
const TICK = 100, TICKS_OF_TEXT = 5, MOST_PREFIXES = 3, WHOLE_SERVER = ""
const SILENT_SECONDS = 60
const LINES = ["time", "points", "vertices", "area", "rate"], SERVER_LINES = ["time", "updates", "mean", "percentile"]
export class Viewer {
  // `source` has the clients, the address and the prefix of the server, the units, and the settings of fences; `picked` is the query
  // of the page: without hulls, fences and prefixes it chooses; an empty one stands for none. `take` is given messages.
  constructor(source, metrics, picked, take, reached) {
    this.source = source
    this.metrics = metrics
    this.take_message = take
    this.hulls = new Map()  // by name, the feed and the look of each
    this.fences = new Map()
    this.many = new Map()
    this.outliers = new Map()
    this.past = undefined
    this.properties = {}
    this.drawn = new Map()
    this.awaited = new Set()  // fences whose hulls are not known yet
    this.alarm_trouble = ""
    this.ticks = 0
    this.hull_list = new ServerList(source.prefix, (...about) => source.asker.listHulls(...about), reached)
    this.fence_list = new ServerList(source.prefix, (...about) => source.asker.listFences(...about))
    this.alarms = new AlarmList(source)
    const names = noun => picked.has(noun) ? picked.getAll(noun).filter(Boolean) : undefined
    const [hulls, fences, prefixes] = [names("hull"), names("fence"), names("prefix") ?? []]
    this.untouched = !hulls && !fences?.length && !prefixes.length
    this.fences_untouched = !fences
    this.with_outliers = Boolean(picked.get("outliers"))
    this.sought = picked.get("key") ?? ""
    this.silent_after = +picked.get("silent") > 0 ? +picked.get("silent") : SILENT_SECONDS
    this.pick_prefixes(prefixes)
    this.pick_fences(fences ?? [])
    this.pick_hulls(hulls ?? [])
    this.ticking = setInterval(() => this.tick(), TICK)
    this.tick()
  }
  close() {
    clearInterval(this.ticking)
    this.past?.close()
    for (const feeds of [this.outliers, this.hulls, this.fences, this.many]) for (const {feed} of feeds.values()) feed.close()
    for (const each of [this.hull_list, this.fence_list, this.alarms]) each.close()
  }
  // Does what the page asks for.
  take(asked) {
    if (asked.hulls || asked.prefixes) this.untouched = false
    if (asked.fences) this.fences_untouched = false
    const takes = {
      hulls: names => this.pick_hulls(names),
      fences: names => this.pick_fences(names),
      prefixes: names => this.pick_prefixes(names),
      sought: key => this.sought = key,
      typed: ([noun, letters]) => (noun == "hull" ? this.hull_list : this.fence_list).typed = letters,
      outliers: chosen => this.choose_outliers(chosen),
      verify: () => this.feeds.forEach(feed => feed.verify_now()),
      past: moment => this.go_back(moment),
      acknowledge: about => this.about_alarm(this.alarms.acknowledge(...about)),
      mute: about => this.about_alarm(this.alarms.mute(...about)),
    }
    for (const [name, value] of Object.entries(asked)) takes[name](value)
    this.ticks = 0
    this.tick()  // the answer at once
  }
  get feeds() {
    return [...this.hulls.values()].map(({feed}) => feed)
  }
  async about_alarm(done) {
    this.alarm_trouble = await done
  }
  pick_hulls(picked) {
    const most = LOOKS.length - this.many.size
    show(this.hulls, [...new Set(picked)].slice(0, most), LOOKS, [...this.many.values()], name => new HullFeed(this.source, name))
    this.show_outliers()
    this.past?.show(this.feeds)
    this.forget()
  }
  pick_fences(picked) {
    const names = [...new Set(picked)].slice(0, FENCE_LOOKS.length)
    for (const name of names) if (!this.fences.has(name)) this.awaited.add(name)
    show(this.fences, names, FENCE_LOOKS, [], name => new FenceFeed(this.source, name))
    this.forget()
  }
  pick_prefixes(picked) {
    show(this.many, [...new Set(picked)].slice(0, MOST_PREFIXES), LOOKS, [...this.hulls.values()], prefix => new ManyFeed(this.source, prefix))
    this.pick_hulls([...this.hulls.keys()])
  }
  choose_outliers(chosen) {
    this.with_outliers = chosen
    this.show_outliers()
  }
  show_outliers() {
    const names = this.with_outliers ? [...this.hulls.keys()] : []
    show(this.outliers, names, [], [], name => new OutlierFeed(this.source, this.hulls.get(name).feed))
  }
  // Shows the past from a moment on, or not any more.
  go_back(asked) {
    this.past?.close()
    this.past = asked ? new PastPlay(this.source, asked) : undefined
    this.past?.show(this.feeds)
  }
  // What the page no longer shows, it has to be given again when it shows it again.
  forget() {
    for (const id of this.drawn.keys()) {
      const name = id.slice(id.indexOf(" ") + 1)
      if (!this.hulls.has(name) && !this.fences.has(name)) this.drawn.delete(id)
    }
  }
  // Shows what belongs to the viewer's choice, and something where there is none.
  choose() {
    const known = this.hull_list.names, shown = [...this.hulls.keys()]
    if (this.untouched && !shown.length) this.pick_hulls(this.hull_list.largest())
    if (this.fences_untouched && !this.fences.size) {
      const fences = [...this.fence_list.by_name.values()].filter(fence => hulls_of(fence, known).some(name => this.hulls.has(name)))
      if (fences.length) this.pick_fences(fences.map(({name}) => name))
    }
    const hulls = []
    for (const name of this.awaited) {
      const fence = this.fences.get(name)?.feed.fence
      if (fence) hulls.push(...hulls_of(fence, known))
      if (fence || !this.fences.has(name)) this.awaited.delete(name)
    }
    if (hulls.length && (this.untouched || !this.fences_untouched)) this.pick_hulls([...this.hulls.keys(), ...hulls])
  }
  // Gives the page what is new since the last call.
  tick() {
    // What the lists say comes before the first drawing: later it would move the picture.
    if (![this.hull_list, this.fence_list].every(({listed, error}) => listed || error)) return
    if (this.ticks++ % TICKS_OF_TEXT == 0) {
      this.choose()
      this.tell({...this.looks(), ...this.text()})
      this.give_lines()
      this.say_past()
    }
    this.tell(this.found())
    // Hulls first: fences may have their outlines.
    for (const {feed} of this.hulls.values()) this.draw(feed.drawings)
    for (const {feed} of this.fences.values()) this.draw(feed.messages)
    for (const {feed} of this.outliers.values()) if (feed.message) this.draw([feed.message])
    for (const {feed} of this.many.values()) for (const outline of feed.drain()) this.take_message(outline)
    for (const message of this.past?.messages() ?? []) this.take_message(message)
  }
  draw(messages) {
    for (const message of messages) {
      const id = `${message.kind} ${message.fence ?? message.hull}`
      if (this.drawn.get(id) == message) continue
      this.drawn.set(id, message)
      this.take_message(message)
    }
  }
  // The properties of the page that have changed.
  tell(properties) {
    const changed = Object.entries(properties).filter(([name, value]) => JSON.stringify(value) != JSON.stringify(this.properties[name]))
    Object.assign(this.properties, Object.fromEntries(changed))
    if (changed.length) this.take_message({kind: "page", ...Object.fromEntries(changed)})
  }
  give_lines() {
    const lines = this.feeds.map(feed => [feed.name, feed, LINES])
    if (this.metrics) lines.push([WHOLE_SERVER, this.metrics, SERVER_LINES])
    for (const [hull, feed, columns] of lines) {
      const rows = feed.lines.splice(0)
      const values = column => rows.map(row => isNaN(row[column]) ? null : row[column])
      if (rows.length) this.take_message({kind: "lines", hull, ...Object.fromEntries(columns.map((name, column) => [name, values(column)]))})
    }
  }
  // The words and the figures of the moment that is shown, if that is past.
  say_past() {
    if (!this.past) return
    const {hulls, number} = this.past
    const rows = [...this.hulls].filter(([name]) => hulls.has(name)).map(([name, {look}]) => ({feed: hulls.get(name), look}))
    const said = {description: describe([...hulls.values()]), table: past_table(rows, {area_unit: this.source.units.area})}
    this.take_message({kind: "past", number, said})
  }
  // Where the key is that the viewer looks for: in words, and for the picture.
  found() {
    const {sought} = this, sightings = [...this.hulls.values()].map(({feed, look}) => ({feed, look, sighting: feed.search.find(sought)}))
    return {
      sought,
      found: sought ? sightings.map(({feed, sighting}) => describe_key(sought, feed, sighting)) : [],
      places: sought ? sightings.filter(({sighting}) => is_present(sighting)).map(({feed, sighting, look}) =>
        [...sighting.place, look.colour, disk(sighting.place, sighting.accuracy, feed.center)]) : [],
      // With the first drawing, so that the field for keys does not move the picture later.
      keyed: this.feeds.some(({followed, keyed}) => followed && keyed),
    }
  }
  looks() {
    const looks = shown => [...shown].map(([name, {look}]) => ({name, key: key(look), ...look}))
    return {hulls: looks(this.hulls), fences: looks(this.fences), prefixes: looks(this.many)}
  }
  // How many of the hulls shown move, and how many have not moved for long.
  figures() {
    const moved = new Map(this.feeds.map(({name, moved}) => [name, moved]))
    for (const {feed} of this.many.values()) for (const {hull, moved: at} of feed.hulls.values()) moved.set(hull, at)
    const since = Date.now() - 1000 * this.silent_after, moving = [...moved.values()].filter(at => at > since).length
    return {moving, silent: moved.size - moving, silent_after: this.silent_after}
  }
  // The words and the figures.
  text() {
    const {hull_list, fence_list, feeds, alarms, source: {address, units, fence_settings}} = this
    const [fences, many] = [this.fences, this.many].map(shown => [...shown.values()].map(({feed}) => feed))
    const look = {connected: !hull_list.error, area_unit: units.area}
    return {
      offered: [...hull_list.prefixes().map(prefix => `${prefix}*`), ...hull_list.names.sort()],
      offered_fences: fence_list.names.sort(),
      refused: hull_list.error?.status == 401,
      banner: hull_list.error ? about_server(address, hull_list.error) : about_metrics(this.metrics),
      alarms: alarms.rows,
      raised: alarms.raised,
      figures: this.figures(),
      all_prefixes: hull_list.prefixes(),
      alarm_trouble: this.alarm_trouble,
      kept: feeds.map(({kept}) => kept.message),
      note: about_picture(address, hull_list, feeds, fences, many),
      outliers: [...this.outliers.values()].map(({feed}) => feed.words),
      fence_hint: about_fences(address, fence_list, fences.length > 0),
      description: describe(feeds, fences, many),
      many_table: many_table([...this.many.values()], look),
      table: hull_table([...this.hulls.values()], look),
      fence_table: fence_table([...this.fences.values()], [...this.hulls.keys()], {...look, described: fence_settings}),
    }
  }
}
// Shows these and no others; each new one gets a look that neither they nor `others` have.
function show(shown, names, looks, others, begin) {
  for (const [name, {feed}] of shown) {
    if (names.includes(name)) continue
    feed.close()
    shown.delete(name)
  }
  for (const name of names) {
    if (shown.has(name)) continue
    const taken = [...shown.values(), ...others].map(({look}) => look)
    shown.set(name, {feed: begin(name), look: looks.find(look => !taken.includes(look)) ?? looks[0]})
  }
}
