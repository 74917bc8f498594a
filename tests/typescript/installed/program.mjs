// A program in a folder with the installed package: a copy answers without a server.
import { Client, DynhullError, HullCopies, HullCopy, Writer, isoTime, micros } from "dynhull"

const copy = new HullCopy()
copy.update({
  type: "snapshot", revision: 1n, points: 3, vertices: [[0, 0], [4, 0], [4, 3]], vertexKeys: null, center: null, measures: null,
  changed: null, error: null,
})
for (const each of [Client, DynhullError, HullCopies, Writer, isoTime, micros]) if (typeof each !== "function") throw new TypeError()
console.log(copy.area, copy.side([3, 1]))
