//! Bilinear queries of the planes of a scale and the product of the samples, forward and backward.
//!
//! Planes are given as `[C, H, W]`. They are repacked into blocks of eight channels, `[C / 8][H · W][8]`, so that a
//! sample is four vector loads; C is padded with zeros. The backward pass gives each block of channels to one task,
//! which alone writes that block's gradients. So there are no atomics, and the sums are the same for any number of
//! threads.

use light4gs_codec::plane_layout::{AXIS_NAMES, PlaneAxes};
use light4gs_render::lanes::{LANES, LaneKernel, Lanes, dispatch};
use rayon::prelude::*;

/// Points of a task in the forward pass.
const CHUNK: usize = 1024;

/// Planes that a scale may have.
const PLANES: usize = PlaneAxes::ALL.len();
const PLANE_AXES: [[usize; 2]; PLANES] = {
    let mut axes = [[0; 2]; PLANES];
    let mut plane = 0;
    while plane < PLANES {
        axes[plane] = PlaneAxes::ALL[plane].axes();
        plane += 1;
    }
    axes
};

type Block = [f32; LANES];

/// The planes of one scale, repacked.
#[derive(Debug)]
pub(crate) struct PackedPlanes {
    channels: usize,
    /// Cells along x, y, z, t; 1 along an axis that no plane spans.
    resolution: [usize; AXIS_NAMES.len()],
    /// Which planes exist.
    present: [bool; PLANES],
    /// For each plane, `[blocks][H · W]`; empty where there is no plane.
    planes: [Vec<Block>; PLANES],
}

