const DAY = `--ink: #1b1f24; --faint: #5c6570; --paper: #ffffff; --raised: #f3f5f7; --line: #d5dae0; --grid: #e9ecef; --sea: #f6f8fa;
  --veil: #ffffff59; --coast: #7f8a95; --border: #d5dae0; --alarm: #b3261e; --alarm-ink: #ffffff; --focus: #0072b2;`
const NIGHT = `--ink: #e6eaee; --faint: #9aa5b1; --paper: #12161b; --raised: #1d232a; --line: #343c46; --grid: #232a32; --sea: #151a20;
  --veil: #12161b99; --coast: #66717d; --border: #2f3740; --alarm: #ff8a80; --alarm-ink: #12161b; --focus: #56b4e9;`
/** Colours are those that the picture reads; a page may set them on the element. By night where the attribute, or else the system, says so. */
export const STYLE = `
:host { display: block; height: 24rem; ${DAY} }
@media (prefers-color-scheme: dark) { :host(:not([look=day])) { ${NIGHT} } }
:host([look=night]) { ${NIGHT} }
:host([hidden]) { display: none; }
.map { position: relative; height: 100%; overflow: hidden; touch-action: none; cursor: grab; user-select: none; color: var(--ink);
  background: var(--paper); font: 14px/1.45 system-ui, sans-serif; }
.map:focus-visible, button:focus-visible { outline: 2px solid var(--focus); outline-offset: -2px; }
canvas { position: absolute; inset: 0; width: 100%; height: 100%; }
.buttons { position: absolute; right: .5rem; top: .5rem; display: flex; flex-direction: column; gap: .3rem; }
button { min-width: 2rem; min-height: 2rem; font: inherit; color: var(--ink); background: var(--raised); border: 1px solid var(--line);
  border-radius: 4px; cursor: pointer; }
.alarms { position: absolute; left: .5rem; top: .5rem; margin: 0; padding: 0; list-style: none; max-height: 60%; overflow: auto; }
.alarms li { margin-bottom: .2rem; padding: .1rem .5rem; font-weight: 600; color: var(--paper); background: var(--alarm); border-radius: 4px; }
.note, .attribution { position: absolute; bottom: 0; margin: 0; padding: .1rem .4rem; font-size: .8rem; color: var(--faint);
  background: var(--raised); pointer-events: none; }
.note { left: 0; } .attribution { right: 0; } .note:empty, .attribution:empty { display: none; }
.tip { position: absolute; left: 0; top: 0; padding: .3rem .6rem; max-width: 70%; color: var(--ink); background: var(--raised);
  border: 1px solid var(--line); border-radius: 4px; pointer-events: none; overflow-wrap: anywhere; }
.tip[hidden] { display: none; }
`
