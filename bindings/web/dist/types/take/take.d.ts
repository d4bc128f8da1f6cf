import { SceneError } from "../errors.js";
import { Scene } from "../scene/scene.js";
import { Segments } from "./segments.js";
export type Place = import("./plan.js").Place;
export type Connection = import("../scene/connection.js").Connection;
export type Index = {
    name: string;
    /**
     * 0 where not known
     */
    fps: number;
    seconds: number;
    /**
     * where its bytes begin and end
     */
    base: [number, number];
    /**
     * begin and end in seconds, and in bytes of the file
     */
    segments: [number, number, number, number][];
    extra: Record<string, string>;
};
export type RangedFile = {
    address?: string;
    /**
     * bytes, NaN where they are not known
     */
    length: number;
    /**
     * whether a range costs nothing when it is read once more
     */
    keeps: boolean;
    /**
     * told whenever something has come by itself
     */
    report: () => void;
    /**
     * whether a range is here
     */
    has: (begin: number, end: number) => boolean;
    /**
     * a range; less where the file ends before
     */
    read: (begin: number, end: number, signal?: AbortSignal) => Promise<Uint8Array<ArrayBuffer>>;
    /**
     * what else comes by itself is not needed soon
     */
    pause: () => void;
    /**
     * the file as it is now; null where it cannot be another one
     */
    again: () => RangedFile | null;
    close: () => void;
};
/**
 * An open take. Made by {@link import("../scene/load.js").load}; {@link Take.close} frees what it holds. Times are in seconds.
 *
 * Events: `progress` (what is loaded has changed), `problem` (detail: the {@link SceneError} of a segment that cannot be shown; the rest
 * plays on), `change` (the take has grown).
 */
export declare class Take extends Scene {
    #private;
    segments: Segments;
    /**
     * Use {@link import("../scene/load.js").load}.
     * @param {Connection} connection
     * @param {RangedFile} file
     * @param {Index} index
     */
    constructor(connection: Connection, file: RangedFile, index: Index);
    /**
     * @param {Connection} connection
     * @param {RangedFile} file
     */
    static open(connection: Connection, file: RangedFile): Promise<Take>;
    /** Where the file is; none where its bytes were given. */
    get address(): string | undefined;
    /** Seconds. */
    get duration(): number;
    /** Number of Gaussians of the base and, where it is decoded, of the segment that is shown. */
    get count(): number;
    /** What is wrong with segments that cannot be shown, the newest last. */
    get problems(): SceneError[];
    /** Which parts of the take can be shown at once: first and last second of each. @returns {[number, number][]} */
    get loaded(): [number, number][];
    /**
     * The Gaussians of base and segment, without those that are hidden. Their number is another one in each segment.
     * @param {number} seconds
     * @throws {SceneError} where the segment cannot be had
     */
    gaussiansAt(seconds: number): Promise<import("../scene/scene.js").GaussiansAt>;
    /**
     * Without its segment, where that cannot be had.
     * @param {number} seconds
     * @param {import("../scene/scene.js").Viewpoint} viewpoint @param {ArrayBuffer | null} [memory] @param {number} [level]
     * @param {boolean} [apart]
     */
    frame(seconds: number, viewpoint: import("../scene/scene.js").Viewpoint, memory?: ArrayBuffer | null, level?: number, apart?: boolean): Promise<import("../scene/scene.js").Frame>;
    /** While a segment is on its way, what was shown before stays. @param {number} share */
    momentAt(share: number): number;
    /** @param {number} share @param {boolean} loop */
    follow(share: number, loop: boolean): void;
    /** @param {number} share */
    waitsAt(share: number): boolean;
    /** @param {number} share */
    ready(share: number): Promise<void>;
    /**
     * Looks whether the file has grown.
     * @returns {Promise<boolean>}  false where it is another file: something that was there is not there any more
     * @throws {SceneError} where it cannot be read now; nothing changes then
     */
    refresh(): Promise<boolean>;
    close(): void;
}
