// Runs an ONNX graph with onnxruntime-web, the runtime of browsers: node run.mjs graph.onnx < feeds.json
//
// Feeds and what is printed are JSON: by name the type, the sizes and the values of a tensor.

import { readFileSync } from "node:fs";
import * as ort from "onnxruntime-web";

const ARRAYS = { float32: Float32Array, int64: BigInt64Array, bool: Uint8Array };

ort.env.wasm.numThreads = 1;
ort.env.logLevel = "error";
const session = await ort.InferenceSession.create(readFileSync(process.argv[2]));
const feeds = {};
for (const [name, { type, dims, data }] of Object.entries(JSON.parse(readFileSync(0, "utf8")))) {
  const values = type === "int64" ? data.map(BigInt) : data;
  feeds[name] = new ort.Tensor(type, ARRAYS[type].from(values), dims);
}
const found = await session.run(feeds);
const told = Object.entries(found).map(([name, { dims, data }]) => [name, { dims, data: [...data] }]);
process.stdout.write(JSON.stringify(Object.fromEntries(told)));
