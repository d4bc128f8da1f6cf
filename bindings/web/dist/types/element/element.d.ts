import { Layers } from "./layers.js";
import { Player } from "../player.js";
import { Scene } from "../scene/scene.js";
export type DatasetCamera = import("../views/camera.js").DatasetCamera;
declare const L4gsPlayer_base: {
    new (): HTMLElement;
    prototype: HTMLElement;
};
/**
 * Attributes: `src` (address of a scene), `cameras` (address of its cameras as JSON), `autoplay`, `loop`, `background` (a
 * color such as `#ffffff`), `page` (fills the page: files may be dropped, the wheel zooms at once, `?url=` is looked at),
 * `watch` (address of a small JSON text; whenever it changes, the scene is loaded again). In place of `src` a child
 * `<script type="application/l4gs">` may hold the scene as base64, and `<script type="application/json">` the cameras.
 *
 * Events: `load` (the first image), `complete` (all of a file that was loaded from an address), `error` (detail: the error),
 * `timechange`, `statechange`.
 */
export declare class L4gsPlayer extends L4gsPlayer_base {
    #private;
    /** @type {(id: string) => any} */
    find: (id: string) => any;
    layers: Layers;
    canvas: HTMLCanvasElement;
    static observedAttributes: string[];
    /** @type {Player | null} */
    player: Player | null;
    constructor();
    connectedCallback(): void;
    disconnectedCallback(): void;
    /** @param {string} name @param {string | null} before @param {string | null} value */
    attributeChangedCallback(name: string, before: string | null, value: string | null): void;
    /**
     * Loads a scene from an address, and cameras from another.
     * @param {string} address @param {string | null} [cameras]
     * @param {{ keep?: boolean }} [options]  whether view and time stay as they are
     * @returns {Promise<boolean>}  whether the bytes came; what was wrong is shown
     */
    load(address: string, cameras?: string | null, { keep }?: {
        keep?: boolean;
    }): Promise<boolean>;
    /**
     * Shows a scene: a file, or one that was loaded.
     * @param {import("../scene/load.js").Source | Scene} source
     * @param {{ cameras?: DatasetCamera[], keep?: boolean }} [options]
     */
    open(source: import("../scene/load.js").Source | Scene, { cameras, keep }?: {
        cameras?: DatasetCamera[];
        keep?: boolean;
    }): Promise<void>;
    /** Ends the player and frees what it holds. */
    close(): void;
}
export {};
