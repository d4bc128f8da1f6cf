//! The sums behind significance pruning on a GPU: the kernels of splatting without color.

use burn::tensor::Shape;
use burn_wgpu::CubeBackend;
use burn_wgpu::CubeTensor;
use light4gs_shaders::{SIGNIFICANCE, SIGNIFICANCE_GATHER};

use super::context::{Gpu, first_words};
use super::kernel::Launch;
use super::splat::{Begun, begin};
use crate::cpu::significance::SCORES;
use crate::gpu_error::GpuError;
use crate::kernels::splat::{SplatInputs, View};

/// Values of an intersection's sums.
const SUMS: usize = 3;

fn scores(inputs: SplatInputs<CubeBackend>, view: View) -> Result<CubeTensor, GpuError> {
    let gpu = Gpu::of(&inputs.means)?;
    let Begun { frame, intersections: lists, .. } = begin(&gpu, inputs, view)?;
    let sums = gpu.allocate("sums of intersections", SUMS * lists.count)?;
    let chunks = frame.chunks(lists.count);
    let carried = gpu.allocate("pixels between chunks", if chunks > 1 { frame.pixels() } else { 0 })?;
    for chunk in 0..chunks {
        frame
            .team
            .launch(&gpu, SIGNIFICANCE)
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

/// Scores `[N, 4]` on a wgpu device; see [`SCORES`].
pub(crate) fn significance_on_gpu(inputs: SplatInputs<CubeBackend>, view: View) -> CubeTensor {
    scores(inputs, view).unwrap_or_else(|error| error.raise())
}

#[cfg(test)]
mod tests {
    use burn::tensor::{Device, Tensor, TensorData};
    use glam::Vec3;
    use light4gs_data::Camera;

    use crate::scene::gaussians::GaussianTensors;
    use crate::significance::{PixelContribution, Significance};
    use crate::splatter::Splatter;

    const SIDE: u32 = 8;

    /// Faint dots, each in the middle of one pixel of an image that is one cell, no two at one depth: nothing hangs on
    /// the last bit.
    fn dots(count: usize, device: &Device) -> (GaussianTensors, Camera) {
        let camera = Camera::look_at(Vec3::new(0.3, -4.0, 0.5), Vec3::ZERO, Vec3::Z, 0.7, SIDE, SIDE);
        let place = |i: usize| {
            let pixel = i as u32 % (SIDE * SIDE);
            let across = ((pixel % SIDE) as f32 + 0.5 - camera.cx) / camera.fx;
            let down = ((pixel / SIDE) as f32 + 0.5 - camera.cy) / camera.fy;
            let depth = 2.0 + 1e-4 * i as f32;
            (camera.rotation.transpose() * (Vec3::new(across, down, 1.0) * depth - camera.translation)).to_array()
        };
        let means: Vec<f32> = (0..count).flat_map(place).collect();
        let quats = [1.0, 0.0, 0.0, 0.0].repeat(count);
        let gaussians = GaussianTensors {
            means: Tensor::from_data(TensorData::new(means, [count, 3]), device),
            quats: Tensor::from_data(TensorData::new(quats, [count, 4]), device),
            log_scales: Tensor::full([count, 3], -7.0, device),
            // An alpha of 0.0055: above 1/255 in its pixel, below it in the next.
            opacity_logits: Tensor::full([count, 1], -5.2, device),
            sh_dc: Tensor::zeros([count, 1, 3], device),
            sh_rest: Tensor::zeros([count, 15, 3], device),
            further: Vec::new(),
        };
        (gaussians, camera)
    }

    /// No Gaussian, one, and more in one cell than one launch takes.
    #[test]
    fn scores_are_those_of_the_cpu() {
        for count in [0, 1, 40_000] {
            let run = |device: Device| {
                let (gaussians, camera) = dots(count, &device);
                let mut significance = Significance::new(count);
                significance.add(&Splatter::new([0.0; 3], 0), gaussians, &camera);
                significance
            };
            let (found, expected) = (run(Device::wgpu(Default::default())), run(Device::flex()));
            assert_eq!(found.sums(PixelContribution::PixelCount), vec![1.0; count]);
            for score in [
                PixelContribution::PixelCount,
                PixelContribution::Opacity,
                PixelContribution::BlendingWeight,
                PixelContribution::TransmittanceOpacity,
            ] {
                for (i, (found, expected)) in found.sums(score).iter().zip(expected.sums(score)).enumerate() {
                    assert!(
                        (found - expected).abs() <= 1e-4 * expected,
                        "{score:?} of {i} in {count}: {found} against {expected}"
                    );
                }
            }
        }
    }
}
