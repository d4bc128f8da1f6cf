export type Place = {
    /**
     * the first second of the take at which it is shown; it tells the segment from all others
     */
    begin: number;
    /**
     * the second at which it is not shown any more
     */
    end: number;
    /**
     * where its bytes begin in the file
     */
    first: number;
    /**
     * where they end
     */
    last: number;
};
/** Segments that are decoded at most: besides those ahead, the one that is shown and one behind. */
export declare const MOST_DECODED: number;
/**
 * The segment of a time; none in a gap.
 * @param {Place[]} places
 * @param {number} seconds
 * @returns {Place | undefined}
 */
export declare function placeAt(places: Place[], seconds: number): Place | undefined;
/**
 * @param {Place[]} places  in the order of their begins
 * @param {number} seconds
 * @param {{ held?: Place, loop: boolean, duration: number }} options  `held` is on the screen until the segment of the time is there
 * @returns {{ shown: Place | undefined, load: Place[], decode: Place[], keep: Place[] }}  in the order in which they are needed: those whose
 *   bytes are loaded, those that are decoded now, and those that may stay decoded, at most {@link MOST_DECODED}
 */
export declare function plan(places: Place[], seconds: number, { held, loop, duration }: {
    held?: Place;
    loop: boolean;
    duration: number;
}): {
    shown: Place | undefined;
    load: Place[];
    decode: Place[];
    keep: Place[];
};
