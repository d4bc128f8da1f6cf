//! How Gaussians are drawn: the numbers that all renderers share, so that a scene looks everywhere as it was trained.
//!
//! `docs/design.md` has the arithmetic around them, that of the original 3DGS (Kerbl et al. 2023). The kernels on the CPU and
//! the player's decoder take them from here; the shaders of the wgpu back end begin with them as constants; the player's
//! `constants.js` is written from them by a test.

/// What lies nearer along the view axis is not drawn, world units.
pub const NEAR: f32 = 0.2;
/// Variance in square pixels that every projected Gaussian gets on top, so that none falls between pixels.
pub const DILATION: f32 = 0.3;
/// The Jacobian of the projection is taken no further out than this many half fields of view.
pub const FRUSTUM_MARGIN: f32 = 1.3;
/// Side of a tile in pixels.
pub const TILE: usize = 16;
/// A contribution with less alpha is skipped.
pub const MIN_ALPHA: f32 = 1.0 / 255.0;
/// Alpha is clamped here, so that something shines through everything.
pub const MAX_ALPHA: f32 = 0.99;
/// A pixel takes no Gaussian that would leave it with less transmittance.
pub const MIN_TRANSMITTANCE: f32 = 1e-4;
/// Logarithms (of scales, above all) are clamped here before the exponential: far beyond any scene, and the exponential stays finite, so
/// that a backward pass has no 0 · infinity.
pub const MAX_LOGARITHM: f32 = 40.0;
