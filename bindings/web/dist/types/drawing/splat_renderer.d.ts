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
    /** Whether sums are half floats; bytes lose faint layers. */
    halfFloats: boolean;
    /**
     * Whether the page gives the canvas its size, whatever its pixels are: a draft is a smaller canvas then, and nothing has
     * to be enlarged here. Not known: null.
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
    /** @param {Float32Array} list  what is drawn, as {@link import("../scene/scene.js").Scene.frame} gives it */
    setList(list: Float32Array): void;
    /**
     * Draws what was set, over a background.
     * @param {View} view
     * @param {ArrayLike<number>} background  red, green, blue in [0, 1]
     * @param {number} [scale]  below 1: a draft of so many of the pixels along each side, in bytes, and enlarged
     */
    draw(view: View, background: ArrayLike<number>, scale?: number): void;
    /** A mark behind everything that was asked for until now. */
    fence(): WebGLSync | null;
    /**
     * Whether the graphics card has come to a mark. Takes the mark away then.
     * @param {WebGLSync | null} fence
     */
    isDone(fence: WebGLSync | null): boolean;
    /** Waits until everything is drawn: for measuring. */
    finish(): void;
    /** The picture on the canvas: `[height, width, 4]` bytes from the upper edge. Right after {@link draw}. */
    readPixels(): Uint8Array<ArrayBuffer>;
    /** Gives everything back. */
    dispose(): void;
}
