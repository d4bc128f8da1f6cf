export { Camera } from "./views/camera.js";
export { L4gsPlayer } from "./element/element.js";
export { Player } from "./player.js";
export { GraphicsError, SceneError } from "./errors.js";
export { Scene, dismiss, load, prepare } from "./scene/scene.js";
export { SplatRenderer } from "./drawing/splat_renderer.js";
