//! Points, their coordinates in the planes, and samples of the planes at these points.
//!
//! Additions, multiplications, divisions and square roots in a fixed order, as in the exact executor, since the
//! hexplane-coupled model codes spherical harmonics with these numbers.

use crate::{CoordinateMapping, Plane, SceneCoordinateArrays, network::kernels::kept};

/// Coordinates in [-1, 1]: standardized along the principal axes, and by default contracted into the ball of radius 2 and
/// halved (paper III-A).
pub(crate) fn normalized(coordinates: &SceneCoordinateArrays, point: [f32; 3]) -> [f32; 3] {
    let offset: [f32; 3] = std::array::from_fn(|i| point[i] - coordinates.mean[i]);
    let [x, y, z] = std::array::from_fn(|j| {
        let axis = coordinates.axes[j];
        (offset[0] * axis[0] + offset[1] * axis[1] + offset[2] * axis[2]) / coordinates.std[j]
    });
    let CoordinateMapping { contracts, scale, offset, .. } = coordinates.mapping;
    let square = x * x + y * y + z * z;
    let inverse = if contracts && square > 1.0 { 1.0 / square.sqrt() } else { 1.0 };
    let factor = (2.0 - inverse) * inverse;
    std::array::from_fn(|axis| [x, y, z][axis] * (factor * scale[axis]) + offset[axis])
}

/// Two samples of an axis and the share of the second.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Between {
    pub(crate) low: usize,
    pub(crate) high: usize,
    share: f32,
}

impl Between {
    /// Where a coordinate in [-1, 1] falls among `samples`, the first at -1 and the last at 1. Coordinates outside are
    /// moved to the border.
    pub(crate) fn of(coordinate: f32, samples: u32) -> Self {
        let last = samples as usize - 1;
        let position = (coordinate + 1.0) * 0.5 * last as f32;
        // NaN is treated as 0.
        let position = if position > 0.0 { position } else { 0.0 };
        let low = (position as usize).min(last);
        let share = position - low as f32;
        Self { low, high: (low + 1).min(last), share: if share < 1.0 { share } else { 1.0 } }
    }

    /// The value there, from those of the two samples.
    pub(crate) fn between(self, low: f32, high: f32) -> f32 {
        low * (1.0 - self.share) + high * self.share
    }
}

/// Multiplies `product [channels]` by the bilinear samples of a plane at `across` (width) and `down` (height).
fn multiply_by_sample(plane: &Plane, across: f32, down: f32, product: &mut [f32]) {
    let (x, y) = (Between::of(across, plane.width), Between::of(down, plane.height));
    let width = plane.width as usize;
    for (product, channel) in product.iter_mut().zip(plane.values.chunks_exact(width * plane.height as usize)) {
        let row = |y: usize| {
            let row = &channel[y * width..(y + 1) * width];
            x.between(kept(row[x.low]), kept(row[x.high]))
        };
        *product = kept(*product * kept(y.between(row(y.low), row(y.high))));
    }
}

/// Multiplies `product [channels]` by the samples of a scale's space-only planes at a point, in their order.
pub(crate) fn multiply_by_space_samples(planes: &[Plane], point: [f32; 3], product: &mut [f32]) {
    for plane in planes.iter().filter(|plane| !plane.axes.is_space_time()) {
        let [across, down] = plane.axes.axes();
        multiply_by_sample(plane, point[across], point[down], product);
    }
}

/// The planes of each scale, which are neighbors in the list.
pub(crate) fn scales(planes: &[Plane]) -> impl Iterator<Item = &[Plane]> {
    planes.chunk_by(|a, b| a.scale == b.scale)
}
