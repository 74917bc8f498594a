// A client of other authors: @grpc/grpc-js, from the .proto files alone. Prints one line of JSON with what it saw.
"use strict";

const path = require("path");
const grpc = require("@grpc/grpc-js");
const loader = require("@grpc/proto-loader");

const [address, name] = process.argv.slice(2);
const root = path.join(__dirname, "..", "..", "proto");
const definition = loader.loadSync("dynhull/v1/hull_service.proto", {
  includeDirs: [root],
  keepCase: true,
  longs: Number,
  enums: String,
  defaults: true,
  oneofs: true,
});
const { HullService } = grpc.loadPackageDefinition(definition).dynhull.v1;
const client = new HullService(address, grpc.credentials.createInsecure());

const unary = (method, request) =>
  new Promise((resolve, reject) =>
    client[method](request, (error, response) => (error ? reject(error) : resolve(response))));

async function main() {
  const saw = {};
  saw.created = (await unary("CreateHull", { name })).hull;
  const watch = client.Watch({ name, encoding: "POINT_ENCODING_COORDINATES", include_measures: true });
  const events = watch[Symbol.asyncIterator]();
  saw.snapshot = (await events.next()).value;

  const stream = client.Stream();
  const acknowledgements = stream[Symbol.asyncIterator]();
  saw.acknowledged = [];
  for (const [sequence, coordinates] of [[1, [0, 0, 4, 0]], [2, [4, 4, 0, 4]], [3, [1, 1]]]) {
    stream.write({ name, producer: "stranger", sequence, batch: { inserts: { coordinates } } });
    saw.acknowledged.push((await acknowledgements.next()).value);
  }
  stream.end();
  saw.ended = (await acknowledgements.next()).done;

  do saw.event = (await events.next()).value;
  while (saw.event.revision < 2);
  watch.on("error", () => {}); // of being cancelled
  watch.cancel();

  saw.hull = await unary("GetHull", { name, encoding: "POINT_ENCODING_COORDINATES" });
  const packed = Buffer.alloc(32);
  [1, 2, 4, 9].forEach((value, i) => packed.writeDoubleLE(value, 8 * i));
  saw.sides = [...(await unary("Locate", { name, points: { packed } })).sides];
  saw.verified = (await unary("Verify", { name })).equal;
  try {
    await unary("Apply", { name, batch: { deletes: { coordinates: [8, 8] } } });
  } catch (error) {
    saw.refused = { code: error.code, details: error.details };
  }
  console.log(JSON.stringify(saw));
  client.close();
}

main().catch((error) => {
  console.error(error);
  process.exit(1);
});
