export type Player = import("../player.js").Player;
export declare class Controls {
    #private;
    player: import("../player.js").Player;
    /** Whether a drag turns the view where it stands, in place of turning around the target. */
    flying: boolean;
    /** Whether the wheel zooms before the canvas was clicked: not in a page that scrolls. */
    wheelAlways: boolean;
    still: boolean;
    /** @param {Player} player */
    constructor(player: Player);
    /**
     * Moves the camera by the keys that are held down. Returns whether it moved since the last call.
     * @param {number} seconds
     */
    step(seconds: number): boolean;
    /** Ends all movement. */
    rest(): void;
    /** Listens no more. */
    dispose(): void;
}
