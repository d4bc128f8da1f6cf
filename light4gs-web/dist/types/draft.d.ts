/** Chooses the scale from the time that images take. What stands still is always drawn in full. */
export declare class Draft {
    #private;
    /** The scale to draw moving images at. */
    get scale(): number;
    /**
     * After a moving image it took so long until the page could draw again.
     * @param {number} interval  milliseconds
     * @param {number} now
     */
    measure(interval: number, now: number): void;
}
