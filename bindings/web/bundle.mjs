// Puts the player into one ES module: the decoder as compressed WebAssembly, the worker as text.
// The script of the page that trains is a module of its own.
// usage: node bundle.mjs DECODER.wasm FOLDER

import { build } from "esbuild";
import { readFileSync, writeFileSync } from "node:fs";
import { gzipSync } from "node:zlib";

const [wasm, folder] = process.argv.slice(2);
const common = { bundle: true, minify: true, target: ["chrome100", "firefox113", "safari16.4"], legalComments: "none", write: false };

/** Modules made here rather than read: texts by name. */
const virtual = (parts) => ({
  name: "virtual",
  setup(build) {
    build.onResolve({ filter: /^virtual:/ }, ({ path }) => ({ path, namespace: "virtual" }));
    build.onLoad({ filter: /.*/, namespace: "virtual" }, ({ path }) => ({ contents: parts[path], loader: "text" }));
  },
});
// What a worker decodes before the first file, so that its code is compiled by then.
const sample = readFileSync("../../tests/golden-streams/compact.l4gs").toString("base64");
const workerPlugins = [virtual({ "virtual:sample": sample })];
const worker = await build({ ...common, entryPoints: ["player/scene/worker.js"], format: "iife", plugins: workerPlugins });
const packed = gzipSync(readFileSync(wasm), { level: 9 });
packed[9] = 255; // the operating system: none
const parts = {
  "virtual:worker": worker.outputFiles[0].text,
  "virtual:decoder": packed.toString("base64"),
  "virtual:style": (await build({ ...common, entryPoints: ["player/element/style.css"] })).outputFiles[0].text,
};
const main = await build({ ...common, entryPoints: ["player/index.js"], format: "esm", plugins: [virtual(parts)], charset: "utf8" });
const code = main.outputFiles[0].text;
// The module also stands inside of pages.
if (/<\/script|<!--/i.test(code)) throw new Error("the bundle would end the script element that holds it");
writeFileSync(`${folder}/light4gs-player.js`, code);

const trainerWorker = await build({ ...common, entryPoints: ["trainer/page/worker.js"], format: "iife" });
const trainerPlugins = [virtual({ "virtual:trainer-worker": trainerWorker.outputFiles[0].text })];
const trainer = await build({ ...common, entryPoints: ["trainer/page/page.js"], format: "esm", plugins: trainerPlugins, charset: "utf8" });
writeFileSync(`${folder}/light4gs-trainer.js`, trainer.outputFiles[0].text);

const size = (text) => `${Buffer.byteLength(text)} bytes, ${gzipSync(text, { level: 9 }).length} compressed`;
console.log(`light4gs-player.js: ${size(code)}`);
console.log(`  of which the decoder: ${readFileSync(wasm).length} bytes, ${packed.length} compressed`);
console.log(`  worker: ${size(parts["virtual:worker"])}; style: ${size(parts["virtual:style"])}`);
console.log(`light4gs-trainer.js: ${size(trainer.outputFiles[0].text)}`);
