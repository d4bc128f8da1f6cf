//! The change of the images without a Gaussian: a score for pruning.

use burn::tensor::Tensor;
use light4gs_data::Camera;

use crate::ops::uniform_noise::{NoiseDraw, add_uniform_noise};
use crate::scene::gaussians::{ActivatedGaussians, GaussianTensors};
use crate::splatter::Splatter;

/// Squared changes of the images without each of `N` Gaussians, summed over pixels and color channels.
///
/// A color `C` is linear in the alpha of each Gaussian, and alpha is its opacity `o` times its falloff. So without the Gaussian,
/// the color changes by `o dC/do`, also where it hides others. (This is exact up to alpha's largest value, 0.99.) SpeeDe3DGS
/// (Tu et al. 2025) and Speedy-Splat (Hanson et al. 2024) sum squares of such a derivative in a backward pass of their own.
/// Here the pass of training does it: with a random sign for each color, the square of the opacity's gradient has the sum
/// of squares as its mean (Hutchinson 1990). Over a hundred views its standard deviation is a seventh of the sum.
///
/// ```
/// use burn::tensor::Device;
/// use light4gs_data::{Camera, PointCloud};
/// use light4gs_model::{GaussiansConfig, Sensitivity, Splatter};
///
/// let positions = vec![[0.0; 3], [0.0, -9.0, 0.0]]; // the second is behind the camera
/// let cloud = PointCloud { positions, colors: vec![[0.5; 3]; 2] };
/// let gaussians = GaussiansConfig::new().init(&cloud, &Device::flex());
/// let camera = Camera::look_at([0.0, -4.0, 0.0].into(), [0.0; 3].into(), [0.0, 0.0, 1.0].into(), 0.7, 40, 30);
/// let mut sensitivity = Sensitivity::new(2);
/// sensitivity.add(&Splatter::new([1.0; 3], 0), gaussians.tensors(), &camera, 7);
/// assert!(sensitivity.sums()[0] > 0.0);
/// assert_eq!(sensitivity.sums()[1], 0.0);
/// ```
#[derive(Clone, Debug)]
pub struct Sensitivity {
    sums: Vec<f64>,
}

impl Sensitivity {
    /// For `count` Gaussians, without any image yet.
    pub fn new(count: usize) -> Self {
        Self { sums: vec![0.0; count] }
    }

    /// Adds the image of raw attributes at a time, seen by a camera, with signs from a seed, another for each image.
    ///
    /// # Panics
    /// If the number of Gaussians has changed.
    pub fn add(&mut self, splatter: &Splatter, gaussians: GaussianTensors, camera: &Camera, seed: u64) {
        let gaussians = gaussians.inner().activated();
        let device = gaussians.means.device();
        let opacities = Tensor::from_inner(gaussians.opacities.clone()).require_grad();
        let on_tape = ActivatedGaussians {
            means: Tensor::from_inner(gaussians.means),
            quats: Tensor::from_inner(gaussians.quats),
            scales: Tensor::from_inner(gaussians.scales),
            opacities: opacities.clone(),
            sh_dc: Tensor::from_inner(gaussians.sh_dc),
            sh_rest: Tensor::from_inner(gaussians.sh_rest),
        };
        let image = splatter.render_activated(on_tape, camera, None).image;
        let zeros = vec![Tensor::zeros([image.shape().num_elements()], &device)];
        let [width, unit] = [1.0, 1.0].map(|one: f32| Tensor::from_floats([one], &device));
        let draw = NoiseDraw { width: 0, in_units: false, seed };
        let noise = add_uniform_noise(zeros, width, unit, vec![draw]).remove(0);
        let signs = noise.sign().reshape(image.dims());
        let gradients = (image * Tensor::from_inner(signs)).sum().backward();
        let Some(gradient) = opacities.grad(&gradients) else { return };
        let changes: Vec<f32> = (gradient * gaussians.opacities).into_data().iter().collect();
        assert_eq!(changes.len(), self.sums.len(), "the number of Gaussians has changed");
        // A Gaussian that is not finite is not drawn, and changes nothing.
        for (sum, change) in self.sums.iter_mut().zip(changes).filter(|(_, change)| change.is_finite()) {
            *sum += f64::from(change).powi(2);
        }
    }

    /// `[N]`: the sums over all images so far.
    pub fn sums(&self) -> &[f64] {
        &self.sums
    }
}
