// Ranges of a file at an address, one request each.

import { SceneError } from "../errors.js";
import { PAUSE, RESUMES } from "./sources.js";

/** A server that answers a range with the whole file. */
export class NoRanges extends Error {}

/**
 * The bytes from `begin` to before `end`, and the length of the file, NaN where the server does not say it. A connection that breaks is
 * resumed where it broke.
 * @param {string} address @param {number} begin @param {number} end
 * @param {AbortSignal} signal
 * @returns {Promise<{ bytes: Uint8Array<ArrayBuffer>, length: number }>}
 * @throws {SceneError} `network`; {@link NoRanges}
 */
export async function fetchRange(address, begin, end, signal) {
  const bytes = new Uint8Array(end - begin);
  let [received, length] = [0, NaN];
  for (let resumes = 0; ; resumes++) {
    try {
      const range = `bytes=${begin + received}-${end - 1}`;
      const response = await fetch(address, { cache: "no-cache", signal, headers: { range } });
      // Nothing is there: the reader of the bytes says what is missing.
      if (response.status === 416) return { bytes: bytes.slice(0, received), length };
      if (response.status === 200) {
        response.body?.cancel().catch(() => {});
        throw new NoRanges();
      }
      if (response.status !== 206 || !response.body) throw new Error(`HTTP ${response.status} ${response.statusText}`);
      const [, first, total] = /^bytes (\d+)-\d+\/(\d+)$/.exec(response.headers.get("content-range") ?? "") ?? [];
      if (first && Number(first) !== begin + received) throw new Error(`the server has answered ${range} with other bytes`);
      if (total) length = Number(total);
      const reader = response.body.getReader();
      for (;;) {
        const { done, value } = await reader.read();
        // A file that ends before is shorter, and not broken.
        if (done) return { bytes: bytes.slice(0, received), length };
        if (received + value.length > bytes.length) {
          reader.cancel().catch(() => {});
          throw new SceneError("network", `${address}: the server has answered ${range} with more bytes`);
        }
        bytes.set(value, received);
        received += value.length;
      }
    } catch (error) {
      if (signal.aborted) throw new SceneError("closed", "not wanted any more");
      if (error instanceof SceneError || error instanceof NoRanges) throw error;
      if (received === bytes.length) return { bytes, length };
      if (resumes >= RESUMES) throw new SceneError("network", `${address}: ${error instanceof Error ? error.message : error}`);
      await new Promise((resolve) => setTimeout(resolve, PAUSE));
    }
  }
}
