//! Access to the memory of CPU tensors, without copies where the layout allows it.

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Flex, NdArray};
use burn::tensor::{Shape, TensorData};
use burn_flex::FlexTensor;
use burn_ndarray::{NdArrayTensor, SharedArray};
use ndarray::{ArrayD, IxDyn};

/// A contiguous float32 tensor in main memory. Cloning shares it.
#[derive(Clone, Debug)]
pub(crate) enum HostTensor {
    NdArray(SharedArray<f32>),
    Flex(FlexTensor),
}

impl HostTensor {
    /// Row-major values.
    pub(crate) fn as_slice(&self) -> &[f32] {
        match self {
            Self::NdArray(array) => array.as_slice().expect("made contiguous by `to_host`"),
            Self::Flex(tensor) => {
                let (start, end) = tensor.layout().contiguous_offsets().expect("made contiguous by `to_host`");
                &tensor.storage::<f32>()[start..end]
            }
        }
    }

    /// Row-major values for writing; copies only where somebody else holds the tensor.
    pub(crate) fn as_mut_slice(&mut self) -> &mut [f32] {
        match self {
            Self::NdArray(array) => array.as_slice_mut().expect("made contiguous by `to_host`"),
            Self::Flex(tensor) => {
                let (start, end) = tensor.layout().contiguous_offsets().expect("made contiguous by `to_host`");
                &mut tensor.storage_mut::<f32>()[start..end]
            }
        }
    }
}

/// A back end whose float32 tensors lie in main memory.
pub(crate) trait HostBackend: Backend {
    fn to_host(tensor: FloatTensor<Self>) -> HostTensor;
    fn from_host(tensor: HostTensor) -> FloatTensor<Self>;

    fn from_values(values: Vec<f32>, shape: impl Into<Shape>) -> FloatTensor<Self>;
}

impl HostBackend for NdArray {
    fn to_host(tensor: FloatTensor<Self>) -> HostTensor {
        let NdArrayTensor::F32(storage) = tensor else { panic!("the custom operations take float32 tensors") };
        let array = storage.into_shared();
        HostTensor::NdArray(if array.is_standard_layout() {
            array
        } else {
            array.as_standard_layout().into_owned().into_shared()
        })
    }

    fn from_host(tensor: HostTensor) -> FloatTensor<Self> {
        match tensor {
            HostTensor::NdArray(array) => array.into(),
            HostTensor::Flex(_) => unreachable!("a tensor stays on its back end"),
        }
    }

    fn from_values(values: Vec<f32>, shape: impl Into<Shape>) -> FloatTensor<Self> {
        let shape = shape.into();
        let dimensions: Vec<usize> = shape.iter().copied().collect();
        let array = ArrayD::from_shape_vec(IxDyn(&dimensions), values).expect("as many values as the shape asks for");
        array.into_shared().into()
    }
}

impl HostBackend for Flex {
    fn to_host(tensor: FloatTensor<Self>) -> HostTensor {
        HostTensor::Flex(if tensor.is_contiguous() { tensor } else { tensor.to_contiguous() })
    }

    fn from_host(tensor: HostTensor) -> FloatTensor<Self> {
        match tensor {
            HostTensor::Flex(tensor) => tensor,
            HostTensor::NdArray(_) => unreachable!("a tensor stays on its back end"),
        }
    }

    fn from_values(values: Vec<f32>, shape: impl Into<Shape>) -> FloatTensor<Self> {
        FlexTensor::from_data(TensorData::new(values, shape))
    }
}
