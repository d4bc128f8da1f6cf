// A worker with a decoder, and the requests to it.

import wasmBase64 from "virtual:decoder";
import workerSource from "virtual:worker";
import { fromBase64 } from "../bytes/base64.js";
import { SceneError } from "../errors.js";

/** Milliseconds that decoders leave for the first image before they go on. */
export const FIRST_IMAGE = 200;

/** @type {Promise<WebAssembly.Module> | null} */
let module = null;

/** The decoder, compiled once a page. */
export function decoderModule() {
  const unpack = async () => {
    const stream = new Blob([fromBase64(wasmBase64)]).stream().pipeThrough(new DecompressionStream("gzip"));
    return WebAssembly.compile(await new Response(stream).arrayBuffer());
  };
  module ??= unpack().catch((error) => {
    // A second attempt may succeed.
    module = null;
    throw new SceneError("blocked", error instanceof Error ? error.message : String(error));
  });
  return module;
}

/** A worker of its own. It starts at once, and {@link Connection.close} ends it. */
export class Connection {
  /** @type {Map<number, { resolve: (answer: any) => void, reject: (error: Error) => void }>} */
  #waiting = new Map();
  #worker;
  #url;
  #next = 0;
  /** Whether the worker has answered: then it had started. */
  #answered = false;
  /** Why the worker answers no more. @type {SceneError | null} */
  #failure = null;

  constructor() {
    this.#url = URL.createObjectURL(new Blob([workerSource], { type: "text/javascript" }));
    this.#worker = new Worker(this.#url);
    this.#worker.onmessage = ({ data: answer }) => {
      this.#answered = true;
      const waiting = this.#waiting.get(answer.id);
      this.#waiting.delete(answer.id);
      if (answer.error) waiting?.reject(new SceneError(answer.error, answer.message));
      else waiting?.resolve(answer);
    };
    this.#worker.onerror = (event) => {
      event.preventDefault();
      // It may come before anything was asked: the decoder is still being compiled then.
      this.#failure ??= new SceneError(this.#answered ? "fault" : "blocked", event.message || "the worker did not start");
      this.#fail(this.#failure);
    };
    /** Resolves when the decoder is there; fails where the browser has none for us. @type {Promise<void>} */
    this.prepared = decoderModule().then((module) => this.ask({ type: "prepare", module }));
    this.prepared.catch(() => {});
  }

  /** @param {Error} error */
  #fail(error) {
    for (const { reject } of this.#waiting.values()) reject(error);
    this.#waiting.clear();
  }

  /**
   * @param {any} request
   * @param {Transferable[]} [transfer]
   * @returns {Promise<any>}
   */
  ask(request, transfer = []) {
    if (this.closed) return Promise.reject(new SceneError("closed", "the scene was closed"));
    if (this.#failure) return Promise.reject(this.#failure);
    return new Promise((resolve, reject) => {
      const id = this.#next++;
      this.#waiting.set(id, { resolve, reject });
      this.#worker.postMessage({ id, ...request }, transfer);
    });
  }

  get closed() {
    return !this.#url;
  }

  /** Ends the worker and frees its memory. Open requests fail with a {@link SceneError} `closed`. */
  close() {
    if (this.closed) return;
    this.#worker.terminate();
    URL.revokeObjectURL(this.#url);
    this.#url = "";
    this.#fail(new SceneError("closed", "the scene was closed"));
  }
}
