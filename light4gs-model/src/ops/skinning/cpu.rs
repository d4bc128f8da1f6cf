//! Linear blend skinning, eight Gaussians at a time, forward.
//!
//! Eight Gaussians meet all nodes in turn, whose numbers are spread over the lanes: first for the exponents and their maximum,
//! then for the weights, then twice for half of the blended pose each, since sixteen sums and a weight do not fit into the
//! sixteen vector registers of AVX2.

use std::ops::Range;
use std::sync::Arc;

use burn::backend::TensorMetadata;
use light4gs_render::lanes::{LANES, LaneKernel, Lanes, dispatch};
use rayon::prelude::*;

use super::cpu_backward::skin_backward;
use super::{MOVED, MovedTensors, PLACE, POSE, POSED, SkinningKernels, SkinningTensors};
use crate::ops::for_cpu_back_ends;
use crate::ops::host::{HostBackend, HostTensor};

/// Gaussians whose values stay in the first-level cache while all nodes pass by; a whole number of groups.
pub(super) const CHUNK: usize = 256;

/// Exponent of 2, relative to the largest, below which a weight is 0. Such a weight is 12 digits below rounding, and times a small
/// gradient it would be a denormal number, on which processors are slow.
const SMALLEST_EXPONENT: f32 = -64.0;

/// Numbers of a row of moved Gaussians: position, quaternion.
pub(super) const ROW: usize = MOVED[0] + MOVED[1];

/// One value for each Gaussian of a group of eight.
pub(super) type Block = [f32; LANES];

/// Gaussians and nodes, row by row.
#[derive(Clone, Copy)]
pub(super) struct SkinningSlices<'a> {
    /// `[N, 3]`
    pub(super) means: &'a [f32],
    /// `[N, 4]`
    pub(super) quats: &'a [f32],
    /// `[N, W]`: stillness, then affinities
    pub(super) stillness: &'a [f32],
    /// `[B, 19 + W]`: anchor, precision, pose, affinities
    pub(super) nodes: &'a [f32],
    /// `W - 1`
    pub(super) affinities: usize,
}

impl SkinningSlices<'_> {
    /// Gaussians.
    pub(super) fn count(&self) -> usize {
        self.means.len() / 3
    }

    /// The nodes, each with its numbers next to each other.
    pub(super) fn nodes<const W: usize>(&self) -> Vec<Node<W>> {
        let nodes = self.nodes.chunks_exact(POSED + self.affinities).map(|row| {
            let mut affinities = [0.0; W];
            affinities[1..].copy_from_slice(&row[POSED..]);
            Node {
                anchor: [row[0], row[1], row[2]],
                affinities,
                sharpness: -row[PLACE - 1] * std::f32::consts::LOG2_E,
                pose: row[PLACE..POSED].try_into().expect("a pose"),
            }
        });
        nodes.collect()
    }
}

/// A node at one time.
pub(super) struct Node<const W: usize> {
    anchor: [f32; 3],
    /// Behind a zero in the place of the stillness.
    pub(super) affinities: [f32; W],
    /// Exponent of 2 a unit of squared distance.
    sharpness: f32,
    pub(super) pose: [f32; POSE],
}

impl<const W: usize> Node<W> {
    /// Offsets from the anchor, their squared length, and the exponent of 2 of the weight before the softmax. `scaled` are the
    /// Gaussians' stillness and affinities as exponents of 2.
    #[inline(always)]
    pub(super) fn reach<L: Lanes>(&self, mean: &[L; 3], scaled: &[L; W]) -> ([L; 3], L, L) {
        let x = mean[0].sub(L::splat(self.anchor[0]));
        let y = mean[1].sub(L::splat(self.anchor[1]));
        let z = mean[2].sub(L::splat(self.anchor[2]));
        let squared = x.mul_add(x, y.mul_add(y, z.mul(z)));
        let mut exponent = squared.mul(L::splat(self.sharpness));
        for k in 1..W {
            exponent = scaled[k].mul_add(L::splat(self.affinities[k]), exponent);
        }
        ([x, y, z], squared, exponent)
    }
}

