// The sides of many points, for a test that knows them: prints them in hexadecimal.

import { readFile } from "node:fs/promises"

import { HullCopy } from "../../clients/typescript/src/index.js"

const [folder] = process.argv.slice(2)

/** @param {string} name @returns {Promise<[number, number][]>} */
async function read(name) {
  const bytes = await readFile(`${folder}/${name}`)
  const values = new Float64Array(bytes.buffer, bytes.byteOffset, bytes.length / 8)
  return Array.from({ length: values.length / 2 }, (_, row) => [values[2 * row], values[2 * row + 1]])
}

const copy = new HullCopy()
const vertices = await read("vertices")
copy.update({
  type: "snapshot", revision: 1n, points: vertices.length, vertices, vertexKeys: null, center: null, measures: null,
  changed: null, error: null,
})
process.stdout.write(Buffer.from(copy.locate(await read("points")).buffer).toString("hex"))
