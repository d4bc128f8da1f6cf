//! Coordinates of the planes on a GPU.

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use burn::tensor::{Device, Shape, Tensor, TensorData};
use burn_fusion::{Fusion, FusionBackend};
use burn_wgpu::{CubeBackend, CubeTensor};
use cubecl::server::Handle;
use light4gs_codec::CoordinateMapping;
use light4gs_shaders::{PLANE_COORDINATES, PLANE_COORDINATES_BACKWARD, Shader};

use super::{PlaneCoordinateKernels, PlaneMapping, PointTensors, Standardization, plane_coordinates};
use crate::gpu::{Gpu, Kernel, Launch, buffer_of, first_words};
use crate::gpu_error::GpuError;
use crate::ops::fusion::{leaf, resolve};
use crate::ops::sample::{GpuOperation, Numbers};

/// The operation for checks.
pub(in crate::ops) const OPERATION: GpuOperation =
    GpuOperation { name: "plane_coordinates", kernels, samples: &[sample] };

/// The kernels of this file.
fn kernels() -> Vec<Kernel> {
    [PLANE_COORDINATES, PLANE_COORDINATES_BACKWARD].map(Kernel::new).into()
}

/// State between forward and backward: points, mean, axes, standard deviations.
#[derive(Clone, Debug)]
pub struct GpuMapped {
    inputs: [Handle; 4],
    count: usize,
    mapping: PlaneMapping,
}

impl GpuMapped {
    /// A launch over the points, without its other buffers.
    fn launch<'a>(&self, gpu: &'a Gpu, shader: Shader) -> Launch<'a> {
        let PlaneMapping { mapping, time } = self.mapping;
        let counts = [self.count as u32, self.mapping.width() as u32, u32::from(mapping.contracts)];
        let [scale, offset] = [mapping.scale, mapping.offset].map(|[x, y, z]| [x, y, z, 0.0].map(f32::to_bits));
        let words: Vec<u32> =
            counts.into_iter().chain([time.unwrap_or(0.0).to_bits()]).chain(scale).chain(offset).collect();
        self.inputs.iter().fold(Launch::new(&gpu.client, shader), Launch::reads).uniform(&words)
    }
}

fn forward(tensors: [CubeTensor; 4], mapping: PlaneMapping) -> Result<(CubeTensor, GpuMapped), GpuError> {
    let gpu = Gpu::of(&tensors[0])?;
    let count = tensors[0].shape()[0];
    let saved = GpuMapped { inputs: tensors.map(buffer_of), count, mapping };
    let size = count * mapping.width();
    let coordinates = gpu.allocate("coordinates of the planes", size)?;
    saved.launch(&gpu, PLANE_COORDINATES).writes(&coordinates).invocations(count)?;
    Ok((gpu.tensor(first_words(&coordinates, size), Shape::from([count, mapping.width()])), saved))
}

fn backward(saved: &GpuMapped, gradient: CubeTensor) -> Result<CubeTensor, GpuError> {
    let gpu = Gpu::of(&gradient)?;
    let gradients = gpu.allocate("gradients of points", 3 * saved.count)?;
    let launch = saved.launch(&gpu, PLANE_COORDINATES_BACKWARD);
    launch.reads(&buffer_of(gradient)).writes(&gradients).invocations(saved.count)?;
    Ok(gpu.tensor(first_words(&gradients, 3 * saved.count), Shape::from([saved.count, 3])))
}

impl PlaneCoordinateKernels for CubeBackend {
    type Mapped = GpuMapped;

    fn plane_coordinates_forward(points: PointTensors<Self>, mapping: PlaneMapping) -> (FloatTensor<Self>, GpuMapped) {
        forward(points.into_array(), mapping).unwrap_or_else(|error| error.raise())
    }

    fn plane_coordinates_backward(saved: GpuMapped, gradient: FloatTensor<Self>) -> FloatTensor<Self> {
        backward(&saved, gradient).unwrap_or_else(|error| error.raise())
    }
}

impl<B: FusionBackend + PlaneCoordinateKernels> PlaneCoordinateKernels for Fusion<B> {
    type Mapped = B::Mapped;

    fn plane_coordinates_forward(
        points: PointTensors<Self>,
        mapping: PlaneMapping,
    ) -> (FloatTensor<Self>, Self::Mapped) {
        let [points, mean, axes, std] = points.into_array().map(resolve::<B>);
        let (coordinates, saved) = B::plane_coordinates_forward(PointTensors { points, mean, axes, std }, mapping);
        (leaf::<B>(coordinates), saved)
    }

    fn plane_coordinates_backward(saved: Self::Mapped, gradient: FloatTensor<Self>) -> FloatTensor<Self> {
        leaf::<B>(B::plane_coordinates_backward(saved, resolve::<B>(gradient)))
    }
}

fn sample(device: &Device) -> Vec<TensorData> {
    let mut numbers = Numbers::new(&device.clone().autodiff());
    let points = numbers.leaf(700, 3, -3.0, 3.0);
    let standardization = Standardization {
        mean: numbers.matrix(1, 3, -0.5, 0.5),
        axes: numbers.matrix(3, 3, -0.6, 0.6),
        std: numbers.matrix(1, 3, 0.5, 1.5),
    };
    let shifted =
        CoordinateMapping { contracts: false, scale: [0.1, 0.2, 0.3], offset: [0.1; 3], ..Default::default() };
    let mut call = |mapping: CoordinateMapping, time: Option<f32>| {
        let coordinates: Tensor<2> = plane_coordinates(points.clone(), standardization.clone(), mapping, time);
        numbers.with_gradients(coordinates, std::slice::from_ref(&points))
    };
    let mut values = call(CoordinateMapping::default(), Some(0.25));
    values.extend(call(shifted, None));
    values
}