/// Numbers as exponents of 2.
#[inline(always)]
pub(super) fn as_exponents<L: Lanes, const W: usize>(numbers: &[L; W]) -> [L; W] {
    let mut scaled = [L::splat(0.0); W];
    for k in 0..W {
        scaled[k] = numbers[k].mul(L::splat(std::f32::consts::LOG2_E));
    }
    scaled
}

/// The nodes, blended for eight Gaussians.
#[derive(Clone, Debug)]
pub(super) struct BlendedGroup {
    /// `A`, `t` and `q` of [`skin`](super::skin).
    pub(super) pose: [Block; POSE],
    /// The largest exponent of 2.
    pub(super) largest: Block,
    /// Sum of the weights before the softmax divides by it, inverted.
    pub(super) inverse_sum: Block,
    /// Weight of the node that stands still.
    pub(super) still: Block,
}

impl Default for BlendedGroup {
    fn default() -> Self {
        let zeros = [0.0; LANES];
        Self { pose: [zeros; POSE], largest: zeros, inverse_sum: zeros, still: zeros }
    }
}

/// The weight of an exponent before the softmax divides.
#[inline(always)]
pub(super) fn weight<L: Lanes>(exponent: L, largest: L) -> L {
    let relative = exponent.sub(largest);
    relative.at_least(L::splat(SMALLEST_EXPONENT)).and(relative.exp2())
}

/// Values from memory. Here and below loops, not `array::map`: a call that is not inlined leaves the vector registers.
#[inline(always)]
pub(super) fn loaded<L: Lanes, const C: usize>(blocks: &[Block; C]) -> [L; C] {
    let mut values = [L::splat(0.0); C];
    for c in 0..C {
        values[c] = L::load(&blocks[c]);
    }
    values
}

/// Values to memory.
#[inline(always)]
pub(super) fn stored<L: Lanes, const C: usize>(values: &[L; C]) -> [Block; C] {
    let mut blocks = [[0.0; LANES]; C];
    for c in 0..C {
        values[c].store(&mut blocks[c]);
    }
    blocks
}

/// The same numbers for all Gaussians of a group.
#[inline(always)]
pub(super) fn spread<L: Lanes, const C: usize>(numbers: &[f32; C]) -> [L; C] {
    let mut values = [L::splat(0.0); C];
    for c in 0..C {
        values[c] = L::splat(numbers[c]);
    }
    values
}

/// Columns of up to eight rows, zeros where there is none.
#[inline(always)]
pub(super) fn columns<L: Lanes, const C: usize>(rows: &[f32]) -> [L; C] {
    let mut blocks = [[0.0; LANES]; C];
    for (lane, row) in rows.as_chunks::<C>().0.iter().enumerate().take(LANES) {
        for c in 0..C {
            blocks[c][lane] = row[c];
        }
    }
    loaded(&blocks)
}

/// Writes columns to up to eight rows.
#[inline(always)]
pub(super) fn to_rows<L: Lanes, const C: usize>(columns: &[L; C], rows: &mut [f32]) {
    let blocks = stored(columns);
    for (lane, row) in rows.as_chunks_mut::<C>().0.iter_mut().enumerate().take(LANES) {
        for c in 0..C {
            row[c] = blocks[c][lane];
        }
    }
}

/// Hamilton's product.
#[inline(always)]
pub(super) fn product<L: Lanes>(a: &[L; 4], b: &[L; 4]) -> [L; 4] {
    [
        a[0].mul(b[0]).sub(a[1].mul(b[1])).sub(a[2].mul(b[2])).sub(a[3].mul(b[3])),
        a[0].mul(b[1]).add(a[1].mul(b[0])).add(a[2].mul(b[3])).sub(a[3].mul(b[2])),
        a[0].mul(b[2]).sub(a[1].mul(b[3])).add(a[2].mul(b[0])).add(a[3].mul(b[1])),
        a[0].mul(b[3]).add(a[1].mul(b[2])).sub(a[2].mul(b[1])).add(a[3].mul(b[0])),
    ]
}

/// `A mean + t` of a blended pose.
#[inline(always)]
fn place<L: Lanes>(pose: &[L; POSE], mean: &[L; 3]) -> [L; 3] {
    let mut place = [pose[9], pose[10], pose[11]];
    for i in 0..3 {
        for j in 0..3 {
            place[i] = pose[3 * i + j].mul_add(mean[j], place[i]);
        }
    }
    place
}

