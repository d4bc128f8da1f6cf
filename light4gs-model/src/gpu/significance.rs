//! The sums for significance pruning on a GPU: the kernels of splatting without color.

use burn::tensor::Shape;
use burn_wgpu::CubeBackend;
use burn_wgpu::CubeTensor;
use light4gs_render::{SCORES, View};
use light4gs_shaders::{SIGNIFICANCE, SIGNIFICANCE_GATHER};

use super::context::{Gpu, first_words};
use super::kernel::Kernel;
use super::launch::Launch;
use super::splat::{Begun, begin};
use super::team::Team;
use crate::gpu_error::GpuError;
use crate::kernels::splat::{SplatInputs, SplatView};

/// Values of an intersection's sums.
const SUMS: usize = 3;

/// The kernels of this file.
pub(super) fn kernels() -> Vec<Kernel> {
    let blending = Team::all().map(|team| Kernel::new(SIGNIFICANCE).blending(team));
    blending.chain([SIGNIFICANCE_GATHER.into()]).collect()
}

fn scores(inputs: SplatInputs<CubeBackend>, view: View) -> Result<CubeTensor, GpuError> {
    let gpu = Gpu::of(&inputs.means)?;
    let Begun { frame, intersections: lists, .. } = begin(&gpu, inputs, SplatView { view, room: None })?;
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

/// Scores `[N, 3]` on a wgpu device; see [`SCORES`].
pub(crate) fn significance_on_gpu(inputs: SplatInputs<CubeBackend>, view: View) -> CubeTensor {
    scores(inputs, view).unwrap_or_else(|error| error.raise())
}
