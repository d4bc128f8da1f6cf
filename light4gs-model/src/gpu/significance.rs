//! The sums behind significance pruning on a GPU: the stages of splatting without colour.

use burn::tensor::Shape;
use burn_cubecl::CubeBackend;
use burn_cubecl::tensor::CubeTensor;

use super::context::{Gpu, first_words};
use super::error::GpuError;
use super::kernel::Launch;
use super::splat::{Begun, begin};
use super::stages::{SIGNIFICANCE, SIGNIFICANCE_GATHER};
use crate::cpu::project::View;
use crate::cpu::significance::SCORES;
use crate::ops::splat::SplatInputs;

/// Values of an intersection's sums.
const SUMS: usize = 3;

fn scores(inputs: SplatInputs<CubeBackend>, view: View) -> Result<CubeTensor, GpuError> {
    let gpu = Gpu::of(&inputs.means)?;
    let Begun { frame, intersections: lists, .. } = begin(&gpu, inputs, view)?;
    let sums = gpu.allocate("sums of intersections", SUMS * lists.count)?;
    let parts = frame.parts(lists.count);
    let carried = gpu.allocate("pixels between parts", if parts > 1 { frame.pixels() } else { 0 })?;
    for part in 0..parts {
        frame
            .team
            .launch(&gpu, SIGNIFICANCE)
            .reads(&lists.starts)
            .reads(&lists.order)
            .reads(&lists.gaussians)
            .reads(&lists.splats)
            .updates_if(part > 0, &sums)
            .updates_if(part > 0, &carried)
            .uniform(&frame.uniform(part, parts))
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

/// Scores `[N, 4]` on a wgpu device; see [`SCORES`].
pub(crate) fn significance_on_gpu(inputs: SplatInputs<CubeBackend>, view: View) -> CubeTensor {
    scores(inputs, view).unwrap_or_else(|error| error.raise())
}
