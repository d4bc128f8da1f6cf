/** How often a connection that breaks is resumed. */
export declare const RESUMES = 3;
/** Milliseconds before that. */
export declare const PAUSE = 300;
/** Bytes of the longest file that the decoder takes, as in src/limits.rs. */
export declare const MOST_BYTES: number;
/** Bytes of the longest text: the cameras of a scene, or what a page watches. */
export declare const MOST_TEXT: number;
/**
 * Refuses a file before it is in memory.
 * @param {string} name @param {number} bytes  NaN where that is not known @param {number} [most]
 * @throws {SceneError} `too-large`
 */
export declare function checkLength(name: string, bytes: number, most?: number): void;
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
export declare function pieces(address: string, signal: AbortSignal, { report, most, opened }?: {
    report?: (share: number) => void;
    most?: number;
    opened?: (file: {
        length: number;
        ranges: boolean;
    }) => void;
}): AsyncGenerator<Uint8Array<ArrayBuffer>>;
/**
 * All bytes at an address.
 * @param {string} address
 * @param {AbortSignal} signal
 * @param {number} [most]  bytes that are accepted
 * @returns {Promise<Uint8Array>}
 * @throws {SceneError} `network`, `too-large`
 */
export declare function download(address: string, signal: AbortSignal, most?: number): Promise<Uint8Array>;
/**
 * The bytes that a page holds as base64.
 * @param {string} text
 * @throws {SceneError} `damaged`
 */
export declare function bytesOf(text: string): Uint8Array<ArrayBuffer>;
