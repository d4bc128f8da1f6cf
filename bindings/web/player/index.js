// The player of .l4gs scenes, as a library and as the element <l4gs-player>. See docs/player.md.

export { Camera } from "./views/camera.js";
export { L4gsPlayer } from "./element/element.js";
export { Follower } from "./scene/follower.js";
export { Player } from "./player.js";
export { GraphicsError, SceneError } from "./errors.js";
export { Scene } from "./scene/scene.js";
export { Take } from "./take/take.js";
export { dismiss, load, prepare } from "./scene/load.js";
export { SplatRenderer } from "./drawing/splat_renderer.js";
export { baseColors } from "./scene/colors.js";

// Types of arguments and results, for users of TypeScript.
/** @typedef {import("./scene/scene.js").GaussiansAt} GaussiansAt */
/** @typedef {import("./scene/scene.js").SceneInfo} SceneInfo */
/** @typedef {import("./scene/scene.js").Viewpoint} Viewpoint */
/** @typedef {import("./scene/scene.js").Frame} Frame */
/** @typedef {import("./drawing/splat_renderer.js").View} View */
/** @typedef {import("./views/camera.js").DatasetCamera} DatasetCamera */
/** @typedef {import("./player.js").PlayerOptions} PlayerOptions */
