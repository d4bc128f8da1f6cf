//! Splatting on a CPU, with the kernels of `light4gs-render`.

use std::sync::Arc;

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use burn::tensor::TensorData;
use light4gs_render::{CHANNELS, GaussianSlices, TileLists, TilePixels, View, assemble, rasterize, splat_backward};

use super::{INPUTS, SplatInputs, SplatKernels, SplatOutputs, SplatView};
use crate::ops::for_cpu_back_ends;
use crate::ops::host::{HostBackend, HostTensor};

/// State of the CPU back ends between forward and backward.
#[derive(Clone, Debug)]
pub struct CpuSaved {
    inputs: [HostTensor; INPUTS],
    shapes: [Vec<usize>; INPUTS],
    view: View,
    trained: usize,
    lists: Arc<TileLists>,
    pixels: Arc<Vec<TilePixels>>,
}

pub(in crate::ops) fn slices(inputs: &[HostTensor; INPUTS]) -> GaussianSlices<'_> {
    let [means, quats, scales, opacities, sh_dc, sh_rest, screen_offsets] = inputs.each_ref().map(|i| i.as_slice());
    GaussianSlices { means, quats, scales, opacities, sh_dc, sh_rest, screen_offsets }
}

fn forward_on_cpu<B: HostBackend>(
    inputs: SplatInputs<B>,
    SplatView { view, trained, .. }: SplatView,
) -> (SplatOutputs<B>, CpuSaved) {
    let inputs = inputs.into_array();
    let device = inputs[0].device();
    let shapes = inputs.each_ref().map(|input| input.shape().iter().copied().collect());
    let inputs = inputs.map(B::to_host);
    let lists = TileLists::build(&slices(&inputs), &view);
    let pixels = rasterize(&lists, &view);
    let rendering = assemble(&pixels, &view);
    let radii = lists.radii();
    let count = radii.len();
    let outputs = SplatOutputs {
        rendering: B::from_values(rendering, [view.camera.height as usize * view.camera.width as usize * CHANNELS]),
        radii: B::int_from_data(TensorData::new(radii, [count]), &device),
        intersections: B::int_from_data(TensorData::from([lists.intersections() as i32]), &device),
    };
    let trained = trained.unwrap_or(count);
    (outputs, CpuSaved { inputs, shapes, view, trained, lists: Arc::new(lists), pixels: Arc::new(pixels) })
}

fn backward_on_cpu<B: HostBackend>(saved: CpuSaved, gradient: FloatTensor<B>) -> SplatInputs<B> {
    let upstream = B::to_host(gradient);
    let CpuSaved { inputs, shapes, view, trained, lists, pixels } = saved;
    let g = splat_backward(&slices(&inputs), trained, &view, &lists, &pixels, upstream.as_slice());
    let values = [g.means, g.quats, g.scales, g.opacities, g.sh_dc, g.sh_rest, g.screen_offsets];
    let mut shapes = shapes.into_iter();
    SplatInputs::from_array(
        values.map(|values| B::from_values(values, shapes.next().expect("a shape for every input"))),
    )
}

for_cpu_back_ends! {
    SplatKernels {
        type Saved = CpuSaved;

        fn splat_forward(inputs: SplatInputs<Self>, view: SplatView) -> (SplatOutputs<Self>, CpuSaved) {
            forward_on_cpu(inputs, view)
        }

        fn splat_backward(saved: CpuSaved, gradient: FloatTensor<Self>) -> SplatInputs<Self> {
            backward_on_cpu(saved, gradient)
        }
    }
}
