// Decodes golden streams in WebAssembly: `node golden.mjs light4gs_wasm_decoder.wasm ../golden-streams`. Each must give the
// bytes that decoding on x86-64 gave: those of NAME.decoded.l4gs, or the stream itself if it is without loss. Its
// frames must be those of frames.txt: name, time, checksum.
import { createHash } from "node:crypto";
import { existsSync, readFileSync, readdirSync } from "node:fs";

const [module, folder] = process.argv.slice(2);
const { instance } = await WebAssembly.instantiate(readFileSync(module), {});
const { memory, input: place, decode, frame, answer } = instance.exports;
const frames = readFileSync(`${folder}/frames.txt`, "utf8").trim().split("\n").map((line) => line.split(" "));

const digest = (bytes) => createHash("sha256").update(bytes).digest("hex");
let failures = 0;
for (const name of readdirSync(folder).filter((name) => name.endsWith(".l4gs")).sort()) {
    const input = readFileSync(`${folder}/${name}`);
    const at = place(input.length);
    new Uint8Array(memory.buffer, at, input.length).set(input);
    const length = decode();
    const bytes = Buffer.from(new Uint8Array(memory.buffer, answer(), Math.abs(length)));
    if (length < 0) {
        console.error(`${name}: ${bytes}`);
        failures += 1;
        continue;
    }
    const decoded = `${folder}/${name.replace(/\.l4gs$/, ".decoded.l4gs")}`;
    const expected = digest(existsSync(decoded) ? readFileSync(decoded) : input);
    const same = digest(bytes) === expected;
    const shown = frames.filter(([of]) => `${of}.l4gs` === name);
    console.log(`${name}: ${digest(bytes)} ${same ? "as on x86-64" : `expected ${expected}`}, ${shown.length} frames`);
    failures += same ? 0 : 1;
    for (const [, time, checksum] of shown) {
        const found = (frame(Number(time)) >>> 0).toString(16).padStart(8, "0");
        if (found !== checksum) {
            console.error(`${name} at ${time}: ${found}, expected ${checksum}`);
            failures += 1;
        }
    }
}
process.exit(failures === 0 ? 0 : 1);
