// Plays a scene on a canvas: time, camera, drawing. No buttons: those are the element's.

import { Camera } from "./views/camera.js";
import { Controls } from "./views/controls.js";
import { Draft } from "./views/draft.js";
import { sourceLens, stand } from "./views/framing.js";
import { Path } from "./views/path.js";
import { SplatRenderer } from "./drawing/splat_renderer.js";

/** @typedef {import("./views/camera.js").DatasetCamera} DatasetCamera */
/** @typedef {import("./views/camera.js").Vector} Vector */
/** @typedef {import("./scene/scene.js").Scene} Scene */
/** @typedef {import("./drawing/splat_renderer.js").View} View */

/**
 * @typedef {object} PlayerOptions
 * @property {boolean} [autoplay]  begin to play; false
 * @property {boolean} [loop]  begin again at the end; true
 * @property {DatasetCamera[]} [cameras]  of the dataset; the first one is where the view begins
 * @property {Camera} [camera]  where the view begins in place of that
 * @property {Camera} [home]  where {@link Player.resetView} goes in place of that
 * @property {number} [time]  of the first image, in [0, 1]; 0
 * @property {boolean} [controls]  whether pointer and keys move the camera; true
 * @property {number} [pixelRatio]  pixels of the image for one of the page; at most 2 where not given. A canvas that the page
 *   gives no size keeps its own
 * @property {SplatRenderer} [renderer]  one of this canvas that was made while the scene was on its way. The player disposes of it
 */

/** Milliseconds of stillness after which a draft is drawn again in full. */
const STILL = 150;
/** Milliseconds between two looks at the graphics card. */
const WATCH = 3;
/** A draft's list covers this factor of the image's extent. */
const SPARE_SPREAD = 1.25;
/** A viewpoint that has everything before it. */
const EVERYWHERE = { row: [0, 0, 0, 1], eye: [0, 0, 0] };

/**
 * Whether the page gives a canvas its size, whatever the canvas's own is.
 * @param {HTMLCanvasElement} canvas
 */
function isStretched(canvas) {
  const { width, height, clientWidth, clientHeight } = canvas;
  Object.assign(canvas, { width: width + 7, height: 2 * height + 1 });
  const stretched = canvas.clientWidth === clientWidth && canvas.clientHeight === clientHeight;
  Object.assign(canvas, { width, height });
  return stretched;
}

/**
 * Plays a scene or a take on a canvas. Events: `timechange`, `statechange` (playing, loop, speed, waiting), `camerachange`, `error`.
 */
