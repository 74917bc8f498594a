// The fields in which hulls and fences are picked.
import { find } from "./dom.js"
const ALL_OF = "*"
// What is meant by some letters: the name itself, else the first name of which a part begins with them, else the first that
// has them; without any, a name that does not exist yet. All hulls of a prefix are meant by one that ends with a slash.
export function best_match(letters, offered) {
  const prefixed = /[/*]$/.test(letters), names = offered.filter(name => prefixed || !name.endsWith(ALL_OF))
  const begins = name => name.startsWith(letters) || /[._/-]/.test(name) && name.split(/[._/-]/).some(part => part.startsWith(letters))
  return [name => name == letters, begins, name => name.includes(letters)].map(fits => letters && names.find(fits)).find(name => name) ?? (letters.endsWith("/") ? letters + ALL_OF : letters)
}
// The chips and the field of a picker. `picked` is what it shows and changes, of the state of the page, by the noun that it
// has in the address. Of several the last has prefixes, which are shown with an asterisk. `ask` is called with what is
// picked, `keep` with a noun and its values.
export class Picker {
  constructor({form, noun, most, offered, picked}, state, ask, keep) {
    Object.assign(this, {form: find(form), noun, most, offered, picked: Object.entries(picked), state, ask, keep})
    this.field = find(`${form} [list]`)
    this.field.addEventListener("change", () => state[offered].includes(this.field.value) && this.add())
    this.field.addEventListener("input", () => ask({typed: [noun, this.field.value]}))
    this.form.addEventListener("submit", event => { event.preventDefault(); this.add() })
    this.show()
  }
  get names() {
    return this.looks.map(({name}) => name)
  }
  get looks() {
    const {state} = this
    return this.picked.flatMap(([, names], row) => row ? state[names].map(look => ({...look, name: look.name + ALL_OF})) : state[names])
  }
  add() {
    if (this.field.readOnly) return
    const name = best_match(this.field.value, this.state[this.offered])
    if (name && !this.names.includes(name)) this.pick([...this.names, name])
    this.field.value = ""
  }
  pick(names) {
    const [one, many] = [names.filter(name => !name.endsWith(ALL_OF)), names.filter(name => name.endsWith(ALL_OF)).map(name => name.slice(0, -1))]
    this.ask(Object.fromEntries(this.picked.map(([, asked], row) => [asked, row ? many : one])))
    this.picked.forEach(([noun], row) => this.keep(noun, row ? many : one.length ? one : [""]))
  }
  show() {
    const full = this.names.length >= this.most, list = this.form.querySelector("ul")
    const buttons = [...list.querySelectorAll("button")], at = buttons.indexOf(document.activeElement)
    const remove = removed => this.pick(this.names.filter(name => name != removed))
    list.replaceChildren(...this.looks.map(each => chip(each, remove)))
    if (at >= 0) this.focus_again([...list.querySelectorAll("button")], buttons[at].ariaLabel, at)
    this.field.readOnly = full  // not disabled: it may have the focus
    this.field.placeholder = full ? `Remove a ${this.noun} to pick another` : `Pick ${this.noun}s`
  }
  // On the button that had the focus, on the one in its place, or in the field.
  focus_again(buttons, label, at) {
    const same = buttons.find(({ariaLabel}) => ariaLabel == label)
    const next = same ?? buttons[Math.min(at, buttons.length - 1)] ?? this.field
    next.focus()
  }
  offer() {
    this.field.list.replaceChildren(...this.state[this.offered].map(name => new Option(name, name)))
  }
}
function chip({name, key}, remove) {
  const item = document.createElement("li"), line = document.createElement("span")
  const button = document.createElement("button")
  line.innerHTML = key
  button.type = "button"
  button.textContent = "✕"
  button.ariaLabel = `Remove ${name}`
  button.onclick = () => remove(name)
  item.append(line, name, button)
  return item
}
