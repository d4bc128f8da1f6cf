// What the worker does with a take, besides evaluating and drawing.

import { SceneError } from "../errors.js";
import { MOST_DECODED } from "./plan.js";

/** @typedef {import("../scene/decoder.js").Decoder} Decoder */

/** Bytes of memory that are taken at once, at most. */
const MOST_RESERVED = 2 ** 26;

export class TakeDecoder {
  #decoder;
  /** Bytes of memory that the first segment took; 0 once they were taken for the others as well. @type {number | null} */
  #taken = null;
  /** The level that was evaluated last. */
  #level = 0;

  /** @param {Decoder} decoder */
  constructor(decoder) {
    this.#decoder = decoder;
  }

  /**
   * Reads the index. It needs ranges of the file, one after the other.
   * @param {Uint8Array[]} ranges  those that it has needed so far
   * @param {number} length  bytes of the file; a very large number where they are not known
   * @returns {{ needed: [number, number] } | { index: import("./take.js").Index | null }}  null where it is that of another file than before
   * @throws {SceneError}
   */
  index(ranges, length) {
    const { wasm } = this.#decoder;
    // The decoder would ask for the same range again, and so without end.
    if (ranges.some((bytes) => bytes.length === 0)) {
      throw new SceneError("damaged", "take: the file ends before a block of the index begins");
    }
    wasm.begin_index();
    /** @type {{ needed: [number, number] } | null} */
    let more = null;
    // No bytes at all ask for the first range.
    for (const bytes of [new Uint8Array(), ...ranges]) {
      more = this.#decoder.call(() => {
        this.#decoder.give(bytes);
        return wasm.push_index();
      });
    }
    if (more) return more;
    this.#decoder.forgetTimes();
    return { index: this.#decoder.call(() => wasm.finish_index(length)) };
  }

  /**
   * Decodes the base.
   * @param {Uint8Array} bytes
   * @returns {import("../scene/scene.js").SceneInfo}
   */
  base(bytes) {
    this.#decoder.forgetTimes();
    return this.#decoder.call(() => {
      this.#decoder.give(bytes);
      return this.#decoder.wasm.open_base();
    });
  }

  /**
   * Decodes a segment for another worker.
   * @param {number} begin
   * @param {Uint8Array} bytes  those of the file
   */
  unpack(begin, bytes) {
    const { wasm } = this.#decoder;
    this.#decoder.call(() => {
      this.#decoder.give(bytes);
      return wasm.unpack_segment(begin);
    });
    const unpacked = new Uint8Array(wasm.memory.buffer, wasm.output(), wasm.output_length()).slice();
    wasm.forget_output();
    return unpacked;
  }

  /**
   * Opens what another worker has decoded.
   * @param {number} begin
   * @param {Uint8Array} unpacked
   * @returns {{ count: number, levels: number }}
   */
  segment(begin, unpacked) {
    const { wasm } = this.#decoder;
    this.#decoder.forgetTimes();
    // Memory for all that are decoded at a time is taken at once, after the first image, and as much as for one more for gaps. Else it would grow for
    // a minute and longer, since each segment has another size, and leaves gaps of other sizes.
    if (this.#taken) wasm.reserve_input(Math.min((MOST_DECODED + 1) * this.#taken, MOST_RESERVED));
    const before = wasm.memory.buffer.byteLength;
    const opened = this.#decoder.call(() => {
      this.#decoder.give(unpacked);
      return wasm.open_segment(begin);
    });
    this.#taken = this.#taken === null ? wasm.memory.buffer.byteLength - before : 0;
    return opened;
  }

  /** @param {number} begin */
  forget(begin) {
    this.#decoder.forgetTimes();
    this.#decoder.wasm.close_segment(begin);
  }

  /**
   * Chooses level of detail and segment. Base and segment need not have the same levels: a small one is shown as it is, at any level.
   * @param {number} level
   * @param {number} time
   */
  show(level, time) {
    this.#decoder.show(level, time);
    this.#decoder.shown = 0;
    if (level !== this.#level) this.#decoder.forgetTimes();
    this.#level = level;
  }
}
