// Plays a scene on a canvas: time, camera, drawing. No buttons: those are the element's.

import { Camera, commonTarget, commonUp } from "./camera.js";
import { Controls } from "./controls.js";
import { Draft } from "./draft.js";
import { NEAR } from "./shaders.js";
import { SplatRenderer } from "./splat_renderer.js";

/** @typedef {import("./camera.js").DatasetCamera} DatasetCamera */
/** @typedef {import("./camera.js").Vector} Vector */
/** @typedef {import("./scene.js").Scene} Scene */
/** @typedef {import("./splat_renderer.js").View} View */

/**
 * @typedef {object} PlayerOptions
 * @property {boolean} [autoplay]  begin to play; false
 * @property {boolean} [loop]  begin again at the end; true
 * @property {DatasetCamera[]} [cameras]  of the dataset; the first one is where the view begins
 * @property {Camera} [camera]  where the view begins in place of that
 * @property {Camera} [home]  where {@link Player.resetView} goes in place of that
 * @property {number} [time]  of the first image, in [0, 1]; 0
 * @property {boolean} [controls]  whether pointer and keys move the camera; true
 * @property {number} [pixelRatio]  pixels of the image for one of the page; at most 2 where not given
 */

/** Shares of the Gaussians' coordinates that count as outliers, on either side. */
const OUTLIERS = 0.03;
/** Milliseconds of stillness after which a draft is drawn again in full. */
const STILL = 150;
/** A viewpoint that has everything before it. */
const EVERYWHERE = { row: [0, 0, 0, 1], eye: [0, 0, 0] };

/**
 * Plays a {@link Scene} on a canvas. Events: `timechange`, `statechange` (playing, loop, speed), `camerachange`, `error`.
 */
export class Player extends EventTarget {
  /** Memory of a list that is not needed any more. @type {ArrayBuffer | null} */
  #spare = null;
  #busy = false;
  #dirty = true;
  #disposed = false;
  #request = 0;
  #last = 0;
  #time = 0;
  #playing = false;
  #shownTime = -1;
  #shownFrom = "";
  #draft = new Draft();
  #wasDraft = false;
  #lastDraw = 0;
  /** The image that the graphics card is at. @type {{ fence: WebGLSync | null, since: number, moving: boolean } | null} */
  #drawing = null;
  /** @type {number[]} */
  #frameTimes = [];
  #visible = true;
  /** @type {(ResizeObserver | IntersectionObserver)[]} */
  #observers = [];

