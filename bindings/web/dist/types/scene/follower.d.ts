/**
 * One request at a time. Of the times that are wanted meanwhile, only the newest is asked for next. So a renderer that is slower
 * than the clock drops times instead of falling behind.
 * @template Wanted  what is asked for, as JSON can hold it: a time, or a time and a viewpoint
 * @template Answer
 */
export declare class Follower<Wanted, Answer> {
    #private;
    /** The request that was applied last. @type {Wanted | null} */
    shown: Wanted | null;
    /**
     * @param {(wanted: Wanted) => Promise<Answer>} ask  such as `(time) => scene.gaussiansAt(time)`
     * @param {(answer: Answer, wanted: Wanted) => void} apply  gives what has come to the renderer
     */
    constructor(ask: (wanted: Wanted) => Promise<Answer>, apply: (answer: Answer, wanted: Wanted) => void);
    /**
     * Sets the request. To be called for each frame, changed or not.
     * @param {Wanted} wanted
     * @returns {Promise<void>}  settles when the newest is applied; fails with what `ask` or `apply` throws, and so it stays
     */
    update(wanted: Wanted): Promise<void>;
    /** Nothing is asked for or applied any more. */
    stop(): void;
}
