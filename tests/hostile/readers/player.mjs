// Takes through the player's decoder, that of bindings/web/dist: hostile-streams --what records | node player.mjs [SECONDS]
// It ends after SECONDS of the processor. `records.py` says what a record is, and when an answer is right.

import { crc32 } from "node:zlib";
import { SceneError } from "../../../bindings/web/player/errors.js";
import { Decoder } from "../../../bindings/web/player/scene/decoder.js";
import { TakeDecoder } from "../../../bindings/web/player/take/take_decoder.js";
import { decoderModule } from "../../../bindings/web/tests/bundled_decoder.mjs";

/** One instance has the base, a segment as it was unpacked, and the same as it is drawn. */
const MOST_MIB = 4 * 256;
/** Decoding a stream may take 2 seconds; it is decoded, and read again from what was unpacked. */
const MOST_SECONDS = 4;
const VIEW = { row: [0, 0, 1, 4], eye: [0, 0, -4], spread: Infinity };

const [seconds = "Infinity"] = process.argv.slice(2);

const processorTime = () => (process.cpuUsage().user + process.cpuUsage().system) / 1e6;

/** The records on the standard input. */
async function* records() {
  let rest = Buffer.alloc(0);
  let record = null;
  for await (const piece of process.stdin) {
    rest = rest.length ? Buffer.concat([rest, piece]) : piece;
    for (;;) {
      if (!record) {
        const end = rest.indexOf(10);
        if (end < 0) break;
        record = JSON.parse(rest.subarray(0, end).toString());
        rest = rest.subarray(end + 1);
      }
      if (rest.length < record.bytes) break;
      yield [record, new Uint8Array(rest.subarray(0, record.bytes))];
      rest = rest.subarray(record.bytes);
      record = null;
    }
  }
}

/** Calls something that may refuse a file: its answer, or null. Anything else that it throws is a fault. */
function unlessRefused(call) {
  try {
    return call();
  } catch (error) {
    if (error instanceof SceneError && error.kind !== "memory") return null;
    throw error;
  }
}

/** The index of a take, range by range as the player reads it. */
function indexOf(take, bytes) {
  const ranges = [];
  for (;;) {
    const answer = take.index(ranges, bytes.length);
    if ("index" in answer) return answer.index;
    const [begin, end] = answer.needed;
    ranges.push(bytes.subarray(begin, end));
  }
}

/** What a take shows at a time: the checksum of the centers, which activations do not change; null where it is refused. */
async function centersAt(decoder, take, index, bytes, time, drawn, large) {
  for (const [begin, , from, to] of index.segments.filter(([begin]) => drawn.includes(begin))) {
    const unpacked = unlessRefused(() => take.unpack(begin, bytes.subarray(from, to)));
    if (!unpacked || !unlessRefused(() => take.segment(begin, unpacked))) return null;
  }
  let sum = 0;
  if (!large) {
    take.show(0, time);
    await decoder.evaluate(time, async () => {});
    decoder.drawList(VIEW, null);
    const { numbers, shDegree } = decoder.attributesAt(time);
    // Three for the center, three for the scales, four for the rotation, one for the opacity, and the harmonics.
    const count = numbers.length / (11 + 3 * (shDegree + 1) ** 2);
    const centers = numbers.subarray(0, 3 * count);
    sum = crc32(new Uint8Array(centers.buffer, centers.byteOffset, centers.byteLength));
  }
  for (const begin of drawn) take.forget(begin);
  return sum;
}

/** What is wrong with the player's answers, whether something was shown, and the memory. */
async function check(record, bytes, mostTime) {
  const decoder = new Decoder(decoderModule);
  const take = new TakeDecoder(decoder);
  let shown = false;
  let fault = null;
  try {
    const index = unlessRefused(() => indexOf(take, bytes));
    const base = index && unlessRefused(() => take.base(bytes.subarray(...index.base)));
    for (const [number, [time, expected, sum, centers]] of record.asked.entries()) {
      const before = processorTime();
      const found = base ? await centersAt(decoder, take, index, bytes, time, record.drawn[number], expected === "large") : null;
      mostTime(processorTime() - before);
      shown ||= found !== null;
      if (found === null && expected !== "refused") fault ??= `refuses ${time} s, which the codec shows`;
      if (found !== null && expected === "refused") fault ??= `shows ${time} s, which the codec refuses as ${sum}`;
      if (found !== null && expected === "shown" && found !== centers) fault ??= `shows other Gaussians at ${time} s`;
    }
  } catch (error) {
    fault = `fails: ${error instanceof Error ? error.message : error}`;
  }
  return { fault, shown, mib: decoder.wasm.memory.buffer.byteLength / 2 ** 20 };
}

const begin = processorTime();
const counts = { takes: 0, shown: 0, forged: 0, damaged: 0 };
let most = { seconds: 0, number: -1 };
let largest = { mib: 0, number: -1 };
let findings = 0;
for await (const [record, bytes] of records()) {
  const { number, kind, forged } = record;
  let slowest = 0;
  const found = await check(record, bytes, (time) => (slowest = Math.max(slowest, time)));
  const { mib, shown } = found;
  let { fault } = found;
  if (mib > MOST_MIB) fault ??= `takes ${mib} MiB`;
  if (slowest > MOST_SECONDS) fault ??= `takes ${slowest} s`;
  counts.takes += 1;
  counts.shown += Number(shown);
  counts[forged ? "forged" : "damaged"] += 1;
  if (slowest > most.seconds) most = { seconds: slowest, number };
  if (mib > largest.mib) largest = { mib, number };
  if (fault) {
    findings += 1;
    console.log(`take ${number} (${kind}): ${fault}`);
  }
  if (processorTime() - begin > Number(seconds)) break;
}
console.log(
  `the player: ${JSON.stringify(counts)}, ${findings} findings; ${Math.round(processorTime() - begin)} s, ` +
    `at most ${most.seconds.toFixed(3)} s (take ${most.number}), ${Math.round(largest.mib)} MiB (take ${largest.number})`,
);
process.exit(findings || !counts.takes ? 1 : 0);
