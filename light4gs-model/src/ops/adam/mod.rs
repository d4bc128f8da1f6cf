//! One fused Adam step for each tensor (Kingma and Ba, 2015), in place where the tensor is not shared.

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, TensorMetadata, backend_extension};
use burn::tensor::Tensor;
#[cfg(feature = "wgpu")]
use burn_fusion::{Fusion, FusionBackend};
#[cfg(feature = "wgpu")]
use burn_wgpu::CubeBackend;

use super::for_cpu_back_ends;
#[cfg(feature = "wgpu")]
use super::fusion::{leaf, resolve};
use super::host::HostBackend;
use crate::cpu::adam::adam_step as adam_step_on_slices;
#[cfg(feature = "wgpu")]
use crate::gpu::adam_on_gpu;
pub use crate::kernels::adam::{AdamStep, AdamTensors};

/// The fused step on every back end.
#[backend_extension(NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"))]
pub trait AdamOps: Backend {
    /// Parameter and moments after one step along `gradient`.
    fn adam(
        #[extension_type] tensors: AdamTensors<Self>,
        gradient: FloatTensor<Self>,
        step: AdamStep,
    ) -> AdamTensors<Self>;
}

fn adam_on_cpu<B: HostBackend>(tensors: AdamTensors<B>, gradient: FloatTensor<B>, step: AdamStep) -> AdamTensors<B> {
    debug_assert_eq!(tensors.parameter.shape(), gradient.shape());
    let mut parameter = B::to_host(tensors.parameter);
    let mut first = B::to_host(tensors.first_moment);
    let mut second = B::to_host(tensors.second_moment);
    let gradient = B::to_host(gradient);
    adam_step_on_slices(
        parameter.as_mut_slice(),
        gradient.as_slice(),
        first.as_mut_slice(),
        second.as_mut_slice(),
        step,
    );
    AdamTensors {
        parameter: B::from_host(parameter),
        first_moment: B::from_host(first),
        second_moment: B::from_host(second),
    }
}

for_cpu_back_ends! {
    AdamOps {
        fn adam(tensors: AdamTensors<Self>, gradient: FloatTensor<Self>, step: AdamStep) -> AdamTensors<Self> {
            adam_on_cpu(tensors, gradient, step)
        }
    }
}

#[cfg(feature = "wgpu")]
impl AdamOps for CubeBackend {
    fn adam(tensors: AdamTensors<Self>, gradient: FloatTensor<Self>, step: AdamStep) -> AdamTensors<Self> {
        adam_on_gpu(tensors, gradient, step)
    }
}

#[cfg(feature = "wgpu")]
impl<B: FusionBackend + AdamOps> AdamOps for Fusion<B> {
    fn adam(tensors: AdamTensors<Self>, gradient: FloatTensor<Self>, step: AdamStep) -> AdamTensors<Self> {
        let AdamTensors { parameter, first_moment, second_moment } = tensors;
        let tensors = AdamTensors {
            parameter: resolve::<B>(parameter),
            first_moment: resolve::<B>(first_moment),
            second_moment: resolve::<B>(second_moment),
        };
        let AdamTensors { parameter, first_moment, second_moment } = B::adam(tensors, resolve::<B>(gradient), step);
        AdamTensors {
            parameter: leaf::<B>(parameter),
            first_moment: leaf::<B>(first_moment),
            second_moment: leaf::<B>(second_moment),
        }
    }
}

/// Takes one Adam step on tensors without autodiff; returns parameter, first and second moment.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::ops::adam::{AdamStep, adam_step};
///
/// let device = Device::flex();
/// let step = AdamStep { learning_rate: 0.1, beta_1: 0.9, beta_2: 0.999, epsilon: 1e-15, time: 1 };
/// let zeros = Tensor::<1>::zeros([2], &device);
/// let gradient = Tensor::from_floats([3.0, -4.0], &device);
/// let [parameter, _, _] = adam_step([zeros.clone(), zeros.clone(), zeros], gradient, step);
/// // The first step has the size of the learning rate, against the gradient's sign.
/// let values = parameter.into_data().to_vec::<f32>().unwrap();
/// assert!((values[0] + 0.1).abs() < 1e-6 && (values[1] - 0.1).abs() < 1e-6);
/// ```
pub fn adam_step<const D: usize>(
    [parameter, first, second]: [Tensor<D>; 3],
    gradient: Tensor<D>,
    step: AdamStep,
) -> [Tensor<D>; 3] {
    let tensors = AdamTensors {
        parameter: parameter.into_dispatch(),
        first_moment: first.into_dispatch(),
        second_moment: second.into_dispatch(),
    };
    let out = Dispatch::adam(tensors, gradient.into_dispatch(), step);
    [out.parameter, out.first_moment, out.second_moment].map(Tensor::from_dispatch)
}
