// A take: a base that stands still, and segments in time that are loaded when they are needed.

import { SceneError } from "../errors.js";
import { Scene } from "../scene/scene.js";
import { readIndex } from "./read_index.js";
import { placeAt } from "./plan.js";
import { Segments } from "./segments.js";

/** @typedef {import("./plan.js").Place} Place */
/** @typedef {import("../scene/connection.js").Connection} Connection */

/**
 * @typedef {object} Index  what the front of the file says
 * @property {string} name
 * @property {number} fps  0 where not known
 * @property {number} seconds
 * @property {[number, number]} base  where its bytes begin and end
 * @property {[number, number, number, number][]} segments  begin and end in seconds, and in bytes of the file
 * @property {Record<string, string>} extra
 */

/**
 * @typedef {object} RangedFile  a file of which ranges are read
 * @property {string} [address]
 * @property {number} length  bytes, NaN where they are not known
 * @property {boolean} keeps  whether a range costs nothing when it is read once more
 * @property {() => void} report  told whenever something has come by itself
 * @property {(begin: number, end: number) => boolean} has  whether a range is here
 * @property {(begin: number, end: number, signal?: AbortSignal) => Promise<Uint8Array<ArrayBuffer>>} read  a range; less where the file ends before
 * @property {() => void} pause  what else comes by itself is not needed soon
 * @property {() => RangedFile | null} again  the file as it is now; null where it cannot be another one
 * @property {() => void} close
 */

/** The largest share of the duration that still lies in the last segment, whose end does not belong to it. */
const BEFORE_THE_END = 1 - 1e-9;

/**
 * An open take. Made by {@link import("../scene/load.js").load}; {@link Take.close} frees what it holds. Times are in seconds.
 *
 * Events: `progress` (what is loaded has changed), `problem` (detail: the {@link SceneError} of a segment that cannot be shown; the rest
 * plays on), `change` (the take has grown).
 */
export class Take extends Scene {
  /** The second that a player shows, while it waits for another one. */
  #held = 0;
  #file;
  /** @type {Index} */
  #index;
  /** The index that is being read. @type {Promise<boolean> | null} */
  #refreshing = null;

  /**
   * Use {@link import("../scene/load.js").load}.
   * @param {Connection} connection
   * @param {RangedFile} file
   * @param {Index} index
   */
  constructor(connection, file, index) {
    super(connection);
    this.#file = file;
    this.#index = index;
    this.segments = new Segments(connection, file, this);
  }

  /**
   * @param {Connection} connection
   * @param {RangedFile} file
   */
  static async open(connection, file) {
    await connection.prepared;
    const front = await readIndex(connection, file);
    // A decoder without a take takes any.
    if (!front) throw new SceneError("fault", "the decoder has another take");
    const take = new Take(connection, file, front.index);
    try {
      await take.#begin(front.ranges);
      return take;
    } catch (error) {
      take.close();
      throw error;
    }
  }

  /** @param {Uint8Array[]} ranges  those of the index */
  async #begin(ranges) {
    const [begin, end] = this.#index.base;
    const bytes = await this.#file.read(begin, end);
    // Only now: where the first segment is right behind the base, the stream goes on with it, and ends there.
    const cut = () => {
      if (this.segments.loaded.length === 0) return;
      this.#file.pause();
      this.removeEventListener("progress", cut);
    };
    this.addEventListener("progress", cut);
    this.segments.setIndex(this.#index, ranges, this.#file.length);
    const segment = this.segments.with(0, async () => {});
    // A base that is refused ends both.
    segment.catch(() => {});
    const { info, milliseconds } = await this.connection.ask({ type: "base", bytes }, [bytes.buffer]);
    await segment;
    this.removeEventListener("progress", cut);
    this.#file.pause();
    this.segments.goAhead();
    this.decodeMs += milliseconds;
    this.info = info;
    this.#describe();
    this.segments.follow(0, { loop: false, duration: this.duration });
  }

