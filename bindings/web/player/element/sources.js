// Sources of the bytes of a scene: an address, or the page itself.

import { SceneError } from "../errors.js";

/** How often a connection that breaks is resumed. */
const RESUMES = 3;
/** Milliseconds before that. */
const PAUSE = 300;

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
 * The bytes at an address as they come. Where the connection breaks and the server gives ranges, the rest is asked for.
 * @param {string} address
 * @param {AbortSignal} signal
 * @param {(share: number) => void} [report]  told how much has come, in [0, 1]; NaN where that is not known
 * @returns {AsyncGenerator<Uint8Array<ArrayBuffer>>}
 * @throws {SceneError} `network`
 */
export async function* pieces(address, signal, report = () => {}) {
  let received = 0;
  let total = NaN;
  /** The file's tag. While it stays the same, so does the file. */
  let tag = "";
  for (let resumes = 0; ; resumes++) {
    try {
      /** @type {Record<string, string>} */
      const headers = received > 0 ? { range: `bytes=${received}-`, ...(tag && { "if-range": tag }) } : {};
      const response = await fetch(address, { cache: "no-cache", signal, headers });
      if (!response.ok || !response.body) throw new Error(`HTTP ${response.status} ${response.statusText}`);
      if (received > 0 && response.status !== 206) throw new Error(`the connection broke after ${received} bytes`);
      if (received === 0) {
        total = Number(response.headers.get("content-length")) || NaN;
        tag = response.headers.get("etag") ?? "";
        // A weak tag may be that of other bytes, and ranges of compressed bytes are others.
        const resumable = response.headers.get("accept-ranges") === "bytes" && !response.headers.has("content-encoding");
        if (!resumable || tag.startsWith("W/")) resumes = RESUMES;
      }
      yield* read(response.body.getReader(), (bytes) => report(Math.min((received += bytes) / total, 1)));
      return;
    } catch (error) {
      // The connection may also end halfway.
      if (signal.aborted || received === 0 || resumes >= RESUMES) {
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
 * @param {(share: number) => void} [report]  as of {@link pieces}
 * @returns {Promise<Uint8Array>}
 * @throws {SceneError} `network`
 */
export async function download(address, signal, report) {
  const parts = [];
  for await (const piece of pieces(address, signal, report)) parts.push(piece);
  return new Uint8Array(await new Blob(parts).arrayBuffer());
}

/**
 * The bytes that a page holds as base64.
 * @param {string} text
 * @throws {SceneError} `damaged`
 */
export function bytesOf(text) {
  try {
    return Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
  } catch {
    throw new SceneError("damaged", "the scene in this page is no base64");
  }
}
