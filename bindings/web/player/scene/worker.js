// The worker: one scene or one take, decoded, moved and sorted off the main thread.

import sampleBase64 from "virtual:sample";
import { fromBase64 } from "../bytes/base64.js";
import { Decoder } from "./decoder.js";
import { SceneError } from "../errors.js";
import { TakeDecoder } from "../take/take_decoder.js";

/** @type {Decoder | null} */
let decoder = null;
/** The take, where it is one. @type {TakeDecoder | null} */
let take = null;

// A message to oneself comes after those that are waiting.
const channel = new MessageChannel();
/** @type {(() => void)[]} */
const paused = [];
channel.port1.onmessage = () => paused.shift()?.();
const pause = () =>
  new Promise((/** @type {(value: void) => void} */ resolve) => {
    paused.push(resolve);
    channel.port2.postMessage(0);
  });

/**
 * @param {any} answer
 * @param {ArrayBufferLike[]} transfer
 */
const send = (answer, transfer = []) => /** @type {any} */ (self).postMessage(answer, transfer);

/** The last request that needs the Gaussians at one time, done or not. @type {Promise<void>} */
let last = Promise.resolve();

/** One after the other: the decoder moves the Gaussians of one scene to one time only, and pauses meanwhile. */
const inTurn = (/** @type {() => void | Promise<void>} */ work) => {
  const turn = last.then(work);
  last = turn.catch(() => {});
  return turn;
};

/** @param {any} request */
async function frame({ id, time, viewpoint, memory, level, apart }) {
  if (!decoder) throw new Error("no scene is open");
  (take ?? decoder).show(level, time);
  const start = performance.now();
  const moved = time !== decoder.time;
  if (moved) await decoder.evaluate(time, pause);
  const evaluated = performance.now();
  const weight = decoder.wasm.weight_of_later();
  const [joins, mixed] = [weight > 0, weight > 0 && apart];
  const list = decoder.drawList(viewpoint, memory, Number(mixed));
  const later = mixed ? { list: decoder.drawList(viewpoint, null, 2), weight } : null;
  const times = { evaluateMs: moved ? evaluated - start : 0, sortMs: performance.now() - evaluated };
  send({ id, list, later, together: joins && !mixed, ...times }, [list.buffer, ...(later ? [later.list.buffer] : [])]);
}

/** @type {Record<string, (request: any) => void | Promise<void>>} */
const answers = {
  // Browsers compile a function when it is first called. A small scene calls those that every scene needs.
  prepare({ id, module }) {
    decoder = new Decoder(module);
    decoder.open(fromBase64(sampleBase64));
    send({ id });
  },

  open({ id, bytes }) {
    if (!decoder) throw new Error("there is no decoder");
    const start = performance.now();
    const info = decoder.open(new Uint8Array(bytes));
    send({ id, info, milliseconds: performance.now() - start });
  },

  begin({ id }) {
    if (!decoder) throw new Error("there is no decoder");
    decoder.begin();
    send({ id });
  },

  push: ({ id, bytes }) =>
    inTurn(() => {
      if (!decoder) throw new Error("there is no decoder");
      const start = performance.now();
      const info = decoder.push(new Uint8Array(bytes));
      send({ id, info, milliseconds: performance.now() - start });
    }),

  finish({ id }) {
    if (!decoder) throw new Error("there is no decoder");
    decoder.finish();
    send({ id });
  },

  index: ({ id, ranges, length }) =>
    inTurn(() => {
      if (!decoder) throw new Error("there is no decoder");
      take ??= new TakeDecoder(decoder);
      send({ id, ...take.index(ranges, length) });
    }),

  base: ({ id, bytes }) =>
    inTurn(() => {
      const start = performance.now();
      const info = take?.base(bytes);
      send({ id, info, milliseconds: performance.now() - start });
    }),

  unpack: ({ id, begin, bytes }) =>
    inTurn(() => {
      if (!take) throw new Error("no take is open");
      const start = performance.now();
      const unpacked = take.unpack(begin, bytes);
      send({ id, unpacked, milliseconds: performance.now() - start }, [unpacked.buffer]);
    }),

  segment: ({ id, begin, unpacked }) => inTurn(() => send({ id, ...take?.segment(begin, unpacked) })),

  forget: ({ id, begin }) =>
    inTurn(() => {
      take?.forget(begin);
      send({ id });
    }),

  frame: (request) => inTurn(() => frame(request)),

  attributes({ id, time }) {
    if (!decoder) throw new Error("no scene is open");
    const { numbers, shDegree } = decoder.attributesAt(time);
    send({ id, numbers, shDegree }, [numbers.buffer]);
  },

  digest({ id, bytes }) {
    if (!decoder) throw new Error("there is no decoder");
    send({ id, digest: decoder.digest(new Uint8Array(bytes)) });
  },
};

self.onmessage = async ({ data: request }) => {
  try {
    await answers[request.type](request);
  } catch (error) {
    const kind = error instanceof SceneError ? error.kind : "fault";
    send({ id: request.id, error: kind, message: error instanceof Error ? error.message : String(error) });
  }
};
