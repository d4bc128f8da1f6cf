import { SceneError } from "../errors.js";
import { Connection } from "../scene/connection.js";
export type Place = import("./plan.js").Place;
export declare class Segments {
    #private;
    /** @type {Place[]} */
    places: Place[];
    /** The open ones, by their begins. @type {Map<number, { place: Place, count: number, levels: number }>} */
    decoded: Map<number, {
        place: Place;
        count: number;
        levels: number;
    }>;
    /** Why a segment cannot be shown, by its begin. @type {Map<number, SceneError>} */
    failed: Map<number, SceneError>;
    /**
     * @param {Connection} connection  to the worker that draws
     * @param {import("./take.js").RangedFile} file
     * @param {import("./take.js").Take} take  which is told of progress and problems
     */
    constructor(connection: Connection, file: import("./take.js").RangedFile, take: import("./take.js").Take);
    /** The same take, where it has grown. @param {import("./take.js").RangedFile} file */
    setFile(file: import("./take.js").RangedFile): void;
    /**
     * Takes an index, which has all that the one before had.
     * @param {import("./take.js").Index} index @param {Uint8Array[]} ranges  from which it was read @param {number} length  of the file
     */
    setIndex({ segments }: import("./take.js").Index, ranges: Uint8Array[], length: number): void;
    /** Parts of the take whose bytes are here. @returns {[number, number][]} */
    get loaded(): [number, number][];
    /** Whether nothing more is awaited for a time: its segment is decoded, or cannot be, or there is none. @param {number} seconds */
    isSettled(seconds: number): boolean;
    /** The first image has what it needs: what comes next is loaded, and decoded after a while. */
    goAhead(): void;
    /**
     * Says where the time is.
     * @param {number} seconds
     * @param {{ loop: boolean, held?: Place, duration: number }} options  as of {@link plan}
     */
    follow(seconds: number, options: {
        loop: boolean;
        held?: Place;
        duration: number;
    }): void;
    /**
     * Does something with the segment of a time, as soon as it is settled.
     * @template T
     * @param {number} seconds
     * @param {(failure: SceneError | undefined) => Promise<T>} work
     * @returns {Promise<T>}
     */
    with<T>(seconds: number, work: (failure: SceneError | undefined) => Promise<T>): Promise<T>;
    close(): void;
}
