// Bytes of segments, as they are in the file: loaded one after the other, and kept as long as there is room.

import { SceneError } from "../errors.js";

/** @typedef {import("./plan.js").Place} Place */

/** Bytes that are kept beyond those that are needed soon. */
const MOST_KEPT = 2 ** 26;

export class LoadedBytes {
  /** The oldest first. What was read once is a blob: the browser keeps those outside of the page. @type {Map<Place, Uint8Array<ArrayBuffer> | Blob>} */
  #kept = new Map();
  /** @type {{ place: Place, abort: AbortController } | null} */
  #loading = null;
  #report;

  /** @param {import("./take.js").RangedFile} file @param {() => void} report  told whenever a segment has come */
  constructor(file, report) {
    this.file = file;
    this.#report = report;
    file.report = report;
  }

  /** The same take, where it has grown. @param {import("./take.js").RangedFile} file */
  setFile(file) {
    this.close();
    this.file = file;
    file.report = this.#report;
  }

  /** Whether the bytes of a segment are here. @param {Place} place */
  has(place) {
    return this.#kept.has(place) || this.file.has(place.first, place.last);
  }

  /** The bytes of a segment that are here. @param {Place} place */
  async read(place) {
    const kept = this.#kept.get(place);
    if (!kept) return this.file.read(place.first, place.last);
    if (kept instanceof Blob) return new Uint8Array(await kept.arrayBuffer());
    this.#kept.set(place, new Blob([kept]));
    return kept;
  }

  /**
   * Loads the first of these that is not here, one at a time: what is needed first has the whole connection. A request for something that is not
   * among them any more is ended.
   * @param {Place[]} places  in the order in which they are needed
   * @param {(place: Place, error: unknown) => void} fail
   */
  load(places, fail) {
    if (this.#loading && !places.includes(this.#loading.place)) {
      this.#loading.abort.abort();
      this.#loading = null;
    }
    const place = places.find((place) => !this.has(place));
    if (this.#loading || !place) return;
    const loading = { place, abort: new AbortController() };
    this.#loading = loading;
    this.file.read(place.first, place.last, loading.abort.signal).then(
      (bytes) => {
        if (this.#loading !== loading) return;
        this.#loading = null;
        if (bytes.length < place.last - place.first) return fail(place, new SceneError("damaged", "the file ends before the end of the segment"));
        if (!this.file.keeps) this.#keep(place, bytes, places);
        this.#report();
      },
      (error) => {
        if (this.#loading !== loading) return;
        this.#loading = null;
        fail(place, error);
      },
    );
  }

  /** @param {Place} place @param {Uint8Array<ArrayBuffer>} bytes @param {Place[]} needed */
  #keep(place, bytes, needed) {
    this.#kept.set(place, bytes);
    const size = (/** @type {Place} */ { first, last }) => last - first;
    let sum = 0;
    for (const other of this.#kept.keys()) sum += size(other);
    for (const other of this.#kept.keys()) {
      if (sum <= MOST_KEPT) return;
      if (needed.includes(other)) continue;
      this.#kept.delete(other);
      sum -= size(other);
    }
  }

  /** Nothing more is loaded. */
  close() {
    this.#loading?.abort.abort();
    this.#loading = null;
  }
}
