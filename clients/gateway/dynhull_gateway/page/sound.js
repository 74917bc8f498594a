// A sound while alarms are raised that nobody takes care of, for whoever wants one.
import { put } from "./dom.js"
const TONES = [880, 660], TONE_SECONDS = 0.25, VOLUME = 0.3, AGAIN = 2000
const SILENCED = "This browser lets no page sound before somebody has touched it: press a key, or click. A screen without anybody: "
  + "start Chromium with --autoplay-policy=no-user-gesture-required."
export class Sound {
  rung = 0  // how often it has sounded
  // `field` says whether one is wanted; `trouble` gets why there is none.
  constructor(field, wanted, trouble, changed) {
    this.field = field
    this.trouble = trouble
    field.checked = wanted
    field.onchange = () => {
      changed(field.checked)
      this.tick()
    }
    for (const touch of ["pointerdown", "keydown"]) addEventListener(touch, () => this.audio?.resume().then(() => this.tick()))
    this.raised = 0
    setInterval(() => this.tick(), AGAIN)
  }
  take(raised) {
    const more = raised > this.raised
    this.raised = raised
    if (more) this.tick()
  }
  tick() {
    if (this.field.checked) this.audio ??= new AudioContext()
    const silenced = this.field.checked && this.audio.state == "suspended"
    put(this.trouble, silenced ? SILENCED : "")
    if (silenced || !this.field.checked || !this.raised) return
    this.ring()
  }
  ring() {
    const {audio} = this, volume = new GainNode(audio, {gain: VOLUME})
    volume.connect(audio.destination)
    TONES.forEach((frequency, row) => {
      const tone = new OscillatorNode(audio, {frequency})
      tone.connect(volume)
      tone.start(audio.currentTime + row * TONE_SECONDS)
      tone.stop(audio.currentTime + (row + 1) * TONE_SECONDS)
    })
    this.rung++
  }
}
