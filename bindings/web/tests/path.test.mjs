// The path of the training cameras.

import assert from "node:assert/strict";
import { test } from "node:test";

import { center } from "../player/views/camera.js";
import { Path } from "../player/views/path.js";

const LENS = { fx: 50, fy: 50, cx: 32, cy: 24, width: 64, height: 48 };

/** A camera at (x, 0, 0) that is turned to the right by an angle. */
function camera(time, x, angle = 0, split = "train") {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  const rotation = [c, 0, -s, 0, 1, 0, s, 0, c];
  return { ...LENS, rotation, translation: [-c * x, 0, -s * x], time, split };
}

/** Axes are mixed and made orthogonal, so angles are in proportion only nearly. */
const close = (found, expected) =>
  found.forEach((value, k) => assert.ok(Math.abs(value - expected[k]) < 1e-4, `${found}, expected ${expected}`));

test("one camera that moves goes all the way", () => {
  const walk = Array.from({ length: 11 }, (_, k) => camera(k / 10, k, k / 10));
  const path = new Path([...walk.toReversed(), camera(0.55, 100, 0, "test")]);
  assert.ok(path.isContinuous);
  assert.equal(path.cameras.length, 11);
  for (const [time, x] of [[0, 0], [0.25, 2.5], [0.5, 5], [0.93, 9.3], [1, 10]]) {
    const at = path.at(time);
    close(center(at), [x, 0, 0]);
    close(at.rotation, camera(time, x, time).rotation);
    assert.equal(at.width, 64);
  }
  // Before the first and after the last.
  const late = new Path(walk.slice(2, 5));
  close(center(late.at(0)), [2, 0, 0]);
  close(center(late.at(1)), [4, 0, 0]);
});

test("cameras here and there are jumped between", () => {
  const places = [0, 9, 1, 8, 2, 7, 3, 6, 4, 5];
  const path = new Path(places.map((x, k) => camera(k / 9, x)));
  assert.ok(!path.isContinuous);
  close(center(path.at(0.4 / 9)), [0, 0, 0]);
  close(center(path.at(0.6 / 9)), [9, 0, 0]);
  close(center(path.at(2)), [5, 0, 0]);
});

test("a rig is no way, and without times there is no path", () => {
  const rig = [0, 0.5, 1].flatMap((time) => [camera(time, 0), camera(time, 1)]);
  const path = new Path(rig);
  assert.ok(!path.isContinuous);
  close(center(path.at(0.6)), [0, 0, 0]);
  assert.equal(new Path([{ ...LENS, rotation: rig[0].rotation, translation: [0, 0, 0] }]).at(0), undefined);
  assert.ok(!new Path([camera(0, 1), camera(0.5, 1), camera(1, 1)]).isContinuous, "it stands still");
});
