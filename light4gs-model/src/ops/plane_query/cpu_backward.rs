//! The derivative of the query of a scale's planes.

use light4gs_render::lanes::{LANES, LaneKernel, Lanes, dispatch};
use rayon::prelude::*;

use super::PLANES;
use super::cpu::{Block, CHUNK, Corners, PLANE_AXES, PackedPlanes, corners, samples, transposed};

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

/// Gradients of [`query`](super::cpu::query).
pub(super) struct QueryGradients {
    /// `[N, 4]`, absent if not asked for.
    pub(super) points: Option<Vec<f32>>,
    /// Each `[C, H, W]`; nothing where there is no plane.
    pub(super) planes: [Vec<f32>; PLANES],
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

/// With `FULL`, all planes exist, as in the forward pass.
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
pub(super) fn query_backward(
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

fn unpack(blocks: &[&[Block]], channels: usize) -> Vec<f32> {
    let cells = blocks[0].len();
    let mut plane = vec![0.0; channels * cells];
    for (group, block) in plane.chunks_mut(cells * LANES).zip(blocks) {
        let mut rows: Vec<&mut [f32]> = group.chunks_exact_mut(cells).collect();
        let mut done = 0;
        if let Some(rows) = rows.first_chunk_mut::<LANES>() {
            let (squares, _) = block.as_chunks::<LANES>();
            done = squares.len() * LANES;
            for (k, square) in squares.iter().enumerate() {
                for (row, values) in rows.iter_mut().zip(transposed(square)) {
                    row[k * LANES..][..LANES].copy_from_slice(&values);
                }
            }
        }
        for (cell, from) in block.iter().enumerate().skip(done) {
            for (row, value) in rows.iter_mut().zip(from) {
                row[cell] = *value;
            }
        }
    }
    plane
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
