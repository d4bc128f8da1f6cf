// The Gaussians of a .l4gs scene as a gsplat component of PlayCanvas: textures of a container, in a format made for them.

import { BoundingBox, Entity, GSplatContainer, GSplatFormat, PIXELFORMAT_RGBA32F, Vec3, WORKBUFFER_UPDATE_ALWAYS, WORKBUFFER_UPDATE_AUTO } from "playcanvas";
import { Follower, baseColors } from "light4gs-player";

const STREAMS = ["center", "scale", "rotation", "color"];
/** PlayCanvas has quaternions as (w, x, y, z) here, as the library has them. */
const readGLSL = `
  vec3 getCenter() { return loadL4gsCenter().xyz; }
  vec3 getScale() { return loadL4gsScale().xyz; }
  vec4 getRotation() { return loadL4gsRotation(); }
  vec4 getColor() { return loadL4gsColor(); }`;
const readWGSL = readGLSL.replace(/(vec\d) (\w+)\(\)/g, "fn $2() -> $1f");

export async function createSplats(scene, app) {
  const streams = STREAMS.map((name) => ({ name: `l4gs${name[0].toUpperCase()}${name.slice(1)}`, format: PIXELFORMAT_RGBA32F }));
  const [least, most] = scene.info.bounds.map((corner) => new Vec3(...corner));
  const containerFor = (count) => {
    const made = new GSplatContainer(app.graphicsDevice, count, new GSplatFormat(app.graphicsDevice, streams, { readGLSL, readWGSL }));
    made.aabb = new BoundingBox(new Vec3().add2(least, most).mulScalar(0.5), new Vec3().sub2(most, least).mulScalar(0.5));
    return made;
  };
  let container = containerFor(scene.count);
  const follower = new Follower((time) => scene.gaussiansAt(time), (gaussians) => {
    const { count, means, scales, quaternions } = gaussians;
    // A segment of a take may have more Gaussians than the one before.
    if (count > container.maxSplats) {
      const before = container;
      container = object.gsplat.resource = containerFor(count);
      before.destroy();
    }
    const textures = streams.map(({ name }) => container.getTexture(name));
    const [center, scale, rotation, color] = textures.map((texture) => texture.lock());
    for (let i = 0; i < count; i++) {
      for (let axis = 0; axis < 3; axis++) {
        center[4 * i + axis] = means[3 * i + axis];
        scale[4 * i + axis] = scales[3 * i + axis];
      }
    }
    rotation.set(quaternions);
    baseColors(gaussians, color.subarray(0, 4 * count));
    for (const texture of textures) texture.unlock();
    // For the order, which a worker of PlayCanvas makes.
    container.centers.set(means);
    container.update(count);
    // PlayCanvas draws from a copy of all splats. WORKBUFFER_UPDATE_ONCE would be lost where a new order comes in the same frame.
    object.gsplat.workBufferUpdate = WORKBUFFER_UPDATE_ALWAYS;
  });
  const copied = () => (object.gsplat.workBufferUpdate = WORKBUFFER_UPDATE_AUTO);
  app.scene.on("postrender", copied);
  const object = new Entity("light4gs");
  object.addComponent("gsplat", { resource: container });
  await follower.update(0);
  return {
    object,
    update: (time) => follower.update(time),
    get time() {
      return follower.shown;
    },
    dispose() {
      follower.stop();
      app.scene.off("postrender", copied);
      object.destroy();
      container.destroy();
    },
  };
}
