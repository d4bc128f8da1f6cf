//! Sums of tensors on a CPU: Burn's additions.

use super::SumsOps;
use crate::ops::for_cpu_back_ends;
use crate::ops::tensor_list::TensorList;

for_cpu_back_ends! {
    SumsOps {
        fn sums(parts: TensorList<Self>, numbers: Vec<usize>) -> TensorList<Self> {
            use burn::backend::ops::FloatTensorOps;

            let mut parts = parts.0.into_iter();
            let sum = |number| parts.by_ref().take(number).reduce(Self::float_add).expect("a sum has a part");
            TensorList(numbers.into_iter().map(sum).collect())
        }
    }
}
