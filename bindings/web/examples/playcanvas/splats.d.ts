import type { Scene } from "light4gs-player";
import type { AppBase, Entity } from "playcanvas";
import type { Splats } from "../splats.js";

/** The Gaussians as an entity with a gsplat component; `app` has the system of those. */
export function createSplats(scene: Scene, app: AppBase): Promise<Splats<Entity>>;
