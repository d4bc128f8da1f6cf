//! Bilinear queries of the planes of a scale and the product of the samples, forward and backward.
//!
//! Planes are given as `[C, H, W]`. They are repacked into blocks of eight channels, `[C / 8][H · W][8]`, so that a
//! sample is four vector loads; C is padded with zeros. The backward pass gives each block of channels to one task,
//! which alone writes that block's gradients. So there are no atomics, and the sums are the same for any number of
//! threads.

use std::sync::Arc;

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use light4gs_codec::plane_layout::{AXIS_NAMES, PlaneAxes};
use light4gs_render::lanes::{LANES, LaneKernel, Lanes, dispatch};
use rayon::prelude::*;

use super::cpu_backward::query_backward;
use super::{PLANES, PlaneQueryGradients, PlaneQueryInputs, PlaneQueryKernels, PlaneSet};
use crate::ops::for_cpu_back_ends;
use crate::ops::host::{HostBackend, HostTensor};

/// Points of a task in the forward pass.
pub(super) const CHUNK: usize = 1024;

pub(super) const PLANE_AXES: [[usize; 2]; PLANES] = {
    let mut axes = [[0; 2]; PLANES];
    let mut plane = 0;
    while plane < PLANES {
        axes[plane] = PlaneAxes::ALL[plane].axes();
        plane += 1;
    }
    axes
};

pub(super) type Block = [f32; LANES];

/// The planes of one scale, repacked.
#[derive(Debug)]
pub(super) struct PackedPlanes {
    pub(super) channels: usize,
    /// Cells along x, y, z, t; 1 along an axis that no plane spans.
    pub(super) resolution: [usize; AXIS_NAMES.len()],
    /// Which planes exist.
    pub(super) present: [bool; PLANES],
    /// For each plane, `[blocks][H · W]`; empty where there is no plane.
    planes: [Vec<Block>; PLANES],
}

impl PackedPlanes {
    /// Repacks planes over the axes of [`PlaneAxes::ALL`] with shapes `[C, H, W]`; `None` where there is no plane.
    fn new(planes: [Option<&[f32]>; PLANES], shapes: &[Option<[usize; 3]>; PLANES]) -> Self {
        let mut resolution = [1; AXIS_NAMES.len()];
        let mut channels = 0;
        for ([across, down], shape) in PLANE_AXES.into_iter().zip(shapes) {
            if let Some(shape) = shape {
                [channels, resolution[down], resolution[across]] = *shape;
            }
        }
        let packed = planes.into_par_iter().map(|plane| plane.map_or_else(Vec::new, |plane| pack(plane, channels)));
        let packed: Vec<Vec<Block>> = packed.collect();
        let present = planes.map(|plane| plane.is_some());
        let planes = packed.try_into().expect("as many planes out as in");
        Self { channels, resolution, present, planes }
    }

    /// Channels of each plane.
    fn channels(&self) -> usize {
        self.channels
    }

    pub(super) fn is_full(&self) -> bool {
        self.present == [true; PLANES]
    }

    pub(super) fn blocks(&self) -> usize {
        self.channels.div_ceil(LANES)
    }

    fn cells(&self, plane: usize) -> usize {
        self.planes[plane].len() / self.blocks()
    }

    pub(super) fn block(&self, plane: usize, block: usize) -> &[Block] {
        let cells = self.cells(plane);
        &self.planes[plane][block * cells..(block + 1) * cells]
    }
}

fn pack(plane: &[f32], channels: usize) -> Vec<Block> {
    let cells = plane.len() / channels;
    let mut packed = vec![[0.0; LANES]; cells * channels.div_ceil(LANES)];
    for (block, group) in packed.chunks_exact_mut(cells).zip(plane.chunks(cells * LANES)) {
        let rows: Vec<&[f32]> = group.chunks_exact(cells).collect();
        // Of whole blocks as many cells as channels at once: a square stays in registers.
        let mut done = 0;
        if let Some(rows) = rows.first_chunk::<LANES>() {
            let (squares, _) = block.as_chunks_mut::<LANES>();
            done = squares.len() * LANES;
            let rows = rows.map(|row| row.as_chunks::<LANES>().0);
            for (k, square) in squares.iter_mut().enumerate() {
                *square = transposed(&rows.map(|row| row[k]));
            }
        }
        for (cell, to) in block.iter_mut().enumerate().skip(done) {
            for (value, row) in to.iter_mut().zip(&rows) {
                *value = row[cell];
            }
        }
    }
    packed
}

