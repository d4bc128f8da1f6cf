//! Linear blend skinning, eight Gaussians at a time, backward.
//!
//! Forward, a Gaussian is moved by the product of its blended pose `P = Σ w_b P_b` with factors that depend on nothing else. So the
//! derivative by `P` is the same sixteen numbers `F` for all nodes of a Gaussian, and
//!
//! ```text
//! gradient of P_b = Σ over the Gaussians of w_b F
//! gradient of w_b = F · P_b,   of its logit  w_b (F · P_b - F · P)
//! ```
//!
//! A task has a range of Gaussians. Chunk by chunk it computes `F`; then each node in turn meets all Gaussians of the chunk, with
//! weights computed anew, which is faster than fetching them. Each task has its own sums for the gradients of the nodes, and these
//! are added in the order of the tasks: the result does not depend on the number of threads.

use light4gs_render::lanes::{LANES, LaneKernel, Lanes, dispatch};
use rayon::prelude::*;

use super::cpu::{
    BlendedGroup, Block, CHUNK, Node, ROW, STILL, SkinningSlices, as_exponents, columns, loaded, product, spread,
    stored, to_rows, weight,
};
use super::{PLACE, POSE, POSED};

/// Most tasks, so that their sums take no more memory than some thousand Gaussians.
const MOST_TASKS: usize = 64;

/// Gradients of [`skin`](super::skin), row by row.
pub(super) struct SkinningGradients {
    /// `[N, 3]`
    pub(super) means: Vec<f32>,
    /// `[N, 4]`
    pub(super) quats: Vec<f32>,
    /// `[N, W]`
    pub(super) stillness: Vec<f32>,
    /// `[B, 19 + W]`
    pub(super) nodes: Vec<f32>,
}

/// Numbers of eight Gaussians that every node reads in the second half of the backward pass.
struct Handed<const W: usize> {
    mean: [Block; 3],
    /// Affinities, behind the stillness, which no node reads.
    stillness: [Block; W],
    /// `F`: derivatives by the blended pose.
    by_pose: [Block; POSE],
    /// `F · P`
    product: Block,
    largest: Block,
    inverse_sum: Block,
}

/// Sums over Gaussians for one node.
#[derive(Clone, Copy)]
struct NodeSums<const W: usize> {
    pose: [f32; POSE],
    /// Of the logit's gradient times the offset from the anchor.
    offset: [f32; 3],
    /// Of the logit's gradient times the squared distance.
    squared: f32,
    /// Of the logit's gradient times the Gaussian's affinities.
    affinities: [f32; W],
}

impl<const W: usize> NodeSums<W> {
    const ZERO: Self = Self { pose: [0.0; POSE], offset: [0.0; 3], squared: 0.0, affinities: [0.0; W] };

    fn add(&mut self, other: &Self) {
        let add = |to: &mut [f32], from: &[f32]| to.iter_mut().zip(from).for_each(|(to, from)| *to += from);
        add(&mut self.pose, &other.pose);
        add(&mut self.offset, &other.offset);
        add(&mut self.affinities, &other.affinities);
        self.squared += other.squared;
    }
}

/// `F · P`. Where one weight is 1, the blended pose is that node's own, and the same order of sums makes the difference of their
/// products exactly 0, as it should be: Adam would take a step along any rounding error.
#[inline(always)]
fn inner_product<L: Lanes>(by_pose: &[Block; POSE], pose: &[L; POSE]) -> L {
    // Four sums next to each other, since each waits for its own last step.
    let mut sums = [L::splat(0.0); 4];
    for k in 0..POSE {
        sums[k % 4] = L::load(&by_pose[k]).mul_add(pose[k], sums[k % 4]);
    }
    sums[0].add(sums[1]).add(sums[2].add(sums[3]))
}

/// One task: a range of Gaussians.
struct Backward<'a, const W: usize> {
    nodes: &'a [Node<W>],
    means: &'a [f32],
    quats: &'a [f32],
    stillness: &'a [f32],
    blended: &'a [BlendedGroup],
    /// `[N, 7]`
    upstream: &'a [f32],
    of_means: &'a mut [f32],
    of_quats: &'a mut [f32],
    of_stillness: &'a mut [f32],
}

/// Eight Gaussians at rest, and the gradients of their places and of their turned quaternions.
struct Group<L> {
    mean: [L; 3],
    quat: [L; 4],
    by_position: [L; 3],
    by_turned: [L; 4],
}

impl<L: Lanes> Group<L> {
    #[inline(always)]
    fn new(means: &[f32], quats: &[f32], upstream: &[f32]) -> Self {
        let upstream = columns::<L, ROW>(upstream);
        Self {
            mean: columns::<L, 3>(means),
            quat: columns::<L, 4>(quats),
            by_position: [upstream[0], upstream[1], upstream[2]],
            by_turned: [upstream[3], upstream[4], upstream[5], upstream[6]],
        }
    }

