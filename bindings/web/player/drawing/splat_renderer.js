// Draws sorted Gaussians with WebGL2: one quad each, back to front, premultiplied, into half floats where the browser can.

import { GraphicsError } from "../errors.js";
import { ENTRY, ROW } from "./constants.js";
import { fragmentShader, screenFragmentShader, screenVertexShader, vertexShader } from "./shaders.js";

/**
 * @typedef {object} View  an OpenCV pinhole: +x right, +y down, +z forward
 * @property {ArrayLike<number>} rotation  `[3, 3]` row-major, world to camera
 * @property {ArrayLike<number>} translation  `[3]`: `x_camera = rotation · x_world + translation`
 * @property {number} fx  focal length, pixels
 * @property {number} fy  focal length, pixels
 * @property {number} cx  principal point, pixels from the left edge
 * @property {number} cy  principal point, pixels from the upper edge
 * @property {number} width  pixels
 * @property {number} height  pixels
 */

/**
 * The share of a Gaussian's weight that a draft leaves out, at its border: a quarter of the time of drawing, and closer to the
 * image in full, since in a smaller image the dilation makes Gaussians larger.
 */
const DRAFT_TAIL = 0.1;

export class SplatRenderer {
  /** Gaussians of the list. */
  #count = 0;
  /** The list of another picture, behind the first one, and its weight; 0 where there is none. */
  #later = { count: 0, weight: 0 };
  #rows = 0;
  #indexed = 0;
  #target = "";

  /** @param {HTMLCanvasElement | OffscreenCanvas} canvas */
  constructor(canvas) {
    this.canvas = canvas;
    const options = { alpha: false, antialias: false, depth: false, stencil: false, powerPreference: "high-performance" };
    const gl = /** @type {WebGL2RenderingContext | null} */ (canvas.getContext("webgl2", options));
    if (!gl) throw new GraphicsError("this browser has no WebGL2");
    this.gl = gl;
    /** Whether images are summed in half floats. Bytes lose faint layers. */
    this.halfFloats = Boolean(gl.getExtension("EXT_color_buffer_float") ?? gl.getExtension("EXT_color_buffer_half_float"));
    /**
     * Whether the page gives the canvas its size, independent of its pixels: a draft is then a smaller canvas, and nothing has to
     * be enlarged here. Null before it is known.
     * @type {boolean | null}
     */
    this.stretched = null;
    this.parts = this.#make();
  }