/// Rows and columns exchanged.
#[inline(always)]
pub(super) fn transposed(square: &[Block; LANES]) -> [Block; LANES] {
    std::array::from_fn(|column| std::array::from_fn(|row| square[row][column]))
}

/// The position of a coordinate on an axis.
#[derive(Clone, Copy)]
pub(super) struct AxisSample {
    low: usize,
    high: usize,
    pub(super) fraction: f32,
    /// Cells for each unit of the coordinate; 0 where it is clamped to the border.
    pub(super) slope: f32,
}

impl AxisSample {
    /// Align-corners: -1 is the first cell's center, 1 the last one's; clamped to the border.
    #[inline(always)]
    fn new(coordinate: f32, cells: usize) -> Self {
        let last = (cells - 1) as f32;
        let position = (coordinate + 1.0) * 0.5 * last;
        let inside = position > 0.0 && position < last;
        // `max` before `min`, so that NaN becomes 0 and can be an index.
        let clamped = position.max(0.0).min(last);
        let low = (clamped as usize).min(cells.saturating_sub(2));
        Self {
            low,
            high: (low + 1).min(cells - 1),
            fraction: clamped - low as f32,
            slope: if inside { 0.5 * last } else { 0.0 },
        }
    }
}

/// The four cells of a bilinear sample and their weights.
#[derive(Clone, Copy, Default)]
pub(super) struct Corners {
    pub(super) index: [usize; 4],
    pub(super) weight: [f32; 4],
}

impl Corners {
    #[inline(always)]
    fn new(across: &AxisSample, down: &AxisSample, width: usize) -> Self {
        let (x, y) = (across.fraction, down.fraction);
        Self {
            index: [
                down.low * width + across.low,
                down.low * width + across.high,
                down.high * width + across.low,
                down.high * width + across.high,
            ],
            weight: [(1.0 - x) * (1.0 - y), x * (1.0 - y), (1.0 - x) * y, x * y],
        }
    }

    #[inline(always)]
    fn sample<L: Lanes>(&self, cells: &[Block]) -> L {
        let mut value = L::load(&cells[self.index[0]]).mul(L::splat(self.weight[0]));
        for k in 1..4 {
            value = L::load(&cells[self.index[k]]).mul_add(L::splat(self.weight[k]), value);
        }
        value
    }

    /// The sample and its derivatives by the fractions `x` (across) and `y` (down).
    #[inline(always)]
    pub(super) fn sample_with_slopes<L: Lanes>(&self, cells: &[Block], x: L, y: L) -> (L, [L; 2]) {
        let [low_left, low_right] = [L::load(&cells[self.index[0]]), L::load(&cells[self.index[1]])];
        let [high_left, high_right] = [L::load(&cells[self.index[2]]), L::load(&cells[self.index[3]])];
        let (low_step, high_step) = (low_right.sub(low_left), high_right.sub(high_left));
        let low = low_step.mul_add(x, low_left);
        let by_down = high_step.mul_add(x, high_left).sub(low);
        let by_across = high_step.sub(low_step).mul_add(y, low_step);
        (by_down.mul_add(y, low), [by_across, by_down])
    }
}

#[inline(always)]
pub(super) fn samples(point: &[f32], resolution: [usize; AXIS_NAMES.len()]) -> [AxisSample; 4] {
    std::array::from_fn(|axis| AxisSample::new(point[axis], resolution[axis]))
}

#[inline(always)]
pub(super) fn corners(axes: &[AxisSample; 4], resolution: [usize; AXIS_NAMES.len()]) -> [Corners; PLANES] {
    // A loop, not `array::map`: its closure is not inlined.
    let mut corners = [Corners::default(); PLANES];
    for (corners, [across, down]) in corners.iter_mut().zip(PLANE_AXES) {
        *corners = Corners::new(&axes[across], &axes[down], resolution[across]);
    }
    corners
}

/// With `FULL`, all planes exist. This is known at compile time, so that no plane is checked.
struct Forward<'a, const FULL: bool> {
    points: &'a [f32],
    planes: &'a PackedPlanes,
    out: &'a mut [f32],
}

