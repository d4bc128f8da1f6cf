//! The mean difference of two images on a GPU.

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use burn::tensor::Shape;
use burn::tensor::{Device, TensorData};
use burn_fusion::{Fusion, FusionBackend};
use burn_wgpu::{CubeBackend, CubeTensor};
use light4gs_shaders::{IMAGE_DIFFERENCE, IMAGE_DIFFERENCE_BACKWARD, Shader};

use super::{Difference, ImageDifferenceKernels, mean_difference};
use crate::gpu::{Gpu, Kernel, Launch, buffer_of, first_words};
use crate::gpu_error::GpuError;
use crate::ops::fusion::{leaf, resolve};
use crate::ops::sample::{GpuOperation, Numbers};

/// Numbers that a workgroup adds up.
const BLOCK: usize = 4096;

/// The operation for checks.
pub(in crate::ops) const OPERATION: GpuOperation =
    GpuOperation { name: "image_difference", kernels, samples: &[sample] };

/// The kernels of this file.
fn kernels() -> Vec<Kernel> {
    let of = |difference| [IMAGE_DIFFERENCE, IMAGE_DIFFERENCE_BACKWARD].map(|shader| kernel(shader, difference));
    [Difference::Absolute, Difference::Squared].into_iter().flat_map(of).collect()
}

fn kernel(shader: Shader, difference: Difference) -> Kernel {
    let squared = difference == Difference::Squared;
    Kernel::new(shader).constant("SQUARED", squared.into()).constant("BLOCK", BLOCK as u32)
}

fn forward(difference: Difference, image: CubeTensor, truth: CubeTensor) -> Result<CubeTensor, GpuError> {
    let gpu = Gpu::of(&image)?;
    let count = image.shape().num_elements();
    let blocks = count.div_ceil(BLOCK);
    let parts = gpu.allocate("parts of a mean difference", blocks)?;
    Launch::new(&gpu.client, kernel(IMAGE_DIFFERENCE, difference))
        .reads(&buffer_of(image))
        .reads(&buffer_of(truth))
        .writes(&parts)
        .uniform(&[count as u32])
        .groups(blocks)?;
    Ok(gpu.tensor(first_words(&parts, blocks), Shape::from([blocks])))
}

fn backward(
    difference: Difference,
    image: CubeTensor,
    truth: CubeTensor,
    upstream: CubeTensor,
) -> Result<CubeTensor, GpuError> {
    let gpu = Gpu::of(&image)?;
    let shape = image.shape();
    let count = shape.num_elements();
    let gradient = gpu.allocate("gradient of an image", count)?;
    Launch::new(&gpu.client, kernel(IMAGE_DIFFERENCE_BACKWARD, difference))
        .reads(&buffer_of(image))
        .reads(&buffer_of(truth))
        .reads(&buffer_of(upstream))
        .writes(&gradient)
        .uniform(&[count as u32])
        .invocations(count)?;
    Ok(gpu.tensor(first_words(&gradient, count), shape))
}

impl ImageDifferenceKernels for CubeBackend {
    fn image_difference_forward(difference: Difference, image: CubeTensor, truth: CubeTensor) -> CubeTensor {
        forward(difference, image, truth).unwrap_or_else(|error| error.raise())
    }

    fn image_difference_backward(
        difference: Difference,
        image: CubeTensor,
        truth: CubeTensor,
        upstream: CubeTensor,
    ) -> CubeTensor {
        backward(difference, image, truth, upstream).unwrap_or_else(|error| error.raise())
    }
}

impl<B: FusionBackend + ImageDifferenceKernels> ImageDifferenceKernels for Fusion<B> {
    fn image_difference_forward(
        difference: Difference,
        image: FloatTensor<Self>,
        truth: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        leaf::<B>(B::image_difference_forward(difference, resolve::<B>(image), resolve::<B>(truth)))
    }

    fn image_difference_backward(
        difference: Difference,
        image: FloatTensor<Self>,
        truth: FloatTensor<Self>,
        upstream: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        let [image, truth, upstream] = [image, truth, upstream].map(resolve::<B>);
        leaf::<B>(B::image_difference_backward(difference, image, truth, upstream))
    }
}

fn sample(device: &Device) -> Vec<TensorData> {
    let mut numbers = Numbers::new(&device.clone().autodiff());
    let (image, truth) = (numbers.leaf(2, 4000, -1.0, 1.0), numbers.matrix(2, 4000, -1.0, 1.0));
    let mut of = |difference| {
        let mean = mean_difference(difference, image.clone(), truth.clone());
        numbers.with_gradients(mean, std::slice::from_ref(&image))
    };
    [of(Difference::Absolute), of(Difference::Squared)].concat()
}
