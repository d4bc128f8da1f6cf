//! How Gaussians are drawn: the numbers that all renderers share, so that a scene looks everywhere as it did in
//! training.
//!
//! `docs/design.md` has the arithmetic in which they occur, that of the original 3DGS (Kerbl et al. 2023). The kernels
//! on the CPU and the player's decoder use these constants; the shaders of the wgpu back end get them as their first
//! lines; a test writes the player's `constants.js` from them.

/// Gaussians nearer than this along the view axis are not drawn, world units.
pub const NEAR: f32 = 0.2;
/// Variance in square pixels that is added to every projected Gaussian, so that none falls between pixels.
pub const DILATION: f32 = 0.3;
/// The Jacobian of the projection is evaluated at most this many half images from the image's middle.
pub const FRUSTUM_MARGIN: f32 = 1.3;
/// Side of a tile in pixels.
pub const TILE: usize = 16;
/// A contribution with less alpha is skipped.
pub const MIN_ALPHA: f32 = 1.0 / 255.0;
/// Alpha is clamped to this, so that a little light passes through every Gaussian.
pub const MAX_ALPHA: f32 = 0.99;
/// A pixel stops before a Gaussian that would leave it with less transmittance.
pub const MIN_TRANSMITTANCE: f32 = 1e-4;
/// Logarithms (above all those of scales) are clamped to this before the exponential. It is far beyond any scene, and
/// keeps the exponential finite, so that a backward pass has no 0 · infinity.
pub const MAX_LOGARITHM: f32 = 40.0;

/// A quaternion that is not longer than this has no direction; its Gaussian is not drawn.
const SHORTEST_QUATERNION: f32 = 1e-12;

/// The standard deviation from its logarithm, clamped at [`MAX_LOGARITHM`].
pub fn scale(log_scale: f32) -> f32 {
    log_scale.min(MAX_LOGARITHM).exp()
}

/// The opacity in [0, 1] from its logit.
pub fn opacity(logit: f32) -> f32 {
    1.0 / (1.0 + (-logit).exp())
}

/// The quaternion at unit length; none where it has no direction.
pub fn unit_quaternion(quaternion: [f32; 4]) -> Option<[f32; 4]> {
    let length = quaternion.iter().map(|q| q * q).sum::<f32>().sqrt();
    (length.is_finite() && length > SHORTEST_QUATERNION).then(|| quaternion.map(|q| q / length))
}
