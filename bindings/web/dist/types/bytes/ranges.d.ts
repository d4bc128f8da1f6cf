/** A server that answers a range with the whole file. */
export declare class NoRanges extends Error {
}
/**
 * The bytes from `begin` to before `end`, and the length of the file, NaN where the server does not say it. A connection that breaks is
 * resumed where it broke.
 * @param {string} address @param {number} begin @param {number} end
 * @param {AbortSignal} signal
 * @returns {Promise<{ bytes: Uint8Array<ArrayBuffer>, length: number }>}
 * @throws {SceneError} `network`; {@link NoRanges}
 */
export declare function fetchRange(address: string, begin: number, end: number, signal: AbortSignal): Promise<{
    bytes: Uint8Array<ArrayBuffer>;
    length: number;
}>;
