//! The sums for significance pruning on a CPU, with the kernels of `light4gs-render`.

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use light4gs_render::{SCORES, TileLists, significance as significance_of_lists};

use super::SignificanceOps;
use crate::ops::activation::ActivationOps;
use crate::ops::for_cpu_back_ends;
use crate::ops::host::HostBackend;
use crate::ops::splat::cpu::{activated, slices};
use crate::ops::splat::{SplatInputs, SplatView};

fn significance_on_cpu<B: HostBackend + ActivationOps>(inputs: SplatInputs<B>, view: SplatView) -> FloatTensor<B> {
    let inputs = activated(inputs, view).into_array();
    let count = inputs[0].shape()[0];
    let inputs = inputs.map(B::to_host);
    let lists = TileLists::build(&slices(&inputs), &view.view);
    B::from_values(significance_of_lists(&lists, &view.view), [count, SCORES])
}

for_cpu_back_ends! {
    SignificanceOps {
        fn significance(inputs: SplatInputs<Self>, view: SplatView) -> FloatTensor<Self> {
            significance_on_cpu(inputs, view)
        }
    }
}