  /**
   * @param {HTMLCanvasElement} canvas
   * @param {Scene} scene
   * @param {PlayerOptions} [options]
   */
  constructor(canvas, scene, options = {}) {
    super();
    this.canvas = canvas;
    this.scene = scene;
    this.cameras = options.cameras ?? [];
    this.pixelRatio = options.pixelRatio;
    this.loop = options.loop ?? true;
    this.speed = 1;
    /** Whether the camera goes along the training path while time runs. */
    this.following = false;
    /** Red, green, blue in [0, 1]. @type {number[]} */
    this.background = [...scene.info.background];
    this.renderer = new SplatRenderer(canvas);
    this.camera = new Camera();
    this.home = this.camera.clone();
    this.#fitLens();
    /** What the last frames took, in milliseconds. */
    this.timings = { evaluate: 0, sort: 0, upload: 0, draw: 0 };
    this.#time = Math.min(1, Math.max(0, Number(options.time) || 0));
    /** Resolves when the first image is on the canvas. @type {Promise<void>} */
    this.ready = this.#begin(options);
    this.controls = options.controls === false ? null : new Controls(this);
    canvas.addEventListener("webglcontextlost", this.#lost);
    canvas.addEventListener("webglcontextrestored", this.#restored);
  }

  #lost = (/** @type {Event} */ event) => event.preventDefault();

  #restored = () => {
    try {
      this.renderer.restore();
    } catch (error) {
      return this.#fail(error);
    }
    // The marks of the lost images are never passed.
    this.#drawing = null;
    this.#shownTime = -1;
  };

  /** @param {PlayerOptions} options */
  async #begin({ autoplay = false, camera, home }) {
    this.#measure();
    const { list } = await this.scene.frame(0, EVERYWHERE);
    if (this.#disposed) return;
    this.#fitCamera(list);
    if (camera) this.camera = camera.clone();
    if (home) this.home = home.clone();
    await this.#show(this.#time);
    if (this.#disposed) return;
    this.#draw(1);
    this.#observers = [
      new ResizeObserver(() => (this.#dirty = true)),
      // A player that was scrolled away costs nothing.
      new IntersectionObserver((entries) => (this.#visible = entries[entries.length - 1].isIntersecting)),
    ];
    for (const observer of this.#observers) observer.observe(this.canvas);
    if (autoplay) this.play();
    this.#request = requestAnimationFrame(this.#tick);
  }

  #fitLens() {
    const { width, height, fovX } = this.scene.info;
    const [w, h] = width > 0 && height > 0 ? [width, height] : [800, 800];
    const angle = fovX > 0 && fovX < 3 ? fovX : 0.7;
    const focal = w / 2 / Math.tan(angle / 2);
    this.camera.lens = { fx: focal, fy: focal, cx: w / 2, cy: h / 2, width: w, height: h };
  }

  /**
   * Stands at the dataset's first camera, or where all Gaussians but outliers are seen.
   * @param {Float32Array} list
   */
  #fitCamera(list) {
    const { camera, cameras } = this;
    const count = list.length / 16;
    const centers = [0, 1, 2].map((axis) => {
      /** @type {number[]} */
      const values = [];
      const stride = Math.max(1, Math.floor(count / 5000));
      for (let i = 0; i < count; i += stride) if (list[16 * i + 3] > 0.05) values.push(list[16 * i + axis]);
      values.sort((a, b) => a - b);
      const at = (/** @type {number} */ share) => values[Math.floor(share * (values.length - 1))] ?? 0;
      return { middle: (at(OUTLIERS) + at(1 - OUTLIERS)) / 2, half: (at(1 - OUTLIERS) - at(OUTLIERS)) / 2 };
    });
    const middle = /** @type {Vector} */ (centers.map(({ middle }) => middle));
    // Where the centers are close together, the Gaussians' own size counts: the variances stand at 4, 7 and 9.
    const sizes = [];
    for (let i = 0; i < list.length; i += 16 * Math.max(1, Math.floor(count / 5000))) {
      if (list[i + 3] > 0.05) sizes.push(2 * Math.sqrt(Math.max(list[i + 4], list[i + 7], list[i + 9])));
    }
    sizes.sort((a, b) => a - b);
    const size = sizes[Math.floor(0.5 * sizes.length)] ?? 0;
    const radius = Math.max(Math.hypot(...centers.map(({ half }) => half)) + size, 1e-6);
    camera.up = commonUp(cameras);
    if (cameras.length > 0) {
      const target = commonTarget(cameras) ?? middle;
      camera.take(cameras[0]);
      const ahead = [0, 1, 2].reduce((sum, i) => sum + (target[i] - camera.position[i]) * camera.axes[2][i], 0);
      camera.distance = ahead > 0.1 * radius ? ahead : Math.max(radius, 0.1);
    } else {
      const view = camera.view(this.canvas.width || 1, this.canvas.height || 1);
      const narrow = Math.min(view.width / 2 / view.fx, view.height / 2 / view.fy);
      const wanted = (1.15 * radius) / Math.sin(Math.atan(narrow));
      // A scene so small that all of it would be too near is looked at from farther, through a longer lens.
      const distance = Math.max(wanted, 1.5 * NEAR + radius);
      camera.lens.fx *= distance / wanted;
      camera.lens.fy *= distance / wanted;
      camera.lookAt(
        [middle[0], middle[1] - distance * Math.cos(Math.PI / 6), middle[2] + distance * Math.sin(Math.PI / 6)],
        middle,
      );
    }
    this.home = camera.clone();
  }

  /** Pixels of the canvas. */
  #measure() {
    const { canvas } = this;
    const ratio = this.pixelRatio ?? Math.min(globalThis.devicePixelRatio || 1, 2);
    const width = Math.max(1, Math.round(canvas.clientWidth * ratio) || canvas.width);
    const height = Math.max(1, Math.round(canvas.clientHeight * ratio) || canvas.height);
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  }

  /** What is seen now. @returns {View} */
  get view() {
    return this.camera.view(this.canvas.width, this.canvas.height);
  }

  /** Time in [0, 1]. */
  get time() {
    return this.#time;
  }

  set time(value) {
    this.#time = Math.min(1, Math.max(0, Number(value) || 0));
    this.dispatchEvent(new Event("timechange"));
  }

  /** Whether time runs. */
  get playing() {
    return this.#playing;
  }

  /** Lets time run, from the beginning where it is at the end. */
  play() {
    if (this.#time >= 1) this.time = 0;
    this.#playing = true;
    this.#last = performance.now();
    this.dispatchEvent(new Event("statechange"));
  }

  /** Stops time. */
  pause() {
    this.#playing = false;
    this.dispatchEvent(new Event("statechange"));
  }

  /** Back to where the view began. */
  resetView() {
    this.camera = this.home.clone();
    this.following = false;
    this.controls?.rest();
    this.cameraMoved();
  }

  /**
   * Takes the place of a camera of the dataset, at its time.
   * @param {number} index
   */
  showCamera(index) {
    const camera = this.cameras[index];
    if (!camera) return;
    this.#take(camera);
    this.following = false;
    this.controls?.rest();
    if (camera.time !== undefined) this.time = camera.time;
    this.cameraMoved();
  }

  /** @param {DatasetCamera} camera */
  #take(camera) {
    const { distance } = this.camera;
    this.camera.take(camera);
    this.camera.distance = distance;
  }

  /** To be called after the camera was changed from outside. */
  cameraMoved() {
    this.#dirty = true;
    this.dispatchEvent(new Event("camerachange"));
  }

  /** The training cameras in the order of their times: the path that {@link following} takes. */
  get path() {
    return this.cameras
      .filter(({ split, time }) => (split ?? "train") === "train" && time !== undefined)
      .sort((a, b) => (a.time ?? 0) - (b.time ?? 0));
  }

  #tick = (/** @type {number} */ now) => {
    if (this.#disposed) return;
    this.#request = requestAnimationFrame(this.#tick);
    const seconds = Math.min((now - this.#last) / 1000, 0.25);
    this.#last = now;
    if (!this.#visible) return;
    if (this.#playing && seconds > 0) this.#advance(seconds);
    if (this.controls?.step(seconds)) {
      this.following = false;
      this.cameraMoved();
    }
    if (this.following) this.#follow();
    if (!this.#busy) {
      const time = this.#time === this.#shownTime ? null : this.#time;
      if (time !== null || this.#viewpointKey() !== this.#shownFrom) this.#show(time).catch(this.#fail);
    }
    // One image at a time: a queue of them would only make the player slow to answer.
    if (this.#drawing && !this.renderer.isDone(this.#drawing.fence)) return;
    if (this.#drawing?.moving) this.#draft.measure(now - this.#drawing.since, now);
    this.#drawing = null;
    const moving = this.#dirty;
    if (moving) {
      this.#lastDraw = now;
      this.#measure();
      this.#draw(this.#draft.scale);
    } else if (this.#wasDraft && now - this.#lastDraw > STILL) {
      this.#draw(1);
    } else return;
    this.#drawing = { fence: this.renderer.fence(), since: now, moving };
  };

  #fail = (/** @type {any} */ error) => {
    if (this.#disposed || error?.kind === "closed") return;
    this.pause();
    this.dispatchEvent(new CustomEvent("error", { detail: error }));
  };

  /** @param {number} seconds */
  #advance(seconds) {
    const time = this.#time + (seconds * this.speed) / this.scene.duration;
    if (time < 1) this.time = time;
    else if (this.loop) this.time = time % 1;
    else {
      this.time = 1;
      this.pause();
    }
  }

  #follow() {
    const { path } = this;
    if (path.length === 0) return;
    let nearest = path[0];
    for (const camera of path) {
      if (Math.abs((camera.time ?? 0) - this.#time) < Math.abs((nearest.time ?? 0) - this.#time)) nearest = camera;
    }
    if (nearest === this.#followed) return;
    this.#followed = nearest;
    this.#take(nearest);
    this.#dirty = true;
  }

  /** @type {DatasetCamera | null} */
  #followed = null;

  /** Where it is seen from. */
  #viewpoint() {
    const { axes, position } = this.camera;
    const forward = axes[2];
    return { row: [...forward, -(forward[0] * position[0] + forward[1] * position[1] + forward[2] * position[2])], eye: position };
  }

  #viewpointKey() {
    return this.#viewpoint().row.join() + this.camera.position.join();
  }

  /**
   * Has the worker make the list for a time, or for another view of the time before, and gives it to the renderer.
   * @param {number | null} time
   */
  async #show(time) {
    this.#busy = true;
    try {
      const key = this.#viewpointKey();
      const memory = this.#spare;
      this.#spare = null;
      const { list, evaluateMs, sortMs } = await this.scene.frame(time, this.#viewpoint(), memory);
      if (this.#disposed) return;
      const start = performance.now();
      this.renderer.setList(list);
      this.#spare = /** @type {ArrayBuffer} */ (list.buffer);
      this.timings.upload = performance.now() - start;
      this.timings.sort = sortMs;
      if (time !== null) {
        this.timings.evaluate = evaluateMs;
        this.#shownTime = time;
      }
      this.#shownFrom = key;
      this.#dirty = true;
    } finally {
      this.#busy = false;
    }
  }

  /** @param {number} scale */
  #draw(scale) {
    const start = performance.now();
    this.#dirty = false;
    this.#wasDraft = scale < 1;
    this.renderer.draw(this.view, this.background, scale);
    this.timings.draw = performance.now() - start;
    this.#frameTimes.push(start);
    while (this.#frameTimes.length > 1 && start - this.#frameTimes[0] > 1000) this.#frameTimes.shift();
  }

  /** The share of the canvas's pixels along each side that is drawn while something moves: 1 where there is time for all. */
  get draftScale() {
    return this.#draft.scale;
  }

  /** Images a second over the last second; 0 where nothing changes. */
  get fps() {
    const times = this.#frameTimes;
    if (times.length < 2 || performance.now() - times[times.length - 1] > 500) return 0;
    return (1000 * (times.length - 1)) / (times[times.length - 1] - times[0]);
  }

  /** Draws again, as after {@link background} was changed. */
  redraw() {
    this.#dirty = true;
  }

  /**
   * Draws one time from one place, exactly, and returns the image: `[height, width, 4]` bytes. Time and camera of the
   * player go there and stay.
   * @param {number} time @param {View} view
   * @returns {Promise<Uint8Array>}
   */
  async renderAt(time, view) {
    this.pause();
    this.following = false;
    await this.ready;
    while (this.#busy) await new Promise((resolve) => setTimeout(resolve, 1));
    this.camera.take(view);
    this.time = time;
    await this.#show(this.#time);
    this.renderer.draw(view, this.background);
    this.#dirty = false;
    this.#wasDraft = false;
    return this.renderer.readPixels();
  }

  /** Stops, and gives back what the graphics card holds. The scene stays open. */
  dispose() {
    this.#disposed = true;
    cancelAnimationFrame(this.#request);
    for (const observer of this.#observers) observer.disconnect();
    this.controls?.dispose();
    this.canvas.removeEventListener("webglcontextlost", this.#lost);
    this.canvas.removeEventListener("webglcontextrestored", this.#restored);
    this.renderer.dispose();
  }
}
