// Shared by the four examples: the scene, the viewpoint, and the clock.

import { Take, load } from "light4gs-player";

/** Four units away, 30 degrees up; the example's scene has z up. Angles in degrees. */
export const view = { position: [0, -4 * Math.cos(Math.PI / 6), 2], target: [0, 0, 0], up: [0, 0, 1], fovY: 40, near: 0.1, far: 100 };

/** The scene beside the page, or that of `?scene=ADDRESS`. */
export async function openScene() {
  const address = new URLSearchParams(location.search).get("scene") ?? "../scene.l4gs";
  const response = await fetch(address);
  if (!response.ok) throw new Error(`${address}: ${response.status}`);
  return load(await response.arrayBuffer());
}

/** The time to show at a moment (milliseconds): the scene over and over, or `example.hold`, where a test has set it. Those of a take are seconds. */
export const timeAt = (scene, now) => {
  const seconds = (now / 1000) % scene.duration;
  return globalThis.example?.hold ?? (scene instanceof Take ? seconds : seconds / scene.duration);
};

/** For the console, and for the tests: `globalThis.example`. `create` makes splats of another scene. */
export function expose(scene, splats, create, more = {}) {
  globalThis.example = { scene, splats, create, hold: null, ...more };
}
