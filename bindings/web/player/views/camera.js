// Cameras: an OpenCV pinhole that turns around a point, moves along its axes and takes the place of a dataset's camera.

import { SceneError } from "../errors.js";

/** @typedef {import("../drawing/splat_renderer.js").View} View */
/** @typedef {[number, number, number]} Vector */

/**
 * @typedef {object} CameraFields
 * @property {string} [name]  for people
 * @property {string} [split]  `train`, `test`, `val`, `video`
 * @property {number} [time]  in [0, 1]
 *
 * @typedef {View & CameraFields} DatasetCamera  a camera of a dataset
 */

/** @param {Vector} a @param {Vector} b */
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
/** @param {Vector} a @param {Vector} b @param {number} [factor] @returns {Vector} */
export const add = (a, b, factor = 1) => [a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]];
/** @param {Vector} a @param {Vector} b @returns {Vector} */
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
/** @param {Vector} a @returns {Vector} */
export const normalize = (a) => {
  const length = Math.hypot(...a);
  return length > 0 ? [a[0] / length, a[1] / length, a[2] / length] : [0, 0, 1];
};

/**
 * A vector turned around a unit axis.
 * @param {Vector} v @param {Vector} axis @param {number} angle  radians
 * @returns {Vector}
 */
export function turn(v, axis, angle) {
  const [cosine, sine] = [Math.cos(angle), Math.sin(angle)];
  const along = dot(v, axis) * (1 - cosine);
  const across = cross(axis, v);
  return add(add([v[0] * cosine, v[1] * cosine, v[2] * cosine], across, sine), axis, along);
}

/** Required fields of a camera, with the length of each list; 0 for a single number. */
const FIELDS = { rotation: 9, translation: 3, fx: 0, fy: 0, cx: 0, cy: 0, width: 0, height: 0 };

/**
 * Cameras from JSON text.
 * @param {string} text
 * @param {string} where  its address or place, for messages
 * @returns {DatasetCamera[]}
 * @throws {SceneError} `cameras`, which names the camera and the field
 */
export function readCameras(text, where) {
  const refuse = (/** @type {string} */ message) => new SceneError("cameras", `${where}: ${message}`);
  let list;
  try {
    list = JSON.parse(text);
  } catch (error) {
    throw refuse(`no JSON: ${error instanceof Error ? error.message : error}`);
  }
  if (!Array.isArray(list)) throw refuse("expected a list of cameras");
  list.forEach((camera, index) => {
    for (const [field, length] of Object.entries(FIELDS)) {
      const value = camera?.[field];
      const numbers = length === 0 ? [value] : Array.isArray(value) && value.length === length ? value : [NaN];
      if (!numbers.every(Number.isFinite)) {
        throw refuse(`camera ${index}: ${field} is ${JSON.stringify(value)}, expected ${length === 0 ? "a number" : `${length} numbers`}`);
      }
    }
    for (const field of ["fx", "fy", "width", "height"]) {
      if (!(camera[field] > 0)) throw refuse(`camera ${index}: ${field} is ${camera[field]}, expected more than 0`);
    }
    if (camera.time !== undefined && !Number.isFinite(camera.time)) {
      throw refuse(`camera ${index}: time is ${JSON.stringify(camera.time)}, expected a number in [0, 1], or nothing`);
    }
  });
  return list;
}

/** Where a camera stands. @param {View} view @returns {Vector} */
export function center({ rotation: r, translation: t }) {
  const coordinate = (/** @type {number} */ i) => -(r[i] * t[0] + r[3 + i] * t[1] + r[6 + i] * t[2]);
  return [coordinate(0), coordinate(1), coordinate(2)];
}

/** How near the view may come to the up axis, radians. */
const POLE = 0.03;

export class Camera {
  /** World axes of the camera: right, down, forward. @type {[Vector, Vector, Vector]} */
  axes = [[1, 0, 0], [0, 0, -1], [0, 1, 0]];
  /** Its center, world units. @type {Vector} */
  position = [0, -4, 0];
  /** Distance to the point that it turns around, ahead. */
  distance = 4;
  /** Upwards in the world. @type {Vector} */
  up = [0, 0, 1];
  /** Intrinsics of an image of `width × height`; the canvas shows all of it. */
  lens = { fx: 1, fy: 1, cx: 0.5, cy: 0.5, width: 1, height: 1 };

  /** A copy. */
  clone() {
    const camera = Object.assign(new Camera(), this);
    camera.axes = /** @type {[Vector, Vector, Vector]} */ (this.axes.map((axis) => [...axis]));
    camera.position = [...this.position];
    camera.lens = { ...this.lens };
    return camera;
  }

  /** The point that it turns around. @returns {Vector} */
  get target() {
    return add(this.position, this.axes[2], this.distance);
  }

  /**
   * Stands at a place and looks at another.
   * @param {Vector} position @param {Vector} target
   */
  lookAt(position, target) {
    const forward = normalize(add(target, position, -1));
    const sideways = [this.up, /** @type {Vector} */ ([0, 1, 0]), /** @type {Vector} */ ([1, 0, 0])]
      .map((up) => cross(forward, up)).find((side) => Math.hypot(...side) > 1e-6);
    const right = normalize(sideways ?? [1, 0, 0]);
    this.axes = [right, cross(forward, right), forward];
    this.position = [...position];
    this.distance = Math.hypot(...add(target, position, -1));
  }

