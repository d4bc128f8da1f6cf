// The index of a take that is cut, read range by range as the player reads it.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { Decoder } from "../player/scene/decoder.js";
import { readIndex } from "../player/take/read_index.js";
import { TakeDecoder } from "../player/take/take_decoder.js";
import { decoderModule } from "./bundled_decoder.mjs";

const appended = readFileSync(new URL("../../../tests/conformance/streams/takes/appended.l4gs", import.meta.url));

/** The index of a file of these bytes, and how often it was asked for. */
async function indexOf(bytes) {
  const take = new TakeDecoder(new Decoder(decoderModule));
  let asked = 0;
  const connection = {
    async ask({ ranges, length }) {
      assert.ok(asked++ < 20, "the same range is asked for again and again");
      return take.index(ranges, length);
    },
  };
  const file = { length: bytes.length, read: async (begin, end) => new Uint8Array(bytes.subarray(begin, end)) };
  return { found: await readIndex(connection, file), asked };
}

test("an index of several blocks is read", async () => {
  const { found, asked } = await indexOf(appended);
  assert.ok(found.index.segments.length > 1 && asked > 3, `${found.index.segments.length} segments, asked ${asked} times`);
});

test("a file that is cut is refused, where a block of its index begins too", async () => {
  // Blocks begin at multiples of 64: before, at and behind each.
  const ends = [...appended.keys()].filter((end) => (end + 1) % 64 < 3);
  for (const end of ends) await assert.rejects(indexOf(appended.subarray(0, end)), { name: "SceneError" }, `cut at ${end}`);
});
