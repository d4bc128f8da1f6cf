// How long the decoder takes to move all Gaussians of a scene, and those of its levels: node measure-motion.mjs $(./build-wasm) FILE...
// The least and the middle of 120 times, without a browser; the engine is that of Chromium.

import { readFileSync } from "node:fs";
import { Decoder } from "./player/scene/decoder.js";

const [wasm, ...files] = process.argv.slice(2);
const module = new WebAssembly.Module(readFileSync(wasm));
for (const file of files) {
  const decoder = new Decoder(module);
  decoder.open(new Uint8Array(readFileSync(file)));
  for (let level = 0; level <= decoder.info.levels; level++) {
    const begin = performance.now();
    decoder.showLevel(level);
    const made = performance.now() - begin;
    const times = [];
    for (let frame = 0; frame < 120; frame++) {
      const start = performance.now();
      decoder.wasm.evaluate((frame % 20) / 19, 0, decoder.count);
      times.push(performance.now() - start);
    }
    times.sort((a, b) => a - b);
    const memory = decoder.wasm.memory.buffer.byteLength / 2 ** 20;
    console.log(
      `${file}, level ${level}: ${decoder.count} Gaussians, made in ${made.toFixed(0)} ms, ` +
        `motion ${times[0].toFixed(2)} to ${times[60].toFixed(2)} ms, memory ${memory.toFixed(1)} MiB`,
    );
  }
}
