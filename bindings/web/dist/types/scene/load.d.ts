import { RemoteFile } from "../bytes/remote_file.js";
export type Source = ArrayBuffer | Uint8Array | Blob | ReadableStream<Uint8Array> | AsyncIterable<Uint8Array> | URL | RemoteFile;
export type Scene = import("./scene.js").Scene;
/** Starts a decoder, so that it is ready when the bytes of a file arrive. {@link load} does so itself, but only then. */
export declare function prepare(): void;
/** Ends the decoder that {@link prepare} started, where no file has come for it. */
export declare function dismiss(): void;
/**
 * Decodes a `.l4gs` file. A scene that comes as a stream is there as soon as something can be seen: {@link Scene.whole} says when
 * all of it is. A take is there with its base and its first segment.
 * @param {Source} source
 * @returns {Promise<Scene>}  a {@link Take}, where it is one
 * @throws {import("../errors.js").SceneError} whose `kind` says what is wrong with the file
 */
export declare function load(source: Source): Promise<Scene>;
