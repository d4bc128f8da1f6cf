// Code for the tests of takes: takes whose segments have different colors, and servers that note what they are asked for.

import { execFileSync } from "node:child_process";
import { copyFileSync, mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { root } from "./harness.mjs";

/** The colors of segments, in their order: those of light4gs-codec/examples/colored_take.rs. */
export const COLORS = ["red", "green", "blue", "yellow"];
/** The base alone. */
export const WHITE = "white";

const folder = mkdtempSync(`${tmpdir()}/light4gs-takes-`);
export const removeTakes = () => rmSync(folder, { recursive: true, force: true });

function run(...options) {
  const example = ["run", "--quiet", "--release", "--locked", "--package", "light4gs-codec", "--example", "colored_take", "--"];
  execFileSync("cargo", [...example, ...options], { cwd: root, stdio: "inherit" });
}

/** A take of so many segments of a second, and a last second without one. `scene` names a file with the Gaussians of each. */
export function makeTake(segments, scene) {
  const path = `${folder}/${segments}${scene ? "-large" : ""}.l4gs`;
  run(path, String(segments), ...(scene ? [scene] : []));
  return readFileSync(path);
}

/** A take of two segments that becomes longer by one, three times: the last index has a second block. */
export function makeGrowing() {
  const path = `${folder}/growing.l4gs`;
  run(path, "2");
  const states = [readFileSync(path)];
  for (let k = 0; k < 3; k++) {
    run("--append", path);
    states.push(readFileSync(path));
  }
  return states;
}

/** Where the parts of a take are: `[first, last]` of the front, the base and each segment, in the order of the slots. */
export function partsOf(bytes) {
  const capacity = bytes.readUInt32LE(16);
  const base = Number(bytes.readBigUInt64LE(20));
  const segments = [];
  for (let slot = 0; slot < capacity; slot++) {
    const row = base - 64 * (capacity - slot);
    const [first, length] = [32, 40].map((at) => Number(bytes.readBigUInt64LE(row + at)));
    if (length > 0) segments.push([first, first + length]);
  }
  return { front: [0, base], base: [base, base + Number(bytes.readBigUInt64LE(28))], segments };
}

/**
 * A server of one take that can be another one later. It notes each request: its range, and how many bytes it gave. Ranges have a delay.
 * @param {Buffer} bytes
 * @param {{ ranges?: boolean, step?: number, pause?: number }} options  `step` bytes at a time, with `pause` milliseconds in between
 */
export function takeServer(bytes, { ranges = true, step = Infinity, pause = 5 } = {}) {
  const served = { bytes, requests: [], delay: 0, broken: () => false };
  served.answer = async (response, request) => {
    const { bytes } = served;
    const asked = ranges && /^bytes=(\d+)-(\d*)$/.exec(request.headers.range ?? "");
    const [first, last] = asked ? [Number(asked[1]), Math.min(Number(asked[2] || bytes.length - 1), bytes.length - 1)] : [0, bytes.length - 1];
    const noted = { range: asked ? [first, last + 1] : null, given: 0 };
    served.requests.push(noted);
    if (served.broken(noted)) return response.destroy();
    if (asked) await new Promise((resolve) => setTimeout(resolve, served.delay));
    response.writeHead(asked ? 206 : 200, {
      "content-type": "application/octet-stream", "content-length": last + 1 - first, etag: `"${bytes.length}"`,
      ...(ranges && { "accept-ranges": "bytes" }), ...(asked && { "content-range": `bytes ${first}-${last}/${bytes.length}` }),
    });
    for (let at = first; at <= last && !response.destroyed; ) {
      const end = Math.min(last + 1, at + step);
      response.write(bytes.subarray(at, end));
      noted.given += end - at;
      at = end;
      if (at <= last) await new Promise((resolve) => setTimeout(resolve, pause));
    }
    response.end();
  };
  return served;
}
