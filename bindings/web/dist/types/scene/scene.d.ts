import { Playable } from "./playable.js";
/**
 * A decoded scene. Made by {@link import("./load.js").load}; {@link Scene.close} frees what it holds. Where its file is still coming, the event
 * `change` tells of more Gaussians. Times are in [0, 1].
 */
export declare class Scene extends Playable {
    #private;
    /** @param {ArrayBuffer} bytes */
    open(bytes: ArrayBuffer): Promise<void>;
    /**
     * Resolves as soon as there is something to see.
     * @param {AsyncIterable<Uint8Array>} pieces
     */
    receive(pieces: AsyncIterable<Uint8Array>): Promise<void>;
    /** A scene that stands still is the same at all times. @param {number} share */
    momentAt(share: number): number;
}
