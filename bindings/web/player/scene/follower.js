// Makes a foreign renderer follow a clock: asks for one time after another, without a queue.

import { SceneError } from "../errors.js";

/**
 * One request at a time. Of the times that are wanted meanwhile, only the newest is asked for next. So a renderer that is slower
 * than the clock drops times instead of falling behind.
 * @template Wanted  what is asked for, as JSON can hold it: a time, or a time and a viewpoint
 * @template Answer
 */
export class Follower {
  #ask;
  #apply;
  /** @type {{ wanted: Wanted } | null} */
  #next = null;
  #newest = "";
  /** @type {Promise<void> | null} */
  #running = null;
  #stopped = false;
  /** The request that was applied last. @type {Wanted | null} */
  shown = null;

  /**
   * @param {(wanted: Wanted) => Promise<Answer>} ask  such as `(time) => scene.gaussiansAt(time)`
   * @param {(answer: Answer, wanted: Wanted) => void} apply  gives what has come to the renderer
   */
  constructor(ask, apply) {
    this.#ask = ask;
    this.#apply = apply;
  }

  /**
   * Sets the request. To be called for each frame, changed or not.
   * @param {Wanted} wanted
   * @returns {Promise<void>}  settles when the newest is applied; fails with what `ask` or `apply` throws, and so it stays
   */
  update(wanted) {
    const newest = JSON.stringify(wanted);
    if (!this.#stopped && newest !== this.#newest) {
      this.#newest = newest;
      this.#next = { wanted };
      this.#running ??= this.#run();
    }
    return this.#running ?? Promise.resolve();
  }

  async #run() {
    try {
      while (this.#next) {
        const { wanted } = this.#next;
        this.#next = null;
        const answer = await this.#ask(wanted);
        if (this.#stopped) break;
        this.#apply(answer, wanted);
        this.shown = wanted;
      }
    } catch (error) {
      // Whoever closes a scene does not want to hear of it.
      if (!(error instanceof SceneError && error.kind === "closed")) throw error;
      this.#stopped = true;
    }
    this.#running = null;
  }

  /** Nothing is asked for or applied any more. */
  stop() {
    this.#stopped = true;
    this.#next = null;
  }
}
