// Bytes that come one after the other, of which ranges are read once they are there.

import { checkLength } from "./sources.js";

export class Arriving {
  #iterator;
  #bytes = new Uint8Array(2 ** 16);
  /** The piece that is awaited. @type {Promise<void> | null} */
  #pulling = null;
  #ended = false;
  #closed = false;
  /** @type {unknown} */
  #failure = null;

  /** @param {AsyncIterable<Uint8Array>} pieces @param {() => void} [report]  told whenever something has come */
  constructor(pieces, report = () => {}) {
    this.#iterator = pieces[Symbol.asyncIterator]();
    this.report = report;
    /** Bytes that are here. */
    this.received = 0;
    /** Whether a range costs nothing when it is read once more. */
    this.keeps = true;
    /** Bytes of the file, where they are known. */
    this.length = NaN;
  }

  /** Waits for the next piece. */
  #next() {
    this.#pulling ??= this.#pull();
    return this.#pulling;
  }

  async #pull() {
    try {
      const { done, value } = await this.#iterator.next();
      if (done) this.#ended = true;
      else this.#append(value);
    } catch (error) {
      this.#ended = true;
      if (!this.#closed) this.#failure = error;
    } finally {
      this.#pulling = null;
    }
  }

  /** @param {Uint8Array} piece */
  #append(piece) {
    const end = this.received + piece.length;
    checkLength("a file that comes as a whole", end);
    if (end > this.#bytes.length) {
      const larger = new Uint8Array(Math.max(end, 2 * this.#bytes.length));
      larger.set(this.#bytes);
      this.#bytes = larger;
    }
    this.#bytes.set(piece, this.received);
    this.received = end;
    this.report();
  }

  /** Whether a range is here. @param {number} begin @param {number} end */
  has(begin, end) {
    return end <= this.received;
  }

  /**
   * Takes no more than is needed for it from the stream. Gives less where the file ends before.
   * @param {number} begin @param {number} end
   * @returns {Promise<Uint8Array<ArrayBuffer>>}
   */
  async read(begin, end) {
    while (this.received < end && !this.#ended) await this.#next();
    // What has come before a connection broke is as good as before.
    if (this.received < end && this.#failure) throw this.#failure;
    return this.#bytes.slice(Math.min(begin, this.received), Math.min(end, this.received));
  }

  /** Takes the whole file, whether somebody reads or not. */
  async takeAll() {
    while (!this.#ended) await this.#next();
    if (!this.#failure) this.length = this.received;
  }

  /** What is here, and then the rest as it comes, which is not kept. */
  async *pieces() {
    if (this.#pulling) await this.#pulling;
    if (this.received > 0) yield this.#bytes.slice(0, this.received);
    this.#bytes = new Uint8Array();
    if (this.#failure) throw this.#failure;
    if (!this.#ended) yield* { [Symbol.asyncIterator]: () => this.#iterator };
  }

  /** All of it is wanted: there is no other way to what comes later. */
  pause() {
    this.takeAll();
  }

  /** The file as it is now; null where it cannot be another one. */
  again() {
    return null;
  }

  /** Nothing more is wanted. */
  close() {
    this.#ended = this.#closed = true;
    this.#iterator.return?.(undefined).catch(() => {});
  }
}
