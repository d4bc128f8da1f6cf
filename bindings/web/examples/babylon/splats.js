// The Gaussians of a .l4gs scene in Babylon.js: written into its 32 bytes a splat, which it sorts in a worker of its own.

import { GaussianSplattingMesh } from "@babylonjs/core/Meshes/GaussianSplatting/gaussianSplattingMesh.js";
import { Follower, baseColors } from "light4gs-player";

/** Bytes a splat: center and scales as floats, color with opacity and quaternion as bytes. */
const SPLAT = 32;

export async function createSplats(scene, world, shDegree = scene.info.shDegree) {
  const object = new GaussianSplattingMesh("light4gs", null, world);
  // The coefficients that depend on the view, as bytes of [-1, 1], 16 of a splat in each texture.
  const rest = 3 * (shDegree + 1) ** 2 - 3;
  const memoryFor = (count) => {
    const data = new ArrayBuffer(SPLAT * count);
    const textures = Array.from({ length: Math.ceil(rest / 16) }, () => new Uint8ClampedArray(16 * count));
    // An array of clamped bytes rounds.
    return { data, floats: new Float32Array(data), bytes: new Uint8ClampedArray(data), colors: new Float32Array(4 * count), textures, count };
  };
  let memory = memoryFor(0);
  const follower = new Follower((time) => scene.gaussiansAt(time), (gaussians) => {
    const { count, means, scales, quaternions, sh } = gaussians;
    // In a take each segment has another number, and may have another degree.
    if (count !== memory.count) memory = memoryFor(count);
    const { data, floats, bytes, colors, textures } = memory;
    const all = 3 * (gaussians.shDegree + 1) ** 2;
    baseColors(gaussians, colors);
    for (let i = 0; i < count; i++) {
      for (let axis = 0; axis < 3; axis++) {
        floats[8 * i + axis] = means[3 * i + axis];
        floats[8 * i + 3 + axis] = scales[3 * i + axis];
      }
      for (let k = 0; k < 4; k++) {
        bytes[SPLAT * i + 24 + k] = 255 * colors[4 * i + k];
        bytes[SPLAT * i + 28 + k] = 127.5 * (1 + quaternions[4 * i + k]);
      }
      for (let k = 0; k < rest; k++) textures[k >> 4][16 * i + (k & 15)] = 127.5 * (1 + (3 + k < all ? sh[all * i + 3 + k] : 0));
    }
    object.updateData(data, rest > 0 ? textures : undefined, { flipY: false }, undefined, shDegree);
  });
  await follower.update(0);
  return {
    object,
    update: (time) => follower.update(time),
    get time() {
      return follower.shown;
    },
    dispose() {
      follower.stop();
      object.dispose();
    },
  };
}
