// How a take plays in headless Chromium over a slow connection: node measure-take.mjs TAKE [--cameras FILE] [--megabits 10] [--latency 20]
// [--width 640] [--height 480] [--joins 20] [--seeks 4] [--only first,seek,joins,memory]
// Prints JSON, times in milliseconds, memory in bytes. The machine should have nothing else to do: its load is in the answer.

import { readFileSync } from "node:fs";
import { parseArgs } from "node:util";
import { firstImage, joins, machine, memory, seeks } from "./tests/take_measures.mjs";

const number = (given) => ({ type: "string", default: String(given) });
const { values, positionals } = parseArgs({
  allowPositionals: true,
  options: {
    cameras: { type: "string" }, megabits: number(10), latency: number(20), width: number(640), height: number(480), joins: number(20), seeks: number(4),
    only: { type: "string", default: "first,seek,joins,memory" },
  },
});
const [file] = positionals;
if (!file) throw new Error("usage: node measure-take.mjs TAKE [--cameras FILE] [--megabits 10] [--latency 20] [--joins 20] ...");
const bytes = readFileSync(file);
const conditions = {
  megabits: Number(values.megabits), latency: Number(values.latency), width: Number(values.width), height: Number(values.height),
  cameras: values.cameras ? readFileSync(values.cameras, "utf8") : "[]",
};
const wanted = values.only.split(",");
const measured = { take: { file, bytes: bytes.length }, conditions: { ...conditions, cameras: values.cameras ?? "none" }, before: machine() };
if (wanted.includes("first")) measured.first_image = await firstImage(bytes, conditions);
if (wanted.includes("seek")) measured.seeks = await seeks(bytes, Number(values.seeks), conditions);
if (wanted.includes("joins")) measured.joins = await joins(bytes, Number(values.joins), conditions);
if (wanted.includes("memory")) measured.memory = await memory(bytes, [10, 60], conditions);
measured.after = machine();
console.log(JSON.stringify(measured, (_, value) => (typeof value === "number" ? Number(value.toFixed(2)) : value), 1));