impl<const FULL: bool> LaneKernel for Forward<'_, FULL> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let planes = self.planes;
        let channels = planes.channels;
        let first = if FULL { 0 } else { planes.present.iter().position(|present| *present).unwrap_or(0) };
        let blocks: Vec<[&[Block]; PLANES]> =
            (0..planes.blocks()).map(|b| std::array::from_fn(|plane| planes.block(plane, b))).collect();
        for (point, out) in self.points.chunks_exact(4).zip(self.out.chunks_exact_mut(channels)) {
            let corners = corners(&samples(point, planes.resolution), planes.resolution);
            for (cells, out) in blocks.iter().zip(out.chunks_mut(LANES)) {
                let mut product = corners[first].sample::<L>(cells[first]);
                for plane in first + 1..PLANES {
                    if !FULL && !planes.present[plane] {
                        continue;
                    }
                    product = product.mul(corners[plane].sample::<L>(cells[plane]));
                }
                if let Some(block) = out.first_chunk_mut() {
                    product.store(block);
                } else {
                    let mut block = [0.0; LANES];
                    product.store(&mut block);
                    out.copy_from_slice(&block[..out.len()]);
                }
            }
        }
    }
}

/// Features `[N, C]` at points `[N, 4]` in [-1, 1].
pub(super) fn query(points: &[f32], planes: &PackedPlanes) -> Vec<f32> {
    let mut out = vec![0.0; points.len() / 4 * planes.channels];
    out.par_chunks_mut(CHUNK * planes.channels).zip(points.par_chunks(4 * CHUNK)).for_each(
        |(out, points)| match planes.is_full() {
            true => dispatch(Forward::<true> { points, planes, out }),
            false => dispatch(Forward::<false> { points, planes, out }),
        },
    );
    out
}

/// State of the CPU back ends between forward and backward.
#[derive(Clone, Debug)]
pub struct CpuSaved {
    points: HostTensor,
    planes: Arc<PackedPlanes>,
    /// `None` where there is no plane.
    shapes: [Option<[usize; 3]>; PLANES],
}

fn forward_on_cpu<B: HostBackend>(inputs: PlaneQueryInputs<B>, set: PlaneSet) -> (FloatTensor<B>, CpuSaved) {
    let [points, planes @ ..] = inputs.into_array();
    let mut present = set.0.into_iter();
    let planes = planes.map(|plane| present.next().expect("one a plane").then_some(plane));
    let shapes = planes.each_ref().map(|plane| plane.as_ref().map(|plane| plane.shape().dims::<3>()));
    let points = B::to_host(points);
    let planes = planes.map(|plane| plane.map(B::to_host));
    let packed = PackedPlanes::new(planes.each_ref().map(|plane| plane.as_ref().map(HostTensor::as_slice)), &shapes);
    let features = query(points.as_slice(), &packed);
    let count = points.as_slice().len() / 4;
    let channels = packed.channels();
    (B::from_values(features, [count, channels]), CpuSaved { points, planes: Arc::new(packed), shapes })
}

fn backward_on_cpu<B: HostBackend>(
    saved: CpuSaved,
    gradient: FloatTensor<B>,
    with_points: bool,
) -> PlaneQueryGradients<B> {
    let upstream = B::to_host(gradient);
    let points = saved.points.as_slice();
    let gradients = query_backward(points, &saved.planes, upstream.as_slice(), with_points);
    let mut shapes = saved.shapes.into_iter();
    PlaneQueryGradients {
        points: gradients.points.map(|values| B::from_values(values, [points.len() / 4, 4])),
        planes: gradients.planes.map(|values| Some(B::from_values(values, shapes.next()??))),
    }
}

for_cpu_back_ends! {
    PlaneQueryKernels {
        type Saved = CpuSaved;

        fn query_forward(inputs: PlaneQueryInputs<Self>, planes: PlaneSet) -> (FloatTensor<Self>, CpuSaved) {
            forward_on_cpu(inputs, planes)
        }

        fn query_backward(saved: CpuSaved, gradient: FloatTensor<Self>, with_points: bool) -> PlaneQueryGradients<Self> {
            backward_on_cpu(saved, gradient, with_points)
        }
    }
}
