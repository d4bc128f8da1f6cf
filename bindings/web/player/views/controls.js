// Pointer, touch, wheel and keys on the canvas, as movements of the camera.

/** @typedef {import("../player.js").Player} Player */

/** Radians for a pixel of the page. */
const TURN = 0.008;
/** Share of the distance for a second of a held key. */
const FLY = 0.9;
/** Radians for a second of a held key. */
const KEY_TURN = 1.4;

/** What held keys do: sideways, upwards, right, down, forward, roll, zoom. @type {Record<string, number[]>} */
const KEYS = {
  ArrowLeft: [-1, 0, 0, 0, 0, 0, 0], ArrowRight: [1, 0, 0, 0, 0, 0, 0],
  ArrowUp: [0, 1, 0, 0, 0, 0, 0], ArrowDown: [0, -1, 0, 0, 0, 0, 0],
  KeyA: [0, 0, -1, 0, 0, 0, 0], KeyD: [0, 0, 1, 0, 0, 0, 0],
  KeyW: [0, 0, 0, 0, 1, 0, 0], KeyS: [0, 0, 0, 0, -1, 0, 0],
  KeyQ: [0, 0, 0, 1, 0, 0, 0], KeyE: [0, 0, 0, -1, 0, 0, 0],
  KeyZ: [0, 0, 0, 0, 0, -1, 0], KeyX: [0, 0, 0, 0, 0, 1, 0],
  Equal: [0, 0, 0, 0, 0, 0, -1], NumpadAdd: [0, 0, 0, 0, 0, 0, -1],
  Minus: [0, 0, 0, 0, 0, 0, 1], NumpadSubtract: [0, 0, 0, 0, 0, 0, 1],
};

export class Controls {
  /** @type {Map<number, { x: number, y: number }>} */
  #pointers = new Map();
  /** @type {Set<string>} */
  #held = new Set();
  #shift = false;
  #moved = false;
  #inertia = { sideways: 0, upwards: 0 };
  #abort = new AbortController();

  /** @param {Player} player */
  constructor(player) {
    this.player = player;
    /** Whether a drag turns the view where it stands, in place of turning around the target. */
    this.flying = false;
    /** Whether the wheel zooms before the canvas was clicked: not in a page that scrolls. */
    this.wheelAlways = false;
    this.still = globalThis.matchMedia?.("(prefers-reduced-motion: reduce)").matches ?? false;
    const { canvas } = player;
    canvas.style.touchAction = "none";
    const options = { signal: this.#abort.signal };
    canvas.addEventListener("pointerdown", this.#down, options);
    canvas.addEventListener("pointermove", this.#move, options);
    for (const name of /** @type {const} */ (["pointerup", "pointercancel", "lostpointercapture"])) {
      canvas.addEventListener(name, this.#up, options);
    }
    canvas.addEventListener("wheel", this.#wheel, { ...options, passive: false });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault(), options);
    canvas.addEventListener("keydown", this.#keyDown, options);
    canvas.addEventListener("keyup", (event) => this.#held.delete(event.code), options);
    canvas.addEventListener("blur", () => this.#held.clear(), options);
  }

  #down = (/** @type {PointerEvent} */ event) => {
    this.player.canvas.focus({ preventScroll: true });
    this.player.canvas.setPointerCapture?.(event.pointerId);
    this.#pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    this.#inertia = { sideways: 0, upwards: 0 };
  };

  #up = (/** @type {PointerEvent} */ event) => {
    this.#pointers.delete(event.pointerId);
  };

  #move = (/** @type {PointerEvent} */ event) => {
    const last = this.#pointers.get(event.pointerId);
    if (!last) return;
    const [dx, dy] = [event.clientX - last.x, event.clientY - last.y];
    const { camera, canvas } = this.player;
    if (this.#pointers.size === 2) {
      const other = [...this.#pointers].find(([id]) => id !== event.pointerId)?.[1] ?? last;
      const before = Math.hypot(last.x - other.x, last.y - other.y);
      const after = Math.hypot(event.clientX - other.x, event.clientY - other.y);
      if (before > 0 && after > 0) camera.zoom(before / after);
      this.#pan(dx / 2, dy / 2);
    } else if (event.buttons & 6 || event.shiftKey || event.ctrlKey) {
      this.#pan(dx, dy);
    } else if (this.flying) {
      camera.look(TURN * dx * 0.5, TURN * dy * 0.5);
    } else {
      camera.orbit(TURN * dx, TURN * dy);
      this.#inertia = { sideways: TURN * dx, upwards: TURN * dy };
    }
    last.x = event.clientX;
    last.y = event.clientY;
    this.#moved = canvas.width > 0;
  };

  /** @param {number} dx @param {number} dy  pixels of the page */
  #pan(dx, dy) {
    const { camera, canvas } = this.player;
    const units = camera.unitsPerPixel(canvas.clientWidth || canvas.width, canvas.clientHeight || canvas.height);
    camera.move(-dx * units, -dy * units, 0);
  }

  #wheel = (/** @type {WheelEvent} */ event) => {
    const { canvas, camera } = this.player;
    const root = /** @type {Document | ShadowRoot} */ (canvas.getRootNode());
    if (!this.wheelAlways && !event.ctrlKey && root.activeElement !== canvas) return;
    event.preventDefault();
    const pixels = event.deltaY * (event.deltaMode === 1 ? 16 : event.deltaMode === 2 ? 400 : 1);
    camera.zoom(Math.exp(Math.max(-200, Math.min(200, pixels)) * (event.ctrlKey ? 0.01 : 0.0015)));
    this.#moved = true;
  };

  #keyDown = (/** @type {KeyboardEvent} */ event) => {
    if (!KEYS[event.code] || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    this.#held.add(event.code);
    this.#shift = event.shiftKey;
  };

  /**
   * Moves the camera by the keys that are held down. Returns whether it moved since the last call.
   * @param {number} seconds
   */
  step(seconds) {
    const { camera } = this.player;
    let moved = this.#moved;
    this.#moved = false;
    for (const code of this.#held) {
      const [sideways, upwards, right, down, forward, roll, zoom] = KEYS[code].map((value) => value * seconds);
      const way = FLY * camera.distance;
      if (this.#shift && (sideways || upwards)) camera.move(way * sideways, -way * upwards, 0);
      else if (sideways || upwards) {
        if (this.flying) camera.look(KEY_TURN * sideways, -KEY_TURN * upwards);
        else camera.orbit(KEY_TURN * sideways, KEY_TURN * upwards);
      }
      if (right || down || forward) camera.move(way * right, way * down, way * forward);
      if (roll) camera.roll(roll);
      if (zoom) camera.zoom(Math.exp(zoom));
      moved = true;
    }
    const { sideways, upwards } = this.#inertia;
    if (this.#pointers.size === 0 && !this.still && Math.hypot(sideways, upwards) > 2e-4) {
      camera.orbit(sideways, upwards);
      const left = Math.exp(-6 * seconds);
      this.#inertia = { sideways: sideways * left, upwards: upwards * left };
      moved = true;
    }
    return moved;
  }

  /** Ends all movement. */
  rest() {
    this.#inertia = { sideways: 0, upwards: 0 };
    this.#moved = false;
  }

  /** Listens no more. */
  dispose() {
    this.#abort.abort();
  }
}