    /// Gradients of the means, `Aᵀ by_position`, with the matrix of the blended pose.
    #[inline(always)]
    fn of_means(&self, pose: &[L; POSE]) -> [L; 3] {
        let mut of_means = [L::splat(0.0); 3];
        for j in 0..3 {
            for i in 0..3 {
                of_means[j] = pose[3 * i + j].mul_add(self.by_position[i], of_means[j]);
            }
        }
        of_means
    }

    /// Gradients of the quaternions, `conjugate of q ⊗ by_turned`, with the quaternion of the blended pose.
    #[inline(always)]
    fn of_quats(&self, pose: &[L; POSE]) -> [L; 4] {
        product(&conjugate([pose[12], pose[13], pose[14], pose[15]]), &self.by_turned)
    }

    /// `F`: by the matrix `by_position meanᵀ`, by the offset `by_position`, by the quaternion `by_turned ⊗ conjugate of quat`.
    #[inline(always)]
    fn by_pose(&self) -> [L; POSE] {
        let mut by_pose = [L::splat(0.0); POSE];
        for i in 0..3 {
            for j in 0..3 {
                by_pose[3 * i + j] = self.by_position[i].mul(self.mean[j]);
            }
            by_pose[9 + i] = self.by_position[i];
        }
        by_pose[12..].copy_from_slice(&product(&self.by_turned, &conjugate(self.quat)));
        by_pose
    }
}

#[inline(always)]
fn conjugate<L: Lanes>(q: [L; 4]) -> [L; 4] {
    let zero = L::splat(0.0);
    [q[0], zero.sub(q[1]), zero.sub(q[2]), zero.sub(q[3])]
}

/// Writes the gradients of eight Gaussians, but for their affinities, and returns the numbers for the nodes.
#[inline(always)]
fn hand<L: Lanes, const W: usize>(
    [means, quats, stillness, upstream]: [&[f32]; 4],
    blended: &BlendedGroup,
    [of_means, of_quats]: [&mut [f32]; 2],
    of_stillness: &mut Block,
) -> Handed<W> {
    let group = Group::<L>::new(means, quats, upstream);
    let pose = loaded(&blended.pose);
    to_rows(&group.of_means(&pose), of_means);
    to_rows(&group.of_quats(&pose), of_quats);

    let by_pose = stored(&group.by_pose());
    let product = inner_product::<L>(&by_pose, &pose);
    let by_weight = inner_product::<L>(&by_pose, &spread(&STILL));
    L::load(&blended.still).mul(by_weight.sub(product)).store(of_stillness);

    let [product] = stored(&[product]);
    Handed {
        mean: stored(&group.mean),
        stillness: if W > 1 { stored(&columns::<L, W>(stillness)) } else { [[0.0; LANES]; W] },
        by_pose,
        product,
        largest: blended.largest,
        inverse_sum: blended.inverse_sum,
    }
}

/// Sums over a chunk of Gaussians for the gradients of a node. Adds the node's share to the gradients of their affinities. `weights` is
/// room for one block a group.
#[inline(always)]
fn sums<L: Lanes, const W: usize>(
    node: &Node<W>,
    handed: &[Handed<W>],
    weights: &mut [Block],
    of_stillness: &mut [[Block; W]],
) -> NodeSums<W> {
    let mut affinity_sums = [L::splat(0.0); W];
    let mut offset_sums = [L::splat(0.0); 3];
    let mut squared_sum = L::splat(0.0);
    for ((group, place), of_stillness) in handed.iter().zip(weights.iter_mut()).zip(of_stillness) {
        let mean = loaded(&group.mean);
        let stillness = loaded(&group.stillness);
        let (offset, squared, exponent) = node.reach(&mean, &as_exponents(&stillness));
        let weight = weight(exponent, L::load(&group.largest)).mul(L::load(&group.inverse_sum));
        weight.store(place);
        let by_weight: L = inner_product(&group.by_pose, &spread(&node.pose));
        let by_logit = weight.mul(by_weight.sub(L::load(&group.product)));
        for i in 0..3 {
            offset_sums[i] = by_logit.mul_add(offset[i], offset_sums[i]);
        }
        squared_sum = by_logit.mul_add(squared, squared_sum);
        for k in 1..W {
            affinity_sums[k] = by_logit.mul_add(stillness[k], affinity_sums[k]);
            let of_affinity = by_logit.mul_add(L::splat(node.affinities[k]), L::load(&of_stillness[k]));
            of_affinity.store(&mut of_stillness[k]);
        }
    }
    let mut sums = NodeSums::ZERO;
    // In two halves, as forward.
    for first in [0, POSE / 2] {
        let mut pose_sums = [L::splat(0.0); POSE / 2];
        for (group, weight) in handed.iter().zip(weights.iter()) {
            let weight = L::load(weight);
            for k in 0..POSE / 2 {
                pose_sums[k] = weight.mul_add(L::load(&group.by_pose[first + k]), pose_sums[k]);
            }
        }
        for k in 0..POSE / 2 {
            sums.pose[first + k] = pose_sums[k].sum();
        }
    }
    for i in 0..3 {
        sums.offset[i] = offset_sums[i].sum();
    }
    sums.squared = squared_sum.sum();
    for k in 1..W {
        sums.affinities[k] = affinity_sums[k].sum();
    }
    sums
}

