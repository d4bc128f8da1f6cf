// A dynamic scene in three.js, with a mesh that is made here.

import * as THREE from "three";
import { expose, openScene, timeAt, view } from "../page.js";
import { createSplats } from "./splats.js";

const scene = await openScene();
const renderer = new THREE.WebGLRenderer({ canvas: document.querySelector("canvas") });
const world = new THREE.Scene();
world.background = new THREE.Color().setRGB(...scene.info.background, THREE.SRGBColorSpace);
const camera = new THREE.PerspectiveCamera(view.fovY, 1, view.near, view.far);
camera.up.set(...view.up);
camera.position.set(...view.position);
camera.lookAt(...view.target);
const resize = () => {
  renderer.setSize(innerWidth, innerHeight, false);
  camera.aspect = innerWidth / innerHeight;
  camera.updateProjectionMatrix();
};
addEventListener("resize", resize);
resize();

const splats = await createSplats(scene, camera);
world.add(splats.object);
expose(scene, splats, (other) => createSplats(other, camera), { THREE, renderer, world, camera });
renderer.setAnimationLoop((now) => {
  splats.update(timeAt(scene, now));
  renderer.render(world, camera);
});
