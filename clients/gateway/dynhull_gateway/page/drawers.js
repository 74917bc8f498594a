// The drawers beside the map: a button opens and closes each, and Escape in one closes it.
export class Drawers {
  // `open` has the names of those that are open, with commas between; all are where it is null. `keep` is called with such a text in a
  // list, which is empty while all are open.
  constructor(page, open, keep) {
    this.page = page
    this.keep = keep
    this.buttons = [...page.querySelectorAll(".drawers button")]
    for (const button of this.buttons) {
      const drawer = this.drawer(button)
      drawer.hidden = open != null && !open.split(",").includes(drawer.id)
      button.onclick = () => this.toggle(button)
      drawer.addEventListener("keydown", event => {
        if (event.key != "Escape") return
        this.toggle(button)
        button.focus()
      })
    }
    this.show()
  }
  drawer(button) {
    return document.getElementById(button.getAttribute("aria-controls"))
  }
  toggle(button) {
    const drawer = this.drawer(button)
    drawer.hidden = !drawer.hidden
    const open = this.show()
    this.keep(open.length == this.buttons.length ? [] : [open.join()])
  }
  show() {
    for (const button of this.buttons) button.setAttribute("aria-expanded", !this.drawer(button).hidden)
    const open = this.buttons.map(button => this.drawer(button)).filter(({hidden}) => !hidden).map(({id}) => id)
    this.page.classList.toggle("shut", !open.length)
    return open
  }
}
