// Colors for renderers that do not evaluate spherical harmonics.

/** @typedef {import("./scene.js").GaussiansAt} GaussiansAt */

/** The constant basis function, `1 / (2 √π)`. */
const DEGREE_0 = 0.2820948;

/**
 * The part of the colors that is the same from everywhere, and the opacities: `max(0, 0.5 + 0.2820948 · sh[i, 0])`.
 * @param {GaussiansAt} gaussians
 * @param {Float32Array} [colors]  to be used again
 * @returns {Float32Array}  `[N, 4]`: red, green, blue as in the images of the training (sRGB, not linear; may exceed 1), opacity
 */
export function baseColors({ count, shDegree, sh, opacities }, colors = new Float32Array(4 * count)) {
  const coefficients = 3 * (shDegree + 1) ** 2;
  for (let i = 0; i < count; i++) {
    for (let c = 0; c < 3; c++) colors[4 * i + c] = Math.max(0, 0.5 + DEGREE_0 * sh[coefficients * i + c]);
    colors[4 * i + 3] = opacities[i];
  }
  return colors;
}