export class Player extends EventTarget {
  /** Memory of a list that is not needed any more. @type {ArrayBuffer | null} */
  #spare = null;
  /** The training cameras over time. */
  #path;
  #busy = false;
  #dirty = true;
  /** Whether the renderer has a list that was not drawn yet. */
  #undrawn = false;
  #disposed = false;
  #request = 0;
  #last = 0;
  #time = 0;
  #playing = false;
  /** Seconds of which the time is a share. */
  #duration;
  #shownTime = -1;
  #shownFrom = "";
  /** The level of detail of the list that the renderer has. */
  #shownLevel = 0;
  /** Whether the list shows two segments of a take at once, as a draft of the mean of two pictures. */
  #shownTogether = false;
  /** Whether it is that mean. */
  #shownMixed = false;
  /** @type {Draft} */
  #draft;
  #wasDraft = false;
  /** Pixels of the image in full. */
  #size = { width: 1, height: 1 };
  /** When the image was last due to change. */
  #lastChange = -Infinity;
  /** The image that the graphics card is drawing. @type {{ fence: WebGLSync | null, since: number, moving: boolean } | null} */
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
    this.#path = new Path(this.cameras);
    this.pixelRatio = options.pixelRatio;
    this.loop = options.loop ?? true;
    this.speed = 1;
    /** Whether time stands still until more of a take has come. */
    this.waiting = false;
    /** Whether the camera goes along the training path while time runs. */
    this.following = false;
    /** Red, green, blue in [0, 1]. @type {number[]} */
    this.background = [...scene.info.background];
    this.renderer = options.renderer ?? new SplatRenderer(canvas);
    this.#draft = new Draft(scene.info.levels);
    this.#duration = scene.duration;
    this.camera = new Camera();
    this.home = this.camera.clone();
    this.camera.lens = sourceLens(scene.info);
    /** Times of the last frames, milliseconds. */
    this.timings = { evaluate: 0, sort: 0, upload: 0, draw: 0 };
    this.#time = Math.min(1, Math.max(0, Number(options.time) || 0));
    /** Resolves when the first image is on the canvas. @type {Promise<void>} */
    this.ready = this.#begin(options);
    this.controls = options.controls === false ? null : new Controls(this);
    canvas.addEventListener("webglcontextlost", this.#lost);
    canvas.addEventListener("webglcontextrestored", this.#restored);
    scene.addEventListener("change", this.#more);
    scene.addEventListener("segment", this.#again);
  }

  /** More Gaussians of the scene have come, or a take has grown. */
  #more = () => {
    this.#shownTime = -1;
    // The second stays.
    const { duration } = this.scene;
    this.#time = Math.min(1, (this.#time * this.#duration) / duration);
    this.#duration = duration;
    // With more Gaussians there are more levels, and other times.
    this.#draft = new Draft(this.scene.info.levels);
  };

  /** A segment of a take is there now. At rest in a fade, the image lacks it. */
  #again = () => {
    if (!this.#playing) this.#shownTime = -1;
  };

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
    stand(this.camera, this.cameras, list, this.view);
    this.home = this.camera.clone();
    if (camera) this.camera = camera.clone();
    if (home) this.home = home.clone();
    await this.#show();
    if (this.#disposed) return;
    this.#draw(1);
    this.#observers = [
      new ResizeObserver(() => this.#change()),
      // A player that was scrolled away costs nothing.
      new IntersectionObserver((entries) => (this.#visible = entries[entries.length - 1].isIntersecting)),
    ];
    for (const observer of this.#observers) observer.observe(this.canvas);
    if (autoplay) this.play();
    this.#request = requestAnimationFrame(this.#tick);
  }

  /** Finds the pixels of the image. */
  #measure() {
    const { canvas, renderer } = this;
    const { clientWidth, clientHeight } = canvas;
    if (renderer.stretched === null && clientWidth > 0 && clientHeight > 0) renderer.stretched = isStretched(canvas);
    const ratio = this.pixelRatio ?? Math.min(globalThis.devicePixelRatio || 1, 2);
    const [width, height] = renderer.stretched ? [ratio * clientWidth, ratio * clientHeight] : [canvas.width, canvas.height];
    this.#size = { width: Math.max(1, Math.round(width)), height: Math.max(1, Math.round(height)) };
  }

  /** The current view. @returns {View} */
  get view() {
    return this.camera.view(this.#size.width, this.#size.height);
  }

  /** Time in [0, 1]. */
  get time() {
    return this.#time;
  }

  set time(value) {
    this.#time = Math.min(1, Math.max(0, Number(value) || 0));
    if (this.scene.info.moves) this.#lastChange = performance.now();
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

  /** Back to the view at the beginning. */
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
    this.#change();
    this.dispatchEvent(new Event("camerachange"));
  }

  /** The image on the canvas is out of date. */
  #change() {
    this.#dirty = true;
    this.#lastChange = performance.now();
  }

  /** The training cameras in the order of their times: the path that {@link following} takes. */
  get path() {
    return this.#path.cameras;
  }

  /** Whether {@link path} is that of one camera that moves. */
  get followsOneCamera() {
    return this.#path.isContinuous;
  }

  #tick = (/** @type {number} */ now) => {
    if (this.#disposed) return;
    this.#request = requestAnimationFrame(this.#tick);
    const seconds = Math.min((now - this.#last) / 1000, 0.25);
    this.#last = now;
    if (!this.#visible) return;
    this.scene.follow(this.#time, this.loop);
    if (this.#playing && seconds > 0) this.#advance(seconds);
    else this.#wait(this.scene.waitsAt(this.#time));
    if (this.controls?.step(seconds)) {
      this.following = false;
      this.cameraMoved();
    }
    if (this.following) this.#follow();
    else this.#followed = undefined;
    this.#update();
    this.#render(now);
  };

  /**
   * Draws what has changed, as soon as the graphics card is done with the image before: a queue of images would only make
   * the player slow to answer.
   * @param {number} now
   */
  #render(now) {
    if (this.#disposed || this.#isDrawing(now)) return;
    const full = this.#isStill(now) && this.#shownLevel === 0 && !this.#shownTogether && this.#isShown();
    if (!this.#dirty && !(this.#wasDraft && full)) return;
    this.#measure();
    this.#draw(full ? 1 : this.#draft.scale);
    // The worker makes the next list while this one is drawn.
    if (this.#playing) this.#update();
    // Right after a rest the list has more Gaussians than those that follow, and few images are the mean of two.
    this.#drawing = { fence: this.renderer.fence(), since: now, moving: !full && !this.#shownMixed && this.#shownLevel === this.#draft.level };
    this.#watch();
  }

  /** Whether nothing has moved for a while. @param {number} now */
  #isStill(now) {
    return !(this.#playing && this.scene.info.moves) && now - this.#lastChange > STILL;
  }

  /** Whether the list is that of the current time and viewpoint. */
  #isShown() {
    return this.#moment === this.#shownTime && this.#viewpointKey() === this.#shownFrom;
  }

  /** The time as the scene counts it. */
  get #moment() {
    return this.scene.momentAt(this.#time);
  }

  /** Looks after the graphics card between animation frames: an image need not wait for the next one. */
  #watch() {
    setTimeout(() => {
      if (this.#disposed || !this.#drawing) return;
      const now = performance.now();
      if (this.#isDrawing(now)) this.#watch();
      else if (this.#dirty) this.#render(now);
    }, WATCH);
  }

  #fail = (/** @type {any} */ error) => {
    if (this.#disposed || error?.kind === "closed") return;
    this.pause();
    this.dispatchEvent(new CustomEvent("error", { detail: error }));
  };

  /** Has the worker make a list for the current time and viewpoint, if its last one is another. */
  #update() {
    if (this.#busy || this.#undrawn) return;
    const still = this.#isStill(performance.now());
    if (this.#isShown() && !(still && (this.#shownLevel > 0 || this.#shownTogether))) return;
    const { level, hasTimeForTwo } = this.#draft;
    (still ? this.#show() : this.#show(level, hasTimeForTwo)).catch(this.#fail);
  }

  /** Whether the graphics card is still at the last image. @param {number} now */
  #isDrawing(now) {
    if (!this.#drawing) return false;
    if (!this.renderer.isDone(this.#drawing.fence)) return true;
    if (this.#drawing.moving) this.#draft.measureDrawing(now - this.#drawing.since, now);
    this.#drawing = null;
    return false;
  }

  /** @param {number} seconds */
  #advance(seconds) {
    const time = this.#time + (seconds * this.speed) / this.scene.duration;
    const next = time < 1 ? time : this.loop ? time % 1 : 1;
    // A moment that is not there yet is not jumped over.
    this.#wait(this.scene.waitsAt(next));
    if (this.waiting) return;
    if (time < 1) this.time = time;
    else if (this.loop) this.time = next;
    else {
      this.time = 1;
      this.pause();
    }
  }

  /** @param {boolean} waiting */
  #wait(waiting) {
    if (waiting === this.waiting) return;
    this.waiting = waiting;
    this.dispatchEvent(new Event("statechange"));
  }

  #follow() {
    const camera = this.#path.at(this.#time);
    if (!camera || camera.time === this.#followed) return;
    this.#followed = camera.time;
    this.#take(camera);
    this.#change();
  }

  /** Time of the camera whose place was taken last. @type {number | undefined} */
  #followed;

  /** The viewpoint. */
  #viewpoint() {
    const { axes, position } = this.camera;
    const forward = axes[2];
    return { row: [...forward, -(forward[0] * position[0] + forward[1] * position[1] + forward[2] * position[2])], eye: position };
  }

  /** The tangent of the angle between the view axis and a corner of the image, and some more for turning until the next list. */
  #spread() {
    const { fx, fy, cx, cy, width, height } = this.view;
    return SPARE_SPREAD * Math.hypot(Math.max(cx, width - cx) / fx, Math.max(cy, height - cy) / fy);
  }

  #viewpointKey() {
    return this.#viewpoint().row.join() + this.camera.position.join();
  }

  /**
   * Has the worker make the list for the current time and viewpoint, and gives it to the renderer.
   * @param {number} [level]  of detail
   * @param {boolean} [apart]  whether the picture around a join of a take is the mean of two
   */
  async #show(level = 0, apart = true) {
    this.#busy = true;
    try {
      const time = this.#moment;
      const key = this.#viewpointKey();
      const memory = this.#spare;
      // A draft may leave out Gaussians outside of the image: the image at rest has a list of its own.
      const viewpoint = level > 0 ? { ...this.#viewpoint(), spread: this.#spread() } : this.#viewpoint();
      this.#spare = null;
      const { list, later, together, evaluateMs, sortMs } = await this.scene.frame(time, viewpoint, memory, level, apart);
      if (this.#disposed) return;
      const start = performance.now();
      this.renderer.setList(list, later);
      this.#spare = /** @type {ArrayBuffer} */ (list.buffer);
      this.timings.upload = performance.now() - start;
      this.timings.sort = sortMs;
      if (evaluateMs > 0) this.timings.evaluate = evaluateMs;
      if (level === this.#draft.level && !later && !this.#isStill(start)) this.#draft.measureWorker(evaluateMs + sortMs, start);
      this.#shownTime = time;
      this.#shownFrom = key;
      this.#shownLevel = level;
      this.#shownTogether = together;
      this.#shownMixed = Boolean(later);
      this.#dirty = this.#undrawn = true;
    } finally {
      this.#busy = false;
    }
    if (!this.#playing || !this.#visible) return;
    this.#render(performance.now());
  }

  /** @param {number} scale */
  #draw(scale) {
    const start = performance.now();
    this.#dirty = this.#undrawn = false;
    this.#wasDraft = scale < 1;
    this.renderer.draw(this.view, this.background, scale);
    this.timings.draw = performance.now() - start;
    this.#frameTimes.push(start);
    while (this.#frameTimes.length > 1 && start - this.#frameTimes[0] > 1000) this.#frameTimes.shift();
  }

  /** The share of the canvas's pixels along each side that is drawn while something moves: 1 if there is time for all. */
  get draftScale() {
    return this.#draft.scale;
  }

  /**
   * The level of detail that is drawn while something moves, of {@link Scene.info}'s `levels`: 0 where there is time for all
   * Gaussians, and half as many with each further one.
   */
  get draftLevel() {
    return this.#draft.level;
  }

  /** Images per second over the last second; 0 where nothing changes. */
  get fps() {
    const times = this.#frameTimes;
    if (times.length < 2 || performance.now() - times[times.length - 1] > 500) return 0;
    return (1000 * (times.length - 1)) / (times[times.length - 1] - times[0]);
  }

  /** Draws again, as after {@link background} was changed. */
  redraw() {
    this.#change();
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
    // While an image of an earlier time is on its way, the segment of this time may be forgotten again.
    do {
      await this.scene.ready(time);
      while (this.#busy) await new Promise((resolve) => setTimeout(resolve, 1));
    } while (this.scene.waitsAt(time));
    this.camera.take(view);
    this.time = time;
    await this.#show();
    this.renderer.draw(view, this.background);
    this.#dirty = this.#undrawn = this.#wasDraft = false;
    return this.renderer.readPixels();
  }

  /** Stops, and frees the memory of the graphics card. The scene stays open. */
  dispose() {
    this.#disposed = true;
    cancelAnimationFrame(this.#request);
    for (const observer of this.#observers) observer.disconnect();
    this.controls?.dispose();
    this.scene.removeEventListener("change", this.#more);
    this.scene.removeEventListener("segment", this.#again);
    this.canvas.removeEventListener("webglcontextlost", this.#lost);
    this.canvas.removeEventListener("webglcontextrestored", this.#restored);
    this.renderer.dispose();
  }
}
