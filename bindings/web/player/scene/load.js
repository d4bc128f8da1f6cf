// Loading what can be played, from wherever its bytes come.

import { Arriving } from "../bytes/arriving.js";
import { LocalFile } from "../bytes/local_file.js";
import { RemoteFile } from "../bytes/remote_file.js";
import { checkLength } from "../bytes/sources.js";
import { MAGIC_BYTES, isTake } from "../take/magic.js";
import { Take } from "../take/take.js";
import { Connection } from "./connection.js";
import { StreamScene } from "./stream_scene.js";

/**
 * @typedef {ArrayBuffer | Uint8Array | Blob | ReadableStream<Uint8Array> | AsyncIterable<Uint8Array> | URL | RemoteFile} Source  a file: whole, as
 *   it comes, or its address, from which a take is loaded in parts
 */

/** @typedef {import("./scene.js").Scene} Scene */

/** A worker that waits for a file. @type {Connection | null} */
let standby = null;

/** Starts a decoder, so that it is ready when the bytes of a file arrive. {@link load} does so itself, but only then. */
export function prepare() {
  standby ??= new Connection();
}

/** Ends the decoder that {@link prepare} started, where no file has come for it. */
export function dismiss() {
  standby?.close();
  standby = null;
}

/** The pieces of a stream; browsers differ in whether it can be walked over. @param {ReadableStream<Uint8Array>} stream */
async function* piecesOf(stream) {
  const reader = stream.getReader();
  try {
    for (;;) {
      const { done, value } = await reader.read();
      if (done) return;
      yield value;
    }
  } finally {
    reader.cancel().catch(() => {});
  }
}

/** @param {Connection} connection @param {Blob} blob */
async function loadWhole(connection, blob) {
  const file = new LocalFile(blob);
  if (isTake(await file.read(0, MAGIC_BYTES))) return Take.open(connection, file);
  checkLength(blob instanceof File ? blob.name : "the file", blob.size);
  const scene = new StreamScene(connection);
  const bytes = await file.read(0, blob.size);
  await scene.open(bytes.buffer);
  return scene;
}

/** @param {Connection} connection @param {Arriving} arriving @param {RemoteFile | null} remote  the file, where it has an address */
async function loadArriving(connection, arriving, remote) {
  if (isTake(await arriving.read(0, MAGIC_BYTES))) return Take.open(connection, remote ?? arriving);
  remote?.checkLength();
  const scene = new StreamScene(connection);
  await scene.receive(arriving.pieces());
  return scene;
}

/**
 * Decodes a `.l4gs` file. A scene that comes as a stream is there as soon as something can be seen: {@link Scene.whole} says when
 * all of it is. A take is there with its base and its first segment.
 * @param {Source} source
 * @returns {Promise<Scene>}  a {@link Take}, where it is one
 * @throws {import("../errors.js").SceneError} whose `kind` says what is wrong with the file
 */
export async function load(source) {
  const connection = standby ?? new Connection();
  standby = null;
  const remote = source instanceof URL ? new RemoteFile(source.href) : source instanceof RemoteFile ? source : null;
  try {
    if (remote) return await loadArriving(connection, remote.arriving, remote);
    if (source instanceof Blob) return await loadWhole(connection, source);
    if ("getReader" in source) return await loadArriving(connection, new Arriving(piecesOf(source)), null);
    if (Symbol.asyncIterator in source) return await loadArriving(connection, new Arriving(source), null);
    return await loadWhole(connection, new Blob([/** @type {BlobPart} */ (source)]));
  } catch (error) {
    remote?.close();
    connection.close();
    throw error;
  }
}
