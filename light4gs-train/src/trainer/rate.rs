//! Quantization noise and the rate in a training step (paper III-C to III-E, IV-B).

use std::collections::HashMap;

use burn::module::{Module, Param, ParamId};
use burn::tensor::Tensor;
use light4gs_model::attributes::attribute_of_path;
use light4gs_model::ops::noise_gradient::{NoisyValues, noise_gradient};
use light4gs_model::parameters::{ParameterVisitor, visit_parameters};
use light4gs_model::{AttributeEntropy, CodedAttribute, DeformationField, DynamicScene, GaussianPlaces};
use rand::Rng;

use super::Trainer;
use super::background::Pending;
use crate::compression::{BITS_A_MEGABYTE, Compression, EntropyModels, NoisyScene, freeze_planes};
use crate::config::{Config, RateWeighting};
use crate::error::TrainError;
use crate::optimization::gradients::GradientSums;
use crate::randomness::{Purpose, generator, seed_device};
use crate::stage::Stage;

/// The rate of a step, differentiated.
pub(super) struct RateTerm {
    /// Numbers whose sum is the weighted rate.
    value: Tensor<1>,
    /// With respect to the noisy scene's parameters and those of the entropy models.
    gradients: GradientSums,
    /// With respect to the steps, `[S]`, without the part through the noise.
    steps: Option<Tensor<1>>,
}

impl<F: DeformationField, E: EntropyModels> Trainer<F, E> {
    /// The scene roughly as it will be decoded; `None` before `compression.rate.from`.
    pub(super) fn quantization_noise(
        &mut self,
        stage: Stage,
        iteration: usize,
    ) -> Result<Option<NoisyScene<F>>, TrainError> {
        let Config { seed, compression: config, .. } = &self.config;
        let from = config.rate.from.max(1);
        if stage == Stage::Coarse || iteration < from {
            return Ok(None);
        }
        let with_gaussians = self.gaussian_rate_is_active(iteration);
        let first_with_gaussians = with_gaussians && !self.gaussian_rate_is_active(iteration - 1);
        let frozen = self.planes_are_frozen(stage, iteration);
        let Some(compression) = self.state.compression.as_mut() else { return Ok(None) };
        let scene = &mut self.state.scene;
        if iteration == from {
            compression.start_from(scene.planes());
        }
        if first_with_gaussians {
            compression.start_attributes_from(&scene.gaussians);
        }
        if frozen && iteration == config.rate.planes_until + 1 {
            let frozen = freeze_planes(scene, compression, config, &self.device)?;
            if let (Some(planes), Some(frozen)) = (scene.planes_mut(), frozen) {
                *planes = frozen;
            }
        }
        seed_device(&self.device, *seed, Purpose::Rate, stage, iteration);
        let noise_seed = generator(*seed, Purpose::Noise, stage, iteration).random();
        let learn_steps = config.steps.adaptive && iteration >= config.steps.adaptive_from;
        Ok(Some(match frozen {
            true => compression.noisy_beside_frozen_planes(scene, with_gaussians, noise_seed),
            false => compression.noisy(scene, learn_steps, with_gaussians, noise_seed),
        }))
    }

    /// Whether the planes are frozen: they have the values that the file will have, and neither they nor their entropy
    /// models change any more.
    pub(super) fn planes_are_frozen(&self, stage: Stage, iteration: usize) -> bool {
        let until = self.config.compression.rate.planes_until;
        stage == Stage::Fine && until > 0 && iteration > until && self.state.compression.is_some()
    }

    /// Whether the rate includes the attributes of the Gaussians, as it does after the end of densification.
    pub(super) fn gaussian_rate_is_active(&self, iteration: usize) -> bool {
        let from = self.config.compression.rate.from.max(1);
        iteration >= from && self.density.is_over(Stage::Fine, iteration - 1)
    }

    /// Begins to read the noisy positions; `None` if the rate is not due, or does not include the Gaussians.
    pub(super) fn begin_places(&self, noisy: &NoisyScene<F>, iteration: usize) -> Option<Pending<GaussianPlaces>> {
        let due = iteration.is_multiple_of(self.config.compression.rate.interval);
        let attributes = self.state.compression.as_ref()?.attributes.as_ref()?;
        let gaussians = &noisy.scene.gaussians;
        (due && self.gaussian_rate_is_active(iteration) && !gaussians.is_empty()).then(|| {
            let (attributes, means) = (attributes.clone(), gaussians.means.val());
            self.background.begin(move || attributes.places(means))
        })
    }

