// A scene: the bytes of a file in, Gaussians at a time out.

import { joined } from "../bytes/joined.js";
import { FIRST_IMAGE } from "./connection.js";
import { Scene } from "./scene.js";


/**
 * A decoded scene. Made by {@link import("./load.js").load}; {@link StreamScene.close} frees what it holds. Where its file is still coming, the event
 * `change` tells of more Gaussians. Times are in [0, 1].
 */
export class StreamScene extends Scene {
  /** @param {ArrayBuffer} bytes */
  async open(bytes) {
    await this.connection.prepared;
    const { info, milliseconds } = await this.connection.ask({ type: "open", bytes });
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
          const { info, milliseconds } = await this.connection.ask({ type: "push", bytes: bytes.buffer }, [bytes.buffer]);
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
    await this.connection.prepared;
    await this.connection.ask({ type: "begin" });
    for await (const piece of pieces) {
      if (failure) throw failure;
      waiting.push(piece);
      working ??= work();
    }
    while (working) await working;
    if (failure) throw failure;
    await this.connection.ask({ type: "finish" });
  }

  /** A scene that stands still is the same at all times. @param {number} share */
  momentAt(share) {
    return this.info.moves ? share : 0;
  }
}
