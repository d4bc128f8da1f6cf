//! Noise in place of rounding, and the file size that the noisy values estimate (paper III-C, IV-B).

use burn::module::Param;
use burn::tensor::{Int, Tensor, TensorData};
use light4gs_model::parameters::on_a_new_tape;
use light4gs_model::{
    Attribute, AttributeMapper, BuiltInField, DeformationField, DynamicScene, FeaturePlanes, GaussianPlaces, Latent,
    PlaneEntropy, PlaneSteps, PlaneTensors, ShKnown,
};
use rand::Rng;
use rand::seq::index;

use super::{Compression, ShModel};

/// A scene with quantization noise, from which both the image and the rate are computed.
#[derive(Clone, Debug)]
pub struct NoisyScene<F: DeformationField = BuiltInField> {
    /// Its parameters begin a new tape. Gradients with respect to its planes and spherical harmonics are those of the
    /// scene's, since noise is only added to them; those of the steps
    /// lack the part through the noise.
    pub scene: DynamicScene<F>,
    /// Steps of the planes; they begin a new tape where they are learned. `None` if there are no planes, or if they are
    /// frozen: then they have the file's values, without noise, without gradient, and are not in the rate.
    pub steps: Option<PlaneSteps>,
}

/// Bits of 10^6 bytes.
pub(crate) const BITS_A_MEGABYTE: f64 = 8e6;

/// Estimated bits of a part of a file, from a share of its numbers.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// `[1]`: of the share.
    bits: Tensor<1>,
    /// All numbers, divided by those of the share.
    scale: f64,
    /// All numbers.
    symbols: usize,
}

impl Estimate {
    /// `[1]`: of all numbers.
    pub fn bits(self) -> Tensor<1> {
        self.weighted(1.0)
    }

    /// All numbers.
    pub fn symbols(&self) -> usize {
        self.symbols
    }

    /// `[1]`: the bits of all numbers, times a weight. The factors are multiplied first: on a GPU each is a launch.
    pub fn weighted(self, weight: f64) -> Tensor<1> {
        self.bits * (self.scale * weight)
    }
}

/// Estimated bits of a file's planes, spherical harmonics and other attributes.
#[derive(Clone, Debug)]
pub struct Rate {
    /// Of all planes, latents included, if there are planes that are not frozen.
    pub planes: Option<Estimate>,
    /// Of all spherical harmonics beyond degree 0, if they have a model of their own and are in the rate.
    pub sh: Option<Estimate>,
    /// `[1 + C]`: of the other attributes of the Gaussians, if they are in the rate: of the positions, then of each number, times the
    /// weight that they were asked for with.
    pub attributes: Option<Tensor<1>>,
}

impl Rate {
    /// `[1]`: the bits of planes and spherical harmonics, each times its weight; `None` if neither is in the rate.
    pub fn weighted(self, weight: impl Fn(&Estimate) -> f64) -> Option<Tensor<1>> {
        let parts = [self.planes, self.sh].into_iter().flatten();
        let weighted = parts.map(|part| {
            let weight = weight(&part);
            part.weighted(weight)
        });
        weighted.reduce(|sum, part| sum + part)
    }

    /// `[1]`: megabytes (10^6) of planes and spherical harmonics in the file; `None` if neither is in the rate.
    pub fn megabytes(self) -> Option<Tensor<1>> {
        self.weighted(|_| 1.0 / BITS_A_MEGABYTE)
    }
}