  /**
   * Takes the place of a dataset's camera, lens and all.
   * @param {View} view
   */
  take(view) {
    const { rotation: r } = view;
    this.axes = [[r[0], r[1], r[2]], [r[3], r[4], r[5]], [r[6], r[7], r[8]]];
    this.position = center(view);
    const { fx, fy, cx, cy, width, height } = view;
    this.lens = { fx, fy, cx, cy, width, height };
  }

  /** Turns around the target. Angles in radians; positive: the scene turns right, and towards the viewer from above. */
  orbit(/** @type {number} */ sideways, /** @type {number} */ upwards) {
    const { target } = this;
    this.#turnView(sideways, upwards);
    this.position = add(target, this.axes[2], -this.distance);
  }

  /** Turns the view where it stands. */
  look(/** @type {number} */ sideways, /** @type {number} */ upwards) {
    this.#turnView(-sideways, -upwards);
  }

  #turnView(/** @type {number} */ sideways, /** @type {number} */ upwards) {
    const height = Math.asin(Math.max(-1, Math.min(1, -dot(this.axes[2], this.up))));
    const highest = Math.PI / 2 - POLE;
    // Where a dataset's camera stands beyond the pole already, it may only come back.
    const tilt = Math.max(Math.min(upwards, Math.max(highest - height, 0)), Math.min(-highest - height, 0));
    const right = this.axes[0];
    this.axes = /** @type {[Vector, Vector, Vector]} */ (
      this.axes.map((axis) => normalize(turn(turn(axis, right, -tilt), this.up, -sideways)))
    );
  }

  /** Rolls around the view axis. */
  roll(/** @type {number} */ angle) {
    const forward = this.axes[2];
    this.axes = [turn(this.axes[0], forward, angle), turn(this.axes[1], forward, angle), forward];
  }

  /** Moves along its axes, in world units: right, down, forward. The target goes along. */
  move(/** @type {number} */ right, /** @type {number} */ down, /** @type {number} */ forward) {
    this.position = add(add(add(this.position, this.axes[0], right), this.axes[1], down), this.axes[2], forward);
  }

  /** Goes nearer to the target (factor below 1) or away from it. */
  zoom(/** @type {number} */ factor) {
    const { target } = this;
    this.distance = Math.max(this.distance * factor, 1e-3);
    this.position = add(target, this.axes[2], -this.distance);
  }

  /** World units that a pixel of the canvas covers at the target. */
  unitsPerPixel(/** @type {number} */ width, /** @type {number} */ height) {
    return this.distance / this.view(width, height).fx;
  }

  /**
   * The view on a canvas of `width` × `height` pixels: all of the lens's image, and more on two sides if the shape differs.
   * @param {number} width @param {number} height
   * @returns {View}
   */
  view(width, height) {
    const { lens, axes, position } = this;
    const scale = Math.min(width / lens.width, height / lens.height);
    const translation = axes.map((axis) => -dot(axis, position));
    return {
      rotation: axes.flat(), translation, width, height,
      fx: lens.fx * scale, fy: lens.fy * scale,
      cx: width / 2 + (lens.cx - lens.width / 2) * scale,
      cy: height / 2 + (lens.cy - lens.height / 2) * scale,
    };
  }
}

/**
 * The upward direction of most of a dataset's cameras; z without cameras.
 * @param {DatasetCamera[]} cameras
 * @returns {Vector}
 */
export function commonUp(cameras) {
  const sum = cameras.reduce((up, { rotation: r }) => add(up, [r[3], r[4], r[5]], -1), /** @type {Vector} */ ([0, 0, 0]));
  if (Math.hypot(...sum) < 0.1 * cameras.length || cameras.length === 0) return [0, 0, 1];
  const up = normalize(sum);
  // Cameras all around that look down a little mean the axis itself.
  const axis = up.findIndex((component) => Math.abs(component) > 0.9);
  return axis < 0 ? up : /** @type {Vector} */ ([0, 1, 2].map((i) => (i === axis ? Math.sign(up[i]) : 0)));
}

/**
 * The point that a dataset's cameras look at: nearest to their view axes.
 * @param {DatasetCamera[]} cameras
 * @returns {Vector | null}  nothing where the axes are parallel
 */
export function commonTarget(cameras) {
  // Sum of (1 - f fᵀ) x = sum of (1 - f fᵀ) c, solved by Cramer's rule.
  const m = [0, 0, 0, 0, 0, 0, 0, 0, 0];
  const b = [0, 0, 0];
  for (const camera of cameras) {
    const f = [camera.rotation[6], camera.rotation[7], camera.rotation[8]];
    const c = center(camera);
    for (let i = 0; i < 3; i++) {
      for (let j = 0; j < 3; j++) {
        const p = (i === j ? 1 : 0) - f[i] * f[j];
        m[3 * i + j] += p;
        b[i] += p * c[j];
      }
    }
  }
  /** @type {Vector[]} */
  const columns = [[m[0], m[3], m[6]], [m[1], m[4], m[7]], [m[2], m[5], m[8]]];
  const determinant = dot(columns[0], cross(columns[1], columns[2]));
  if (!(Math.abs(determinant) > 1e-3 * cameras.length ** 3)) return null;
  const right = /** @type {Vector} */ (b);
  return [
    dot(right, cross(columns[1], columns[2])) / determinant,
    dot(columns[0], cross(right, columns[2])) / determinant,
    dot(columns[0], cross(columns[1], right)) / determinant,
  ];
}
