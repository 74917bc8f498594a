// The list of alarms that are raised, those first that nobody takes care of.
import { cell, put } from "./dom.js"
import { moment_format } from "./time_bar.js"
const ALARM_WORDS = {raised: "▲ Raised", acknowledged: "◆ Acknowledged", muted: "◇ Muted", cleared: "✓ Cleared"}, MUTE_SECONDS = 3600
export class Alarms {
  // `ask` is called with what is to be acknowledged or muted.
  constructor(section, ask) {
    this.section = section
    this.ask = ask
    this.rows = new Map()
    this.title = document.title
  }
  // Only what has changed is written: a button keeps the focus.
  show(rows, raised, trouble) {
    const body = this.section.querySelector("tbody"), wanted = new Map(rows.map(row => [`${row.alarm} ${row.hull}`, row]))
    for (const [id, {element}] of this.rows) {
      if (wanted.has(id)) continue
      element.remove()
      this.rows.delete(id)
    }
    let next = body.firstElementChild
    for (const [id, row] of wanted) {
      const known = this.rows.get(id) ?? this.element(row)
      this.rows.set(id, known)
      if (known.element == next) next = next.nextElementSibling
      else body.insertBefore(known.element, next)
      this.write(known, row)
    }
    this.section.classList.toggle("any", rows.length > 0)
    this.section.classList.toggle("raised", raised > 0)
    put(this.section.querySelector("h2"), raised ? `▲ ${raised.toLocaleString("en")} ${raised == 1 ? "alarm" : "alarms"}` : "No alarm without somebody who takes care of it")
    put(this.section.querySelector(".trouble"), trouble)
    document.title = raised ? `▲ ${raised} ${this.title}` : this.title
  }
  write({element, cells, acknowledge, mute}, row) {
    const {hull, alarm, rule, state, value, since, muted, may} = row
    element.className = state
    put(cells.state, state == "muted" ? `${ALARM_WORDS[state]} until ${moment_format.format(muted)}` : ALARM_WORDS[state])
    put(cells.hull, hull)
    put(cells.value, value)
    put(cells.rule, `${alarm}: ${rule}`)
    put(cells.since, moment_format.format(since))
    acknowledge.hidden = !may || state != "raised"
    mute.hidden = !may || state == "cleared"
    put(mute, state == "muted" ? "Unmute" : "Mute 1 h")
    mute.onclick = () => this.ask({mute: [alarm, hull, state == "muted" ? 0 : MUTE_SECONDS]})
  }
  element({alarm, hull}) {
    const element = document.createElement("tr")
    const cells = Object.fromEntries(["state", "hull", "value", "rule", "since"].map(name => [name, cell(name, "")]))
    const [acknowledge, mute] = ["Acknowledge", "Mute 1 h"].map(text => {
      const button = document.createElement("button")
      button.type = "button"
      button.textContent = text
      button.title = `${alarm} for ${hull}`
      return button
    })
    acknowledge.onclick = () => this.ask({acknowledge: [alarm, hull]})
    const actions = cell("actions", acknowledge)
    actions.append(mute)
    element.append(...Object.values(cells), actions)
    return {element, cells, acknowledge, mute}
  }
}
