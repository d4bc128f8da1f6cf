// The path of the training cameras over time. Where one camera moves, it goes all the way between them; where cameras are here and
// there, it is at the nearest in time.

import { add, center, cross, dot, normalize } from "./camera.js";

/** @typedef {import("./camera.js").DatasetCamera} DatasetCamera */
/** @typedef {import("./camera.js").Vector} Vector */

/** One camera that moves makes steps that are at most this share of the box around all places, in the mean. */
const LONGEST_STEP = 0.2;

export class Path {
  /** @param {DatasetCamera[]} cameras  of a dataset */
  constructor(cameras) {
    /** In the order of their times. */
    this.cameras = cameras
      .filter(({ split, time }) => (split ?? "train") === "train" && time !== undefined)
      .sort((a, b) => (a.time ?? 0) - (b.time ?? 0));
    /** Whether they are one camera that moves. */
    this.isContinuous = isContinuous(this.cameras);
  }

  /**
   * The camera at a time; none without cameras.
   * @param {number} time  in [0, 1]
   * @returns {DatasetCamera | undefined}
   */
  at(time) {
    const { cameras } = this;
    const next = cameras.findIndex((camera) => (camera.time ?? 0) > time);
    if (next <= 0) return next === 0 ? cameras[0] : cameras.at(-1);
    const [before, after] = [cameras[next - 1], cameras[next]];
    const [begin, end] = [before.time ?? 0, after.time ?? 0];
    const share = (time - begin) / (end - begin);
    if (this.isContinuous) return between(before, after, share, time);
    // Of several at one time, the first.
    const nearest = share > 0.5 ? after : before;
    return cameras.find((camera) => camera.time === nearest.time);
  }
}

/** @param {DatasetCamera[]} cameras  in the order of their times */
function isContinuous(cameras) {
  const places = cameras.map(center);
  const steps = cameras.slice(1).map((camera, index) => ({
    seconds: (camera.time ?? 0) - (cameras[index].time ?? 0),
    length: Math.hypot(...add(places[index + 1], places[index], -1)),
  }));
  if (steps.length < 2 || steps.some(({ seconds }) => !(seconds > 0))) return false;
  const extents = [0, 1, 2].map((axis) => {
    const along = places.map((place) => place[axis]);
    return Math.max(...along) - Math.min(...along);
  });
  const mean = steps.reduce((sum, { length }) => sum + length, 0) / steps.length;
  return mean > 0 && mean <= LONGEST_STEP * Math.hypot(...extents);
}

/**
 * @param {DatasetCamera} a @param {DatasetCamera} b @param {number} share  of the way from one to the other @param {number} time
 * @returns {DatasetCamera}
 */
function between(a, b, share, time) {
  const row = (/** @type {number} */ at) => /** @type {Vector} */ ([0, 1, 2].map((k) => mix(a.rotation[at + k], b.rotation[at + k], share)));
  const forward = normalize(row(6));
  const down = normalize(add(row(3), forward, -dot(row(3), forward)));
  const right = cross(down, forward);
  const [from, to] = [center(a), center(b)];
  const place = add(from, add(to, from, -1), share);
  const translation = [right, down, forward].map((axis) => -dot(axis, place));
  return { ...a, rotation: [...right, ...down, ...forward], translation, time };
}

/** @param {number} a @param {number} b @param {number} share */
const mix = (a, b, share) => a + share * (b - a);
