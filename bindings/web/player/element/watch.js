// Looks at a small text again and again: how a page follows a scene that is still being trained.

import { MOST_TEXT, download } from "../bytes/sources.js";

/** Milliseconds between two looks. */
const INTERVAL = 1500;

/**
 * @param {string} address  of a JSON text with `status`, a line for people, and `scene`, which changes whenever the scene does
 * @param {AbortSignal} signal
 * @param {(status: string) => void} say
 * @param {() => Promise<boolean>} load  loads the scene; whether it came
 */
export async function watch(address, signal, say, load) {
  /** The scene that came last. */
  let shown = "";
  while (!signal.aborted) {
    try {
      const text = new TextDecoder().decode(await download(address, signal, MOST_TEXT));
      if (signal.aborted) return;
      const { status, scene } = JSON.parse(text);
      say(status ?? "");
      // A text that did not come is asked for again.
      if (scene && shown !== String(scene) && (await load())) shown = String(scene);
    } catch {
      if (!signal.aborted) say("The server does not answer");
    }
    await new Promise((resolve) => setTimeout(resolve, INTERVAL));
  }
}
