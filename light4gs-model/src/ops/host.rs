//! Access to the memory of CPU tensors, without copies where the layout allows it.

use burn::backend::Backend;
#[cfg(feature = "flex")]
use burn::backend::Flex;
#[cfg(feature = "ndarray")]
use burn::backend::NdArray;
use burn::backend::tensor::FloatTensor;
use burn::tensor::Shape;
#[cfg(feature = "flex")]
use burn_flex::FlexTensor;
#[cfg(feature = "ndarray")]
use burn_ndarray::{NdArrayTensor, SharedArray};

/// A contiguous float32 tensor in main memory. Cloning shares it.
#[derive(Clone, Debug)]
pub(crate) enum HostTensor {
    #[cfg(feature = "ndarray")]
    NdArray(SharedArray<f32>),
    #[cfg(feature = "flex")]
    Flex(FlexTensor),
}

impl HostTensor {
    /// Row-major values.
    pub(crate) fn as_slice(&self) -> &[f32] {
        match *self {
            #[cfg(feature = "ndarray")]
            Self::NdArray(ref array) => array.as_slice().expect("made contiguous by `to_host`"),
            // Where this one begins may be behind the end of its storage.
            #[cfg(feature = "flex")]
            Self::Flex(ref tensor) if tensor.layout().num_elements() == 0 => &[],
            #[cfg(feature = "flex")]
            Self::Flex(ref tensor) => {
                let (start, end) = tensor.layout().contiguous_offsets().expect("made contiguous by `to_host`");
                &tensor.storage::<f32>()[start..end]
            }
        }
    }

    /// Row-major values for writing; copies only if the tensor is shared.
    pub(crate) fn as_mut_slice(&mut self) -> &mut [f32] {
        match *self {
            #[cfg(feature = "ndarray")]
            Self::NdArray(ref mut array) => array.as_slice_mut().expect("made contiguous by `to_host`"),
            #[cfg(feature = "flex")]
            Self::Flex(ref mut tensor) => {
                let (start, end) = tensor.layout().contiguous_offsets().expect("made contiguous by `to_host`");
                &mut tensor.storage_mut::<f32>()[start..end]
            }
        }
    }
}

/// A back end whose float32 tensors are in main memory.
pub(crate) trait HostBackend: Backend {
    fn to_host(tensor: FloatTensor<Self>) -> HostTensor;
    fn from_host(tensor: HostTensor) -> FloatTensor<Self>;

    fn from_values(values: Vec<f32>, shape: impl Into<Shape>) -> FloatTensor<Self>;
}

#[cfg(feature = "ndarray")]
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
            #[cfg(feature = "flex")]
            HostTensor::Flex(_) => unreachable!("a tensor stays on its back end"),
        }
    }

    fn from_values(values: Vec<f32>, shape: impl Into<Shape>) -> FloatTensor<Self> {
        let shape = shape.into();
        let dimensions: Vec<usize> = shape.iter().copied().collect();
        let array = ndarray::ArrayD::from_shape_vec(ndarray::IxDyn(&dimensions), values);
        array.expect("as many values as the shape asks for").into_shared().into()
    }
}

#[cfg(feature = "flex")]
impl HostBackend for Flex {
    fn to_host(tensor: FloatTensor<Self>) -> HostTensor {
        HostTensor::Flex(if tensor.is_contiguous() { tensor } else { tensor.to_contiguous() })
    }

    fn from_host(tensor: HostTensor) -> FloatTensor<Self> {
        match tensor {
            HostTensor::Flex(tensor) => tensor,
            #[cfg(feature = "ndarray")]
            HostTensor::NdArray(_) => unreachable!("a tensor stays on its back end"),
        }
    }

    fn from_values(values: Vec<f32>, shape: impl Into<Shape>) -> FloatTensor<Self> {
        FlexTensor::from_data(burn::tensor::TensorData::new(values, shape))
    }
}
