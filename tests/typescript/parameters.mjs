// The parameters of the public methods of the TypeScript package, those in options among them, as the compiler knows them.

import { createRequire } from "node:module"
import { resolve } from "node:path"

const ts = createRequire(`${process.cwd()}/`)("typescript")
const [given, ...classes] = process.argv.slice(2)
const configuration = resolve(given)
const { config } = ts.readConfigFile(configuration, ts.sys.readFile)
const { fileNames, options } = ts.parseJsonConfigFileContent(config, ts.sys, configuration.replace(/[^/]*$/, ""))
const program = ts.createProgram(fileNames, options)
const checker = program.getTypeChecker()

/** @param {ts.Type} type @returns {string[]} */
function fields(type) {
  if (type.isUnion()) return type.types.flatMap(fields)
  if (checker.isArrayType(type) || checker.isTupleType(type) || type.getCallSignatures().length || !(type.flags & ts.TypeFlags.Object || type.isIntersection())) return []
  if (type.symbol?.declarations?.some((each) => each.getSourceFile().hasNoDefaultLib)) return []
  if (type.symbol && ["HullCopy", "HullCopies", "AbortSignal", "Date"].includes(type.symbol.name)) return []
  return type.getProperties().map((each) => each.name)
}

/** @type {Record<string, Record<string, string[]>>} */
const found = {}
for (const source of program.getSourceFiles().filter(({ fileName }) => fileNames.includes(fileName))) {
  ts.forEachChild(source, (node) => {
    if (!ts.isClassDeclaration(node) || !node.name || !classes.includes(node.name.text)) return
    const type = checker.getTypeAtLocation(node.name)
    const methods = (found[node.name.text] = /** @type {Record<string, string[]>} */ ({}))
    for (const member of type.getProperties()) {
      const [signature] = checker.getTypeOfSymbolAtLocation(member, node).getCallSignatures()
      if (!signature || member.name.startsWith("#") || member.name.startsWith("_")) continue
      methods[member.name] = signature.parameters.flatMap((each) => [each.name, ...fields(checker.getTypeOfSymbolAtLocation(each, node))])
    }
  })
}
console.log(JSON.stringify(found))
