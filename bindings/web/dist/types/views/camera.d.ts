export type View = import("../drawing/splat_renderer.js").View;
export type Vector = [number, number, number];
export type CameraFields = {
    /**
     * for people
     */
    name?: string;
    /**
     * `train`, `test`, `val`, `video`
     */
    split?: string;
    /**
     * in [0, 1]
     */
    time?: number;
};
export type DatasetCamera = View & CameraFields;
/** @typedef {import("../drawing/splat_renderer.js").View} View */
/** @typedef {[number, number, number]} Vector */
/**
 * @typedef {object} CameraFields
 * @property {string} [name]  for people
 * @property {string} [split]  `train`, `test`, `val`, `video`
 * @property {number} [time]  in [0, 1]
 *
 * @typedef {View & CameraFields} DatasetCamera  a camera of a dataset
 */
/** @param {Vector} a @param {Vector} b */
export declare const dot: (a: Vector, b: Vector) => number;
/** @param {Vector} a @param {Vector} b @param {number} [factor] @returns {Vector} */
export declare const add: (a: Vector, b: Vector, factor?: number) => Vector;
/** @param {Vector} a @param {Vector} b @returns {Vector} */
export declare const cross: (a: Vector, b: Vector) => Vector;
/** @param {Vector} a @returns {Vector} */
export declare const normalize: (a: Vector) => Vector;
/**
 * A vector turned around a unit axis.
 * @param {Vector} v @param {Vector} axis @param {number} angle  radians
 * @returns {Vector}
 */
export declare function turn(v: Vector, axis: Vector, angle: number): Vector;
/**
 * Cameras from JSON text.
 * @param {string} text
 * @param {string} where  its address or place, for messages
 * @returns {DatasetCamera[]}
 * @throws {SceneError} `cameras`, which names the camera and the field
 */
export declare function readCameras(text: string, where: string): DatasetCamera[];
/** Where a camera stands. @param {View} view @returns {Vector} */
export declare function center({ rotation: r, translation: t }: View): Vector;
export declare class Camera {
    #private;
    /** World axes of the camera: right, down, forward. @type {[Vector, Vector, Vector]} */
    axes: [Vector, Vector, Vector];
    /** Its center, world units. @type {Vector} */
    position: Vector;
    /** Distance to the point that it turns around, ahead. */
    distance: number;
    /** Upwards in the world. @type {Vector} */
    up: Vector;
    /** Intrinsics of an image of `width × height`; the canvas shows all of it. */
    lens: {
        fx: number;
        fy: number;
        cx: number;
        cy: number;
        width: number;
        height: number;
    };
    /** A copy. */
    clone(): Camera & this;
    /** The point that it turns around. @returns {Vector} */
    get target(): Vector;
    /**
     * Stands at a place and looks at another.
     * @param {Vector} position @param {Vector} target
     */
    lookAt(position: Vector, target: Vector): void;
    /**
     * Takes the place of a dataset's camera, lens and all.
     * @param {View} view
     */
    take(view: View): void;
    /** Turns around the target. Angles in radians; positive: the scene turns right, and towards the viewer from above. */
    orbit(/** @type {number} */ sideways: number, /** @type {number} */ upwards: number): void;
    /** Turns the view where it stands. */
    look(/** @type {number} */ sideways: number, /** @type {number} */ upwards: number): void;
    /** Rolls around the view axis. */
    roll(/** @type {number} */ angle: number): void;
    /** Moves along its axes, in world units: right, down, forward. The target goes along. */
    move(/** @type {number} */ right: number, /** @type {number} */ down: number, /** @type {number} */ forward: number): void;
    /** Goes nearer to the target (factor below 1) or away from it. */
    zoom(/** @type {number} */ factor: number): void;
    /** World units that a pixel of the canvas covers at the target. */
    unitsPerPixel(/** @type {number} */ width: number, /** @type {number} */ height: number): number;
    /**
     * The view on a canvas of `width` × `height` pixels: all of the lens's image, and more on two sides if the shape differs.
     * @param {number} width @param {number} height
     * @returns {View}
     */
    view(width: number, height: number): View;
}
/**
 * The upward direction of most of a dataset's cameras; z without cameras.
 * @param {DatasetCamera[]} cameras
 * @returns {Vector}
 */
export declare function commonUp(cameras: DatasetCamera[]): Vector;
/**
 * The point that a dataset's cameras look at: nearest to their view axes.
 * @param {DatasetCamera[]} cameras
 * @returns {Vector | null}  nothing where the axes are parallel
 */
export declare function commonTarget(cameras: DatasetCamera[]): Vector | null;
