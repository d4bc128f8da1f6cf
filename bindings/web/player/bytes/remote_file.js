// A file at an address. Its beginning comes as a stream, since nobody knows before what it is; what comes later, in ranges, where the server
// gives them.

import { Arriving } from "./arriving.js";
import { joined } from "./joined.js";
import { NoRanges, fetchRange } from "./ranges.js";
import { checkLength, pieces } from "./sources.js";

export class RemoteFile {
  #abort = new AbortController();
  /** Ends the stream. */
  #cut = new AbortController();
  /** Whether the server may give ranges. */
  #ranges = false;
  /** Whether the rest of the stream is not wanted. */
  #paused = false;
  #options;

  /**
   * @param {string} address
   * @param {{ signal?: AbortSignal, report?: (share: number) => void }} [options]  `report` is told how much of the stream has come
   */
  constructor(address, options = {}) {
    this.address = address;
    this.#options = options;
    options.signal?.addEventListener("abort", () => this.close(), { signal: this.#abort.signal });
    /** Bytes of the file, NaN where they are not known. */
    this.length = NaN;
    /** Told whenever something of the stream has come. */
    this.report = () => {};
    this.arriving = this.#stream();
  }

  #stream() {
    const opened = (/** @type {{ length: number, ranges: boolean }} */ { length, ranges }) => {
      this.length = length;
      this.#ranges = ranges;
    };
    const { report } = this.#options;
    return new Arriving(pieces(this.address, this.#cut.signal, { report, most: Infinity, opened }), () => this.report());
  }

  /** Refuses a scene that is too long. A take may be longer, since only parts of it are here. */
  checkLength() {
    checkLength(this.address, this.length);
  }

  /** Whether a range costs nothing when it is read once more. */
  get keeps() {
    return !this.#ranges;
  }

  /** Whether a range is here. @param {number} begin @param {number} end */
  has(begin, end) {
    return this.arriving.has(begin, end);
  }

  /**
   * A range of the file; less where the file ends before.
   * @param {number} begin @param {number} end
   * @param {AbortSignal} [signal]  ends the request
   * @returns {Promise<Uint8Array<ArrayBuffer>>}
   * @throws {import("../errors.js").SceneError}
   */
  async read(begin, end, signal = this.#abort.signal) {
    const { arriving } = this;
    // The stream brings it next, or has brought it.
    if (!this.#ranges || this.has(begin, end) || (!this.#paused && begin <= arriving.received)) {
      const bytes = await arriving.read(begin, end);
      if (bytes.length === end - begin || !this.#paused) return bytes;
    }
    this.#stop();
    const kept = begin < arriving.received ? await arriving.read(begin, arriving.received) : new Uint8Array();
    try {
      const { bytes, length } = await fetchRange(this.address, begin + kept.length, end, signal);
      if (length) this.length = length;
      return joined([kept, bytes]);
    } catch (error) {
      if (!(error instanceof NoRanges)) throw error;
      this.#takeStream();
      return this.arriving.read(begin, end);
    }
  }

  /** The server gives no ranges after all. */
  #takeStream() {
    if (!this.#ranges) return;
    this.#ranges = this.#paused = false;
    this.#cut = new AbortController();
    this.arriving = this.#stream();
    this.arriving.takeAll();
  }

  #stop() {
    if (this.#paused) return;
    this.#paused = true;
    this.arriving.close();
    this.#cut.abort();
  }

  /** What else comes is not needed soon. Without ranges there is no other way to it. */
  pause() {
    if (this.#ranges) this.#stop();
    else this.arriving.takeAll();
  }

  /** The file as it is now. Nothing of what has come is believed. */
  again() {
    const file = new RemoteFile(this.address, { signal: this.#options.signal });
    if (this.#ranges) {
      file.#ranges = file.#paused = true;
      file.arriving.close();
    }
    return file;
  }

  close() {
    this.#abort.abort();
    this.#cut.abort();
  }
}