impl<C: PlaneEntropy, S: ShModel> Compression<C, S> {
    /// The scene with uniform noise as wide as the steps. With `learn_steps` the steps get gradients; with
    /// `with_gaussians` the Gaussians have noise too, in the attributes that have an entropy model. The noise is from
    /// `seed`; that of harmonics with a model of their own is from the device's generator.
    pub fn noisy<F: DeformationField>(
        &self,
        scene: &DynamicScene<F>,
        learn_steps: bool,
        with_gaussians: bool,
        seed: u64,
    ) -> NoisyScene<F> {
        let mut noisy = scene.clone();
        let steps = match (&self.planes, noisy.planes_mut()) {
            (Some(models), Some(planes)) => {
                let steps = models.quantization.steps_without_gradient();
                let noisy = steps.add_noise(&planes.tensors(), seed);
                for (parameter, plane) in planes.planes.iter_mut().zip(noisy.into_tensors()) {
                    replace(parameter, plane);
                }
                Some(steps.leaves(learn_steps))
            }
            _ => None,
        };
        NoisyScene { scene: self.with_noisy_gaussians(noisy, with_gaussians.then_some(seed)), steps }
    }

    /// The same for a scene with frozen planes.
    pub fn noisy_beside_frozen_planes<F: DeformationField>(
        &self,
        scene: &DynamicScene<F>,
        with_gaussians: bool,
        seed: u64,
    ) -> NoisyScene<F> {
        let mut scene = scene.clone();
        for plane in scene.planes_mut().into_iter().flat_map(|planes| &mut planes.planes) {
            *plane = plane.clone().set_require_grad(false);
        }
        NoisyScene { scene: self.with_noisy_gaussians(scene, with_gaussians.then_some(seed)), steps: None }
    }

    /// Noise from a seed, if there is one. Also begins a new tape.
    fn with_noisy_gaussians<F: DeformationField>(&self, scene: DynamicScene<F>, seed: Option<u64>) -> DynamicScene<F> {
        let mut scene = on_a_new_tape(scene);
        let Some(seed) = seed else { return scene };
        if let Some(attributes) = &self.attributes {
            let noisy = attributes.add_noise(scene.gaussians.tensors(), seed);
            scene.gaussians.set_tensors(noisy.map(&mut Leaves));
        }
        if let Some(sh) = &self.sh {
            let noisy = sh.add_noise(scene.gaussians.sh_rest.val().set_require_grad(false));
            replace(&mut scene.gaussians.sh_rest, noisy);
        }
        scene
    }

    /// Estimates the rate on a random share of the planes and of the Gaussians. It is unbiased: over many draws, the
    /// mean is the rate of everything. `places` are those of the noisy positions
    /// ([`light4gs_model::AttributeEntropy::places`]). With `None` they are read here, and the host waits for the GPU.
    /// A bit of the attributes counts `attribute_weight`.
    pub fn rate<F: DeformationField>(
        &self,
        noisy: &NoisyScene<F>,
        fraction: f64,
        with_gaussians: bool,
        places: Option<GaussianPlaces>,
        attribute_weight: f32,
        generator: &mut impl Rng,
    ) -> Rate {
        let scene = &noisy.scene;
        let planes = &plane_tensors(scene);
        let sh_rest = scene.gaussians.sh_rest.val();
        let plane_bits = self.planes.as_ref().zip(noisy.steps.as_ref()).map(|(models, steps)| {
            let chosen = sample(generator, planes.len(), fraction);
            let share = planes.len() as f64 / chosen.len() as f64;
            let bits = models.context.rate(planes, steps, &chosen, Latent::Noise);
            let bits = bits.into_iter().map(|rate| rate.total()).reduce(|sum, plane| sum + plane);
            let symbols = planes.iter().map(|plane| plane.dims().iter().product::<usize>()).sum();
            Estimate { bits: bits.expect("at least one plane is chosen"), scale: share, symbols }
        });

        let [count, coefficients, colors] = sh_rest.dims();
        let mut rows = |count: usize| -> Vec<u32> {
            sample(generator, count, fraction).into_iter().map(|row| row as u32).collect()
        };
        let sh = self.sh.as_ref().filter(|_| with_gaussians && count > 0).map(|sh| {
            let rows = rows(count);
            let share = count as f64 / rows.len() as f64;
            let (all, count) = (count, rows.len());
            let rows: Vec<i64> = rows.into_iter().map(i64::from).collect();
            let rows = Tensor::<1, Int>::from_data(TensorData::new(rows, [count]), &sh_rest.device());
            let known = match sh.tables() {
                // Models with tables need none of these; values that are not computed do not stay on the tape.
                Some(_) => ShKnown::nothing(&rows.device()),
                None => known(scene, planes, Some(rows.clone())),
            };
            let bits = sh.bits(sh_rest.clone().select(0, rows), &known).sum();
            Estimate { bits, scale: share, symbols: all * coefficients * colors }
        });
        let attributes = self.attributes.as_ref().filter(|_| with_gaussians && count > 0);
        let attributes = attributes.map(|model| {
            let gaussians = scene.gaussians.tensors();
            let places = places.unwrap_or_else(|| model.places(gaussians.means.clone()));
            model.bits(gaussians, &places, &rows(count), attribute_weight)
        });
        Rate { planes: plane_bits, sh, attributes }
    }
}

