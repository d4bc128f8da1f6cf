//! Affinities: a Gaussian follows some nodes more than its distance from them says. Neighbors at rest need not move
//! together, such as a foot and the floor.

use burn::tensor::{Device, Tensor};

use super::tensor;
use crate::scene::Attribute;

/// The attribute with the affinities of a Gaussian, `[N, H]`: their inner product with a node's own affinities is added to
/// the logit of the node's weight. After the learned coordinates of SC-GS (Huang et al., CVPR 2024).
pub const AFFINITY: &str = "affinity";

/// Learning rate of affinities, and their step in a file.
const RATE: f64 = 0.01;
const STEP: f64 = 0.5;

pub(super) fn attribute(count: usize) -> Attribute {
    Attribute::new(AFFINITY, count).constant().with_learning_rate(RATE).with_step(STEP)
}

/// The nodes' own affinities at the beginning, `[B, H]`: uniform, of variance 1, so that nodes can be told apart while the
/// Gaussians' are still zeros. They depend on the seed alone.
pub(super) fn of_nodes(nodes: usize, count: usize, seed: u64, device: &Device) -> Tensor<2> {
    let mut state = seed;
    let mut uniform = || {
        // SplitMix64 (Steele, Lea and Flood 2014).
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        let share = ((mixed ^ (mixed >> 31)) >> 40) as f32 / (1 << 24) as f32;
        (share - 0.5) * 12.0_f32.sqrt()
    };
    tensor((0..nodes * count).map(|_| uniform()).collect(), [nodes, count], device)
}
