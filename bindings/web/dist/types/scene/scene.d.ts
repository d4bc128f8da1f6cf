export type SceneInfo = {
    /**
     * for people
     */
    name: string;
    /**
     * frames of the source
     */
    frameCount: number;
    /**
     * frames a second of the source, 0 where it is not known
     */
    fps: number;
    /**
     * smallest and largest corner, world units
     */
    bounds: [number[], number[]];
    /**
     * red, green, blue in [0, 1]
     */
    background: [number, number, number];
    /**
     * of the source's default camera, pixels
     */
    width: number;
    /**
     * of the source's default camera, pixels
     */
    height: number;
    /**
     * its horizontal field of view, radians
     */
    fovX: number;
    /**
     * of the format
     */
    version: number;
    /**
     * of the file
     */
    bytes: number;
    /**
     * Gaussians
     */
    count: number;
    /**
     * of the spherical harmonics, 0 to 3
     */
    shDegree: number;
    /**
     * whether anything changes with time
     */
    moves: boolean;
    /**
     * layers of Gaussians that the file has
     */
    layers: number;
    /**
     * those that have come
     */
    layersShown: number;
    /**
     * levels of detail besides the scene itself; each has half of the Gaussians of the one before
     */
    levels: number;
    /**
     * name and bytes of each part of the file
     */
    sections: [string, number][];
    /**
     * free notes
     */
    extra: Record<string, string>;
};
export type GaussiansAt = {
    /**
     * N
     */
    count: number;
    /**
     * `[N, 3]`: centers, world units
     */
    means: Float32Array;
    /**
     * `[N, 3]`: standard deviations, world units
     */
    scales: Float32Array;
    /**
     * `[N, 4]`: `(w, x, y, z)` of unit length
     */
    quaternions: Float32Array;
    /**
     * `[N]` in [0, 1]
     */
    opacities: Float32Array;
    /**
     * d
     */
    shDegree: number;
    /**
     * `[N, (d + 1)², 3]`: a color is `max(0, 0.5 + Σ basis · coefficient)`
     */
    sh: Float32Array;
};
export type Viewpoint = {
    /**
     * the depth of a point is `row · (x, y, z, 1)`
     */
    row: ArrayLike<number>;
    /**
     * the camera's center, world units
     */
    eye: ArrayLike<number>;
    /**
     * what does not reach into the cone around the view axis is left out: the tangent of its angle to
     * the axis; all in front of the camera where not given
     */
    spread?: number;
};
export type Frame = {
    /**
     * back to front, 16 numbers a Gaussian: center (3), opacity, covariance xx, xy, xz, yy, yz, zz,
     * color as seen from the viewpoint (3), three zeros; filled up to a multiple of 256 Gaussians with zeros
     */
    list: Float32Array;
    /**
     * what the motion took; 0 where the list before was for the same time
     */
    evaluateMs: number;
    /**
     * what order and colors took
     */
    sortMs: number;
};
export type Source = ArrayBuffer | Uint8Array | ReadableStream<Uint8Array> | AsyncIterable<Uint8Array>;
/**
 * A decoded scene. Made by {@link load}; {@link Scene.close} frees what it holds. Where its file is still coming, the event
 * `change` tells of more Gaussians.
 */
export declare class Scene extends EventTarget {
    #private;
    /** @type {SceneInfo} */
    info: SceneInfo;
    /** Time of decoding, milliseconds. */
    decodeMs: number;
    /** Resolves when the whole file is there; fails with a {@link SceneError} where it does not come. @type {Promise<void>} */
    whole: Promise<void>;
    /** Use {@link load}. */
    constructor();
    /** @param {ArrayBuffer} bytes */
    open(bytes: ArrayBuffer): Promise<void>;
    /**
     * Resolves as soon as there is something to see.
     * @param {AsyncIterable<Uint8Array>} pieces
     */
    receive(pieces: AsyncIterable<Uint8Array>): Promise<void>;
    /** Number of Gaussians. */
    get count(): number;
    /** Length in seconds: the source's where it is known, else at 30 frames a second. */
    get duration(): number;
    /**
     * The Gaussians at a time in [0, 1], activated, for a renderer of your own.
     * @param {number} time
     * @returns {Promise<GaussiansAt>}
     */
    gaussiansAt(time: number): Promise<GaussiansAt>;
    /**
     * The list of Gaussians to draw at a time from a viewpoint.
     * @param {number} time  in [0, 1]
     * @param {Viewpoint} viewpoint
     * @param {ArrayBuffer | null} [memory]  to be used again
     * @param {number} [level]  of detail: 0 is the scene itself, at most {@link SceneInfo.levels}
     * @returns {Promise<Frame>}
     */
    frame(time: number, viewpoint: Viewpoint, memory?: ArrayBuffer | null, level?: number): Promise<Frame>;
    /**
     * One number for all bits of the scene that a file decodes to, as 16 hexadecimal digits: the same on every machine.
     * @param {ArrayBuffer} bytes
     * @returns {Promise<string>}
     */
    digest(bytes: ArrayBuffer): Promise<string>;
    /** Ends the worker and frees its memory. Open requests fail with a {@link SceneError} `closed`. */
    close(): void;
}
/** Starts a decoder, so that it is ready when the bytes of a file arrive. {@link load} does so itself, but only then. */
export declare function prepare(): void;
/** Ends the decoder that {@link prepare} started, where no file has come for it. */
export declare function dismiss(): void;
/**
 * Decodes a `.l4gs` file. One that comes as a stream is there as soon as something can be seen: {@link Scene.whole} says when
 * all of it is.
 * @param {Source} source
 * @returns {Promise<Scene>}
 * @throws {SceneError} whose `kind` says what is wrong with the file
 */
export declare function load(source: Source): Promise<Scene>;
