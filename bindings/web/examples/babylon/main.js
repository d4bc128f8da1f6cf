// A dynamic scene in Babylon.js.

import { FreeCamera } from "@babylonjs/core/Cameras/freeCamera.js";
import { Engine } from "@babylonjs/core/Engines/engine.js";
import { Color4 } from "@babylonjs/core/Maths/math.color.js";
import { Vector3 } from "@babylonjs/core/Maths/math.vector.js";
import { Scene } from "@babylonjs/core/scene.js";
import { expose, openScene, timeAt, view } from "../page.js";
import { createSplats } from "./splats.js";

const scene = await openScene();
const engine = new Engine(document.querySelector("canvas"), false);
const world = new Scene(engine);
world.useRightHandedSystem = true;
world.clearColor = new Color4(...scene.info.background, 1);
const camera = new FreeCamera("camera", new Vector3(...view.position), world);
camera.fov = (view.fovY * Math.PI) / 180;
camera.minZ = view.near;
camera.maxZ = view.far;
camera.upVector = new Vector3(...view.up);
camera.setTarget(new Vector3(...view.target));
addEventListener("resize", () => engine.resize());

const splats = await createSplats(scene, world);
expose(scene, splats, (other, shDegree) => createSplats(other, world, shDegree));
engine.runRenderLoop(() => {
  splats.update(timeAt(scene, performance.now()));
  world.render();
});