/// Sums over the nodes of weight times the eight numbers of the pose from `first` on.
#[inline(always)]
fn half_of_pose<L: Lanes, const W: usize>(weights: &[Block], nodes: &[Node<W>], first: usize) -> [L; POSE / 2] {
    let mut sums = [L::splat(0.0); POSE / 2];
    for (weight, node) in weights.iter().zip(nodes) {
        let weight = L::load(weight);
        for k in 0..POSE / 2 {
            sums[k] = weight.mul_add(L::splat(node.pose[first + k]), sums[k]);
        }
    }
    sums
}

/// Pose of the node that stands still.
pub(super) const STILL: [f32; POSE] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];

struct Forward<'a, const W: usize> {
    nodes: &'a [Node<W>],
    means: &'a [f32],
    quats: &'a [f32],
    stillness: &'a [f32],
    moved: &'a mut [f32],
    blended: &'a mut [BlendedGroup],
}

impl<const W: usize> LaneKernel for Forward<'_, W> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let mut weights = vec![[0.0; LANES]; self.nodes.len()];
        let inputs = self.means.chunks(3 * LANES).zip(self.quats.chunks(4 * LANES));
        let inputs = inputs.zip(self.stillness.chunks(W * LANES));
        let outputs = self.moved.chunks_mut(ROW * LANES).zip(self.blended);
        for (((means, quats), stillness), (moved, blended)) in inputs.zip(outputs) {
            let mean = columns::<L, 3>(means);
            let scaled = as_exponents(&columns::<L, W>(stillness));
            let still_exponent = scaled[0];
            let mut largest = still_exponent;
            for (node, weight) in self.nodes.iter().zip(&mut weights) {
                let (_, _, exponent) = node.reach(&mean, &scaled);
                largest = largest.max(exponent);
                exponent.store(weight);
            }
            let still = weight(still_exponent, largest);
            let mut sum = still;
            for place in &mut weights {
                let weight = weight(L::load(place), largest);
                sum = sum.add(weight);
                weight.store(place);
            }
            let inverse_sum = L::splat(1.0).div(sum);
            let mut pose = [L::splat(0.0); POSE];
            for first in [0, POSE / 2] {
                let half = half_of_pose::<L, W>(&weights, self.nodes, first);
                for k in 0..POSE / 2 {
                    let with_still = still.mul_add(L::splat(STILL[first + k]), half[k]);
                    pose[first + k] = with_still.mul(inverse_sum);
                }
            }
            let quat = columns::<L, 4>(quats);
            let at = place(&pose, &mean);
            let turned = product(&[pose[12], pose[13], pose[14], pose[15]], &quat);
            let mut all = [L::splat(0.0); ROW];
            all[..3].copy_from_slice(&at);
            all[3..].copy_from_slice(&turned);
            to_rows(&all, moved);
            blended.pose = stored(&pose);
            largest.store(&mut blended.largest);
            inverse_sum.store(&mut blended.inverse_sum);
            still.mul(inverse_sum).store(&mut blended.still);
        }
    }
}

/// Positions and quaternions `[N, 7]`, and the state for the backward pass.
fn skin_slices(inputs: &SkinningSlices) -> (Vec<f32>, Vec<BlendedGroup>) {
    match inputs.affinities {
        0 => skin_with::<1>(inputs),
        1 => skin_with::<2>(inputs),
        2 => skin_with::<3>(inputs),
        3 => skin_with::<4>(inputs),
        _ => skin_with::<5>(inputs),
    }
}

fn skin_with<const W: usize>(inputs: &SkinningSlices) -> (Vec<f32>, Vec<BlendedGroup>) {
    let nodes = inputs.nodes::<W>();
    let count = inputs.count();
    let mut moved = vec![0.0; ROW * count];
    let mut blended = vec![BlendedGroup::default(); count.div_ceil(LANES)];
    let chunks = (
        inputs.means.par_chunks(3 * CHUNK),
        inputs.quats.par_chunks(4 * CHUNK),
        inputs.stillness.par_chunks(W * CHUNK),
        moved.par_chunks_mut(ROW * CHUNK),
        blended.par_chunks_mut(CHUNK / LANES),
    );
    chunks.into_par_iter().for_each(|(means, quats, stillness, moved, blended)| {
        dispatch(Forward { nodes: &nodes, means, quats, stillness, moved, blended });
    });
    (moved, blended)
}

