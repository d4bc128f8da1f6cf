/** The layers of one element. */
export declare class Layers {
    find: (id: string) => any;
    /** @param {(id: string) => any} find */
    constructor(find: (id: string) => any);
    /** Shows one of them, or none. @param {"progress" | "message" | "invitation" | ""} id */
    show(id: "progress" | "message" | "invitation" | ""): void;
    /** @param {string} what @param {number} [share]  in [0, 1]; NaN where it is not known */
    progress(what: string, share?: number): void;
    /**
     * Says what is wrong.
     * @param {unknown} error
     * @param {(() => void) | null} chooseAnother  what a button does that offers to choose another file
     */
    message(error: unknown, chooseAnother: (() => void) | null): void;
}
