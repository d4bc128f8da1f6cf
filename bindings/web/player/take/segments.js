// The segments of a take: loaded in time, decoded by a worker of their own, and forgotten again.

import { SceneError } from "../errors.js";
import { Connection, FIRST_IMAGE } from "../scene/connection.js";
import { LoadedBytes } from "./loaded_bytes.js";
import { placeAt, plan } from "./plan.js";
import { lengthOf } from "./read_index.js";

/** @typedef {import("./plan.js").Place} Place */

/** Milliseconds for which a player that follows the time says what comes next. */
const FOLLOWED = 1000;

export class Segments {
  /** @type {Place[]} */
  places = [];
  /** The open ones, by their begins. @type {Map<number, { place: Place, count: number, levels: number }>} */
  decoded = new Map();
  /** Why a segment cannot be shown, by its begin. @type {Map<number, SceneError>} */
  failed = new Map();
  /** @type {LoadedBytes} */
  #bytes;
  #connection;
  #take;
  /** Decodes, so that the worker that draws need not stop for it. @type {Promise<Connection> | null} */
  #unpacker = null;
  /** What makes the index known to a worker. @type {object | null} */
  #indexRequest = null;
  #seconds = 0;
  /** @type {{ loop: boolean, held?: Place, duration: number }} */
  #options = { loop: false, duration: 0 };
  #followedAt = -Infinity;
  /** Whether what comes next is loaded: not before what the first image needs. */
  #loadsAhead = false;
  /** Whether it is decoded, too: not before the first image. */
  #decodesAhead = false;
  /** What is needed at once, one after the other. @type {{ place: Place, resolve: () => void }[]} */
  #needed = [];
  #working = false;
  #closed = false;

  /**
   * @param {Connection} connection  to the worker that draws
   * @param {import("./take.js").RangedFile} file
   * @param {import("./take.js").Take} take  which is told of progress and problems
   */
  constructor(connection, file, take) {
    this.#connection = connection;
    this.#take = take;
    this.#bytes = new LoadedBytes(file, () => this.#progress());
    // It starts while bytes are on their way.
    this.#unpacker = this.#startUnpacker();
    this.#unpacker.catch(() => {});
  }

  /** The same take, where it has grown. @param {import("./take.js").RangedFile} file */
  setFile(file) {
    this.#bytes.setFile(file);
  }

  /**
   * Takes an index, which has all that the one before had.
   * @param {import("./take.js").Index} index @param {Uint8Array[]} ranges  from which it was read @param {number} length  of the file
   */
  setIndex({ segments }, ranges, length) {
    const before = new Map(this.places.map((place) => [place.begin, place]));
    this.places = segments.map(([begin, end, first, last]) => {
      // Its bytes may be elsewhere in the file now.
      const place = before.get(begin) ?? { begin, end, first, last };
      return Object.assign(place, { first, last });
    });
    // They may be well now.
    this.failed.clear();
    const request = { type: "index", ranges, length: lengthOf({ length }) };
    this.#indexRequest = request;
    this.#unpacker?.then((unpacker) => unpacker.ask(request)).catch(() => {});
    this.#progress();
  }

