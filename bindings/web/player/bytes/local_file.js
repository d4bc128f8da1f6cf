// A file of this machine, or bytes in memory, of which ranges are read.

import { SceneError } from "../errors.js";

export class LocalFile {
  /** @param {Blob} blob */
  constructor(blob) {
    this.blob = blob;
    /** Whether a range costs nothing when it is read once more. */
    this.keeps = true;
    this.length = blob.size;
    this.report = () => {};
  }

  /** Whether a range is here. @param {number} begin @param {number} end */
  has(begin, end) {
    return true;
  }

  /**
   * A range of the file; less where the file ends before.
   * @param {number} begin @param {number} end
   * @returns {Promise<Uint8Array<ArrayBuffer>>}
   * @throws {SceneError} `network`
   */
  async read(begin, end) {
    try {
      return new Uint8Array(await this.blob.slice(begin, end).arrayBuffer());
    } catch (error) {
      const name = this.blob instanceof File ? `${this.blob.name}: ` : "";
      throw new SceneError("network", `${name}${error instanceof Error ? error.message : error}`);
    }
  }

  /** What else comes is not needed soon. */
  pause() {}

  /** The file as it is now; null where it cannot be another one. */
  again() {
    return null;
  }

  close() {}
}
