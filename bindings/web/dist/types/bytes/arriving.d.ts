export declare class Arriving {
    #private;
    report: () => void;
    /** Bytes that are here. */
    received: number;
    /** Whether a range costs nothing when it is read once more. */
    keeps: boolean;
    /** Bytes of the file, where they are known. */
    length: number;
    /** @param {AsyncIterable<Uint8Array>} pieces @param {() => void} [report]  told whenever something has come */
    constructor(pieces: AsyncIterable<Uint8Array>, report?: () => void);
    /** Whether a range is here. @param {number} begin @param {number} end */
    has(begin: number, end: number): boolean;
    /**
     * Takes no more than is needed for it from the stream. Gives less where the file ends before.
     * @param {number} begin @param {number} end
     * @returns {Promise<Uint8Array<ArrayBuffer>>}
     */
    read(begin: number, end: number): Promise<Uint8Array<ArrayBuffer>>;
    /** Takes the whole file, whether somebody reads or not. */
    takeAll(): Promise<void>;
    /** What is here, and then the rest as it comes, which is not kept. */
    pieces(): AsyncGenerator<Uint8Array<ArrayBufferLike>, void, any>;
    /** All of it is wanted: there is no other way to what comes later. */
    pause(): void;
    /** The file as it is now; null where it cannot be another one. */
    again(): null;
    /** Nothing more is wanted. */
    close(): void;
}
