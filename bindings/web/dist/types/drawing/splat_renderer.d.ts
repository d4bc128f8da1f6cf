export type View = {
    /**
     * `[3, 3]` row-major, world to camera
     */
    rotation: ArrayLike<number>;
    /**
     * `[3]`: `x_camera = rotation · x_world + translation`
     */
    translation: ArrayLike<number>;
    /**
     * focal length, pixels
     */
    fx: number;
    /**
     * focal length, pixels
     */
    fy: number;
    /**
     * principal point, pixels from the left edge
     */
    cx: number;
    /**
     * principal point, pixels from the upper edge
     */
    cy: number;
    /**
     * pixels
     */
    width: number;
    /**
     * pixels
     */
    height: number;
};
export declare class SplatRenderer {
    #private;
    canvas: HTMLCanvasElement | OffscreenCanvas;
    gl: WebGL2RenderingContext;
    /** Whether images are summed in half floats. Bytes lose faint layers. */
    halfFloats: boolean;
    /**
     * Whether the page gives the canvas its size, independent of its pixels: a draft is then a smaller canvas, and nothing has to
     * be enlarged here. Null before it is known.
     * @type {boolean | null}
     */
    stretched: boolean | null;
    parts: {
        splats: WebGLProgram;
        screen: WebGLProgram;
        rotation: WebGLUniformLocation | null;
        translation: WebGLUniformLocation | null;
        focal: WebGLUniformLocation | null;
        principal: WebGLUniformLocation | null;
        size: WebGLUniformLocation | null;
        tail: WebGLUniformLocation | null;
        triangles: WebGLUniformLocation | null;
        target: WebGLTexture;
        framebuffer: WebGLFramebuffer;
        list: WebGLTexture;
        quads: WebGLVertexArrayObject;
        nothing: WebGLVertexArrayObject;
        indices: WebGLBuffer;
    };
    /** @param {HTMLCanvasElement | OffscreenCanvas} canvas */
    constructor(canvas: HTMLCanvasElement | OffscreenCanvas);
    /** Makes everything again after the graphics card has lost it. */
    restore(): void;
    /** Has the graphics driver compile what an image in full takes, while there is none. */
    warm(): void;
    /**
     * What is drawn, as {@link import("../scene/scene.js").Scene.frame} gives it.
     * @param {Float32Array} list
     * @param {{ list: Float32Array, weight: number } | null} [later]  of another picture, with which that of the list is mixed
     */
    setList(list: Float32Array, later?: {
        list: Float32Array;
        weight: number;
    } | null): void;
    /**
     * Draws the list that was set, over a background; of two lists the mean, by the weight of the later one.
     * @param {View} view
     * @param {ArrayLike<number>} background  red, green, blue in [0, 1]
     * @param {number} [scale]  below 1: a draft with this share of the pixels along each side, in bytes, and enlarged
     */
    draw(view: View, background: ArrayLike<number>, scale?: number): void;
    /** A mark behind all commands so far. */
    fence(): WebGLSync | null;
    /**
     * Whether the graphics card has reached a mark. If so, the mark is deleted.
     * @param {WebGLSync | null} fence
     */
    isDone(fence: WebGLSync | null): boolean;
    /** Waits until everything is drawn: for measuring. */
    finish(): void;
    /** The picture on the canvas: `[height, width, 4]` bytes from the upper edge. Right after {@link draw}. */
    readPixels(): Uint8Array<ArrayBuffer>;
    /** Frees everything on the graphics card. */
    dispose(): void;
}
