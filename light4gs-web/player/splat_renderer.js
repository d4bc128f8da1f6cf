// Draws sorted Gaussians with WebGL2: one quad each, back to front, premultiplied, into half floats where the browser can.

import { center } from "./camera.js";
import { GraphicsError } from "./errors.js";
import {
  TEXELS, fragmentShader, harmonicsTexels, screenFragmentShader, screenVertexShader, vertexShader,
} from "./shaders.js";

/** Gaussians of a texture row. */
const ROW = 256;

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

export class SplatRenderer {
  /** @type {WebGLProgram | null} */
  #program = null;
  /** @type {Record<string, WebGLUniformLocation | null>} */
  #uniforms = {};
  #count = 0;
  #targetSize = [0, 0];
  #capacity = [0, 0];

  /** @param {HTMLCanvasElement | OffscreenCanvas} canvas */
  constructor(canvas) {
    this.canvas = canvas;
    const options = { alpha: false, antialias: false, depth: false, stencil: false, powerPreference: "high-performance" };
    const gl = /** @type {WebGL2RenderingContext | null} */ (canvas.getContext("webgl2", options));
    if (!gl) throw new GraphicsError("this browser has no WebGL2");
    this.gl = gl;
    /** Whether sums are half floats; bytes lose faint layers. */
    this.halfFloats = Boolean(gl.getExtension("EXT_color_buffer_float") ?? gl.getExtension("EXT_color_buffer_half_float"));
    this.degree = 0;
    this.parts = this.#make();
  }

