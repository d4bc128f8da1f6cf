// A scene: bytes in, Gaussians at a time out. The work is done by a worker of its own.

import wasmBase64 from "virtual:decoder";
import workerSource from "virtual:worker";
import { SceneError } from "../errors.js";

/**
 * @typedef {object} SceneInfo  what a file says of itself
 * @property {string} name  for people
 * @property {number} frameCount  frames of the source
 * @property {number} fps  frames a second of the source, 0 where it is not known
 * @property {[number[], number[]]} bounds  smallest and largest corner, world units
 * @property {[number, number, number]} background  red, green, blue in [0, 1]
 * @property {number} width  of the source's default camera, pixels
 * @property {number} height  of the source's default camera, pixels
 * @property {number} fovX  its horizontal field of view, radians
 * @property {number} version  of the format
 * @property {number} bytes  of the file
 * @property {number} count  Gaussians
 * @property {number} shDegree  of the spherical harmonics, 0 to 3
 * @property {boolean} moves  whether anything changes with time
 * @property {number} layers  layers of Gaussians that the file has
 * @property {number} layersShown  those that have come
 * @property {number} levels  levels of detail besides the scene itself; each has half of the Gaussians of the one before
 * @property {[string, number][]} sections  name and bytes of each part of the file
 * @property {Record<string, string>} extra  free notes
 */

/**
 * @typedef {object} GaussiansAt  activated attributes of N Gaussians
 * @property {number} count  N
 * @property {Float32Array} means  `[N, 3]`: centers, world units
 * @property {Float32Array} scales  `[N, 3]`: standard deviations, world units
 * @property {Float32Array} quaternions  `[N, 4]`: `(w, x, y, z)` of unit length
 * @property {Float32Array} opacities  `[N]` in [0, 1]
 * @property {number} shDegree  d
 * @property {Float32Array} sh  `[N, (d + 1)², 3]`: a color is `max(0, 0.5 + Σ basis · coefficient)`
 */

/**
 * @typedef {object} Viewpoint  where a scene is seen from
 * @property {ArrayLike<number>} row  the depth of a point is `row · (x, y, z, 1)`
 * @property {ArrayLike<number>} eye  the camera's center, world units
 * @property {number} [spread]  what does not reach into the cone around the view axis is left out: the tangent of its angle to
 *   the axis; all in front of the camera where not given
 */

/**
 * @typedef {object} Frame  what the renderer draws
 * @property {Float32Array} list  back to front, 16 numbers a Gaussian: center (3), opacity, covariance xx, xy, xz, yy, yz, zz,
 *   color as seen from the viewpoint (3), three zeros; filled up to a multiple of 256 Gaussians with zeros
 * @property {number} evaluateMs  what the motion took; 0 where the list before was for the same time
 * @property {number} sortMs  what order and colors took
 */

/** @type {Promise<WebAssembly.Module> | null} */
let module = null;

