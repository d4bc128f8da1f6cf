// What scenes and takes have in common: Gaussians at a time, lists for drawing.

/** @typedef {import("./connection.js").Connection} Connection */

/**
 * @typedef {object} SceneInfo  what a file says of itself
 * @property {string} name  for people
 * @property {number} frameCount  frames of the source
 * @property {number} fps  frames per second of the source, 0 where it is not known
 * @property {[number[], number[]]} bounds  smallest and largest corner, world units
 * @property {[number, number, number]} background  red, green, blue in [0, 1]
 * @property {number} width  of the source's default camera, pixels
 * @property {number} height  of the source's default camera, pixels
 * @property {number} fovX  its horizontal field of view, radians
 * @property {number} version  of the format
 * @property {number} bytes  of the file
 * @property {number} count  Gaussians
 * @property {number} shDegree  of the spherical harmonics, 0 to 3
 * @property {boolean} moves  whether anything changes with time
 * @property {number} layers  layers of Gaussians that the file has
 * @property {number} layersShown  those that have come
 * @property {number} levels  levels of detail besides the scene itself; each has half of the Gaussians of the one before
 * @property {[string, number][]} sections  name and bytes of each part of the file
 * @property {Record<string, string>} extra  free notes
 */

/**
 * @typedef {object} GaussiansAt  activated attributes of N Gaussians
 * @property {number} count  N
 * @property {Float32Array} means  `[N, 3]`: centers, world units
 * @property {Float32Array} scales  `[N, 3]`: standard deviations, world units
 * @property {Float32Array} quaternions  `[N, 4]`: `(w, x, y, z)` of unit length
 * @property {Float32Array} opacities  `[N]` in [0, 1]
 * @property {number} shDegree  d
 * @property {Float32Array} sh  `[N, (d + 1)², 3]`: a color is `max(0, 0.5 + Σ basis · coefficient)`
 */

/**
 * @typedef {object} Viewpoint  where a scene is seen from
 * @property {ArrayLike<number>} row  the depth of a point is `row · (x, y, z, 1)`
 * @property {ArrayLike<number>} eye  the camera's center, world units
 * @property {number} [spread]  what does not reach into the cone around the view axis is left out: the tangent of its angle to
 *   the axis; all in front of the camera where not given
 */

/**
 * @typedef {object} Frame  what the renderer draws
 * @property {Float32Array} list  back to front, 16 numbers a Gaussian: center (3), opacity, covariance xx, xy, xz, yy, yz, zz,
 *   color as seen from the viewpoint (3), three zeros; filled up to a multiple of 256 Gaussians with zeros
 * @property {{ list: Float32Array, weight: number } | null} later  only where `apart` was asked for, around a join of a take: the list with
 *   the later segment, where the first one has the earlier. The picture is `(1 - weight) · first + weight · later`
 * @property {boolean} together  whether the list has two segments of a take at once, less opaque
 * @property {number} evaluateMs  what the motion took; 0 where the list before was for the same time
 * @property {number} sortMs  what order and colors took
 */

/**
 * What a {@link import("../player.js").Player} plays. Times are in [0, 1] of a scene, and in seconds of a take.
 */
export class Scene extends EventTarget {
  /** @param {Connection} connection  to the worker that draws */
  constructor(connection) {
    super();
    this.connection = connection;
    /** @type {SceneInfo} */
    this.info = /** @type {any} */ (null);
    /** Time of decoding, milliseconds. */
    this.decodeMs = 0;
    /** Resolves when the whole file is there; fails with a {@link SceneError} where it does not come. @type {Promise<void>} */
    this.whole = Promise.resolve();
  }

  /** Number of Gaussians. */
  get count() {
    return this.info.count;
  }

  /** Length in seconds: the source's where it is known, else at 30 frames per second. */
  get duration() {
    return Math.max(this.info.frameCount, 1) / (this.info.fps || 30);
  }

  /**
   * The Gaussians at a time, activated, for a renderer of your own.
   * @param {number} time
   * @returns {Promise<GaussiansAt>}
   */
  async gaussiansAt(time) {
    /** @type {{ numbers: Float32Array, shDegree: number }} */
    const { numbers, shDegree } = await this.connection.ask({ type: "attributes", time });
    const harmonics = 3 * (shDegree + 1) ** 2;
    const count = numbers.length / (3 + 3 + 4 + 1 + harmonics);
    let at = 0;
    const take = (/** @type {number} */ each) => numbers.subarray(at, (at += each * count));
    const means = take(3);
    const scales = take(3);
    const quaternions = take(4);
    const opacities = take(1);
    return { count, means, scales, quaternions, opacities, shDegree, sh: take(harmonics) };
  }

  /**
   * The list of Gaussians to draw at a time from a viewpoint.
   * @param {number} time
   * @param {Viewpoint} viewpoint
   * @param {ArrayBuffer | null} [memory]  to be used again
   * @param {number} [level]  of detail: 0 is the scene itself, at most {@link SceneInfo.levels}
   * @param {boolean} [apart]  whether two segments around a join of a take are listed apart, for two pictures and their mean. One list has
   *   both otherwise, less opaque
   * @returns {Promise<Frame>}
   */
  async frame(time, viewpoint, memory = null, level = 0, apart = false) {
    return this.connection.ask({ type: "frame", time, viewpoint, memory, level, apart }, memory ? [memory] : []);
  }

  /**
   * One number for all bits of the scene that a file decodes to, as 16 hexadecimal digits: the same on every machine.
   * @param {ArrayBuffer} bytes
   * @returns {Promise<string>}
   */
  async digest(bytes) {
    return (await this.connection.ask({ type: "digest", bytes })).digest;
  }

  /**
   * The time for {@link Scene.frame} at a share of the duration.
   * @param {number} share  in [0, 1]
   */
  momentAt(share) {
    return share;
  }

  /**
   * Says where a player is, for each frame, so that what comes next is loaded.
   * @param {number} share  of the duration
   * @param {boolean} loop  whether the beginning follows the end
   */
  follow(share, loop) {}

  /**
   * Whether the time has to wait for something that is still on its way.
   * @param {number} share  of the duration
   */
  waitsAt(share) {
    return false;
  }

  /**
   * Resolves when what is shown at a time is there.
   * @param {number} share  of the duration
   * @returns {Promise<void>}
   */
  async ready(share) {}

  /** Ends the worker and frees its memory. Open requests fail with a {@link SceneError} `closed`. */
  close() {
    this.connection.close();
  }
}