impl PackedPlanes {
    /// Repacks planes over the axes of [`PlaneAxes::ALL`] with shapes `[C, H, W]`; `None` where there is no plane.
    pub(crate) fn new(planes: [Option<&[f32]>; PLANES], shapes: &[Option<[usize; 3]>; PLANES]) -> Self {
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
    pub(crate) fn channels(&self) -> usize {
        self.channels
    }

    fn is_full(&self) -> bool {
        self.present == [true; PLANES]
    }

    fn blocks(&self) -> usize {
        self.channels.div_ceil(LANES)
    }

    fn cells(&self, plane: usize) -> usize {
        self.planes[plane].len() / self.blocks()
    }

    fn block(&self, plane: usize, block: usize) -> &[Block] {
        let cells = self.cells(plane);
        &self.planes[plane][block * cells..(block + 1) * cells]
    }
}

fn pack(plane: &[f32], channels: usize) -> Vec<Block> {
    let cells = plane.len() / channels;
    let mut packed = vec![[0.0; LANES]; cells * channels.div_ceil(LANES)];
    for (block, group) in packed.chunks_exact_mut(cells).zip(plane.chunks(cells * LANES)) {
        let rows: Vec<&[f32]> = group.chunks_exact(cells).collect();
        for (cell, to) in block.iter_mut().enumerate() {
            for (value, row) in to.iter_mut().zip(&rows) {
                *value = row[cell];
            }
        }
    }
    packed
}

fn unpack(blocks: &[&[Block]], channels: usize) -> Vec<f32> {
    let cells = blocks[0].len();
    let mut plane = vec![0.0; channels * cells];
    for (group, block) in plane.chunks_mut(cells * LANES).zip(blocks) {
        let mut rows: Vec<&mut [f32]> = group.chunks_exact_mut(cells).collect();
        for (cell, from) in block.iter().enumerate() {
            for (row, value) in rows.iter_mut().zip(from) {
                row[cell] = *value;
            }
        }
    }
    plane
}

/// Cells of the coarse grid by which points are sorted, along each spatial axis.
const SORT_CELLS: usize = 16;

/// Points sorted by a coarse grid, so that successive points read the same cells of the planes.
fn spatial_order(points: &[f32]) -> Vec<u32> {
    let key = |point: &[f32]| {
        point[..3].iter().fold(0, |key, &coordinate| {
            // Saturating: NaN and coordinates outside go to the border.
            let cell = ((coordinate + 1.0) * 0.5 * SORT_CELLS as f32) as usize;
            key * SORT_CELLS + cell.min(SORT_CELLS - 1)
        })
    };
    let mut starts = vec![0u32; SORT_CELLS.pow(3) + 1];
    for point in points.chunks_exact(4) {
        starts[key(point) + 1] += 1;
    }
    for i in 1..starts.len() {
        starts[i] += starts[i - 1];
    }
    let mut order = vec![0; points.len() / 4];
    for (i, point) in points.chunks_exact(4).enumerate() {
        let place = &mut starts[key(point)];
        order[*place as usize] = i as u32;
        *place += 1;
    }
    order
}

/// The position of a coordinate on an axis.
#[derive(Clone, Copy)]
struct AxisSample {
    low: usize,
    high: usize,
    fraction: f32,
    /// Cells for each unit of the coordinate; 0 where it is clamped to the border.
    slope: f32,
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
struct Corners {
    index: [usize; 4],
    weight: [f32; 4],
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
    fn sample_with_slopes<L: Lanes>(&self, cells: &[Block], x: L, y: L) -> (L, [L; 2]) {
        let [low_left, low_right] = [L::load(&cells[self.index[0]]), L::load(&cells[self.index[1]])];
        let [high_left, high_right] = [L::load(&cells[self.index[2]]), L::load(&cells[self.index[3]])];
        let (low_step, high_step) = (low_right.sub(low_left), high_right.sub(high_left));
        let low = low_step.mul_add(x, low_left);
        let by_down = high_step.mul_add(x, high_left).sub(low);
        let by_across = high_step.sub(low_step).mul_add(y, low_step);
        (by_down.mul_add(y, low), [by_across, by_down])
    }
}

/// A block of channels; the last one may be short.
#[inline(always)]
fn padded(channels: &[f32]) -> Block {
    // Full blocks are handled separately: a copy of unknown length is a function call.
    if let Some(block) = channels.first_chunk() {
        return *block;
    }
    let mut block = [0.0; LANES];
    block[..channels.len()].copy_from_slice(channels);
    block
}

#[inline(always)]
fn samples(point: &[f32], resolution: [usize; AXIS_NAMES.len()]) -> [AxisSample; 4] {
    std::array::from_fn(|axis| AxisSample::new(point[axis], resolution[axis]))
}

#[inline(always)]
fn corners(axes: &[AxisSample; 4], resolution: [usize; AXIS_NAMES.len()]) -> [Corners; PLANES] {
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
pub(crate) fn query(points: &[f32], planes: &PackedPlanes) -> Vec<f32> {
    let mut out = vec![0.0; points.len() / 4 * planes.channels];
    out.par_chunks_mut(CHUNK * planes.channels).zip(points.par_chunks(4 * CHUNK)).for_each(
        |(out, points)| match planes.is_full() {
            true => dispatch(Forward::<true> { points, planes, out }),
            false => dispatch(Forward::<false> { points, planes, out }),
        },
    );
    out
}

/// Gradients of [`query`].
pub(crate) struct QueryGradients {
    /// `[N, 4]`, absent if not asked for.
    pub(crate) points: Option<Vec<f32>>,
    /// Each `[C, H, W]`; nothing where there is no plane.
    pub(crate) planes: [Vec<f32>; PLANES],
}

/// Points and their upstream gradients in the order of [`spatial_order`], so that the tasks read them sequentially.
struct Sorted {
    order: Vec<u32>,
    /// `[N][4]`
    points: Vec<[f32; 4]>,
    /// `[N][blocks]`
    upstream: Vec<Block>,
}

impl Sorted {
    fn new(points: &[f32], upstream: &[f32], channels: usize) -> Self {
        let order = spatial_order(points);
        let blocks = channels.div_ceil(LANES);
        let mut sorted =
            Self { points: vec![[0.0; 4]; order.len()], upstream: vec![[0.0; LANES]; order.len() * blocks], order };
        (
            sorted.points.par_chunks_mut(CHUNK),
            sorted.upstream.par_chunks_mut(CHUNK * blocks),
            sorted.order.par_chunks(CHUNK),
        )
            .into_par_iter()
            .for_each(|(to_points, to_upstream, order)| {
                for ((point, row), &n) in to_points.iter_mut().zip(to_upstream.chunks_exact_mut(blocks)).zip(order) {
                    let n = n as usize;
                    point.copy_from_slice(&points[4 * n..4 * n + 4]);
                    for (block, channels) in
                        row.iter_mut().zip(upstream[channels * n..channels * (n + 1)].chunks(LANES))
                    {
                        *block = padded(channels);
                    }
                }
            });
        sorted
    }
}

/// `FULL` as in [`Forward`].
struct Backward<'a, const FULL: bool> {
    sorted: &'a Sorted,
    planes: &'a PackedPlanes,
    block: usize,
    with_points: bool,
}

/// The gradients from one block of channels.
struct BlockGradients {
    planes: [Vec<Block>; PLANES],
    /// In the order of [`Sorted`]; empty if not requested.
    points: Vec<[f32; 4]>,
}

impl<const FULL: bool> LaneKernel for Backward<'_, FULL> {
    type Output = BlockGradients;

