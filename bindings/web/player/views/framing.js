// The first view: that of the dataset's first camera, or one that shows all Gaussians except outliers.

import { commonTarget, commonUp } from "./camera.js";
import { ENTRY, NEAR } from "../drawing/constants.js";

/** @typedef {import("./camera.js").Camera} Camera */
/** @typedef {import("./camera.js").DatasetCamera} DatasetCamera */
/** @typedef {import("./camera.js").Vector} Vector */
/** @typedef {import("../drawing/splat_renderer.js").View} View */

/** Shares of the Gaussians' coordinates that count as outliers, on either side. */
const OUTLIERS = 0.03;
/** Gaussians that are looked at. */
const SAMPLES = 5000;

/**
 * The lens of the source's default camera.
 * @param {import("../scene/scene.js").SceneInfo} info
 */
export function sourceLens({ width, height, fovX }) {
  const [w, h] = width > 0 && height > 0 ? [width, height] : [800, 800];
  const angle = fovX > 0 && fovX < 3 ? fovX : 0.7;
  const focal = w / 2 / Math.tan(angle / 2);
  return { fx: focal, fy: focal, cx: w / 2, cy: h / 2, width: w, height: h };
}

/**
 * Middle and radius of a scene, world units.
 * @param {Float32Array} list  as {@link import("../scene/scene.js").Scene.frame} gives it
 * @returns {{ middle: Vector, radius: number }}
 */
function extent(list) {
  const stride = ENTRY * Math.max(1, Math.floor(list.length / ENTRY / SAMPLES));
  /** @type {number[]} */
  const entries = [];
  for (let at = 0; at < list.length; at += stride) if (list[at + 3] > 0.05) entries.push(at);
  const sorted = (/** @type {(at: number) => number} */ value) => entries.map(value).sort((a, b) => a - b);
  const pick = (/** @type {number[]} */ values, /** @type {number} */ share) => values[Math.floor(share * (values.length - 1))] ?? 0;
  const centers = [0, 1, 2].map((axis) => {
    const values = sorted((at) => list[at + axis]);
    const [low, high] = [pick(values, OUTLIERS), pick(values, 1 - OUTLIERS)];
    return { middle: (low + high) / 2, half: (high - low) / 2 };
  });
  // Where the centers are close together, the Gaussians' own size counts: the variances stand at 4, 7 and 9.
  const size = pick(sorted((at) => 2 * Math.sqrt(Math.max(list[at + 4], list[at + 7], list[at + 9]))), 0.5);
  return {
    middle: /** @type {Vector} */ (centers.map(({ middle }) => middle)),
    radius: Math.max(Math.hypot(...centers.map(({ half }) => half)) + size, 1e-6),
  };
}

/**
 * Moves a camera to the first view.
 * @param {Camera} camera
 * @param {DatasetCamera[]} cameras
 * @param {Float32Array} list  what is drawn at the beginning, seen from anywhere
 * @param {View} view  what the camera sees
 */
export function stand(camera, cameras, list, view) {
  const { middle, radius } = extent(list);
  camera.up = commonUp(cameras);
  if (cameras.length > 0) {
    const target = commonTarget(cameras) ?? middle;
    camera.take(cameras[0]);
    const ahead = [0, 1, 2].reduce((sum, i) => sum + (target[i] - camera.position[i]) * camera.axes[2][i], 0);
    camera.distance = ahead > 0.1 * radius ? ahead : Math.max(radius, 0.1);
    return;
  }
  const narrow = Math.min(view.width / 2 / view.fx, view.height / 2 / view.fy);
  const wanted = (1.15 * radius) / Math.sin(Math.atan(narrow));
  // A scene so small that all of it would be too near is looked at from farther, through a longer lens.
  const distance = Math.max(wanted, 1.5 * NEAR + radius);
  camera.lens.fx *= distance / wanted;
  camera.lens.fy *= distance / wanted;
  camera.lookAt(
    [middle[0], middle[1] - distance * Math.cos(Math.PI / 6), middle[2] + distance * Math.sin(Math.PI / 6)],
    middle,
  );
}
