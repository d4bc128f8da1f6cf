// Sources of the bytes of a scene: an address, or the page itself.

import { SceneError } from "../errors.js";
import { fromBase64 } from "./base64.js";

/** How often a connection that breaks is resumed. */
export const RESUMES = 3;
/** Milliseconds before that. */
export const PAUSE = 300;
/** Bytes of the longest file that the decoder takes, as in src/limits.rs. */
export const MOST_BYTES = 2 ** 29;
/** Bytes of the longest text: the cameras of a scene, or what a page watches. */
export const MOST_TEXT = 2 ** 26;

/**
 * Refuses a file before it is in memory.
 * @param {string} name @param {number} bytes  NaN where that is not known @param {number} [most]
 * @throws {SceneError} `too-large`
 */
export function checkLength(name, bytes, most = MOST_BYTES) {
  if (bytes > most) throw new SceneError("too-large", `${name}: ${bytes} bytes, at most ${most} are accepted`);
}

/**
 * @param {ReadableStreamDefaultReader<Uint8Array<ArrayBuffer>>} reader
 * @param {(bytes: number) => void} report  told how many bytes have come
 */
async function* read(reader, report) {
  try {
    for (;;) {
      const { done, value } = await reader.read();
      if (done) return;
      report(value.length);
      yield value;
    }
  } finally {
    // If nobody wants the rest.
    reader.cancel().catch(() => {});
  }
}

/**
 * The bytes at an address as they come. Where the connection breaks and the server gives ranges, the rest is asked for; where nothing
 * has come yet, all of it. (Of a connection that is cut right behind the data, a browser may give none of them.)
 * @param {string} address
 * @param {AbortSignal} signal
 * @param {{ report?: (share: number) => void, most?: number, opened?: (file: { length: number, ranges: boolean }) => void }} [options]
 *   `report` is told how much has come, in [0, 1]; NaN where that is not known. `most` bytes are accepted. `opened` is told how long the
 *   file is, NaN where that is not known, and whether the server may give ranges of it
 * @returns {AsyncGenerator<Uint8Array<ArrayBuffer>>}
 * @throws {SceneError} `network`, `too-large`
 */
export async function* pieces(address, signal, { report = () => {}, most = MOST_BYTES, opened = () => {} } = {}) {
  let received = 0;
  let total = NaN;
  /** The file's tag. While it stays the same, so does the file. */
  let tag = "";
  /** Whether the server gives the rest of this file. */
  let resumable = false;
  /** Whether the file has begun to come. */
  let begun = false;
  for (let resumes = 0; ; resumes++) {
    try {
      /** @type {Record<string, string>} */
      const headers = received > 0 ? { range: `bytes=${received}-`, ...(tag && { "if-range": tag }) } : {};
      const response = await fetch(address, { cache: "no-cache", signal, headers });
      // There is nothing behind what has come.
      if (received > 0 && response.status === 416) return;
      if (!response.ok || !response.body) throw new Error(`HTTP ${response.status} ${response.statusText}`);
      if (received > 0 && response.status !== 206) throw new Error(`the connection broke after ${received} bytes`);
      begun = true;
      if (received === 0) {
        total = Number(response.headers.get("content-length")) || NaN;
        checkLength(address, total, most);
        tag = response.headers.get("etag") ?? "";
        // A weak tag may be that of other bytes, and ranges of compressed bytes are others.
        const plain = !response.headers.has("content-encoding");
        resumable = response.headers.get("accept-ranges") === "bytes" && plain && !tag.startsWith("W/");
        // Servers elsewhere may not show this header: then it is tried.
        const ranges = response.headers.get("accept-ranges") ?? (response.type === "cors" ? "bytes" : "");
        opened({ length: plain ? total : NaN, ranges: plain && ranges === "bytes" });
      }
      const count = (/** @type {number} */ bytes) => {
        received += bytes;
        checkLength(address, received, most);
        report(Math.min(received / total, 1));
      };
      yield* read(response.body.getReader(), count);
      return;
    } catch (error) {
      if (error instanceof SceneError) throw error;
      // All of it has come, only its end was not said.
      if (received > 0 && received === total) return;
      if (signal.aborted || !begun || resumes >= RESUMES || (received > 0 && !resumable)) {
        throw new SceneError("network", `${address}: ${error instanceof Error ? error.message : error}`);
      }
      await new Promise((resolve) => setTimeout(resolve, PAUSE));
    }
  }
}

/**
 * All bytes at an address.
 * @param {string} address
 * @param {AbortSignal} signal
 * @param {number} [most]  bytes that are accepted
 * @returns {Promise<Uint8Array>}
 * @throws {SceneError} `network`, `too-large`
 */
export async function download(address, signal, most) {
  const parts = [];
  for await (const piece of pieces(address, signal, { most })) parts.push(piece);
  return new Uint8Array(await new Blob(parts).arrayBuffer());
}

/**
 * The bytes that a page holds as base64.
 * @param {string} text
 * @throws {SceneError} `damaged`
 */
export function bytesOf(text) {
  try {
    return fromBase64(text);
  } catch {
    throw new SceneError("damaged", "the scene in this page is no base64");
  }
}
