// <l4gs-player>: the player with its buttons.

import { readCameras } from "../views/camera.js";
import { fillCameras } from "./camera_list.js";
import { Layers } from "./layers.js";
import { explain } from "./messages.js";
import { icon, LAYOUT } from "./layout.js";
import { fillPanel } from "./panel.js";
import { Player } from "../player.js";
import { SplatRenderer } from "../drawing/splat_renderer.js";
import { RemoteFile } from "../bytes/remote_file.js";
import { MOST_TEXT, bytesOf, download } from "../bytes/sources.js";
import { decoderModule } from "../scene/connection.js";
import { dismiss, load, prepare } from "../scene/load.js";
import { Scene } from "../scene/scene.js";
import { Take } from "../take/take.js";
import { shade } from "./time_line.js";
import { watch } from "./watch.js";

/** @typedef {import("../views/camera.js").DatasetCamera} DatasetCamera */

/** Milliseconds between two updates of the panel. */
const PANEL_INTERVAL = 500;

/** @param {number[]} color */
const toHex = (color) => `#${color.map((c) => Math.round(255 * Math.min(1, Math.max(0, c))).toString(16).padStart(2, "0")).join("")}`;
/** @param {string} hex */
const fromHex = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16) / 255);

/** What keys do. @type {Record<string, string>} */
const KEYS = {
  Space: "play", KeyK: "play", KeyL: "loop", KeyV: "fly", KeyR: "reset", KeyI: "info", KeyF: "full", KeyC: "camera",
  Comma: "back", Period: "forth",
};

/** Elements that stand in the page. */
let connected = 0;

/**
 * Attributes: `src` (address of a scene), `cameras` (address of its cameras as JSON), `autoplay`, `loop`, `background` (a
 * color such as `#ffffff`), `page` (fills the page: files may be dropped, the wheel zooms at once, `?url=` is looked at),
 * `watch` (address of a small JSON text; whenever it changes, the scene is loaded again). In place of `src` a child
 * `<script type="application/l4gs">` may hold the scene as base64, and `<script type="application/json">` the cameras.
 *
 * Events: `load` (the first image), `complete` (all of a file that was loaded from an address), `error` (detail: the error),
 * `timechange`, `statechange`.
 */
export class L4gsPlayer extends (globalThis.HTMLElement ?? class {}) {
  static observedAttributes = ["src", "background", "loop"];

  /** @type {Player | null} */
  player = null;
  /** @type {DatasetCamera[]} */
  #cameras = [];
  #loading = 0;
  /** Made while a scene is on its way: the player's, once there is one. @type {SplatRenderer | null} */
  #renderer = null;
  /** Ends the work of an element in the page: listening, downloads, and watching an address. */
  #abort = new AbortController();
  #connected = false;
  #panelTimer = 0;
  /** What the line in the corner says, and besides it about a part that cannot be shown. */
  #status = "";
  #problem = "";

  constructor() {
    super();
    const root = this.attachShadow({ mode: "open", delegatesFocus: true });
    root.innerHTML = LAYOUT;
    /** @type {(id: string) => any} */
    this.find = (id) => root.getElementById(id);
    this.layers = new Layers(this.find);
    this.canvas = /** @type {HTMLCanvasElement} */ (root.querySelector("canvas"));
    this.#listen();
  }

