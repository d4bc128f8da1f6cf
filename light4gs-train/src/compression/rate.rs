//! Noise in place of rounding, and the size of the file that it stands for (paper III-C, IV-B).

use burn::tensor::{Int, Tensor, TensorData};
use light4gs_model::{DynamicScene, Latent, PlaneSteps, ShEntropy, ShKnown};
use rand::Rng;
use rand::seq::index;

use super::Compression;

/// A scene's planes and spherical harmonics with the noise of quantisation, which both the picture and the rate see.
#[derive(Clone, Debug)]
pub struct NoisyScene {
    /// `[C, H, W]`, scale-major.
    pub planes: Vec<Tensor<3>>,
    /// Of the planes; with a gradient where they are learned. None if the planes are settled: as the file will have them,
    /// without noise, without gradient and without a part in the rate.
    pub steps: Option<PlaneSteps>,
    /// `[N, K, 3]`; without noise as long as the spherical harmonics have no part in the rate.
    pub sh_rest: Tensor<3>,
}

/// Estimated bits of a file's planes and spherical harmonics.
#[derive(Clone, Debug)]
pub struct Rate {
    /// `[1]`: of all planes, hyperpriors included; 0 for settled planes.
    pub planes: Tensor<1>,
    /// Values of all planes.
    pub plane_symbols: usize,
    /// `[1]`: of all spherical harmonics beyond degree 0, where they have a part in the rate.
    pub sh: Option<Tensor<1>>,
    /// Values of those.
    pub sh_symbols: usize,
}

impl Rate {
    /// `[1]`: megabytes (10^6) in the file.
    pub fn megabytes(self) -> Tensor<1> {
        let bits = match self.sh {
            Some(sh) => self.planes + sh,
            None => self.planes,
        };
        bits / 8e6
    }

    /// `[1]`: bits per plane symbol plus bits per symbol of the spherical harmonics, as the paper weighs them.
    pub fn bits_per_symbol(self) -> Tensor<1> {
        let planes = self.planes / self.plane_symbols as f64;
        match self.sh {
            Some(sh) if self.sh_symbols > 0 => planes + sh / self.sh_symbols as f64,
            _ => planes,
        }
    }
}

impl Compression {
    /// The scene with uniform noise as wide as the steps. `learn_steps` lets gradients through to the planes' steps;
    /// `with_sh` puts noise on the spherical harmonics too.
    pub fn noisy(&self, scene: &DynamicScene, learn_steps: bool, with_sh: bool) -> NoisyScene {
        let quantization = &self.quantization;
        let steps = if learn_steps { quantization.steps() } else { quantization.steps_without_gradient() };
        let planes = steps.add_noise(&scene.hexplane.tensors());
        NoisyScene { planes, steps: Some(steps), sh_rest: self.noisy_sh(scene, with_sh) }
    }

    /// The same for a scene whose planes are settled.
    pub fn noisy_beside_settled_planes(&self, scene: &DynamicScene, with_sh: bool) -> NoisyScene {
        let planes = scene.hexplane.tensors().into_iter().map(|plane| plane.set_require_grad(false)).collect();
        NoisyScene { planes, steps: None, sh_rest: self.noisy_sh(scene, with_sh) }
    }

    fn noisy_sh(&self, scene: &DynamicScene, with_sh: bool) -> Tensor<3> {
        let sh_rest = scene.gaussians.sh_rest.val();
        match &self.sh {
            Some(sh) if with_sh => sh.add_noise(sh_rest),
            _ => sh_rest,
        }
    }

    /// Estimates the rate on a random share of the planes and of the Gaussians. Unbiased: over many draws the mean is
    /// the rate of everything.
    pub fn rate(
        &self,
        noisy: &NoisyScene,
        scene: &DynamicScene,
        fraction: f64,
        with_sh: bool,
        generator: &mut impl Rng,
    ) -> Rate {
        let planes = &noisy.planes;
        let plane_bits = noisy.steps.as_ref().map(|steps| {
            let chosen = sample(generator, planes.len(), fraction);
            let share = planes.len() as f64 / chosen.len() as f64;
            let bits = self.context.rate(planes, steps, &chosen, Latent::Noise);
            let bits = bits.into_iter().map(|rate| rate.total()).reduce(|sum, plane| sum + plane);
            bits.expect("at least one plane is chosen") * share
        });
        let plane_bits = plane_bits.unwrap_or_else(|| Tensor::zeros([1], &noisy.sh_rest.device()));

        let [count, coefficients, colors] = noisy.sh_rest.dims();
        let sh = self.sh.as_ref().filter(|_| with_sh && count > 0).map(|sh| {
            let chosen = sample(generator, count, fraction);
            let share = count as f64 / chosen.len() as f64;
            let rows: Vec<i64> = chosen.iter().map(|row| *row as i64).collect();
            let rows = Tensor::<1, Int>::from_data(TensorData::new(rows, [chosen.len()]), &noisy.sh_rest.device());
            let known = match sh.tables() {
                // Tables look at nothing, and what is not computed does not stay on the tape.
                Some(_) => ShKnown::nothing(&rows.device()),
                None => known(scene, planes, Some(rows.clone())),
            };
            sh.bits(noisy.sh_rest.clone().select(0, rows), &known).sum() * share
        });
        let plane_symbols = planes.iter().map(|plane| plane.dims().iter().product::<usize>()).sum();
        Rate { planes: plane_bits, plane_symbols, sh, sh_symbols: count * coefficients * colors }
    }
}

/// What a decoder knows of the Gaussians, or of some rows of them, before it comes to their spherical harmonics.
pub(super) fn known(scene: &DynamicScene, planes: &[Tensor<3>], rows: Option<Tensor<1, Int>>) -> ShKnown {
    let (mut sh_dc, mut means) = (scene.gaussians.sh_dc.val(), scene.gaussians.means.val());
    if let Some(rows) = rows {
        sh_dc = sh_dc.select(0, rows.clone());
        means = means.select(0, rows);
    }
    ShKnown { sh_dc, positions: scene.frame.normalize(means), planes: planes.to_vec() }
}

/// A random share of `0..count` without repetition, at least one, in rising order.
fn sample(generator: &mut impl Rng, count: usize, fraction: f64) -> Vec<usize> {
    let amount = ((count as f64 * fraction).round() as usize).clamp(1, count);
    let mut chosen = index::sample(generator, count, amount).into_vec();
    chosen.sort_unstable();
    chosen
}
