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
export type GaussiansAt = import("./scene/scene.js").GaussiansAt;
export type SceneInfo = import("./scene/scene.js").SceneInfo;
export type Viewpoint = import("./scene/scene.js").Viewpoint;
export type Frame = import("./scene/scene.js").Frame;
export type View = import("./drawing/splat_renderer.js").View;
export type DatasetCamera = import("./views/camera.js").DatasetCamera;
export type PlayerOptions = import("./player.js").PlayerOptions;
/** @typedef {import("./scene/scene.js").GaussiansAt} GaussiansAt */
/** @typedef {import("./scene/scene.js").SceneInfo} SceneInfo */
/** @typedef {import("./scene/scene.js").Viewpoint} Viewpoint */
/** @typedef {import("./scene/scene.js").Frame} Frame */
/** @typedef {import("./drawing/splat_renderer.js").View} View */
/** @typedef {import("./views/camera.js").DatasetCamera} DatasetCamera */
/** @typedef {import("./player.js").PlayerOptions} PlayerOptions */