  connectedCallback() {
    if (this.#connected) return;
    this.#connected = true;
    connected++;
    prepare();
    if (this.hasAttribute("page")) this.#acceptFiles();
    const query = this.hasAttribute("page") ? new URLSearchParams(location.search).get("url") : null;
    this.find("open").hidden = !this.hasAttribute("page");
    const embedded = this.querySelector('script[type="application/l4gs"]');
    const cameras = this.querySelector('script[type="application/json"]');
    const source = query ?? this.getAttribute("src");
    if (embedded) this.#openEmbedded(embedded.textContent ?? "", cameras?.textContent ?? "[]");
    else if (this.hasAttribute("watch")) this.layers.progress("Waiting for the scene");
    else if (source) this.load(source, this.getAttribute("cameras"));
    else if (this.hasAttribute("page")) this.layers.show("invitation");
    if (this.hasAttribute("watch")) this.#watch();
  }

  disconnectedCallback() {
    if (!this.#connected) return;
    this.#connected = false;
    this.#abort.abort();
    this.#abort = new AbortController();
    this.close();
    this.find("status").hidden = true;
    if (--connected === 0) dismiss();
  }

  /** @param {string} scene  base64 @param {string} cameras  JSON */
  #openEmbedded(scene, cameras) {
    try {
      this.open(bytesOf(scene), { cameras: readCameras(cameras, "the cameras in this page") });
    } catch (error) {
      this.#fail(error);
    }
  }

  /** @param {string} name @param {string | null} before @param {string | null} value */
  attributeChangedCallback(name, before, value) {
    if (!this.#connected || before === value) return;
    if (name === "src" && value) this.load(value, this.getAttribute("cameras"));
    if (name === "background" && value) this.#setBackground(value);
    if (name === "loop" && this.player) this.player.loop = value !== null;
  }

  /**
   * Loads a scene from an address, and cameras from another.
   * @param {string} address @param {string | null} [cameras]
   * @param {{ keep?: boolean }} [options]  whether view and time stay as they are
   * @returns {Promise<boolean>}  whether the bytes came; what was wrong is shown
   */
  async load(address, cameras, { keep = false } = {}) {
    const loading = ++this.#loading;
    const { signal } = this.#abort;
    const shown = this.player?.scene;
    /** The scene, as soon as something of it can be seen. @type {Scene | null} */
    let scene = null;
    let share = 0;
    const report = (/** @type {number} */ now) => {
      share = now;
      if (scene ? scene !== this.player?.scene || scene instanceof Take : loading !== this.#loading) return;
      if (scene) this.#say(Number.isNaN(share) ? "Loading …" : `Loading ${Math.round(100 * share)} %`);
      else this.layers.progress("Loading", share);
    };
    try {
      const list = cameras ? download(cameras, signal, MOST_TEXT).then((bytes) => readCameras(new TextDecoder().decode(bytes), cameras)) : Promise.resolve([]);
      // A take that has grown is the same one.
      if (keep && shown instanceof Take && shown.address === address && (await shown.refresh())) return true;
      if (keep) {
        const source = shown instanceof Take ? load(new RemoteFile(address, { signal })) : download(address, signal);
        const [loaded, known] = await Promise.all([source, list]);
        if (loading === this.#loading) await this.open(loaded, { cameras: known, keep });
        return true;
      }
      report(0);
      const coming = load(new RemoteFile(address, { signal, report }));
      this.#warm(loading);
      // Without its cameras the scene is not shown.
      list.catch(() => coming.then((unwanted) => unwanted.close(), () => {}));
      const [loaded, known] = await Promise.all([coming, list]);
      if (loading !== this.#loading) {
        loaded.close();
        return true;
      }
      await this.open(loaded, { cameras: known });
      scene = loaded;
      // All may be there already, and not be decoded yet.
      report(share);
      await loaded.whole;
      if (loaded !== this.player?.scene) return true;
      this.#say("");
      this.#nameCanvas();
      this.dispatchEvent(new Event("complete"));
      return true;
    } catch (error) {
      if (scene && scene === this.player?.scene) {
        this.#say("");
        this.#end();
        this.#fail(error);
        return false;
      }
      // The rest of the file is not reported any more.
      if (loading === this.#loading) {
        this.#loading++;
        if (keep && this.player) this.#say(explain(error).title);
        else this.#fail(error);
      }
      return false;
    }
  }

  /**
   * Has the graphics card get ready while the decoder waits for bytes. Before, the decoder needs this thread.
   * @param {number} loading  for what
   */
  async #warm(loading) {
    try {
      await decoderModule();
      if (loading !== this.#loading || this.player || this.#renderer) return;
      this.#renderer = new SplatRenderer(this.canvas);
      this.#renderer.warm();
    } catch {
      // What is wrong is said when the scene is to be shown.
    }
  }

  /**
   * Shows a scene: a file, or one that was loaded.
   * @param {import("../scene/load.js").Source | Scene} source
   * @param {{ cameras?: DatasetCamera[], keep?: boolean }} [options]
   */
  async open(source, { cameras = [], keep = false } = {}) {
    const loading = ++this.#loading;
    const before = keep ? this.player : null;
    if (!before) this.layers.progress("Decoding");
    let scene;
    try {
      scene = source instanceof Scene ? source : await load(source);
      if (loading !== this.#loading) return scene.close();
      const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
      const playing = before ? before.playing : this.hasAttribute("autoplay") && !still && scene.info.moves;
      const { speed = 1, background, camera, home } = before ?? {};
      // Of a take the second stays, of a scene the share of its length.
      const grown = before && scene instanceof Take ? before.scene.duration / scene.duration : 1;
      const time = before ? before.time * grown : undefined;
      const flying = before?.controls?.flying ?? false;
      const chosen = before ? this.find("camera").value : "free";
      this.#end();
      this.#cameras = cameras;
      const loop = before ? before.loop : this.hasAttribute("loop");
      const renderer = this.#renderer ?? undefined;
      this.#renderer = null;
      this.player = new Player(this.canvas, scene, { cameras, loop, autoplay: playing, time, camera, home, renderer });
      this.player.speed = speed;
      // What a single camera has seen is known from its path only.
      this.player.following = before?.following ?? (scene instanceof Take && this.player.followsOneCamera);
      if (this.player.controls) this.player.controls.flying = flying;
      if (background) this.player.background = background;
      else if (this.getAttribute("background")) this.#setBackground(this.getAttribute("background") ?? "");
      await this.player.ready;
      if (loading !== this.#loading) return;
      this.#begin();
      // If the list still has it.
      this.find("camera").value = chosen;
      if (!this.find("camera").value) this.#showCamera();
    } catch (error) {
      if (loading !== this.#loading) return scene?.close();
      // A scene that is kept is worth more than one that cannot be shown.
      if (before && before === this.player) {
        scene?.close();
        return this.#say(explain(error).title);
      }
      this.#end();
      scene?.close();
      this.#fail(error);
    }
  }

  /** Ends the player and frees what it holds. */
  close() {
    this.#loading++;
    this.#end();
    this.#renderer?.dispose();
    this.#renderer = null;
    this.layers.show("");
    this.find("bar").hidden = true;
  }

  #end() {
    clearInterval(this.#panelTimer);
    this.player?.dispose();
    this.player?.scene.close();
    this.player = null;
    this.#problem = "";
  }

  #begin() {
    const player = /** @type {Player} */ (this.player);
    const { info } = player.scene;
    if (player.controls) player.controls.wheelAlways = this.hasAttribute("page");
    this.layers.show("");
    this.find("bar").hidden = false;
    for (const id of ["play", "line", "clock", "speed", "loop"]) this.find(id).hidden = !info.moves;
    this.find("background").value = toHex(player.background);
    this.find("speed").value = String(player.speed);
    this.#nameCanvas();
    this.find("cameras").hidden = this.#cameras.length === 0;
    fillCameras(this.find("camera"), this.#cameras, player.path.length > 1);
    player.addEventListener("timechange", this.#showTime);
    player.addEventListener("statechange", this.#showState);
    player.addEventListener("camerachange", this.#showCamera);
    player.addEventListener("error", (event) => this.#fail(/** @type {CustomEvent} */ (event).detail));
    for (const event of ["progress", "change"]) player.scene.addEventListener(event, this.#showParts);
    // A step of a key is a frame, where that is less.
    this.find("time").step = String(Math.min(0.001, 1 / info.frameCount));
    this.#showParts();
    this.#showTime();
    this.#showState();
    this.#togglePanel(!this.find("panel").hidden);
    this.dispatchEvent(new Event("load"));
  }

  /** The parts of a take that have come. */
  #showParts = () => {
    if (!this.player) return;
    const { scene } = this.player;
    const { loaded, problems } = scene instanceof Take ? scene : { loaded: [], problems: [] };
    shade(this.find("parts"), loaded, scene.duration);
    this.#problem = problems.length > 0 ? `Cannot be shown: ${problems[problems.length - 1].message}` : "";
    this.#say(this.#status);
    this.#showTime();
  };

  /** The description of the scene for screen readers. */
  #nameCanvas() {
    const { info, count } = /** @type {Player} */ (this.player).scene;
    this.canvas.setAttribute("aria-label", `${info.name || "Scene"}: ${count} Gaussians${info.moves ? `, ${info.frameCount} frames` : ""}`);
  }

  #showTime = () => {
    const { player } = this;
    if (!player) return;
    const seconds = player.scene.duration;
    const text = `${(player.time * seconds).toFixed(2)} / ${seconds.toFixed(2)} s`;
    this.find("time").value = String(player.time);
    this.find("time").setAttribute("aria-valuetext", text);
    this.find("clock").value = text;
    this.dispatchEvent(new Event("timechange"));
  };

  #showState = () => {
    const { player } = this;
    if (!player) return;
    const play = this.find("play");
    const label = player.playing ? "Pause" : "Play";
    play.innerHTML = icon(player.playing ? "pause" : "play");
    play.setAttribute("aria-label", label);
    play.title = `${label} (space)`;
    this.find("loop").setAttribute("aria-pressed", String(player.loop));
    this.find("fly").setAttribute("aria-pressed", String(player.controls?.flying ?? false));
    this.#say(this.#status);
    this.dispatchEvent(new Event("statechange"));
  };

  #showCamera = () => {
    if (this.player) this.find("camera").value = this.player.following ? "path" : "free";
  };

  /** @param {string} color */
  #setBackground(color) {
    if (!this.player || !/^#[0-9a-f]{6}$/i.test(color)) return;
    this.player.background = fromHex(color);
    this.find("background").value = color;
    this.player.redraw();
  }

  /** A line in a corner of the image; none where it is empty. */
  #say = (/** @type {string} */ status) => {
    this.#status = status;
    const text = [status, this.player?.waiting && "Loading …", this.#problem].filter(Boolean).join(" · ");
    this.find("status").textContent = text;
    this.find("status").hidden = !text;
  };

  /** @param {any} error */
  #fail(error) {
    if (error?.kind === "closed") return;
    this.layers.message(error, this.hasAttribute("page") ? () => this.find("file").click() : null);
    this.find("bar").hidden = true;
    this.dispatchEvent(new CustomEvent("error", { detail: error }));
  }

  #listen() {
    const { find } = this;
    const on = (/** @type {string} */ id, /** @type {string} */ type, /** @type {(player: Player) => void} */ act) =>
      find(id).addEventListener(type, () => this.player && act(this.player));
    on("play", "click", () => this.#do("play"));
    on("loop", "click", () => this.#do("loop"));
    on("fly", "click", () => this.#do("fly"));
    on("reset", "click", () => this.#do("reset"));
    on("info", "click", () => this.#do("info"));
    on("full", "click", () => this.#do("full"));
    find("open").addEventListener("click", () => find("file").click());
    find("choose").addEventListener("click", () => find("file").click());
    find("file").addEventListener("change", () => this.#openFile(find("file").files?.[0]));
    on("time", "input", (player) => {
      player.pause();
      player.time = Number(find("time").value);
    });
    on("speed", "change", (player) => (player.speed = Number(find("speed").value)));
    on("background", "input", () => this.#setBackground(find("background").value));
    on("camera", "change", (player) => {
      const { value } = find("camera");
      if (value === "path") player.following = true;
      else if (value === "free") player.following = false;
      else {
        player.showCamera(Number(value));
        find("camera").value = value;
      }
    });
    this.shadowRoot?.addEventListener("keydown", (event) => this.#key(/** @type {KeyboardEvent} */ (event)));
  }

  /** Does what a button or a key asks for. @param {string} what */
  #do(what) {
    const { player } = this;
    if (!player) return;
    if (what === "play" && player.scene.info.moves) {
      if (player.playing) player.pause();
      else player.play();
    } else if (what === "loop") {
      player.loop = !player.loop;
    } else if (what === "fly" && player.controls) {
      player.controls.flying = !player.controls.flying;
    } else if (what === "reset") {
      player.resetView();
    } else if (what === "info") {
      this.#togglePanel(this.find("panel").hidden);
    } else if (what === "full") {
      this.#toggleFull();
    } else if (what === "back" || what === "forth") {
      player.pause();
      player.time += (what === "back" ? -1 : 1) / Math.max(player.scene.info.frameCount - 1, 1);
    } else if (what === "camera" && this.#cameras.length > 0) {
      const select = this.find("camera");
      const next = (Number(select.value) + 1 || 0) % this.#cameras.length;
      player.showCamera(next);
      select.value = String(next);
    }
    this.#showState();
  }

  /** Keys that nothing in the page has asked for belong to a player that is the page. @param {KeyboardEvent} event */
  #takeKey(event) {
    const nobody = document.activeElement === document.body || document.activeElement === null;
    // An event that is sent to the canvas here arrives here once more.
    if (!nobody || event.defaultPrevented || !event.isTrusted) return;
    if (this.canvas.dispatchEvent(new KeyboardEvent(event.type, event))) return;
    event.preventDefault();
    this.canvas.focus({ preventScroll: true });
  }

  /** @param {KeyboardEvent} event */
  #key(event) {
    const target = /** @type {HTMLElement} */ (event.target);
    const does = KEYS[event.code];
    const opens = event.code === "KeyO" && this.hasAttribute("page");
    if (!(does || opens) || event.ctrlKey || event.metaKey || event.altKey) return;
    // A button, a list and a text keep their own keys.
    if (target.matches("select, input:not([type=range])") || (event.code === "Space" && target.matches("button, summary"))) return;
    event.preventDefault();
    if (opens) return this.find("file").click();
    this.#do(does);
  }

  #toggleFull() {
    if (document.fullscreenElement === /** @type {Element} */ (this)) document.exitFullscreen();
    // Phones that give no element the whole screen: the page at least.
    else if (this.requestFullscreen) this.requestFullscreen().catch(() => this.classList.toggle("full"));
    else this.classList.toggle("full");
  }

  /** @param {boolean} shown */
  #togglePanel(shown) {
    const panel = this.find("panel");
    panel.hidden = !shown;
    this.find("info").setAttribute("aria-pressed", String(shown));
    clearInterval(this.#panelTimer);
    if (!shown || !this.player) return;
    const fill = () => this.player && fillPanel(panel, this.player);
    fill();
    this.#panelTimer = setInterval(fill, PANEL_INTERVAL);
  }

  #acceptFiles() {
    const over = (/** @type {boolean} */ is) => this.classList.toggle("over", is);
    const options = { signal: this.#abort.signal };
    document.addEventListener("keydown", (event) => this.#takeKey(event), options);
    addEventListener("dragover", (event) => (event.preventDefault(), over(true)), options);
    addEventListener("dragleave", (event) => event.relatedTarget === null && over(false), options);
    addEventListener("drop", (event) => {
      event.preventDefault();
      over(false);
      this.#openFile(event.dataTransfer?.files[0]);
    }, options);
  }

  /** @param {File | undefined} file */
  #openFile(file) {
    this.find("file").value = "";
    if (file) this.open(file);
  }

  #watch() {
    const show = async () => {
      const address = this.getAttribute("src");
      return address !== null && this.load(address, this.getAttribute("cameras"), { keep: this.player !== null });
    };
    watch(this.getAttribute("watch") ?? "", this.#abort.signal, this.#say, show);
  }
}

if (globalThis.customElements && !customElements.get("l4gs-player")) customElements.define("l4gs-player", L4gsPlayer);