/// State of the CPU back ends between forward and backward.
#[derive(Clone, Debug)]
pub struct CpuSaved {
    means: HostTensor,
    quats: HostTensor,
    stillness: Arc<Vec<f32>>,
    nodes: HostTensor,
    affinities: usize,
    blended: Arc<Vec<BlendedGroup>>,
}

impl CpuSaved {
    fn slices(&self) -> SkinningSlices<'_> {
        SkinningSlices {
            means: self.means.as_slice(),
            quats: self.quats.as_slice(),
            stillness: &self.stillness,
            nodes: self.nodes.as_slice(),
            affinities: self.affinities,
        }
    }
}

/// Two matrices of these widths, the first of 1 or more, each row behind that of the other.
fn side_by_side([first, second]: [&[f32]; 2], [width, other]: [usize; 2]) -> Vec<f32> {
    let mut rows = Vec::with_capacity(first.len() + second.len());
    for (i, row) in first.chunks_exact(width).enumerate() {
        rows.extend_from_slice(row);
        rows.extend_from_slice(&second[other * i..other * (i + 1)]);
    }
    rows
}

/// Some columns of a matrix that is `width` wide.
fn columns_of(matrix: &[f32], width: usize, columns: Range<usize>) -> Vec<f32> {
    matrix.chunks_exact(width).flat_map(|row| &row[columns.clone()]).copied().collect()
}

fn forward_on_cpu<B: HostBackend>(tensors: SkinningTensors<B>) -> (MovedTensors<B>, CpuSaved) {
    let affinities = tensors.affinities.shape()[1];
    let [means, quats, stillness, of_gaussians, nodes] = tensors.into_array().map(B::to_host);
    let stillness = side_by_side([stillness.as_slice(), of_gaussians.as_slice()], [1, affinities]);
    let mut saved =
        CpuSaved { means, quats, stillness: Arc::new(stillness), nodes, affinities, blended: Arc::default() };
    let (moved, blended) = skin_slices(&saved.slices());
    saved.blended = Arc::new(blended);
    let count = moved.len() / ROW;
    let part = |columns: Range<usize>| {
        let width = columns.len();
        B::from_values(columns_of(&moved, ROW, columns), [count, width])
    };
    (MovedTensors { means: part(0..MOVED[0]), quats: part(MOVED[0]..ROW) }, saved)
}

fn backward_on_cpu<B: HostBackend>(saved: CpuSaved, gradients: MovedTensors<B>) -> SkinningTensors<B> {
    let [of_means, of_quats] = [gradients.means, gradients.quats].map(B::to_host);
    let upstream = side_by_side([of_means.as_slice(), of_quats.as_slice()], MOVED);
    let affinities = saved.affinities;
    let gradients = skin_backward(&saved.slices(), &saved.blended, &upstream);
    let count = gradients.means.len() / 3;
    let part = |columns: Range<usize>| {
        let shape = [count, columns.len()];
        B::from_values(columns_of(&gradients.stillness, 1 + affinities, columns), shape)
    };
    let columns = POSED + affinities;
    SkinningTensors {
        stillness: part(0..1),
        affinities: part(1..1 + affinities),
        means: B::from_values(gradients.means, [count, 3]),
        quats: B::from_values(gradients.quats, [count, 4]),
        nodes: B::from_values(gradients.nodes, [saved.nodes.as_slice().len() / columns, columns]),
    }
}

for_cpu_back_ends! {
    SkinningKernels {
        type Saved = CpuSaved;

        fn skinning_forward(tensors: SkinningTensors<Self>) -> (MovedTensors<Self>, CpuSaved) {
            forward_on_cpu(tensors)
        }

        fn skinning_backward(saved: CpuSaved, gradients: MovedTensors<Self>) -> SkinningTensors<Self> {
            backward_on_cpu(saved, gradients)
        }
    }
}
