// What there is time for while something moves: without a browser.

import assert from "node:assert/strict";
import { test } from "node:test";
import { Draft } from "../player/views/draft.js";

/** A draft after images that took this long each, milliseconds. */
function after(milliseconds, images = 4) {
  const draft = new Draft(5);
  for (let k = 0; k < images; k++) draft.measureDrawing(milliseconds, 100 * k);
  return draft;
}

test("two pictures are drawn where one takes less than half of the time", () => {
  assert.equal(new Draft(5).hasTimeForTwo, false, "nothing is known yet");
  assert.equal(after(5).hasTimeForTwo, true);
  assert.equal(after(20).hasTimeForTwo, false);
  assert.equal(after(20).scale, 1);
});

test("slow images get fewer pixels, then fewer Gaussians", () => {
  assert.deepEqual([after(40).scale, after(40).level], [0.7, 0]);
  assert.deepEqual([after(40, 8).scale, after(40, 8).level], [0.7, 1]);
  assert.equal(after(40).hasTimeForTwo, false);
});

test("what small images took says nothing about large ones", () => {
  const draft = after(40);
  for (let k = 0; k < 4; k++) draft.measureDrawing(5, 60000 + 100 * k);
  assert.deepEqual([draft.scale, draft.hasTimeForTwo], [1, false]);
  for (let k = 0; k < 4; k++) draft.measureDrawing(5, 61000 + 100 * k);
  assert.equal(draft.hasTimeForTwo, true);
});

test("where the worker is slow, there is no time for two pictures either", () => {
  const draft = after(5);
  for (let k = 0; k < 4; k++) draft.measureWorker(40, 1000 + 100 * k);
  assert.equal(draft.level, 1);
  assert.equal(draft.hasTimeForTwo, false);
});
