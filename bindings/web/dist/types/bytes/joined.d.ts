/** @param {Uint8Array[]} pieces */
export declare function joined(pieces: Uint8Array[]): Uint8Array<ArrayBuffer>;
