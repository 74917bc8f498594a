// The page over the whole screen, where the browser lets it; Escape leaves it.
export class FullScreen {
  // `button` says whether it is so, and has the focus again when it is over. `page` is what fills the screen.
  constructor(button, page) {
    button.hidden = !document.fullscreenEnabled
    button.onclick = () => {
      const done = document.fullscreenElement ? document.exitFullscreen() : page.requestFullscreen()
      done.catch(() => button.textContent = button.ariaLabel = "Full screen refused: press F11")
    }
    document.addEventListener("fullscreenchange", () => {
      button.ariaPressed = Boolean(document.fullscreenElement)
      if (!document.fullscreenElement && document.activeElement == document.body) button.focus()
    })
  }
}