  /** Everything that lives on the graphics card. */
  #make() {
    const { gl } = this;
    const splats = this.#link(vertexShader, fragmentShader);
    const uniform = (/** @type {string} */ name) => gl.getUniformLocation(splats, name);
    const parts = {
      splats, screen: this.#link(screenVertexShader, screenFragmentShader),
      rotation: uniform("rotation"), translation: uniform("translation"),
      focal: uniform("focal"), principal: uniform("principal"), size: uniform("size"), tail: uniform("tail"), triangles: uniform("triangles"),
      target: gl.createTexture(), framebuffer: gl.createFramebuffer(), list: gl.createTexture(),
      quads: gl.createVertexArray(), nothing: gl.createVertexArray(), indices: gl.createBuffer(),
    };
    gl.bindVertexArray(parts.quads);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, parts.indices);
    gl.bindVertexArray(null);
    return parts;
  }

  /** Makes everything again after the graphics card has lost it. */
  restore() {
    this.#count = this.#rows = this.#indexed = 0;
    this.#later = { count: 0, weight: 0 };
    this.#target = "";
    this.parts = this.#make();
  }

  /** @param {string} vertex @param {string} fragment */
  #link(vertex, fragment) {
    const { gl } = this;
    const program = /** @type {WebGLProgram} */ (gl.createProgram());
    for (const [type, source] of /** @type {[number, string][]} */ ([[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]])) {
      const shader = /** @type {WebGLShader} */ (gl.createShader(type));
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost()) {
        throw new GraphicsError(`the graphics driver refuses a shader: ${gl.getShaderInfoLog(shader)}`);
      }
      gl.deleteShader(shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
      throw new GraphicsError(`the graphics driver refuses the program: ${gl.getProgramInfoLog(program)}`);
    }
    return program;
  }

  /** Has the graphics driver compile what an image in full takes, while there is none. */
  warm() {
    const { width, height } = this.canvas;
    this.setList(new Float32Array(ENTRY * ROW));
    this.draw({ rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1], translation: [0, 0, 0], fx: 1, fy: 1, cx: 0, cy: 0, width, height }, [0, 0, 0]);
    this.gl.flush();
  }

  /**
   * What is drawn, as {@link import("../scene/scene.js").Scene.frame} gives it.
   * @param {Float32Array} list
   * @param {{ list: Float32Array, weight: number } | null} [later]  of another picture, with which that of the list is mixed
   */
  setList(list, later = null) {
    const { gl, parts } = this;
    const rowsOf = (/** @type {number} */ length) => length / (ENTRY * ROW);
    const first = rowsOf(list.length);
    const rows = first + rowsOf(later?.list.length ?? 0);
    this.#count = list.length / ENTRY;
    this.#later = { count: (later?.list.length ?? 0) / ENTRY, weight: later?.weight ?? 0 };
    if (rows === 0 || gl.isContextLost()) return;
    gl.bindTexture(gl.TEXTURE_2D, parts.list);
    if (rows > this.#rows) {
      const most = gl.getParameter(gl.MAX_TEXTURE_SIZE);
      if (rows > most) throw new GraphicsError(`${rows * ROW} Gaussians are more than this graphics card takes (${most * ROW})`);
      // Room for a few more, since their number changes with the view.
      this.#rows = Math.min(Math.ceil(1.2 * rows), most);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, 4 * ROW, this.#rows, 0, gl.RGBA, gl.FLOAT, null);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    }
    if (first > 0) gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, 4 * ROW, first, gl.RGBA, gl.FLOAT, list);
    if (later && rows > first) gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, first, 4 * ROW, rows - first, gl.RGBA, gl.FLOAT, later.list);
    this.#index(this.#rows * ROW);
  }

  /** Two triangles a Gaussian. Quads of one draw are cheaper than instances, above all in software. @param {number} count */
  #index(count) {
    if (count <= this.#indexed) return;
    const { gl, parts } = this;
    const indices = new Uint32Array(6 * count);
    for (let i = 0; i < count; i++) indices.set([4 * i, 4 * i + 1, 4 * i + 2, 4 * i + 2, 4 * i + 1, 4 * i + 3], 6 * i);
    gl.bindVertexArray(parts.quads);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, indices, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    this.#indexed = count;
  }

  /** @param {number} width @param {number} height @param {boolean} halfFloats */
  #prepareTarget(width, height, halfFloats) {
    const { gl, parts } = this;
    const target = `${width} ${height} ${halfFloats}`;
    if (this.#target === target) return;
    this.#target = target;
    gl.bindTexture(gl.TEXTURE_2D, parts.target);
    if (halfFloats) gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA16F, width, height, 0, gl.RGBA, gl.HALF_FLOAT, null);
    else gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, width, height, 0, gl.RGBA, gl.UNSIGNED_BYTE, null);
    for (const [name, value] of [
      [gl.TEXTURE_MIN_FILTER, gl.LINEAR], [gl.TEXTURE_MAG_FILTER, gl.LINEAR],
      [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE],
    ]) gl.texParameteri(gl.TEXTURE_2D, name, value);
    gl.bindFramebuffer(gl.FRAMEBUFFER, parts.framebuffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, parts.target, 0);
    const complete = gl.checkFramebufferStatus(gl.FRAMEBUFFER) === gl.FRAMEBUFFER_COMPLETE;
    if (!complete && halfFloats && !gl.isContextLost()) {
      this.halfFloats = false;
      this.#prepareTarget(width, height, false);
    }
  }

  /**
   * Draws the list that was set, over a background; of two lists the mean, by the weight of the later one.
   * @param {View} view
   * @param {ArrayLike<number>} background  red, green, blue in [0, 1]
   * @param {number} [scale]  below 1: a draft with this share of the pixels along each side, in bytes, and enlarged
   */
  draw(view, background, scale = 1) {
    const { gl, canvas } = this;
    if (gl.isContextLost()) return;
    const { width, height } = view;
    const draft = scale < 1;
    const direct = draft ? this.stretched === true : !this.halfFloats;
    const columns = draft ? Math.max(1, Math.round(width * scale)) : width;
    const rows = draft ? Math.max(1, Math.round(height * scale)) : height;
    const size = direct ? { width: columns, height: rows } : { width, height };
    if (canvas.width !== size.width || canvas.height !== size.height) Object.assign(canvas, size);
    const { count, weight } = this.#later;
    if (!direct || weight > 0) this.#prepareTarget(columns, rows, !draft && this.halfFloats);
    this.#picture(view, background, { first: 0, count: this.#count, columns, rows, draft, direct });
    if (!direct) this.#show(size);
    if (weight > 0) {
      // The other picture goes over the one that is on the canvas.
      this.#picture(view, background, { first: this.#count, count, columns, rows, draft, direct: false });
      gl.enable(gl.BLEND);
      gl.blendColor(0, 0, 0, weight);
      gl.blendFunc(gl.CONSTANT_ALPHA, gl.ONE_MINUS_CONSTANT_ALPHA);
      this.#show(size);
      gl.disable(gl.BLEND);
    }
    gl.bindVertexArray(null);
  }

  /**
   * Draws a part of the list onto the canvas or the target.
   * @param {View} view @param {ArrayLike<number>} background
   * @param {{ first: number, count: number, columns: number, rows: number, draft: boolean, direct: boolean }} part
   */
  #picture(view, background, { first, count, columns, rows, draft, direct }) {
    const { gl, parts } = this;
    const { translation } = view;
    gl.bindFramebuffer(gl.FRAMEBUFFER, direct ? null : parts.framebuffer);
    gl.viewport(0, 0, columns, rows);
    gl.clearColor(background[0], background[1], background[2], 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
    if (count === 0) return;
    const [x, y] = [columns / view.width, rows / view.height];
    gl.useProgram(parts.splats);
    gl.uniformMatrix3fv(parts.rotation, true, Float32Array.from(view.rotation));
    gl.uniform3f(parts.translation, translation[0], translation[1], translation[2]);
    gl.uniform2f(parts.focal, view.fx * x, view.fy * y);
    gl.uniform2f(parts.principal, view.cx * x, view.cy * y);
    gl.uniform2f(parts.size, columns, rows);
    gl.uniform1f(parts.tail, draft ? DRAFT_TAIL : 0);
    gl.bindTexture(gl.TEXTURE_2D, parts.list);
    gl.bindVertexArray(parts.quads);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    // A triangle covers more than a quad, but is one in place of two: cheaper where there are few pixels.
    gl.uniform1i(parts.triangles, Number(draft));
    if (draft) gl.drawArrays(gl.TRIANGLES, 3 * first, 3 * count);
    else gl.drawElements(gl.TRIANGLES, 6 * count, gl.UNSIGNED_INT, 24 * first);
    gl.disable(gl.BLEND);
  }

  /** Brings the target onto the canvas. @param {{ width: number, height: number }} size */
  #show({ width, height }) {
    const { gl, parts } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, width, height);
    gl.useProgram(parts.screen);
    gl.bindTexture(gl.TEXTURE_2D, parts.target);
    gl.bindVertexArray(parts.nothing);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  /** A mark behind all commands so far. */
  fence() {
    const fence = this.gl.fenceSync(this.gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    this.gl.flush();
    return fence;
  }

  /**
   * Whether the graphics card has reached a mark. If so, the mark is deleted.
   * @param {WebGLSync | null} fence
   */
  isDone(fence) {
    const { gl } = this;
    if (!fence || gl.isContextLost()) return true;
    if (gl.getSyncParameter(fence, gl.SYNC_STATUS) !== gl.SIGNALED) return false;
    gl.deleteSync(fence);
    return true;
  }

  /** Waits until everything is drawn: for measuring. */
  finish() {
    this.gl.readPixels(0, 0, 1, 1, this.gl.RGBA, this.gl.UNSIGNED_BYTE, new Uint8Array(4));
  }

  /** The picture on the canvas: `[height, width, 4]` bytes from the upper edge. Right after {@link draw}. */
  readPixels() {
    const { width, height } = this.canvas;
    const upwards = new Uint8Array(4 * width * height);
    this.gl.readPixels(0, 0, width, height, this.gl.RGBA, this.gl.UNSIGNED_BYTE, upwards);
    const pixels = new Uint8Array(upwards.length);
    const row = 4 * width;
    for (let y = 0; y < height; y++) pixels.set(upwards.subarray(y * row, (y + 1) * row), (height - 1 - y) * row);
    return pixels;
  }

  /** Frees everything on the graphics card. */
  dispose() {
    const { gl, parts } = this;
    for (const texture of [parts.target, parts.list]) gl.deleteTexture(texture);
    gl.deleteFramebuffer(parts.framebuffer);
    gl.deleteBuffer(parts.indices);
    for (const array of [parts.quads, parts.nothing]) gl.deleteVertexArray(array);
    for (const program of [parts.splats, parts.screen]) gl.deleteProgram(program);
    this.#count = 0;
    this.#later = { count: 0, weight: 0 };
  }
}