    /// The rate with its gradients; `None` in an iteration without. It needs no view.
    pub(super) fn rate(
        &self,
        noisy: &NoisyScene<F>,
        places: Option<Pending<GaussianPlaces>>,
        iteration: usize,
    ) -> Option<RateTerm> {
        let config = &self.config.compression.rate;
        let with_gaussians = self.gaussian_rate_is_active(iteration);
        let compression = self.state.compression.as_ref()?;
        // With frozen planes, or none, and without the Gaussians there is no rate: constants have no gradient.
        let models_gaussians = compression.sh.is_some() || compression.attributes.is_some();
        let anything = noisy.steps.is_some() || (with_gaussians && models_gaussians);
        if !anything || !iteration.is_multiple_of(config.interval) {
            return None;
        }
        let mut generator = generator(self.config.seed, Purpose::Rate, Stage::Fine, iteration);
        // Seeded here, so that a step that is computed again draws the same.
        seed_device(&self.device, self.config.seed, Purpose::Latents, Stage::Fine, iteration);
        let apart = (!config.planes || !config.sh).then(|| noisy.with_detached(!config.planes, !config.sh));
        let (noisy_or_apart, places) = (apart.as_ref().unwrap_or(noisy), places.map(Pending::wait));
        // Computed once in `interval` iterations and multiplied by that number, so that lambda does not depend on the interval.
        let interval = config.interval as f64;
        let rate_weight = self.state.rate_weight;
        let attribute_weight =
            rate_weight as f32 * (config.attribute_lambda * interval) as f32 * (1.0 / BITS_A_MEGABYTE as f32);
        let rate =
            compression.rate(noisy_or_apart, config.fraction, with_gaussians, places, attribute_weight, &mut generator);
        let attributes = rate.attributes.clone();
        let modeled = rate.weighted(|part| {
            let weight = match config.weighting {
                RateWeighting::PerSymbol => config.lambda / part.symbols().max(1) as f64,
                RateWeighting::Megabytes => config.lambda * interval / BITS_A_MEGABYTE,
            };
            weight * rate_weight
        });
        let term = match (modeled, attributes) {
            (Some(modeled), Some(attributes)) => modeled + attributes.sum(),
            (modeled, attributes) => modeled.or(attributes)?,
        };
        let value = term.clone().inner();
        let mut tape = term.backward();
        let steps = noisy.learned_steps().and_then(|steps| steps.steps().grad(&tape));
        let mut gradients = GradientSums::default();
        gradients.add_module(&noisy.scene, &mut tape);
        gradients.add_module(compression, &mut tape);
        self.profile.lap("rate");
        Some(RateTerm { value, gradients, steps })
    }

    /// Adds the gradients of the rate, where it is due, and the gradients of the steps through the noise. Returns the
    /// weighted rate, as numbers to be added up. `gradients` are those of the views.
    pub(super) fn add_rate(
        &self,
        noisy: &NoisyScene<F>,
        iteration: usize,
        rate: Option<RateTerm>,
        gradients: &mut GradientSums,
    ) -> Option<Tensor<1>> {
        let with_gaussians = self.gaussian_rate_is_active(iteration);
        let compression = self.state.compression.as_ref()?;
        let (value, by_steps) = match rate {
            Some(rate) => {
                gradients.add(rate.gradients);
                (Some(rate.value), rate.steps)
            }
            None => (None, None),
        };
        if let Some((log_steps, gradient)) =
            gradient_of_steps(noisy, &self.state.scene, compression, by_steps, gradients)
        {
            gradients.add_one(log_steps, gradient);
        }
        if let Some(attributes) = compression.attributes.as_ref().filter(|_| with_gaussians)
            && let Some(gradient) = gradient_through_noise(noisy, &self.state.scene, attributes, gradients)
        {
            gradients.add_one(attributes.log_steps.id, gradient);
        }
        self.profile.lap("rate");
        value
    }
}

