import type { GaussianSplattingMesh } from "@babylonjs/core/Meshes/GaussianSplatting/gaussianSplattingMesh.js";
import type { Scene as World } from "@babylonjs/core/scene.js";
import type { Scene } from "light4gs-player";
import type { Splats } from "../splats.js";

/**
 * The Gaussians as a mesh of Babylon.js.
 * @param world with `useRightHandedSystem`, or the scene is a mirror image
 * @param shDegree of the colors that Babylon.js evaluates, the scene's where not given; 0 saves the time of writing the coefficients
 */
export function createSplats(scene: Scene, world: World, shDegree?: number): Promise<Splats<GaussianSplattingMesh>>;