impl<const W: usize> LaneKernel for Backward<'_, W> {
    type Output = Vec<NodeSums<W>>;

    #[inline(always)]
    fn run<L: Lanes>(self) -> Self::Output {
        let mut totals = vec![NodeSums::ZERO; self.nodes.len()];
        let mut handed = Vec::with_capacity(CHUNK / LANES);
        let mut weights = vec![[0.0; LANES]; CHUNK / LANES];
        let mut of_stillness = vec![[[0.0; LANES]; W]; CHUNK / LANES];
        let inputs = self.means.chunks(3 * LANES).zip(self.quats.chunks(4 * LANES));
        let inputs = inputs.zip(self.stillness.chunks(W * LANES));
        let inputs = inputs.zip(self.upstream.chunks(ROW * LANES)).zip(self.blended);
        let outputs = self.of_means.chunks_mut(3 * LANES).zip(self.of_quats.chunks_mut(4 * LANES));
        let mut rows_of_stillness = self.of_stillness.chunks_mut(W * LANES);
        let last = self.blended.len() - 1;
        for (group, (input, (of_means, of_quats))) in inputs.zip(outputs).enumerate() {
            let ((((means, quats), stillness), upstream), blended) = input;
            let of_stillness_here = &mut of_stillness[handed.len()];
            *of_stillness_here = [[0.0; LANES]; W];
            let inputs = [means, quats, stillness, upstream];
            handed.push(hand::<L, W>(inputs, blended, [of_means, of_quats], &mut of_stillness_here[0]));
            if handed.len() == CHUNK / LANES || group == last {
                for (node, total) in self.nodes.iter().zip(&mut totals) {
                    total.add(&sums::<L, W>(node, &handed, &mut weights, &mut of_stillness));
                }
                for (blocks, rows) in of_stillness.iter().take(handed.len()).zip(&mut rows_of_stillness) {
                    to_rows(&loaded::<L, W>(blocks), rows);
                }
                handed.clear();
            }
        }
        totals
    }
}

/// Gradients of all inputs from `upstream [N, 7]`: those of position and quaternion.
pub(super) fn skin_backward(inputs: &SkinningSlices, blended: &[BlendedGroup], upstream: &[f32]) -> SkinningGradients {
    match inputs.affinities {
        0 => skin_backward_with::<1>(inputs, blended, upstream),
        1 => skin_backward_with::<2>(inputs, blended, upstream),
        2 => skin_backward_with::<3>(inputs, blended, upstream),
        3 => skin_backward_with::<4>(inputs, blended, upstream),
        _ => skin_backward_with::<5>(inputs, blended, upstream),
    }
}

fn skin_backward_with<const W: usize>(
    inputs: &SkinningSlices,
    blended: &[BlendedGroup],
    upstream: &[f32],
) -> SkinningGradients {
    let nodes = inputs.nodes::<W>();
    let count = inputs.count();
    let task = count.div_ceil(MOST_TASKS).max(1).next_multiple_of(CHUNK);
    let mut means = vec![0.0; 3 * count];
    let mut quats = vec![0.0; 4 * count];
    let mut stillness = vec![0.0; W * count];
    let tasks = (
        inputs.means.par_chunks(3 * task),
        inputs.quats.par_chunks(4 * task),
        inputs.stillness.par_chunks(W * task),
        blended.par_chunks(task / LANES),
        upstream.par_chunks(ROW * task),
        means.par_chunks_mut(3 * task),
        quats.par_chunks_mut(4 * task),
        stillness.par_chunks_mut(W * task),
    );
    let parts =
        tasks.into_par_iter().map(|(means, quats, stillness, blended, upstream, of_means, of_quats, of_stillness)| {
            let nodes = &nodes;
            dispatch(Backward { nodes, means, quats, stillness, blended, upstream, of_means, of_quats, of_stillness })
        });
    let parts: Vec<Vec<NodeSums<W>>> = parts.collect();
    let mut totals = vec![NodeSums::<W>::ZERO; nodes.len()];
    for part in &parts {
        totals.iter_mut().zip(part).for_each(|(total, part)| total.add(part));
    }
    let rows = inputs.nodes.chunks_exact(POSED + inputs.affinities);
    let of_nodes = totals.iter().zip(rows).flat_map(|(sums, row)| {
        let of_anchor = sums.offset.map(|sum| 2.0 * row[PLACE - 1] * sum);
        of_anchor.into_iter().chain([-sums.squared]).chain(sums.pose).chain(sums.affinities[1..].iter().copied())
    });
    SkinningGradients { means, quats, stillness, nodes: of_nodes.collect() }
}
