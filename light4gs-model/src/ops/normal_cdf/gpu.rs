//! The standard normal distribution function on a GPU.

use burn::backend::tensor::FloatTensor;
use burn::tensor::{Device, TensorData};
use burn_fusion::{Fusion, FusionBackend};
use burn_wgpu::CubeBackend;
use light4gs_shaders::{NORMAL_CDF, NORMAL_CDF_BACKWARD};

use super::{NormalCdfKernels, NormalCdfOps, normal_cdf};
use crate::gpu::{Kernel, elementwise};
use crate::ops::fusion::{leaf, resolve};
use crate::ops::sample::{GpuOperation, Numbers};

/// The operation for checks.
pub(in crate::ops) const OPERATION: GpuOperation = GpuOperation { name: "normal_cdf", kernels, samples: &[sample] };

/// The kernels of this file.
fn kernels() -> Vec<Kernel> {
    [NORMAL_CDF, NORMAL_CDF_BACKWARD].map(Kernel::new).into()
}

impl NormalCdfOps for CubeBackend {
    fn normal_cdf(tensor: FloatTensor<Self>) -> FloatTensor<Self> {
        elementwise(NORMAL_CDF, [tensor], &[])
    }
}

impl NormalCdfKernels for CubeBackend {
    fn normal_cdf_backward(tensor: FloatTensor<Self>, upstream: FloatTensor<Self>) -> FloatTensor<Self> {
        elementwise(NORMAL_CDF_BACKWARD, [tensor, upstream], &[])
    }
}

impl<B: FusionBackend + NormalCdfOps> NormalCdfOps for Fusion<B> {
    fn normal_cdf(tensor: FloatTensor<Self>) -> FloatTensor<Self> {
        leaf::<B>(B::normal_cdf(resolve::<B>(tensor)))
    }
}

impl<B: FusionBackend + NormalCdfKernels> NormalCdfKernels for Fusion<B> {
    fn normal_cdf_backward(tensor: FloatTensor<Self>, upstream: FloatTensor<Self>) -> FloatTensor<Self> {
        leaf::<B>(B::normal_cdf_backward(resolve::<B>(tensor), resolve::<B>(upstream)))
    }
}

fn sample(device: &Device) -> Vec<TensorData> {
    let mut numbers = Numbers::new(&device.clone().autodiff());
    let places = numbers.leaf(1, 2600, -13.0, 13.0);
    numbers.with_gradients(normal_cdf(places.clone()), &[places])
}
