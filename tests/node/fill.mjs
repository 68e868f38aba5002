// Fills a gap with a graph, as examples/browser/interpose.mjs does: node fill.mjs small.onnx < request.json
//
// The request is {rig, frames, start, stop}: what `interpose skeleton --json` says, and what `fill` takes.

import { readFileSync } from "node:fs";
import * as ort from "onnxruntime-web";
import { fill, Rig } from "../../examples/browser/interpose.mjs";

ort.env.wasm.numThreads = 1;
ort.env.logLevel = "error";
const session = await ort.InferenceSession.create(readFileSync(process.argv[2]));
const { rig, frames, start, stop } = JSON.parse(readFileSync(0, "utf8"));
process.stdout.write(JSON.stringify(await fill(ort, session, new Rig(rig), frames, start, stop)));
