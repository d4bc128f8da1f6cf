// How a take plays over 10 Mbit/s in headless Chromium: first image, seeks, joins, memory. The bounds are wide, since machines have other work;
// with LIGHT4GS_WEB_STRICT=1 they are those of two cores that have none. `node measure-take.mjs TAKE` measures a take of your own.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { scenePath } from "./harness.mjs";
import { makeTake, removeTakes } from "./take_harness.mjs";
import { LATE, firstImage, joins, machine, memory, rank, seeks } from "./take_measures.mjs";

const strict = process.env.LIGHT4GS_WEB_STRICT === "1";
/** Milliseconds. */
const [PAGE, TAKE, SEEK] = strict ? [1000, 1000, 700] : [8000, 4000, 4000];
/** Joins that are played over. */
const JOINS = strict ? 20 : 6;
/** Seconds of playing between which memory is compared, and bytes that it may grow. The segments that are loaded meanwhile have more. */
const [EARLY, LATER] = strict ? [10, 60] : [8, 22];
const GROWTH = 1.5e6;

/** Segments of a second, 246 kB each. */
let take;

before(() => (take = makeTake(24, scenePath)));
after(removeTakes);

const ms = (values) => values.map((value) => value.toFixed(0)).join(", ");

test("the first image and seeks take the bytes of a segment, at 10 Mbit/s", async () => {
  const first = await firstImage(take);
  const found = await seeks(take, 2);
  console.log(`  first image ${ms([first.page])} ms from the click, ${ms([first.take])} ms where the player is there; seeks ${ms(found)} ms; load ${machine().load[0]}`);
  assert.ok(first.page < PAGE && first.take < TAKE, JSON.stringify(first));
  assert.ok(found.length === 2 && found.every((seek) => seek < SEEK), JSON.stringify(found));
});

test("joins are played without waiting, and images are no later there than elsewhere", async () => {
  const { joins: at, waited, median, latest_elsewhere } = await joins(take, JOINS);
  const across = at.map(({ across }) => across);
  const latest = at.map(({ latest }) => latest);
  console.log(`  ${JOINS} joins: images across them ${ms(across)} ms, latest near them ${ms(latest)} ms, median of all ${ms([median])} ms; load ${machine().load[0]}`);
  assert.equal(waited, 0, "time stood still");
  assert.equal(at.length, JOINS);
  assert.ok(rank(across, 0.5) < 3 * median + LATE, `${ms(across)}, elsewhere ${median}`);
  if (strict) assert.ok(Math.max(...latest) < LATE, `${ms(latest)}; elsewhere ${latest_elsewhere}`);
});

test("memory does not grow with what was played", async () => {
  const [early, later] = await memory(take, [EARLY, LATER]);
  const grown = later.page - early.page;
  const loaded = (take.length * (LATER - EARLY)) / 24;
  console.log(`  memory of the page: ${(early.page / 1e6).toFixed(1)} MB after ${EARLY} s, ${(later.page / 1e6).toFixed(1)} MB after ${LATER} s; load ${machine().load[0]}`);
  assert.ok(grown < GROWTH && GROWTH < loaded / 2, `${grown} bytes; ${JSON.stringify(later.parts)}, before ${JSON.stringify(early.parts)}`);
});