    #[inline(always)]
    fn run<L: Lanes>(self) -> Self::Output {
        let planes = self.planes;
        let sorted = self.sorted;
        let cells: [&[Block]; PLANES] = std::array::from_fn(|plane| planes.block(plane, self.block));
        let mut gradients: [Vec<Block>; PLANES] = std::array::from_fn(|plane| vec![[0.0; LANES]; cells[plane].len()]);
        let mut point_gradients = Vec::with_capacity(if self.with_points { sorted.points.len() } else { 0 });
        let upstream = sorted.upstream.iter().skip(self.block).step_by(planes.blocks());
        for (point, upstream) in sorted.points.iter().zip(upstream) {
            let axes = samples(point, planes.resolution);
            let corners = corners(&axes, planes.resolution);
            let upstream = L::load(upstream);
            let mut fractions = [upstream; 4];
            for axis in 0..4 {
                fractions[axis] = L::splat(axes[axis].fraction);
            }
            // Loops, not `array::from_fn`: with a call that is not inlined, values leave the vector registers.
            let mut values = [L::splat(1.0); PLANES];
            let mut slopes = [[L::splat(0.0); 2]; PLANES];
            for plane in 0..PLANES {
                if !FULL && !planes.present[plane] {
                    continue;
                }
                let [across, down] = PLANE_AXES[plane];
                (values[plane], slopes[plane]) =
                    corners[plane].sample_with_slopes(cells[plane], fractions[across], fractions[down]);
            }

            // The product of all other samples, without division: upstream · prefix · suffix.
            let mut prefix = [upstream; PLANES];
            for plane in 1..PLANES {
                prefix[plane] = prefix[plane - 1].mul(values[plane - 1]);
            }
            let mut suffix = L::splat(1.0);
            for plane in (0..PLANES).rev() {
                if !FULL && !planes.present[plane] {
                    continue;
                }
                let gradient = prefix[plane].mul(suffix);
                suffix = suffix.mul(values[plane]);
                let Corners { index, weight } = &corners[plane];
                for k in 0..4 {
                    let cell = &mut gradients[plane][index[k]];
                    gradient.mul_add(L::splat(weight[k]), L::load(cell)).store(cell);
                }
                slopes[plane] = [slopes[plane][0].mul(gradient), slopes[plane][1].mul(gradient)];
            }
            if self.with_points {
                let [xy, xz, xt, yz, yt, zt] = slopes;
                let along = [
                    xy[0].add(xz[0]).add(xt[0]),
                    xy[1].add(yz[0]).add(yt[0]),
                    xz[1].add(yz[1]).add(zt[0]),
                    xt[1].add(yt[1]).add(zt[1]),
                ];
                let mut gradient = [0.0; 4];
                for axis in 0..4 {
                    gradient[axis] = along[axis].sum() * axes[axis].slope;
                }
                point_gradients.push(gradient);
            }
        }
        BlockGradients { planes: gradients, points: point_gradients }
    }
}

/// Gradients of the planes and, on request, of the points, from `upstream [N, C]`.
pub(crate) fn query_backward(
    points: &[f32],
    planes: &PackedPlanes,
    upstream: &[f32],
    with_points: bool,
) -> QueryGradients {
    let sorted = Sorted::new(points, upstream, planes.channels);
    let blocks: Vec<BlockGradients> = (0..planes.blocks())
        .into_par_iter()
        .map(|block| match planes.is_full() {
            true => dispatch(Backward::<true> { sorted: &sorted, planes, block, with_points }),
            false => dispatch(Backward::<false> { sorted: &sorted, planes, block, with_points }),
        })
        .collect();
    let unpacked: Vec<Vec<f32>> = (0..PLANES)
        .into_par_iter()
        .map(|plane| {
            if !planes.present[plane] {
                return Vec::new();
            }
            let parts: Vec<&[Block]> = blocks.iter().map(|block| block.planes[plane].as_slice()).collect();
            unpack(&parts, planes.channels)
        })
        .collect();
    let points = with_points.then(|| {
        let mut sum = vec![0.0; points.len()];
        for (place, &n) in sorted.order.iter().enumerate() {
            for (axis, sum) in sum[4 * n as usize..][..4].iter_mut().enumerate() {
                *sum = blocks.iter().map(|block| block.points[place][axis]).sum();
            }
        }
        sum
    });
    QueryGradients { points, planes: unpacked.try_into().expect("as many planes out as in") }
}
