// A dynamic scene in PlayCanvas.

import * as pc from "playcanvas";
import { expose, openScene, timeAt, view } from "../page.js";
import { createSplats } from "./splats.js";

const scene = await openScene();
const canvas = document.querySelector("canvas");
const options = new pc.AppOptions();
options.graphicsDevice = await pc.createGraphicsDevice(canvas, { deviceTypes: ["webgl2"], antialias: false });
options.componentSystems = [pc.CameraComponentSystem, pc.GSplatComponentSystem];
const app = new pc.AppBase(canvas);
app.init(options);
app.setCanvasFillMode(pc.FILLMODE_FILL_WINDOW);
app.setCanvasResolution(pc.RESOLUTION_AUTO);
addEventListener("resize", () => app.resizeCanvas());
// 32 bytes a splat in place of 20: half floats, where PlayCanvas otherwise rounds scales and opacities to bytes.
app.scene.gsplat.dataFormat = pc.GSPLATDATA_LARGE;

const camera = new pc.Entity("camera");
const { fovY: fov, near: nearClip, far: farClip } = view;
camera.addComponent("camera", { fov, nearClip, farClip, clearColor: new pc.Color(...scene.info.background), toneMapping: pc.TONEMAP_NONE });
camera.setPosition(...view.position);
camera.lookAt(...view.target, ...view.up);
app.root.addChild(camera);

const splats = await createSplats(scene, app);
app.root.addChild(splats.object);
expose(scene, splats, (other) => createSplats(other, app));
app.on("update", () => splats.update(timeAt(scene, performance.now())));
app.start();
