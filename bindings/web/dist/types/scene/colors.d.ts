export type GaussiansAt = import("./scene.js").GaussiansAt;
/**
 * The part of the colors that is the same from everywhere, and the opacities: `max(0, 0.5 + 0.2820948 · sh[i, 0])`.
 * @param {GaussiansAt} gaussians
 * @param {Float32Array} [colors]  to be used again
 * @returns {Float32Array}  `[N, 4]`: red, green, blue as in the images of the training (sRGB, not linear; may exceed 1), opacity
 */
export declare function baseColors({ count, shDegree, sh, opacities }: GaussiansAt, colors?: Float32Array): Float32Array;