/** The decoder, compiled once a page. */
function decoderModule() {
  const unpack = async () => {
    const packed = Uint8Array.from(atob(wasmBase64), (character) => character.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
    return WebAssembly.compile(await new Response(stream).arrayBuffer());
  };
  module ??= unpack().catch((error) => {
    // A second attempt may succeed.
    module = null;
    throw new SceneError("blocked", error instanceof Error ? error.message : String(error));
  });
  return module;
}

/** Milliseconds that the decoder leaves for the first image before it goes on. */
const FIRST_IMAGE = 200;

/** @typedef {ArrayBuffer | Uint8Array | ReadableStream<Uint8Array> | AsyncIterable<Uint8Array>} Source  a file, whole or as it comes */

/** The pieces of a stream; browsers differ in whether it can be walked over. @param {ReadableStream<Uint8Array>} stream */
async function* piecesOf(stream) {
  const reader = stream.getReader();
  try {
    for (;;) {
      const { done, value } = await reader.read();
      if (done) return;
      yield value;
    }
  } finally {
    reader.cancel().catch(() => {});
  }
}

/** @param {Uint8Array[]} pieces */
function joined(pieces) {
  const bytes = new Uint8Array(pieces.reduce((sum, piece) => sum + piece.length, 0));
  let at = 0;
  for (const piece of pieces) {
    bytes.set(piece, at);
    at += piece.length;
  }
  return bytes;
}

/**
 * A decoded scene. Made by {@link load}; {@link Scene.close} frees what it holds. Where its file is still coming, the event
 * `change` tells of more Gaussians.
 */
export class Scene extends EventTarget {
  /** @type {Map<number, { resolve: (answer: any) => void, reject: (error: Error) => void }>} */
  #waiting = new Map();
  #worker;
  #url;
  #next = 0;
  /** Whether the worker has answered: then it had started. */
  #answered = false;
  /** Why the worker answers no more. @type {SceneError | null} */
  #failure = null;
  /** Fails where the browser has no decoder for us. @type {Promise<void>} */
  #prepared;

  /** Use {@link load}. */
  constructor() {
    super();
    this.#url = URL.createObjectURL(new Blob([workerSource], { type: "text/javascript" }));
    this.#worker = new Worker(this.#url);
    this.#worker.onmessage = ({ data: answer }) => {
      this.#answered = true;
      const waiting = this.#waiting.get(answer.id);
      this.#waiting.delete(answer.id);
      if (answer.error) waiting?.reject(new SceneError(answer.error, answer.message));
      else waiting?.resolve(answer);
    };
    this.#worker.onerror = (event) => {
      event.preventDefault();
      // It may come before anything was asked: the decoder is still being compiled then.
      this.#failure ??= new SceneError(this.#answered ? "fault" : "blocked", event.message || "the worker did not start");
      this.#fail(this.#failure);
    };
    // While the file is still on its way.
    this.#prepared = decoderModule().then((module) => this.#ask({ type: "prepare", module }));
    this.#prepared.catch(() => {});
    /** @type {SceneInfo} */
    this.info = /** @type {any} */ (null);
    /** Time of decoding, milliseconds. */
    this.decodeMs = 0;
    /** Resolves when the whole file is there; fails with a {@link SceneError} where it does not come. @type {Promise<void>} */
    this.whole = Promise.resolve();
  }

  /** @param {Error} error */
  #fail(error) {
    for (const { reject } of this.#waiting.values()) reject(error);
    this.#waiting.clear();
  }

  /**
   * @param {any} request
   * @param {Transferable[]} [transfer]
   * @returns {Promise<any>}
   */
  #ask(request, transfer = []) {
    if (!this.#url) return Promise.reject(new SceneError("closed", "the scene was closed"));
    if (this.#failure) return Promise.reject(this.#failure);
    return new Promise((resolve, reject) => {
      const id = this.#next++;
      this.#waiting.set(id, { resolve, reject });
      this.#worker.postMessage({ id, ...request }, transfer);
    });
  }

  /** @param {ArrayBuffer} bytes */
  async open(bytes) {
    await this.#prepared;
    const { info, milliseconds } = await this.#ask({ type: "open", bytes });
    this.info = info;
    this.decodeMs = milliseconds;
  }

  /**
   * Resolves as soon as there is something to see.
   * @param {AsyncIterable<Uint8Array>} pieces
   */
  async receive(pieces) {
    /** @type {Promise<void>} */
    const visible = new Promise((resolve) => {
      this.whole = this.#receive(pieces, resolve);
    });
    // Nobody has to ask for the whole.
    this.whole.catch(() => {});
    await Promise.race([visible, this.whole]);
  }

  /** @param {AsyncIterable<Uint8Array>} pieces @param {() => void} show  called once there is something to see */
  async #receive(pieces, show) {
    /** Pieces that have come while the decoder was at work: it gets all of them at once. @type {Uint8Array[]} */
    let waiting = [];
    /** @type {Promise<void> | null} */
    let working = null;
    /** @type {unknown} */
    let failure = null;
    const work = async () => {
      try {
        while (waiting.length > 0) {
          const bytes = joined(waiting);
          waiting = [];
          const { info, milliseconds } = await this.#ask({ type: "push", bytes: bytes.buffer }, [bytes.buffer]);
          this.decodeMs += milliseconds;
          if (!info) continue;
          const first = !this.info;
          this.info = info;
          if (first) {
            show();
            await new Promise((resolve) => setTimeout(resolve, FIRST_IMAGE));
          } else this.dispatchEvent(new Event("change"));
          // One layer is decoded at a time: the next one may be there already.
          if (waiting.length === 0 && info.layersShown < info.layers) waiting.push(new Uint8Array());
        }
      } catch (error) {
        failure = error;
      } finally {
        working = null;
      }
    };
    await this.#prepared;
    await this.#ask({ type: "begin" });
    for await (const piece of pieces) {
      if (failure) throw failure;
      waiting.push(piece);
      working ??= work();
    }
    while (working) await working;
    if (failure) throw failure;
    await this.#ask({ type: "finish" });
  }

  /** Number of Gaussians. */
  get count() {
    return this.info.count;
  }

  /** Length in seconds: the source's where it is known, else at 30 frames a second. */
  get duration() {
    return Math.max(this.info.frameCount, 1) / (this.info.fps || 30);
  }

  /**
   * The Gaussians at a time in [0, 1], activated, for a renderer of your own.
   * @param {number} time
   * @returns {Promise<GaussiansAt>}
   */
  async gaussiansAt(time) {
    /** @type {{ numbers: Float32Array }} */
    const { numbers } = await this.#ask({ type: "attributes", time });
    const { count, shDegree } = this.info;
    let at = 0;
    const take = (/** @type {number} */ each) => numbers.subarray(at, (at += each * count));
    const means = take(3);
    const scales = take(3);
    const quaternions = take(4);
    const opacities = take(1);
    return { count, means, scales, quaternions, opacities, shDegree, sh: take(3 * (shDegree + 1) ** 2) };
  }

  /**
   * The list of Gaussians to draw at a time from a viewpoint.
   * @param {number} time  in [0, 1]
   * @param {Viewpoint} viewpoint
   * @param {ArrayBuffer | null} [memory]  to be used again
   * @param {number} [level]  of detail: 0 is the scene itself, at most {@link SceneInfo.levels}
   * @returns {Promise<Frame>}
   */
  frame(time, viewpoint, memory = null, level = 0) {
    return this.#ask({ type: "frame", time, viewpoint, memory, level }, memory ? [memory] : []);
  }

  /**
   * One number for all bits of the scene that a file decodes to, as 16 hexadecimal digits: the same on every machine.
   * @param {ArrayBuffer} bytes
   * @returns {Promise<string>}
   */
  async digest(bytes) {
    return (await this.#ask({ type: "digest", bytes })).digest;
  }

  /** Ends the worker and frees its memory. Open requests fail with a {@link SceneError} `closed`. */
  close() {
    if (!this.#url) return;
    this.#worker.terminate();
    URL.revokeObjectURL(this.#url);
    this.#url = "";
    this.#fail(new SceneError("closed", "the scene was closed"));
  }
}

/** A worker that waits for a file. @type {Scene | null} */
let standby = null;

/** Starts a decoder, so that it is ready when the bytes of a file arrive. {@link load} does so itself, but only then. */
export function prepare() {
  standby ??= new Scene();
}

/** Ends the decoder that {@link prepare} started, where no file has come for it. */
export function dismiss() {
  standby?.close();
  standby = null;
}

/**
 * Decodes a `.l4gs` file. One that comes as a stream is there as soon as something can be seen: {@link Scene.whole} says when
 * all of it is.
 * @param {Source} source
 * @returns {Promise<Scene>}
 * @throws {SceneError} whose `kind` says what is wrong with the file
 */
export async function load(source) {
  const scene = standby ?? new Scene();
  standby = null;
  try {
    if ("getReader" in source) await scene.receive(piecesOf(source));
    else if (Symbol.asyncIterator in source) await scene.receive(source);
    else await scene.open(source instanceof Uint8Array ? source.slice().buffer : source);
    return scene;
  } catch (error) {
    scene.close();
    throw error;
  }
}
