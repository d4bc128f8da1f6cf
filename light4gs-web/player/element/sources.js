// Where the bytes of a scene come from: an address, or the page itself.

import { SceneError } from "../errors.js";

/**
 * The bytes at an address.
 * @param {string} address
 * @param {AbortSignal} signal
 * @param {(share: number) => void} [report]  told how much has come, in [0, 1]; NaN where that is not known
 * @returns {Promise<Uint8Array>}
 * @throws {SceneError} `network`
 */
export async function download(address, signal, report = () => {}) {
  try {
    const response = await fetch(address, { cache: "no-cache", signal });
    if (!response.ok || !response.body) throw new Error(`HTTP ${response.status} ${response.statusText}`);
    const total = Number(response.headers.get("content-length"));
    const parts = [];
    let received = 0;
    const reader = response.body.getReader();
    for (;;) {
      const { done, value } = await reader.read();
      if (done) break;
      parts.push(value);
      received += value.length;
      report(total > 0 ? Math.min(received / total, 1) : NaN);
    }
    const bytes = new Uint8Array(received);
    let at = 0;
    for (const part of parts) {
      bytes.set(part, at);
      at += part.length;
    }
    return bytes;
  } catch (error) {
    // The connection may also end halfway.
    throw new SceneError("network", `${address}: ${error instanceof Error ? error.message : error}`);
  }
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
