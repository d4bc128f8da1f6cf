// A dynamic scene in Spark, a renderer of splats for three.js.

import { SparkRenderer } from "@sparkjsdev/spark";
import * as THREE from "three";
import { expose, openScene, timeAt, view } from "../page.js";
import { createSplats } from "./splats.js";

const scene = await openScene();
const renderer = new THREE.WebGLRenderer({ canvas: document.querySelector("canvas") });
const world = new THREE.Scene();
world.background = new THREE.Color().setRGB(...scene.info.background, THREE.SRGBColorSpace);
// The constants of the renderer that the scene was trained with; Spark's own are those of scenes with anti-aliasing.
world.add(new SparkRenderer({ renderer, preBlurAmount: 0.3, blurAmount: 0, minAlpha: 1 / 255, maxStdDev: 3.33, sortRadial: false }));
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

const splats = await createSplats(scene);
world.add(splats.object);
expose(scene, splats, createSplats);
renderer.setAnimationLoop((now) => {
  splats.update(timeAt(scene, now));
  renderer.render(world, camera);
});
