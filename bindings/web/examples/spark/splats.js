// The Gaussians of a .l4gs scene in Spark: they are packed into its 16 bytes a splat, Spark sorts and draws them.

import { PackedSplats, SplatMesh, setPackedSplat } from "@sparkjsdev/spark";
import { Follower, baseColors } from "light4gs-player";

export async function createSplats(scene) {
  let object = null;
  const packed = new PackedSplats({ maxSplats: scene.count });
  await packed.initialized;
  let colors = new Float32Array();
  const follower = new Follower((time) => scene.gaussiansAt(time), (gaussians) => {
    const { count, means: m, scales: s, quaternions: q } = gaussians;
    // In a take each segment has another number.
    packed.ensureSplats(count);
    packed.numSplats = count;
    if (colors.length < 4 * count) colors = new Float32Array(4 * count);
    baseColors(gaussians, colors);
    for (let i = 0; i < count; i++) {
      const [a, b] = [3 * i, 4 * i];
      setPackedSplat(
        packed.packedArray, i, m[a], m[a + 1], m[a + 2], s[a], s[a + 1], s[a + 2],
        q[b + 1], q[b + 2], q[b + 3], q[b], colors[b + 3], colors[b], colors[b + 1], colors[b + 2],
      );
    }
    packed.needsUpdate = true; // its texture
    if (object) object.needsUpdate = true; // and Spark's own copy
  });
  await follower.update(0);
  object = new SplatMesh({ packedSplats: packed });
  await object.initialized;
  return {
    object,
    update: (time) => follower.update(time),
    get time() {
      return follower.shown;
    },
    dispose() {
      follower.stop();
      object.removeFromParent();
      object.dispose();
    },
  };
}