/// The logarithms of the planes' steps and their whole gradient, `[S]`: that of the rate by the steps (`direct`), and that through the
/// noisy planes. `gradients` are those of views and rate. `None` if no step is learned.
fn gradient_of_steps<F: DeformationField, C: Module, S: Module>(
    noisy: &NoisyScene<F>,
    scene: &DynamicScene<F>,
    compression: &Compression<C, S>,
    direct: Option<Tensor<1>>,
    gradients: &mut GradientSums,
) -> Option<(ParamId, Tensor<1>)> {
    let steps = noisy.learned_steps()?;
    let log_steps = compression.planes.as_ref()?.quantization.log_steps.id;
    let planes = &scene.planes()?.planes;
    let identities: Vec<ParamId> = planes.iter().map(|plane| plane.id).collect();
    let found = gradients.get(&identities);
    let flat = |plane: &Param<Tensor<3>>| plane.val().inner().reshape([-1]);
    let values = planes.iter().zip(&noisy.scene.planes()?.planes).zip(found).map(|((exact, noisy), gradient)| {
        Some(NoisyValues { noisy: flat(noisy), exact: flat(exact), gradient: gradient? })
    });
    let through_noise = noise_gradient(values.collect()).map(|of_planes| steps.sums_over_planes(of_planes));
    let direct = direct.map(|gradient| gradient * steps.steps().inner());
    let gradient = [direct, through_noise].into_iter().flatten().reduce(|sum, part| sum + part)?;
    Some((log_steps, gradient))
}

/// The gradient of the logarithms of the attributes' steps through the noise, `[A]`. `gradients` are those of views and rate.
/// `None` if no noisy value has a gradient.
fn gradient_through_noise<F: DeformationField>(
    noisy: &NoisyScene<F>,
    scene: &DynamicScene<F>,
    attributes: &AttributeEntropy,
    gradients: &mut GradientSums,
) -> Option<Tensor<1>> {
    #[derive(Default)]
    struct Values(HashMap<String, (ParamId, Tensor<1>)>);
    impl ParameterVisitor for Values {
        fn visit<const D: usize>(&mut self, path: &str, parameter: &Param<Tensor<D>>) {
            let Some(name) = attribute_of_path(path) else { return };
            self.0.insert(name.to_owned(), (parameter.id, parameter.val().inner().reshape([-1])));
        }
    }
    let (mut exact, mut with_noise) = (Values::default(), Values::default());
    visit_parameters(scene, &mut exact);
    visit_parameters(&noisy.scene, &mut with_noise);
    let found = attributes.attributes().iter().map(|CodedAttribute { name, .. }| {
        let (id, exact) = exact.0.remove(name)?;
        let (_, noisy) = with_noise.0.remove(name)?;
        Some((id, noisy, exact))
    });
    let found: Vec<_> = found.collect();
    let identities: Vec<ParamId> = found.iter().flatten().map(|(id, ..)| *id).collect();
    let mut gradients = gradients.get(&identities).into_iter();
    let values = found.into_iter().map(|values| {
        let ((_, noisy, exact), gradient) = (values?, gradients.next().flatten());
        Some(NoisyValues { noisy, exact, gradient: gradient? })
    });
    noise_gradient(values.collect())
}

#[cfg(test)]
mod tests {
    use burn::tensor::Device;
    use light4gs_data::PointCloud;

    use super::*;
    use crate::compression::ConfiguredModels;
    use crate::config::Config;

