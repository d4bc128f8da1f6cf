// A dynamic scene in Spark (three.js): the Gaussians of each time come from light4gs, Spark sorts and draws them.
//
//   npm install && npm run build
//   cp ../../tests/data/quickstart.l4gs scene.l4gs && python3 -m http.server

import { SparkRenderer, SplatMesh } from "@sparkjsdev/spark";
import * as THREE from "three";
import { load } from "../../dist/light4gs-player.js";

const bytes = await (await fetch("scene.l4gs")).arrayBuffer();
const source = await load(bytes);

const renderer = new THREE.WebGLRenderer();
document.body.append(renderer.domElement);
const world = new THREE.Scene();
world.background = new THREE.Color(...source.info.background);
const camera = new THREE.PerspectiveCamera(40, 1, 0.1, 100);
camera.up.set(0, 0, 1);
camera.position.set(0, -3.5, 2);
camera.lookAt(0, 0, 0);
world.add(new SparkRenderer({ renderer }));

const resize = () => {
  renderer.setSize(innerWidth, innerHeight);
  camera.aspect = innerWidth / innerHeight;
  camera.updateProjectionMatrix();
};
addEventListener("resize", resize);
resize();

const [center, scales] = [new THREE.Vector3(), new THREE.Vector3()];
const quaternion = new THREE.Quaternion();
const color = new THREE.Color();

/** Gives every Gaussian of a time to `set`. Colors are those of degree 0. */
function forEach(gaussians, set) {
  const coefficients = 3 * (gaussians.shDegree + 1) ** 2;
  for (let i = 0; i < gaussians.count; i++) {
    const [w, x, y, z] = gaussians.quaternions.subarray(4 * i, 4 * i + 4);
    center.fromArray(gaussians.means, 3 * i);
    scales.fromArray(gaussians.scales, 3 * i);
    quaternion.set(x, y, z, w);
    const channel = (c) => Math.max(0, 0.5 + 0.2820948 * gaussians.sh[coefficients * i + c]);
    color.setRGB(channel(0), channel(1), channel(2));
    set(i, center, scales, quaternion, gaussians.opacities[i], color);
  }
}

const first = await source.gaussiansAt(0);
const mesh = new SplatMesh({
  constructSplats: (splats) => forEach(first, (_, ...splat) => splats.pushSplat(...splat)),
});
await mesh.initialized;
world.add(mesh);

let busy = false;
renderer.setAnimationLoop(async (now) => {
  renderer.render(world, camera);
  if (busy) return;
  busy = true;
  const gaussians = await source.gaussiansAt(((now / 1000) % source.duration) / source.duration);
  forEach(gaussians, (i, ...splat) => mesh.packedSplats.setSplat(i, ...splat));
  mesh.packedSplats.needsUpdate = true;
  busy = false;
});
