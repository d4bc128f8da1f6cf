/** Milliseconds that decoders leave for the first image before they go on. */
export declare const FIRST_IMAGE = 200;
/** The decoder, compiled once a page. */
export declare function decoderModule(): Promise<WebAssembly.Module>;
/** A worker of its own. It starts at once, and {@link Connection.close} ends it. */
export declare class Connection {
    #private;
    /** Resolves when the decoder is there; fails where the browser has none for us. @type {Promise<void>} */
    prepared: Promise<void>;
    constructor();
    /**
     * @param {any} request
     * @param {Transferable[]} [transfer]
     * @returns {Promise<any>}
     */
    ask(request: any, transfer?: Transferable[]): Promise<any>;
    get closed(): boolean;
    /** Ends the worker and frees its memory. Open requests fail with a {@link SceneError} `closed`. */
    close(): void;
}
