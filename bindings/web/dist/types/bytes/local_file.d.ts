export declare class LocalFile {
    blob: Blob;
    /** Whether a range costs nothing when it is read once more. */
    keeps: boolean;
    length: number;
    report: () => void;
    /** @param {Blob} blob */
    constructor(blob: Blob);
    /** Whether a range is here. @param {number} begin @param {number} end */
    has(begin: number, end: number): boolean;
    /**
     * A range of the file; less where the file ends before.
     * @param {number} begin @param {number} end
     * @returns {Promise<Uint8Array<ArrayBuffer>>}
     * @throws {SceneError} `network`
     */
    read(begin: number, end: number): Promise<Uint8Array<ArrayBuffer>>;
    /** What else comes is not needed soon. */
    pause(): void;
    /** The file as it is now; null where it cannot be another one. */
    again(): null;
    close(): void;
}
