import type { Scene } from "light4gs-player";
import type { Camera, Mesh } from "three";
import type { Splats } from "../splats.js";

/** The Gaussians as a mesh of three.js; `camera` is where the first order is made for. */
export function createSplats(scene: Scene, camera: Camera): Promise<ThreeSplats>;
export interface ThreeSplats extends Splats<Mesh> {
  /** With the camera that the scene is seen from, where that is another one. */
  update(time: number, camera?: Camera): Promise<void>;
}
