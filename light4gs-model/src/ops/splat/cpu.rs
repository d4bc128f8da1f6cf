//! Splatting on a CPU, with the kernels of `light4gs-render`.

use std::sync::Arc;

use burn::backend::TensorMetadata;
use burn::tensor::TensorData;
use light4gs_render::{CHANNELS, GaussianSlices, TileLists, TilePixels, View, assemble, rasterize, splat_backward};

use super::{INPUTS, OfPixels, SplatInputs, SplatKernels, SplatOutputs, SplatView};
use crate::ops::activation::{ActivationKernels, ActivationOps, Curve};
use crate::ops::for_cpu_back_ends;
use crate::ops::host::{HostBackend, HostTensor};

/// Channels of an image; behind them come alpha and depth.
const COLORS: usize = 3;

/// State of the CPU back ends between forward and backward.
#[derive(Clone, Debug)]
pub struct CpuSaved {
    inputs: [HostTensor; INPUTS],
    shapes: [Vec<usize>; INPUTS],
    view: View,
    trained: usize,
    logarithms: bool,
    lists: Arc<TileLists>,
    pixels: Arc<Vec<TilePixels>>,
}

pub(in crate::ops) fn slices(inputs: &[HostTensor; INPUTS]) -> GaussianSlices<'_> {
    let [means, quats, scales, opacities, sh_dc, sh_rest, screen_offsets] = inputs.each_ref().map(|i| i.as_slice());
    GaussianSlices { means, quats, scales, opacities, sh_dc, sh_rest, screen_offsets }
}

/// The inputs with scales and opacities.
pub(in crate::ops) fn activated<B: HostBackend + ActivationOps>(
    inputs: SplatInputs<B>,
    view: SplatView,
) -> SplatInputs<B> {
    match view.logarithms {
        true => SplatInputs {
            scales: B::activation(Curve::BoundedExponential, inputs.scales),
            opacities: B::activation(Curve::Sigmoid, inputs.opacities),
            ..inputs
        },
        false => inputs,
    }
}

fn forward_on_cpu<B: HostBackend + ActivationOps>(
    inputs: SplatInputs<B>,
    splat_view: SplatView,
) -> (SplatOutputs<B>, CpuSaved) {
    let SplatView { view, trained, logarithms, .. } = splat_view;
    let inputs = activated(inputs, splat_view).into_array();
    let device = inputs[0].device();
    let shapes = inputs.each_ref().map(|input| input.shape().iter().copied().collect());
    let inputs = inputs.map(B::to_host);
    let lists = TileLists::build(&slices(&inputs), &view);
    let pixels = rasterize(&lists, &view);
    let [width, height] = [view.camera.width, view.camera.height].map(|side| side as usize);
    let mut image = assemble(&pixels, &view);
    let mut alpha = image.split_off(COLORS * width * height);
    let depth = alpha.split_off(width * height);
    let radii = lists.radii();
    let count = radii.len();
    let outputs = SplatOutputs {
        image: B::from_values(image, [height, width, COLORS]),
        alpha: B::from_values(alpha, [height, width]),
        depth: B::from_values(depth, [height, width]),
        radii: B::int_from_data(TensorData::new(radii, [count]), &device),
        intersections: B::int_from_data(TensorData::from([lists.intersections() as i32]), &device),
    };
    let trained = trained.unwrap_or(count);
    (outputs, CpuSaved { inputs, shapes, view, trained, logarithms, lists: Arc::new(lists), pixels: Arc::new(pixels) })
}

/// The gradients one behind the other, with zeros for those that are not there.
fn upstream<B: HostBackend>(gradients: OfPixels<B>, view: &View) -> Vec<f32> {
    let pixels = view.camera.width as usize * view.camera.height as usize;
    let mut upstream = Vec::with_capacity(CHANNELS * pixels);
    for (gradient, end) in gradients.into_iter().zip([COLORS, COLORS + 1, CHANNELS]) {
        if let Some(gradient) = gradient {
            upstream.extend_from_slice(B::to_host(gradient).as_slice());
        }
        upstream.resize(end * pixels, 0.0);
    }
    upstream
}

fn backward_on_cpu<B: HostBackend + ActivationKernels>(saved: CpuSaved, gradients: OfPixels<B>) -> SplatInputs<B> {
    let CpuSaved { inputs, shapes, view, trained, logarithms, lists, pixels } = saved;
    let upstream = upstream::<B>(gradients, &view);
    let g = splat_backward(&slices(&inputs), trained, &view, &lists, &pixels, &upstream);
    let values = [g.means, g.quats, g.scales, g.opacities, g.sh_dc, g.sh_rest, g.screen_offsets];
    let mut shapes = shapes.into_iter();
    let gradients = SplatInputs::from_array(
        values.map(|values| B::from_values(values, shapes.next().expect("a shape for every input"))),
    );
    if !logarithms {
        return gradients;
    }
    let [_, _, scales, opacities, ..] = inputs.map(B::from_host);
    SplatInputs {
        scales: B::activation_backward(Curve::BoundedExponential, scales, gradients.scales),
        opacities: B::activation_backward(Curve::Sigmoid, opacities, gradients.opacities),
        ..gradients
    }
}

for_cpu_back_ends! {
    SplatKernels {
        type Saved = CpuSaved;

        fn splat_forward(inputs: SplatInputs<Self>, view: SplatView) -> (SplatOutputs<Self>, CpuSaved) {
            forward_on_cpu(inputs, view)
        }

        fn splat_backward(saved: CpuSaved, gradients: OfPixels<Self>) -> SplatInputs<Self> {
            backward_on_cpu(saved, gradients)
        }
    }
}
