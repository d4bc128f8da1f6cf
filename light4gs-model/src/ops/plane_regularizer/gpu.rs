//! The regularizer of feature planes on a GPU.

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use burn::tensor::{Device, Shape, TensorData};
use burn_fusion::{Fusion, FusionBackend};
use burn_wgpu::{CubeBackend, CubeTensor};
use cubecl::server::Handle;
use light4gs_shaders::{MEAN_OF_SUMS, PLANE_REGULARIZER, SCALE};

use super::{PLANES, PlaneRegularizerKernels, PlaneWeights, RegularizedPlanes, regularize};
use crate::gpu::{Gpu, Kernel, Launch, Places, buffer_of, first_words};
use crate::gpu_error::GpuError;
use crate::ops::fusion::{leaf, resolve};
use crate::ops::sample::{GpuOperation, Numbers};

/// Numbers that a workgroup owns.
const BLOCK: usize = 2048;

/// The operation for checks.
pub(in crate::ops) const OPERATION: GpuOperation =
    GpuOperation { name: "plane_regularizer", kernels, samples: &[sample] };

/// The kernels of this file. One of `node_regularizer` is launched too.
fn kernels() -> Vec<Kernel> {
    vec![kernel(), MEAN_OF_SUMS.into()]
}

fn kernel() -> Kernel {
    Kernel::new(PLANE_REGULARIZER).constant("BLOCK", BLOCK as u32)
}

/// Gradients for a loss that counts once, of all planes in one buffer.
#[derive(Clone, Debug)]
pub struct RegularizedScale {
    gradients: Handle,
    shapes: [Shape; PLANES],
}

/// Places of the gradients in the buffer.
fn places_of(shapes: &[Shape; PLANES]) -> Places {
    Places::new(&shapes.each_ref().map(Shape::num_elements))
}

fn forward(
    planes: RegularizedPlanes<CubeBackend>,
    weights: [PlaneWeights; PLANES],
) -> Result<(CubeTensor, RegularizedScale), GpuError> {
    let gpu = Gpu::of(&planes.xy)?;
    let planes = planes.into_array();
    let shapes = planes.each_ref().map(TensorMetadata::shape);
    let places = places_of(&shapes);
    let blocks = places.total.div_ceil(BLOCK);
    let mut uniform = vec![places.total as u32, 0, 0, 0];
    for (plane, shape) in shapes.iter().enumerate() {
        let sizes = [places.starts[plane], shape.num_elements(), shape[1], shape[2]];
        uniform.extend(sizes.map(|size| size as u32));
    }
    for (weights, shape) in weights.iter().zip(&shapes) {
        let [smoothness, distance] = weights.of_numbers(shape.dims());
        uniform.extend([smoothness, distance, 0.0, 0.0].map(f32::to_bits));
    }
    let gradients = gpu.allocate("gradients of regularized planes", places.total)?;
    let sums = gpu.allocate("sums of regularized planes", blocks)?;
    let loss = gpu.allocate("loss of planes", 1)?;
    let launch = planes.into_iter().fold(Launch::new(&gpu.client, kernel()), |l, plane| l.reads(&buffer_of(plane)));
    launch.writes(&sums).writes(&gradients).uniform(&uniform).groups(blocks)?;
    Launch::new(&gpu.client, MEAN_OF_SUMS)
        .reads(&sums)
        .writes(&loss)
        .uniform(&[blocks as u32, 1f32.to_bits()])
        .groups(1)?;
    Ok((gpu.tensor(first_words(&loss, 1), Shape::from([1])), RegularizedScale { gradients, shapes }))
}

fn backward(derivatives: RegularizedScale, upstream: CubeTensor) -> Result<[CubeTensor; PLANES], GpuError> {
    let gpu = Gpu::of(&upstream)?;
    let places = places_of(&derivatives.shapes);
    let scaled = gpu.allocate("gradients of planes", places.total)?;
    Launch::new(&gpu.client, SCALE)
        .reads(&derivatives.gradients)
        .reads(&buffer_of(upstream))
        .writes(&scaled)
        .uniform(&[places.total as u32])
        .invocations(places.total)?;
    Ok(std::array::from_fn(|plane| gpu.tensor(places.of(&scaled, plane), derivatives.shapes[plane].clone())))
}

impl PlaneRegularizerKernels for CubeBackend {
    type Derivatives = RegularizedScale;

    fn plane_regularizer_forward(
        planes: RegularizedPlanes<Self>,
        weights: [PlaneWeights; PLANES],
    ) -> (CubeTensor, RegularizedScale) {
        forward(planes, weights).unwrap_or_else(|error| error.raise())
    }

    fn plane_regularizer_backward(derivatives: RegularizedScale, gradient: CubeTensor) -> [CubeTensor; PLANES] {
        backward(derivatives, gradient).unwrap_or_else(|error| error.raise())
    }
}

impl<B: FusionBackend + PlaneRegularizerKernels> PlaneRegularizerKernels for Fusion<B> {
    type Derivatives = B::Derivatives;

    fn plane_regularizer_forward(
        planes: RegularizedPlanes<Self>,
        weights: [PlaneWeights; PLANES],
    ) -> (FloatTensor<Self>, B::Derivatives) {
        let planes = RegularizedPlanes::from_array(planes.into_array().map(resolve::<B>));
        let (loss, derivatives) = B::plane_regularizer_forward(planes, weights);
        (leaf::<B>(loss), derivatives)
    }

    fn plane_regularizer_backward(
        derivatives: B::Derivatives,
        gradient: FloatTensor<Self>,
    ) -> [FloatTensor<Self>; PLANES] {
        B::plane_regularizer_backward(derivatives, resolve::<B>(gradient)).map(leaf::<B>)
    }
}

/// Planes of several sizes, one of them too low for second differences.
fn sample(device: &Device) -> Vec<TensorData> {
    let mut numbers = Numbers::new(&device.clone().autodiff());
    let heights = [40, 9, 2, 5, 33, 3];
    let leaves = heights.map(|height| numbers.leaf(3 * height, 7, 0.5, 1.5));
    let planes = std::array::from_fn(|plane| leaves[plane].clone().reshape([3, heights[plane], 7]));
    let weights = std::array::from_fn(|plane| PlaneWeights { smoothness: 0.5 + plane as f32, distance: 2.0 });
    numbers.with_gradients(regularize(planes, weights), &leaves)
}
