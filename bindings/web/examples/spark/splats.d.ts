import type { SplatMesh } from "@sparkjsdev/spark";
import type { Scene } from "light4gs-player";
import type { Splats } from "../splats.js";

/** The Gaussians as a mesh of Spark. */
export function createSplats(scene: Scene): Promise<Splats<SplatMesh>>;