  /** Parts of the take whose bytes are here. @returns {[number, number][]} */
  get loaded() {
    return this.places.filter((place) => this.decoded.has(place.begin) || this.#bytes.has(place)).map(({ begin, end }) => [begin, end]);
  }

  /** Whether nothing more is awaited for a time: its segment is decoded, or cannot be, or there is none. @param {number} seconds */
  isSettled(seconds) {
    const place = placeAt(this.places, seconds);
    return !place || this.decoded.has(place.begin) || this.failed.has(place.begin);
  }

  /** The first image has what it needs: what comes next is loaded, and decoded after a while. */
  goAhead() {
    this.#loadsAhead = true;
    setTimeout(() => {
      this.#decodesAhead = true;
      this.#advance();
    }, FIRST_IMAGE);
  }

  /**
   * Says where the time is.
   * @param {number} seconds
   * @param {{ loop: boolean, held?: Place, duration: number }} options  as of {@link plan}
   */
  follow(seconds, options) {
    const [before, now] = [placeAt(this.places, this.#seconds), placeAt(this.places, seconds)];
    // The connection may be well again when somebody comes back.
    if (now && now !== before && this.failed.get(now.begin)?.kind === "network") this.failed.delete(now.begin);
    this.#seconds = seconds;
    this.#options = options;
    this.#followedAt = performance.now();
    this.#advance();
  }

  /**
   * Does something with the segment of a time, as soon as it is settled.
   * @template T
   * @param {number} seconds
   * @param {(failure: SceneError | undefined) => Promise<T>} work
   * @returns {Promise<T>}
   */
  async with(seconds, work) {
    const place = placeAt(this.places, seconds);
    // Without a player, times that are asked for say what comes next.
    if (performance.now() - this.#followedAt > FOLLOWED) {
      this.#seconds = seconds;
      this.#options = { loop: true, duration: this.#take.duration };
    }
    if (!place || this.isSettled(seconds)) {
      const done = work(place && this.failed.get(place.begin));
      this.#advance();
      return done;
    }
    /** @type {{ place: Place, resolve: () => void } | null} */
    let need = null;
    await new Promise((resolve) => {
      need = { place, resolve: () => resolve(undefined) };
      this.#needed.push(need);
      this.#advance();
    });
    try {
      if (this.#closed) throw new SceneError("closed", "the scene was closed");
      return await work(this.failed.get(place.begin));
    } finally {
      this.#needed = this.#needed.filter((other) => other !== need);
      this.#advance();
    }
  }

  /** What is to be loaded, decoded and kept now. */
  #plan() {
    const planned = plan(this.places, this.#seconds, this.#options);
    const needed = this.#needed[0]?.place;
    if (!needed) return planned;
    const first = (/** @type {Place[]} */ places) => [needed, ...places.filter((place) => place !== needed)];
    return { load: first(planned.load), decode: first(planned.decode), keep: first(planned.keep) };
  }

  /** Goes on with what is needed first. */
  #advance() {
    if (this.#closed) return;
    const open = (/** @type {Place} */ { begin }) => !this.decoded.has(begin) && !this.failed.has(begin);
    const { load, decode } = this.#plan();
    this.#bytes.load((this.#loadsAhead ? load : load.slice(0, 1)).filter(open), (place, error) => this.#fail(place, error));
    if (this.#working) return;
    const next = (this.#decodesAhead ? decode : decode.slice(0, 1)).find((place) => open(place) && this.#bytes.has(place));
    if (!next) return;
    this.#working = true;
    this.#decode(next)
      .catch((error) => this.#fail(next, error))
      .finally(() => {
        this.#working = false;
        this.#progress();
      });
  }

  /** @param {Place} place */
  async #decode(place) {
    const { begin } = place;
    const bytes = await this.#bytes.read(place);
    if (this.#closed) return;
    this.#unpacker ??= this.#startUnpacker();
    const unpacker = await this.#unpacker;
    let answer;
    try {
      answer = await unpacker.ask({ type: "unpack", begin, bytes });
    } catch (error) {
      // A decoder that has stopped is of no use any more.
      if (!(error instanceof SceneError && error.kind === "damaged")) this.#endUnpacker();
      throw error;
    }
    const { unpacked, milliseconds } = answer;
    // The time may be elsewhere by now.
    if (this.#closed || !this.#plan().keep.includes(place)) return;
    this.#forgetOthers();
    const { count, levels } = await this.#connection.ask({ type: "segment", begin, unpacked }, [unpacked.buffer]);
    this.decoded.set(begin, { place, count, levels });
    this.#take.dispatchEvent(new Event("segment"));
    this.#take.decodeMs = milliseconds;
  }

  /** Frees what is not near the time any more. */
  #forgetOthers() {
    const { keep } = this.#plan();
    for (const begin of [...this.decoded.keys()]) {
      if (keep.some((place) => place.begin === begin)) continue;
      this.decoded.delete(begin);
      this.#connection.ask({ type: "forget", begin }).catch(() => {});
    }
  }

  async #startUnpacker() {
    const request = this.#indexRequest;
    const unpacker = new Connection();
    await unpacker.prepared;
    if (request) await unpacker.ask(request);
    return unpacker;
  }

  #endUnpacker() {
    this.#unpacker?.then((unpacker) => unpacker.close()).catch(() => {});
    this.#unpacker = null;
  }

  /** @param {Place} place @param {unknown} error */
  #fail(place, error) {
    if (this.#closed) return;
    const kind = error instanceof SceneError ? error.kind : "fault";
    const message = error instanceof Error ? error.message : String(error);
    const failure = new SceneError(kind, `seconds ${place.begin} to ${place.end}: ${message}`);
    this.failed.set(place.begin, failure);
    this.#take.dispatchEvent(new CustomEvent("problem", { detail: failure }));
    this.#progress();
  }

  /** Something has come. */
  #progress() {
    if (this.#closed) return;
    for (const { place, resolve } of this.#needed) {
      if (this.decoded.has(place.begin) || this.failed.has(place.begin)) resolve();
    }
    this.#take.dispatchEvent(new Event("progress"));
    this.#advance();
  }

  close() {
    this.#closed = true;
    this.#bytes.close();
    this.#endUnpacker();
    for (const { resolve } of this.#needed) resolve();
  }
}
