import { Camera } from "./views/camera.js";
import { Controls } from "./views/controls.js";
import { SplatRenderer } from "./drawing/splat_renderer.js";
export type DatasetCamera = import("./views/camera.js").DatasetCamera;
export type Vector = import("./views/camera.js").Vector;
export type Scene = import("./scene/scene.js").Scene;
export type View = import("./drawing/splat_renderer.js").View;
export type PlayerOptions = {
    /**
     * begin to play; false
     */
    autoplay?: boolean;
    /**
     * begin again at the end; true
     */
    loop?: boolean;
    /**
     * of the dataset; the first one is where the view begins
     */
    cameras?: DatasetCamera[];
    /**
     * where the view begins in place of that
     */
    camera?: Camera;
    /**
     * where {@link Player.resetView} goes in place of that
     */
    home?: Camera;
    /**
     * of the first image, in [0, 1]; 0
     */
    time?: number;
    /**
     * whether pointer and keys move the camera; true
     */
    controls?: boolean;
    /**
     * pixels of the image for one of the page; at most 2 where not given. A canvas that the page
     * gives no size keeps its own
     */
    pixelRatio?: number;
    /**
     * one of this canvas that was made while the scene was on its way. The player disposes of it
     */
    renderer?: SplatRenderer;
};
/**
 * Plays a scene or a take on a canvas. Events: `timechange`, `statechange` (playing, loop, speed, waiting), `camerachange`, `error`.
 */
export declare class Player extends EventTarget {
    #private;
    canvas: HTMLCanvasElement;
    scene: import("./index.js").Scene;
    cameras: import("./views/camera.js").DatasetCamera[];
    pixelRatio: number | undefined;
    loop: boolean;
    speed: number;
    /** Whether time stands still until more of a take has come. */
    waiting: boolean;
    /** Whether the camera goes along the training path while time runs. */
    following: boolean;
    /** Red, green, blue in [0, 1]. @type {number[]} */
    background: number[];
    renderer: SplatRenderer;
    camera: Camera;
    home: Camera;
    /** Times of the last frames, milliseconds. */
    timings: {
        evaluate: number;
        sort: number;
        upload: number;
        draw: number;
    };
    /** Resolves when the first image is on the canvas. @type {Promise<void>} */
    ready: Promise<void>;
    controls: Controls | null;
    /**
     * @param {HTMLCanvasElement} canvas
     * @param {Scene} scene
     * @param {PlayerOptions} [options]
     */
    constructor(canvas: HTMLCanvasElement, scene: Scene, options?: PlayerOptions);
    /** The current view. @returns {View} */
    get view(): View;
    /** Time in [0, 1]. */
    get time(): number;
    set time(value: number);
    /** Whether time runs. */
    get playing(): boolean;
    /** Lets time run, from the beginning where it is at the end. */
    play(): void;
    /** Stops time. */
    pause(): void;
    /** Back to the view at the beginning. */
    resetView(): void;
    /**
     * Takes the place of a camera of the dataset, at its time.
     * @param {number} index
     */
    showCamera(index: number): void;
    /** To be called after the camera was changed from outside. */
    cameraMoved(): void;
    /** The training cameras in the order of their times: the path that {@link following} takes. */
    get path(): import("./views/camera.js").DatasetCamera[];
    /** Whether {@link path} is that of one camera that moves. */
    get followsOneCamera(): boolean;
    /** The share of the canvas's pixels along each side that is drawn while something moves: 1 if there is time for all. */
    get draftScale(): number;
    /**
     * The level of detail that is drawn while something moves, of {@link Scene.info}'s `levels`: 0 where there is time for all
     * Gaussians, and half as many with each further one.
     */
    get draftLevel(): number;
    /** Images per second over the last second; 0 where nothing changes. */
    get fps(): number;
    /** Draws again, as after {@link background} was changed. */
    redraw(): void;
    /**
     * Draws one time from one place, exactly, and returns the image: `[height, width, 4]` bytes. Time and camera of the
     * player go there and stay.
     * @param {number} time @param {View} view
     * @returns {Promise<Uint8Array>}
     */
    renderAt(time: number, view: View): Promise<Uint8Array>;
    /** Stops, and frees the memory of the graphics card. The scene stays open. */
    dispose(): void;
}
