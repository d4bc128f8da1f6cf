// Writes control nodes as an animated GLB, lets Khronos's validator judge it, and moves it in three.js (its loader and its
// AnimationMixer, without a picture). Positions are compared with those that `light4gs export` writes as PLY at the same times.
//
// usage: node skin.mjs PROGRAM FILE.l4gs [FOLDER]

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import fs from "node:fs";
import os from "node:os";
import path from "node:path";

import { validateBytes } from "gltf-validator";
import * as three from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";

const KEYFRAMES = 21;
const FPS = 10;
// float32 against float64, relative to the scene's size of about 1.
const ROUNDING = 1e-5;

const [program, file, folder = fs.mkdtempSync(path.join(os.tmpdir(), "light4gs-skin-"))] = process.argv.slice(2);
if (!file) {
  console.error("usage: node skin.mjs PROGRAM FILE.l4gs [FOLDER]");
  process.exit(2);
}
const at = (name) => path.join(folder, name);
const run = (...options) => execFileSync(program, ["export", file, "--device", "flex", ...options], { encoding: "utf8" });
fs.mkdirSync(folder, { recursive: true });

/** Positions of a PLY in 3DGS's layout: floats, the first three of each row. */
function positionsOfPly(bytes) {
  const end = bytes.indexOf("end_header\n") + "end_header\n".length;
  const header = bytes.subarray(0, end).toString();
  const count = Number(/element vertex (\d+)/.exec(header)[1]);
  const width = header.match(/^property float /gm).length;
  return Array.from({ length: count }, (_, row) => [0, 1, 2].map((axis) => bytes.readFloatLE(end + 4 * (row * width + axis))));
}

/** Names of attributes with the prefix of an extension, which this release of the validator does not know yet. */
const ofExtension = ({ code, pointer }) =>
  code === "MESH_PRIMITIVE_INVALID_ATTRIBUTE" && pointer.includes("/attributes/KHR_gaussian_splatting:");

/** Neither errors nor warnings. */
async function judge(name) {
  const options = { uri: name, maxIssues: 0 };
  const { issues } = await validateBytes(new Uint8Array(fs.readFileSync(at(name))), options);
  assert.equal(issues.truncated, false);
  const serious = issues.messages.filter((message) => message.severity < 2 && !ofExtension(message));
  assert.deepEqual(serious.map(({ code, message, pointer }) => `${code} ${pointer}: ${message}`), [], name);
  const others = issues.messages.filter((message) => message.severity >= 2).map(({ code }) => code);
  console.log(`${name}: the validator finds neither errors nor warnings (remarks: ${[...new Set(others)].join(", ")})`);
}

run("--out", at("still.glb"), "--time", "0.5");
await judge("still.glb");
const said = run("--out", at("moving.glb"), "--frames", `${KEYFRAMES}`, "--fps", `${FPS}`);
await judge("moving.glb");
const largest = Number(/by (\S+) at most/.exec(said)[1]) + ROUNDING;
run("--out", at("frames"), "--frames", `${2 * KEYFRAMES - 1}`);

globalThis.self = globalThis;
const bytes = fs.readFileSync(at("moving.glb"));
const buffer = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length);
const gltf = await new Promise((done, failed) => new GLTFLoader().parse(buffer, "", done, failed));
const { bones, boneInverses } = await gltf.parser.getDependency("skin", 0);
let points;
gltf.scene.traverse((object) => { if (object.isPoints) points = object; });
const { position, skinIndex, skinWeight, joints_1, weights_1 } = points.geometry.attributes;
const sets = [[skinIndex, skinWeight], [joints_1, weights_1]].filter(([joints]) => joints);
const mixer = new three.AnimationMixer(gltf.scene);
mixer.clipAction(gltf.animations[0]).setLoop(three.LoopOnce).play();
mixer.clipAction(gltf.animations[0]).clampWhenFinished = true;

/** Where three.js has the points at a time: bones as its mixer moves them, weights as its loader reads them. */
function positionsAt(seconds) {
  mixer.setTime(seconds);
  gltf.scene.updateMatrixWorld(true);
  const matrices = bones.map((bone, index) => new three.Matrix4().multiplyMatrices(bone.matrixWorld, boneInverses[index]));
  return Array.from({ length: position.count }, (_, point) => {
    const sum = new three.Vector3();
    for (const [joints, weights] of sets) {
      for (let k = 0; k < 4; k++) {
        const moved = new three.Vector3().fromBufferAttribute(position, point).applyMatrix4(matrices[joints.getComponent(point, k)]);
        sum.addScaledVector(moved, weights.getComponent(point, k));
      }
    }
    return sum.toArray();
  });
}

let [worst, moved] = [0, 0];
const rest = positionsAt(0);
for (let half = 0; half < 2 * KEYFRAMES - 1; half++) {
  const exact = positionsOfPly(fs.readFileSync(at(`frames/${String(half).padStart(4, "0")}.ply`)));
  assert.equal(exact.length, position.count);
  for (const [point, found] of positionsAt(half / 2 / FPS).entries()) {
    worst = Math.max(worst, Math.hypot(...found.map((value, axis) => value - exact[point][axis])));
    moved = Math.max(moved, Math.hypot(...found.map((value, axis) => value - rest[point][axis])));
  }
}
console.log(`three.js: ${bones.length} joints, ${sets.length} sets of weights; points move by ${moved.toFixed(3)}, ` +
  `and are at most ${worst.toFixed(5)} from where the file has them; the program said ${largest.toFixed(5)}`);
assert.ok(moved > 0.1, "nothing moves");
assert.ok(worst <= largest, "farther from the file than the program said");