impl<F: DeformationField> NoisyScene<F> {
    /// The same scene with its planes, or its spherical harmonics, detached: the rate then trains only their entropy
    /// models.
    pub fn with_detached(&self, planes: bool, sh: bool) -> Self {
        let mut apart = self.clone();
        if planes {
            for plane in apart.scene.planes_mut().into_iter().flat_map(|planes| &mut planes.planes) {
                detach(plane);
            }
            apart.steps = apart.steps.map(|steps| steps.leaves(false));
        }
        if sh {
            detach(&mut apart.scene.gaussians.sh_rest);
            // Some models read these.
            detach(&mut apart.scene.gaussians.sh_dc);
            detach(&mut apart.scene.gaussians.means);
        }
        apart
    }

    /// The steps, if they are learned.
    pub fn learned_steps(&self) -> Option<&PlaneSteps> {
        self.steps.as_ref().filter(|steps| steps.steps().is_require_grad())
    }
}

/// Makes every attribute, which is on no tape, a leaf of a new one.
struct Leaves;

impl AttributeMapper for Leaves {
    fn map<const D: usize>(&mut self, _: &Attribute, values: Tensor<D>) -> Tensor<D> {
        values.require_grad()
    }
}

/// Makes the value of a parameter a leaf of a new tape.
fn replace<const D: usize>(parameter: &mut Param<Tensor<D>>, value: Tensor<D>) {
    *parameter = Param::initialized(parameter.id, value.require_grad());
}

/// Makes the value of a parameter a constant.
fn detach<const D: usize>(parameter: &mut Param<Tensor<D>>) {
    *parameter = Param::initialized(parameter.id, parameter.val().detach().set_require_grad(false));
}

/// The planes of a scene; empty if its field has none.
pub(super) fn plane_tensors<F: DeformationField>(scene: &DynamicScene<F>) -> PlaneTensors {
    scene.planes().map(FeaturePlanes::tensors).unwrap_or_default()
}

/// Values of the Gaussians, or of some rows of them, that are decoded before their spherical harmonics.
pub(super) fn known<F: DeformationField>(
    scene: &DynamicScene<F>,
    planes: &PlaneTensors,
    rows: Option<Tensor<1, Int>>,
) -> ShKnown {
    let (mut sh_dc, mut means) = (scene.gaussians.sh_dc.val(), scene.gaussians.means.val());
    if let Some(rows) = rows {
        sh_dc = sh_dc.select(0, rows.clone());
        means = means.select(0, rows);
    }
    ShKnown { sh_dc, positions: scene.coordinates.normalize(means), planes: planes.clone() }
}

/// A random share of `0..count` without repetition, at least one, in ascending order.
fn sample(generator: &mut impl Rng, count: usize, fraction: f64) -> Vec<usize> {
    let amount = ((count as f64 * fraction).round() as usize).clamp(1, count);
    let mut chosen = index::sample(generator, count, amount).into_vec();
    chosen.sort_unstable();
    chosen
}
