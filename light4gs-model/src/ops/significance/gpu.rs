//! The sums for significance pruning on a GPU: the kernels of splatting without color.

use burn::backend::tensor::FloatTensor;
use burn::tensor::Shape;
use burn_fusion::{Fusion, FusionBackend};
use burn_wgpu::{CubeBackend, CubeTensor};
use light4gs_render::SCORES;
use light4gs_shaders::{SIGNIFICANCE, SIGNIFICANCE_GATHER};

use super::SignificanceOps;
use crate::gpu::{Gpu, Kernel, Launch, Team, first_words};
use crate::gpu_error::GpuError;
use crate::ops::fusion::leaf;
use crate::ops::sample::GpuOperation;
use crate::ops::splat::gpu::{Begun, begin, resolve_inputs};
use crate::ops::splat::{SplatInputs, SplatView};

/// Values of an intersection's sums.
const SUMS: usize = 3;

/// The operation for checks.
pub(in crate::ops) const OPERATION: GpuOperation = GpuOperation { name: "significance", kernels, samples: &[] };

/// The kernels of this file.
fn kernels() -> Vec<Kernel> {
    let blending = Team::all().map(|team| Kernel::new(SIGNIFICANCE).blending(team));
    blending.chain([SIGNIFICANCE_GATHER.into()]).collect()
}

/// Scores `[N, 3]`; see [`SCORES`].
fn scores(inputs: SplatInputs<CubeBackend>, view: SplatView) -> Result<CubeTensor, GpuError> {
    let gpu = Gpu::of(&inputs.means)?;
    let Begun { frame, intersections: lists, .. } = begin(&gpu, inputs, SplatView { room: None, ..view })?;
    let sums = gpu.allocate("sums of intersections", SUMS * lists.count)?;
    let chunks = frame.chunks(lists.count);
    let carried = gpu.allocate("pixels between chunks", if chunks > 1 { frame.pixels() } else { 0 })?;
    for chunk in 0..chunks {
        Launch::new(&gpu.client, Kernel::new(SIGNIFICANCE).blending(frame.team))
            .reads(&lists.starts)
            .reads(&lists.order)
            .reads(&lists.gaussians)
            .reads(&lists.splats)
            .updates_if(chunk > 0, &sums)
            .updates_if(chunk > 0, &carried)
            .uniform(&frame.uniform(chunk, chunks))
            .groups(frame.cells())?;
    }

    let values = SCORES * frame.gaussians;
    let scores = gpu.allocate("scores of Gaussians", values)?;
    Launch::new(&gpu.client, SIGNIFICANCE_GATHER)
        .reads(&lists.splats)
        .reads(&lists.first_of_gaussian)
        .reads(&sums)
        .writes(&scores)
        .uniform(&[frame.gaussians as u32])
        .invocations(frame.gaussians)?;
    gpu.check("the significance of Gaussians", &[&scores])?;
    Ok(gpu.tensor(first_words(&scores, values), Shape::from([frame.gaussians, SCORES])))
}

impl SignificanceOps for CubeBackend {
    fn significance(inputs: SplatInputs<Self>, view: SplatView) -> FloatTensor<Self> {
        scores(inputs, view).unwrap_or_else(|error| error.raise())
    }
}

impl<B: FusionBackend + SignificanceOps> SignificanceOps for Fusion<B> {
    fn significance(inputs: SplatInputs<Self>, view: SplatView) -> FloatTensor<Self> {
        leaf::<B>(B::significance(resolve_inputs::<B>(inputs), view))
    }
}
