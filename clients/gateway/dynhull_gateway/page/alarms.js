// The list of alarms that are raised, those first that nobody takes care of.
import { cell, find, put } from "./dom.js"
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
    const body = this.section.querySelector("tbody"), focused = body.contains(document.activeElement) ? document.activeElement : undefined
    const at = focused && [...body.children].indexOf(focused.closest("tr")), wanted = new Map(rows.map(row => [`${row.alarm} ${row.hull}`, row]))
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
    if (focused && !focused.checkVisibility()) this.focus_again(focused.closest("tr"), body, at)
    this.section.classList.toggle("raised", raised > 0)
    put(this.section.querySelector("h2"), raised ? `▲ ${raised.toLocaleString("en")} ${raised == 1 ? "alarm" : "alarms"}` : "No alarm without somebody who takes care of it")
    put(this.section.querySelector(".trouble"), trouble)
    document.title = raised ? `▲ ${raised} ${this.title}` : this.title
  }
  // On the row of a button that is gone, or on the one in its place, and not on the next button: a key may be pressed twice.
  focus_again(row, body, at) {
    const next = row.isConnected ? row : body.children[Math.min(at, body.children.length - 1)]
    if (next) next.focus()
    else find(".map").focus()
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
    element.tabIndex = -1
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
