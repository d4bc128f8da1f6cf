// The WebAssembly module behind plain functions. Everything here runs in the worker.

import { SceneError } from "../errors.js";

/** Gaussians that are computed before the worker looks for messages. */
const SLICE = 8192;

/**
 * @typedef {object} Exports  what bindings/web/src/abi exports
 * @property {WebAssembly.Memory} memory
 * @property {(bytes: number) => number} reserve_input
 * @property {() => number} open
 * @property {() => void} begin
 * @property {() => number} push
 * @property {() => number} finish
 * @property {() => number} text
 * @property {() => number} text_length
 * @property {() => bigint} digest
 * @property {() => void} begin_index
 * @property {() => number} push_index
 * @property {(bytes: number) => number} finish_index
 * @property {() => number} open_base
 * @property {(begin: number) => number} unpack_segment
 * @property {(begin: number) => number} open_segment
 * @property {(begin: number) => void} close_segment
 * @property {() => number} output
 * @property {() => number} output_length
 * @property {() => void} forget_output
 * @property {(level: number, time: number) => number} show
 * @property {() => number} count
 * @property {(time: number, first: number, last: number) => void} evaluate
 * @property {(row_x: number, row_y: number, row_z: number, row_w: number, eye_x: number, eye_y: number, eye_z: number, spread: number, only: number) => number} draw_list
 * @property {() => number} weight_of_later
 * @property {() => number} list_length
 * @property {(time: number) => number} attributes_at
 * @property {() => number} numbers_length
 * @property {() => number} numbers_degree
 * @property {() => void} forget_numbers
 */

/** One decoded scene, or one take, in one instance of the module. */
export class Decoder {
  /** @param {WebAssembly.Module} module */
  constructor(module) {
    this.wasm = /** @type {Exports} */ (/** @type {unknown} */ (new WebAssembly.Instance(module, {}).exports));
    /** The times to which the Gaussians of the scene and those of its level were moved: NaN before the first evaluation. */
    this.times = [NaN, NaN];
    /** Which of the two is shown. */
    this.shown = 0;
  }

  /**
   * Decodes a file and returns its description.
   * @param {Uint8Array} bytes
   * @returns {import("./scene.js").SceneInfo}
   */
  open(bytes) {
    const info = this.#answer(() => {
      this.give(bytes);
      return this.wasm.open();
    });
    return /** @type {import("./scene.js").SceneInfo} */ (info);
  }

  /** Begins with a file that comes in pieces. The scene before stays until something of it can be seen. */
  begin() {
    this.wasm.begin();
  }

  /**
   * Takes the next piece of the file. Returns the description of the scene, if that is another one now.
   * @param {Uint8Array} bytes
   */
  push(bytes) {
    return this.#answer(() => {
      this.give(bytes);
      return this.wasm.push();
    });
  }

  /** Ends the file: throws where bytes are missing. */
  finish() {
    this.#answer(() => this.wasm.finish());
  }

  /** Nothing is evaluated yet. */
  forgetTimes() {
    this.times = [NaN, NaN];
    this.shown = 0;
  }

  /** @param {Uint8Array} bytes  for the function that is called next */
  give(bytes) {
    const at = this.wasm.reserve_input(bytes.length);
    new Uint8Array(this.wasm.memory.buffer, at, bytes.length).set(bytes);
  }

  /**
   * What a function of the module says, where it says something.
   * @param {() => number} call  0 for an error, 1 for a text
   * @returns {any}
   * @throws {SceneError}
   */
  call(call) {
    const { wasm } = this;
    let answer;
    try {
      answer = call();
    } catch (error) {
      // The module stops itself when memory runs out: there is nothing to unwind to.
      throw new SceneError("memory", `the decoder stopped (${error instanceof Error ? error.message : error})`);
    }
    if (answer > 1) return null;
    const text = new Uint8Array(wasm.memory.buffer, wasm.text(), wasm.text_length());
    // Notes in a file may be any text.
    const said = JSON.parse(new TextDecoder().decode(text) || "null");
    if (!answer) throw new SceneError(said.error, said.message);
    return said;
  }

  /**
   * The description of a new scene, where there is one.
   * @param {() => number} ask  0 for an error, 1 for a new scene
   * @returns {import("./scene.js").SceneInfo | null}
   */
  #answer(ask) {
    const info = this.call(ask);
    if (info) this.forgetTimes();
    return info;
  }

  /** Number of Gaussians of the level that is shown. */
  get count() {
    return this.wasm.count();
  }

  /** The time to which the Gaussians of the shown level were moved. */
  get time() {
    return this.times[this.shown];
  }

  /**
   * Chooses the level of detail of evaluations and lists: 0 is the scene itself.
   * @param {number} level
   * @param {number} time  of a take, the segment of this time is chosen too
   */
  show(level, time) {
    if (this.wasm.show(level, time)) this.times[1] = NaN;
    this.shown = Number(level > 0);
  }

  /**
   * Computes the Gaussians at a time. Pauses between slices, so that the worker can answer others.
   * @param {number} time
   * @param {() => Promise<void>} pause
   */
  async evaluate(time, pause) {
    for (let first = 0; first < this.count; first += SLICE) {
      if (first > 0) await pause();
      this.wasm.evaluate(time, first, first + SLICE);
    }
    this.times[this.shown] = time;
  }

  /**
   * The list for drawing the last evaluation, see src/abi.
   * @param {import("./scene.js").Viewpoint} viewpoint
   * @param {ArrayBuffer | null} memory  to be used again
   * @param {number} [only]  around a join of a take: 1 for the earlier segment, 2 for the later one
   */
  drawList({ row, eye, spread = Infinity }, memory, only = 0) {
    const at = this.wasm.draw_list(row[0], row[1], row[2], row[3], eye[0], eye[1], eye[2], spread, only);
    const list = new Float32Array(this.wasm.memory.buffer, at, this.wasm.list_length());
    if (!memory || memory.byteLength < list.byteLength) return list.slice();
    const copy = new Float32Array(memory, 0, list.length);
    copy.set(list);
    return copy;
  }

  /**
   * All attributes at a time, one behind the other, and the degree of the harmonics.
   * @param {number} time
   */
  attributesAt(time) {
    const at = this.wasm.attributes_at(time);
    const numbers = new Float32Array(this.wasm.memory.buffer, at, this.wasm.numbers_length()).slice();
    this.wasm.forget_numbers();
    return { numbers, shDegree: this.wasm.numbers_degree() };
  }

  /**
   * One number for all bits of the scene that a file decodes to, as 16 hexadecimal digits.
   * @param {Uint8Array} bytes
   */
  digest(bytes) {
    this.give(bytes);
    return BigInt.asUintN(64, this.wasm.digest()).toString(16).padStart(16, "0");
  }
}
