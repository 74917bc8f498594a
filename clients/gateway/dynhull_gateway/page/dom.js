// What the modules of the page share: its elements, and how it is set up.
export const find = selector => document.querySelector(selector)
// Written only if it is another text: a selection stays.
export function put(element, text) {
  if (element.textContent != text) element.textContent = text
}
export function cell(name, content) {
  const made = document.createElement("td")
  made.className = name
  made.append(content)
  return made
}
const given = JSON.parse(find(".page").dataset.settings)
export const settings = {...given, gateway: location.origin + given.root}
