//! Coordinates of the planes on a CPU.

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use glam::{Mat3, Vec3};

use super::{PlaneCoordinateKernels, PlaneMapping, PointTensors};
use crate::ops::for_cpu_back_ends;
use crate::ops::host::{HostBackend, HostTensor};

/// State of the CPU back ends between forward and backward.
#[derive(Clone, Debug)]
pub struct CpuMapped {
    points: HostTensor,
    analysis: Analysis,
    mapping: PlaneMapping,
}

/// The analysis of the initial cloud.
#[derive(Clone, Copy, Debug)]
struct Analysis {
    mean: Vec3,
    /// From an offset from the mean to standardized coordinates.
    standardize: Mat3,
}

impl Analysis {
    fn new(mean: &[f32], axes: &[f32], std: &[f32]) -> Self {
        let row = |k: usize| Vec3::from_slice(&axes[3 * k..]) / Vec3::from_slice(std);
        Self { mean: Vec3::from_slice(mean), standardize: Mat3::from_cols(row(0), row(1), row(2)) }
    }

    fn place(&self, point: Vec3) -> Vec3 {
        self.standardize * (point - self.mean)
    }
}

/// `1 / max(|place|, 1)`. A point that is not a number stays one.
fn inverse_radius(place: Vec3) -> f32 {
    let square = place.length_squared();
    if square < 1.0 { 1.0 } else { square.sqrt().recip() }
}

fn forward_on_cpu<B: HostBackend>(tensors: PointTensors<B>, mapping: PlaneMapping) -> (FloatTensor<B>, CpuMapped) {
    let count = tensors.points.shape()[0];
    let [points, mean, axes, std] = tensors.into_array().map(B::to_host);
    let analysis = Analysis::new(mean.as_slice(), axes.as_slice(), std.as_slice());
    let [scale, offset] = [mapping.mapping.scale, mapping.mapping.offset].map(Vec3::from);
    let mut coordinates = Vec::with_capacity(count * mapping.width());
    for point in points.as_slice().chunks_exact(3) {
        let mut place = analysis.place(Vec3::from_slice(point));
        if mapping.mapping.contracts {
            let inverse = inverse_radius(place);
            place *= (2.0 - inverse) * inverse;
        }
        coordinates.extend((place * scale + offset).to_array());
        coordinates.extend(mapping.time);
    }
    (B::from_values(coordinates, [count, mapping.width()]), CpuMapped { points, analysis, mapping })
}

fn backward_on_cpu<B: HostBackend>(saved: CpuMapped, gradient: FloatTensor<B>) -> FloatTensor<B> {
    let CpuMapped { points, analysis, mapping } = saved;
    let count = gradient.shape()[0];
    let upstream = B::to_host(gradient);
    let scale = Vec3::from(mapping.mapping.scale);
    let back = analysis.standardize.transpose();
    let mut gradients = Vec::with_capacity(3 * count);
    for (point, row) in points.as_slice().chunks_exact(3).zip(upstream.as_slice().chunks_exact(mapping.width())) {
        let mut gradient = Vec3::from_slice(row) * scale;
        if mapping.mapping.contracts {
            let place = analysis.place(Vec3::from_slice(point));
            let inverse = inverse_radius(place);
            // The radius has a derivative outside of the unit ball only, where the contraction bends.
            let along = if inverse < 1.0 { gradient.dot(place) * (2.0 * inverse - 2.0) * inverse.powi(3) } else { 0.0 };
            gradient = gradient * ((2.0 - inverse) * inverse) + along * place;
        }
        gradients.extend((back * gradient).to_array());
    }
    B::from_values(gradients, [count, 3])
}

for_cpu_back_ends! {
    PlaneCoordinateKernels {
        type Mapped = CpuMapped;

        fn plane_coordinates_forward(
            points: PointTensors<Self>,
            mapping: PlaneMapping,
        ) -> (FloatTensor<Self>, CpuMapped) {
            forward_on_cpu(points, mapping)
        }

        fn plane_coordinates_backward(saved: CpuMapped, gradient: FloatTensor<Self>) -> FloatTensor<Self> {
            backward_on_cpu::<Self>(saved, gradient)
        }
    }
}
