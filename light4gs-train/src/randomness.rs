//! All random numbers of training are drawn from the seed and the training position. So a resumed run draws the same,
//! and a checkpoint holds no generator.

use burn::tensor::Device;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::stage::Stage;

/// The purpose of a random number.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Purpose {
    /// The order in which frames are trained on.
    FrameOrder,
    /// The positions of the two halves of a split Gaussian.
    Split,
    /// The views on which significance is measured, and the signs of their colors.
    PruningViews,
    /// Quantization noise of planes and the choice of planes and Gaussians for the rate.
    Rate,
    /// Random numbers of a deformation field.
    Motion,
    /// Views and pixels at which Gaussians are added.
    GuidedSampling,
    /// Quantization noise of the attributes of Gaussians.
    Noise,
    /// Quantization noise of the hyperprior's latents.
    Latents,
}

/// A generator for one purpose at one position, which is an iteration or a pass over the data.
pub(crate) fn generator(seed: u64, purpose: Purpose, stage: Stage, position: usize) -> ChaCha8Rng {
    let mut generator = ChaCha8Rng::seed_from_u64(seed);
    let stage = if stage == Stage::Coarse { 0 } else { 1 };
    // Two bits for the first four purposes, and a third bit for the others.
    let (purpose, other) = (purpose as u64 % 4, purpose as u64 / 4);
    generator.set_stream(purpose << 62 | stage << 61 | other << 60 | position as u64);
    generator
}

/// Seeds the device's own generator, which fills random tensors, for one purpose in one iteration.
pub(crate) fn seed_device(device: &Device, seed: u64, purpose: Purpose, stage: Stage, iteration: usize) {
    device.seed(generator(seed, purpose, stage, iteration).random());
}

/// Box-Muller; one number of the pair.
pub(crate) fn standard_normal(generator: &mut impl Rng) -> f32 {
    let (u, v): (f64, f64) = (1.0 - generator.random::<f64>(), generator.random());
    ((-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()) as f32
}
