// Which segments a time needs: without a browser.

import assert from "node:assert/strict";
import { test } from "node:test";
import { MOST_DECODED, placeAt, plan } from "../player/take/plan.js";

/** Segments of these begins and ends. */
const placesOf = (...times) => times.map(([begin, end], k) => ({ begin, end, first: 100 * k, last: 100 * k + 100 }));
const seconds = (count) => placesOf(...Array.from({ length: count }, (_, k) => [k, k + 1]));
const begins = (places) => places.map(({ begin }) => begin);
const once = { loop: false, duration: 10 };

test("the segment of a second begins by it, and ends after it", () => {
  const places = placesOf([0, 1], [1, 2], [4, 6]);
  const found = [-1, 0, 0.999, 1, 2, 3.9, 4, 5.5, 6, NaN].map((at) => placeAt(places, at)?.begin);
  assert.deepEqual(found, [undefined, 0, 0, 1, undefined, undefined, 4, 4, undefined, undefined]);
  assert.equal(placeAt([], 0), undefined);
});

test("what is shown comes first, then some seconds ahead, of which two segments are decoded", () => {
  const { shown, load, decode, keep } = plan(seconds(10), 2.5, once);
  assert.equal(shown.begin, 2);
  assert.deepEqual(begins(load), [2, 3, 4, 5, 6, 7]);
  assert.deepEqual(begins(decode), [2, 3, 4]);
  assert.deepEqual(begins(keep), [2, 3, 4, 1]);
});

test("right after a join only the next segment is decoded, and all stay", () => {
  const long = placesOf([0, 2], [2, 4], [4, 6], [6, 8]);
  const at = (places, seconds) => {
    const { decode, keep } = plan(places, seconds, once);
    return [begins(decode), begins(keep)];
  };
  assert.deepEqual(at(long, 2.4), [[2, 4], [2, 4, 6, 0]]);
  assert.deepEqual(at(long, 2.5), [[2, 4, 6], [2, 4, 6, 0]]);
  // A quarter of a short one.
  assert.deepEqual(at(seconds(10), 2.2)[0], [2, 3]);
  assert.deepEqual(at(seconds(10), 2.25)[0], [2, 3, 4]);
});

test("what is on the screen is kept in place of what is behind", () => {
  const places = seconds(10);
  assert.deepEqual(begins(plan(places, 6.5, { ...once, held: places[1] }).keep), [6, 7, 8, 1]);
  assert.deepEqual(begins(plan(places, 6.5, { ...once, held: places[6] }).keep), [6, 7, 8, 5]);
});

test("the beginning follows the end only in a loop", () => {
  assert.deepEqual(begins(plan(seconds(10), 9.5, once).load), [9]);
  assert.deepEqual(begins(plan(seconds(10), 9.5, { loop: true, duration: 10 }).decode), [9, 0, 1]);
  // Each once, where there are few.
  assert.deepEqual(begins(plan(seconds(2), 1.5, { loop: true, duration: 2 }).load), [1, 0]);
  assert.deepEqual(begins(plan(seconds(1), 0.5, { loop: true, duration: 1 }).load), [0]);
});

test("in a gap the next segment is loaded, however far it is", () => {
  const places = placesOf([0, 1], [600, 601], [601, 602]);
  const { shown, load, keep } = plan(places, 300, { loop: false, duration: 602 });
  assert.equal(shown, undefined);
  assert.deepEqual([begins(load), begins(keep)], [[600], [600, 0]]);
  assert.deepEqual(plan([], 3, { loop: true, duration: 0 }), { shown: undefined, load: [], decode: [], keep: [] });
  // Before the first, and behind the last.
  assert.deepEqual(begins(plan(places.slice(1), 0, { loop: false, duration: 602 }).load), [600]);
  assert.deepEqual(begins(plan(places, 700, { loop: true, duration: 800 }).load), [0]);
});

test("short segments are not loaded without end, and never more than some are decoded", () => {
  const places = placesOf(...Array.from({ length: 10_000 }, (_, k) => [k / 1000, (k + 1) / 1000]));
  const { load, keep } = plan(places, 2, once);
  assert.ok(load.length <= 17, `${load.length}`);
  assert.equal(keep.length, MOST_DECODED);
});
