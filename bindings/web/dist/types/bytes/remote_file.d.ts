import { Arriving } from "./arriving.js";
export declare class RemoteFile {
    #private;
    address: string;
    /** Bytes of the file, NaN where they are not known. */
    length: number;
    /** Told whenever something of the stream has come. */
    report: () => void;
    arriving: Arriving;
    /**
     * @param {string} address
     * @param {{ signal?: AbortSignal, report?: (share: number) => void }} [options]  `report` is told how much of the stream has come
     */
    constructor(address: string, options?: {
        signal?: AbortSignal;
        report?: (share: number) => void;
    });
    /** Refuses a scene that is too long. A take may be longer, since only parts of it are here. */
    checkLength(): void;
    /** Whether a range costs nothing when it is read once more. */
    get keeps(): boolean;
    /** Whether a range is here. @param {number} begin @param {number} end */
    has(begin: number, end: number): boolean;
    /**
     * A range of the file; less where the file ends before.
     * @param {number} begin @param {number} end
     * @param {AbortSignal} [signal]  ends the request
     * @returns {Promise<Uint8Array<ArrayBuffer>>}
     * @throws {import("../errors.js").SceneError}
     */
    read(begin: number, end: number, signal?: AbortSignal): Promise<Uint8Array<ArrayBuffer>>;
    /** What else comes is not needed soon. Without ranges there is no other way to it. */
    pause(): void;
    /** The file as it is now. Nothing of what has come is believed. */
    again(): RemoteFile;
    close(): void;
}