  /** What is said of the take, where a scene says it of itself. */
  #describe() {
    const { name, fps, seconds, segments, base, extra } = this.#index;
    const rate = fps > 0 ? fps : 30;
    const bytes = segments.reduce((sum, [, , first, last]) => sum + last - first, 0);
    const levels = Math.max(this.info.levels, ...[...this.segments.decoded.values()].map((segment) => segment.levels));
    /** @type {[string, number][]} */
    const sections = [["front", base[0]], ["base", base[1] - base[0]], [`${segments.length} segments`, bytes]];
    this.info = {
      ...this.info, levels, sections, name, fps, extra, frameCount: Math.max(Math.round(seconds * rate), 1), moves: seconds > 0,
      bytes: base[1] + bytes,
    };
  }

  /** Where the file is; none where its bytes were given. */
  get address() {
    return this.#file.address;
  }

  /** Seconds. */
  get duration() {
    return this.#index.seconds || 1 / 30;
  }

  /** Number of Gaussians of the base and, where it is decoded, of the segment that is shown. */
  get count() {
    return this.info.count + (this.segments.decoded.get(placeAt(this.segments.places, this.#held)?.begin ?? NaN)?.count ?? 0);
  }

  /** What is wrong with segments that cannot be shown, the newest last. */
  get problems() {
    return [...this.segments.failed.values()];
  }

  /** Which parts of the take can be shown at once: first and last second of each. @returns {[number, number][]} */
  get loaded() {
    return this.segments.loaded;
  }

  /**
   * The Gaussians of base and segment, without those that are hidden. Their number is another one in each segment.
   * @param {number} seconds
   * @throws {SceneError} where the segment cannot be had
   */
  gaussiansAt(seconds) {
    return this.segments.with(seconds, async (failure) => {
      if (failure) throw failure;
      return super.gaussiansAt(seconds);
    });
  }

  /**
   * Without its segment, where that cannot be had.
   * @param {number} seconds
   * @param {import("../scene/scene.js").Viewpoint} viewpoint @param {ArrayBuffer | null} [memory] @param {number} [level]
   * @param {boolean} [apart]
   */
  frame(seconds, viewpoint, memory = null, level = 0, apart = false) {
    return this.segments.with(seconds, async () => super.frame(seconds, viewpoint, memory, level, apart));
  }

  /** @param {number} share */
  #secondsAt(share) {
    return this.duration * Math.min(share, BEFORE_THE_END);
  }

  /** While a segment is on its way, what was shown before stays. @param {number} share */
  momentAt(share) {
    if (!this.waitsAt(share)) this.#held = this.#secondsAt(share);
    return this.#held;
  }

  /** @param {number} share @param {boolean} loop */
  follow(share, loop) {
    const held = placeAt(this.segments.places, this.#held);
    this.segments.follow(this.#secondsAt(share), { loop, held, duration: this.duration });
  }

  /** @param {number} share */
  waitsAt(share) {
    return !this.segments.isSettled(this.#secondsAt(share));
  }

  /** @param {number} share */
  ready(share) {
    return this.segments.with(this.#secondsAt(share), async () => {});
  }

  /**
   * Looks whether the file has grown.
   * @returns {Promise<boolean>}  false where it is another file: something that was there is not there any more
   * @throws {SceneError} where it cannot be read now; nothing changes then
   */
  refresh() {
    this.#refreshing ??= this.#refresh().finally(() => (this.#refreshing = null));
    return this.#refreshing;
  }

  async #refresh() {
    const file = this.#file.again();
    if (!file) return true;
    try {
      const front = await readIndex(this.connection, file);
      if (!front) {
        file.close();
        return false;
      }
      const { index, ranges } = front;
      const before = this.#file;
      this.#file = file;
      this.#index = index;
      this.segments.setFile(file);
      this.segments.setIndex(index, ranges, file.length);
      before.close();
      file.pause();
      this.#describe();
      this.dispatchEvent(new Event("change"));
      return true;
    } catch (error) {
      file.close();
      if (error instanceof SceneError && error.kind === "not-l4gs") return false;
      throw error;
    }
  }

  close() {
    this.segments.close();
    this.#file.close();
    super.close();
  }
}
