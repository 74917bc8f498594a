// Day or night: as the system has it, or as the viewer has chosen.
const system = matchMedia("(prefers-color-scheme: dark)")
export class Night {
  // `chosen` is "day", "night" or none of them; `changed` is called whenever the page becomes light or dark.
  constructor(field, chosen, changed) {
    this.field = field
    field.value = ["day", "night"].includes(chosen) ? chosen : ""
    this.show()
    field.onchange = () => {
      this.show()
      changed()
    }
    system.addEventListener("change", changed)
  }
  get chosen() {
    return this.field.value
  }
  get is_now() {
    return this.chosen ? this.chosen == "night" : system.matches
  }
  show() {
    document.documentElement.dataset.look = this.chosen
  }
}
