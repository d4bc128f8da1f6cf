/**
 * A scene that was refused; `kind` is one of `not-l4gs`, `newer`, `too-large`, `damaged`, `memory`,
 * `network`, `cameras` (their JSON is none), `blocked` (the page or the browser lets no decoder start), `closed`, `fault`.
 */
export declare class SceneError extends Error {
    kind: string;
    /** @param {string} kind @param {string} message */
    constructor(kind: string, message: string);
}
/** A browser, or a graphics driver, that cannot draw this. */
export declare class GraphicsError extends Error {
    /** @param {string} message */
    constructor(message: string);
}