    /// The steps of the attributes get the derivative by the width of the same noise.
    #[test]
    fn the_noise_passes_gradients_on_to_the_steps_of_attributes() {
        let device = Device::flex().autodiff();
        let mut config = Config::default();
        config.model.sh_degree = 1;
        (config.compression.rate.lambda, config.compression.rate.attributes) = (0.01, true);
        let cloud = PointCloud { positions: vec![[0.0; 3], [1.0, 0.5, 2.0]], colors: vec![[0.5; 3]; 2] };
        let scene = config.model.build().init(&cloud, &device);
        let mut compression = Compression::of_run(&ConfiguredModels, &config, &scene, &device).unwrap().unwrap();
        assert!(compression.learned_attributes().is_none());
        compression.start_attributes_from(&scene.gaussians);
        let noisy = compression.noisy(&scene, false, true, 0);
        // A different derivative for every number, and the same as a sum over noise of any width.
        let sum = |scene: &DynamicScene| {
            let gaussians = scene.gaussians.tensors();
            gaussians.means.sin().sum() + gaussians.quats.powi_scalar(3).sum() + gaussians.sh_rest.exp().sum()
        };
        let mut gradients = GradientSums::default();
        gradients.add_module(&noisy.scene, &mut sum(&noisy.scene).backward());
        let attributes = compression.learned_attributes().unwrap();
        let found = gradient_through_noise(&noisy, &scene, attributes, &mut gradients).unwrap();
        let found: Vec<f32> = found.into_data().iter().collect();

        let (exact, noise) = (scene.gaussians.tensors().inner(), noisy.scene.gaussians.tensors().inner());
        let wider = |exact: Tensor<2>, noisy: Tensor<2>, change: f64| exact.clone() + (noisy - exact) * change.exp();
        let value = |change: f64, of: &dyn Fn(f64) -> Tensor<1>| of(change).into_scalar::<f64>();
        let means = |change| wider(exact.means.clone(), noise.means.clone(), change).sin().sum();
        let quats = |change| wider(exact.quats.clone(), noise.quats.clone(), change).powi_scalar(3).sum();
        for (name, of) in [("means", &means as &dyn Fn(f64) -> Tensor<1>), ("quats", &quats)] {
            let place = attributes.attributes().iter().position(|coded| coded.name == name).unwrap();
            let difference = (value(0.1, of) - value(-0.1, of)) / 0.2;
            let found = f64::from(found[place]);
            assert!((found - difference).abs() < 0.02 * difference.abs() + 1e-4, "{name}: {found}, {difference}");
            // The noise is another one each time, and may nearly cancel.
            assert!(found != 0.0, "{name}");
        }
    }

    /// With planes on a separate tape, the steps get the same gradients as on a common one.
    #[test]
    fn the_noise_passes_gradients_on_to_the_steps() {
        let device = Device::flex().autodiff();
        let mut config = Config::default();
        config.model.fields.hexplane.hexplane.channels = 2;
        config.model.fields.hexplane.hexplane.resolution = [8, 8, 8, 4];
        let cloud = PointCloud { positions: vec![[0.0; 3], [1.0, 0.5, 2.0]], colors: vec![[0.5; 3]; 2] };
        let scene = config.model.build().init(&cloud, &device);
        let compression = Compression::new(&ConfiguredModels, &config, scene.planes(), &device).unwrap();
        let noisy = compression.noisy(&scene, true, false, 0);
        // A term that depends on both planes and steps, different in each plane.
        let loss = |planes: &[Tensor<3>], steps: &dyn Fn(usize) -> Tensor<1>| {
            let terms = planes.iter().enumerate().map(|(i, plane)| {
                let divided = plane.clone() / steps(i).unsqueeze::<3>();
                (divided.sin() * (1.0 + i as f32)).sum()
            });
            terms.reduce(|sum, term| sum + term).unwrap()
        };
        let quantization = &compression.planes.as_ref().unwrap().quantization;
        let log_steps = quantization.log_steps.id;

        let leaves = noisy.steps.clone().unwrap();
        let mut tape = loss(&noisy.scene.planes().unwrap().tensors(), &|i| leaves.of(i)).backward();
        let direct = leaves.steps().grad(&tape);
        let mut apart = GradientSums::default();
        apart.add_module(&noisy.scene, &mut tape);
        let (found, gradient) = gradient_of_steps(&noisy, &scene, &compression, direct, &mut apart).unwrap();
        assert_eq!(found, log_steps);
        apart.add_one(found, gradient);

        let steps = quantization.steps();
        let noisy = noisy.scene.planes().unwrap().tensors();
        let planes = scene.planes().unwrap().tensors().map(|i, plane| {
            let step = steps.broadcast(i);
            let noise = (noisy[i].clone().inner() - plane.clone().inner()) / step.clone().inner();
            plane + Tensor::from_inner(noise) * step
        });
        let mut together = GradientSums::default();
        together.add_module(&compression, &mut loss(&planes, &|i| steps.of(i)).backward());

        let [apart, together] = [apart, together].map(|mut sums| sums.get(&[log_steps]).remove(0).unwrap().into_data());
        assert_eq!(together.num_elements(), 2);
        for (a, b) in apart.iter::<f32>().zip(together.iter::<f32>()) {
            assert!((a - b).abs() <= 1e-4 * b.abs().max(1.0), "{a} and {b}");
            assert!(b != 0.0);
        }
    }
}