  /** Everything that lives on the graphics card. */
  #make() {
    const { gl } = this;
    const parts = {
      screen: this.#link(screenVertexShader, screenFragmentShader),
      target: gl.createTexture(), framebuffer: gl.createFramebuffer(),
      gaussians: gl.createTexture(), harmonics: gl.createTexture(),
      vertices: gl.createVertexArray(), nothing: gl.createVertexArray(),
      order: gl.createBuffer(), corners: gl.createBuffer(),
    };
    gl.bindVertexArray(parts.vertices);
    gl.bindBuffer(gl.ARRAY_BUFFER, parts.corners);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([-1, -1, 1, -1, -1, 1, 1, 1]), gl.STATIC_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 0, 0);
    gl.bindBuffer(gl.ARRAY_BUFFER, parts.order);
    gl.enableVertexAttribArray(1);
    gl.vertexAttribIPointer(1, 1, gl.UNSIGNED_INT, 0, 0);
    gl.vertexAttribDivisor(1, 1);
    gl.bindVertexArray(null);
    return parts;
  }

  /** Makes everything again after the graphics card has lost it. */
  restore() {
    this.#program = null;
    this.#targetSize = [0, 0];
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

  /**
   * Prepares for a scene.
   * @param {number} count  Gaussians
   * @param {number} degree  of the spherical harmonics
   */
  begin(count, degree) {
    const { gl } = this;
    const most = gl.getParameter(gl.MAX_TEXTURE_SIZE);
    if (Math.ceil(count / ROW) > most || ROW * harmonicsTexels(degree) > most) {
      throw new GraphicsError(`${count} Gaussians are more than this graphics card takes (${most * ROW})`);
    }
    this.degree = degree;
    if (this.#program) gl.deleteProgram(this.#program);
    this.#program = this.#link(vertexShader(degree), fragmentShader);
    for (const name of ["gaussians", "harmonics", "rotation", "translation", "eye", "focal", "principal", "size"]) {
      this.#uniforms[name] = gl.getUniformLocation(this.#program, name);
    }
    this.#count = 0;
    this.#capacity = [0, 0];
  }

  /**
   * @param {WebGLTexture | null} texture
   * @param {number} slot
   * @param {number} texels
   * @param {Float32Array} numbers
   * @param {number} format
   */
  #upload(texture, slot, texels, numbers, format) {
    const { gl } = this;
    const width = ROW * texels;
    const height = numbers.length / (4 * width);
    gl.bindTexture(gl.TEXTURE_2D, texture);
    if (height === 0) return;
    if (this.#capacity[slot] === height) {
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, width, height, gl.RGBA, gl.FLOAT, numbers);
      return;
    }
    this.#capacity[slot] = height;
    gl.texImage2D(gl.TEXTURE_2D, 0, format, width, height, 0, gl.RGBA, gl.FLOAT, numbers);
    for (const [name, value] of [
      [gl.TEXTURE_MIN_FILTER, gl.NEAREST], [gl.TEXTURE_MAG_FILTER, gl.NEAREST],
      [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE],
    ]) gl.texParameteri(gl.TEXTURE_2D, name, value);
  }

  /** @param {Float32Array} numbers  centers, opacities, covariances, as the decoder packs them */
  setGaussians(numbers) {
    this.#upload(this.parts.gaussians, 0, TEXELS, numbers, this.gl.RGBA32F);
  }

  /** @param {Float32Array} numbers  harmonics, as the decoder packs them */
  setHarmonics(numbers) {
    this.#upload(this.parts.harmonics, 1, harmonicsTexels(this.degree), numbers, this.gl.RGBA16F);
  }

  /** @param {Uint32Array} order  back to front */
  setOrder(order) {
    const { gl } = this;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.parts.order);
    gl.bufferData(gl.ARRAY_BUFFER, order, gl.DYNAMIC_DRAW);
    this.#count = order.length;
  }

  /** @param {number} width @param {number} height */
  #resizeTarget(width, height) {
    const { gl } = this;
    if (this.#targetSize[0] === width && this.#targetSize[1] === height) return;
    this.#targetSize = [width, height];
    gl.bindTexture(gl.TEXTURE_2D, this.parts.target);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA16F, width, height, 0, gl.RGBA, gl.HALF_FLOAT, null);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.parts.framebuffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.parts.target, 0);
    if (gl.checkFramebufferStatus(gl.FRAMEBUFFER) !== gl.FRAMEBUFFER_COMPLETE && !gl.isContextLost()) this.halfFloats = false;
  }

  /**
   * Draws what was set, over a background.
   * @param {View} view
   * @param {ArrayLike<number>} background  red, green, blue in [0, 1]
   */
  draw(view, background) {
    const { gl, canvas } = this;
    const { width, height } = view;
    if (gl.isContextLost()) return;
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    if (this.halfFloats) this.#resizeTarget(width, height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.halfFloats ? this.parts.framebuffer : null);
    gl.viewport(0, 0, width, height);
    gl.clearColor(background[0], background[1], background[2], 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
    if (this.#count > 0 && this.#program) {
      const { rotation, translation } = view;
      const eye = center(view);
      gl.useProgram(this.#program);
      gl.uniformMatrix3fv(this.#uniforms.rotation, true, Float32Array.from(rotation));
      gl.uniform3f(this.#uniforms.translation, translation[0], translation[1], translation[2]);
      gl.uniform3f(this.#uniforms.eye, eye[0], eye[1], eye[2]);
      gl.uniform2f(this.#uniforms.focal, view.fx, view.fy);
      gl.uniform2f(this.#uniforms.principal, view.cx, view.cy);
      gl.uniform2f(this.#uniforms.size, width, height);
      gl.uniform1i(this.#uniforms.gaussians, 0);
      gl.uniform1i(this.#uniforms.harmonics, 1);
      gl.activeTexture(gl.TEXTURE1);
      gl.bindTexture(gl.TEXTURE_2D, this.parts.harmonics);
      gl.activeTexture(gl.TEXTURE0);
      gl.bindTexture(gl.TEXTURE_2D, this.parts.gaussians);
      gl.bindVertexArray(this.parts.vertices);
      gl.enable(gl.BLEND);
      gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
      gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, this.#count);
      gl.disable(gl.BLEND);
    }
    if (this.halfFloats) {
      gl.bindFramebuffer(gl.FRAMEBUFFER, null);
      gl.useProgram(this.parts.screen);
      gl.activeTexture(gl.TEXTURE0);
      gl.bindTexture(gl.TEXTURE_2D, this.parts.target);
      gl.bindVertexArray(this.parts.nothing);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
    }
    gl.bindVertexArray(null);
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

  /** Gives everything back. */
  dispose() {
    const { gl } = this;
    for (const texture of [this.parts.gaussians, this.parts.harmonics, this.parts.target]) gl.deleteTexture(texture);
    for (const buffer of [this.parts.order, this.parts.corners]) gl.deleteBuffer(buffer);
    for (const array of [this.parts.vertices, this.parts.nothing]) gl.deleteVertexArray(array);
    gl.deleteFramebuffer(this.parts.framebuffer);
    for (const program of [this.#program, this.parts.screen]) if (program) gl.deleteProgram(program);
    this.#program = null;
    this.#count = 0;
  }
}
