//! The bits of the attributes of Gaussians, and their learned quantization steps (docs/design.md).
//!
//! The codec codes attributes adaptively, from neighbors and from earlier channels (`light4gs_codec::attributes`). Such
//! a coder has no gradient. Training replaces it by a linear prediction of each channel from the same values, and a
//! density of the residual: so the scene learns to be predictable. Positions take the bits of a set of points that are
//! uniform in their box; these have a gradient by the step only. An evaluation counts the bits that the codec writes
//! for positions: its splitting of counts (Devillers and Gandoin 2000) takes a fifth less, since points cluster.
//!
//! Every attribute has one learned step. A rate on all attributes with learned steps is after HAC++ (Chen et al. 2025),
//! which also modulates the steps of each Gaussian.

mod prediction;

use burn::module::{Module, Param};
use burn::tensor::{Device, Int, Tensor, TensorData, Transaction};
use light4gs_codec::attributes::{AttributeSteps, CodingOrder, typical_size};

use crate::entropy::gaussian_conditional::LIKELIHOOD_BOUND;
use crate::entropy::logistic_mixture::{LogisticMixture, LogisticMixtureConfig};
use crate::gpu_error::GpuError;
use crate::ops::attribute_bits::{AttributeBitsInputs, AttributeChannels, CountedBits, PositionSet, attribute_bits};
use crate::ops::neighborhoods::{Neighborhoods, neighborhoods};
use crate::ops::uniform_noise::{NoiseDraw, add_uniform_noise};
use crate::scene::attributes::{Attribute, MEANS};
use crate::scene::{AttributeMapper, GaussianTensors};
use crate::tape::{off_tape, untracked};
pub use prediction::ChannelPrediction;
use prediction::neighbors_of;

/// Logistics of a channel's density.
const COMPONENTS: usize = 3;
/// The spread of a channel that has the same value everywhere, in steps: its density must have some width.
const LEAST_SPREAD: f64 = 0.5;

/// An attribute whose bits are in the rate.
#[derive(Clone, Debug)]
pub struct CodedAttribute {
    /// Its name in the table of attributes.
    pub name: String,
    /// Numbers for each Gaussian.
    pub width: usize,
    /// Its step at the beginning; that of the positions in units of the typical Gaussian's size, as in
    /// [`AttributeSteps`].
    pub step: f32,
}

/// Densities and steps of the quantized attributes.
#[derive(Module, Debug)]
pub struct AttributeEntropy {
    /// The densities of the residuals: a channel for each number of each attribute except the positions, in the order of
    /// the attributes.
    pub mixture: LogisticMixture,
    /// The predictions.
    pub prediction: ChannelPrediction,
    /// `[A]`: natural logarithms of the steps. That of the positions is in units of `size`.
    pub log_steps: Param<Tensor<1>>,
    /// `[1]`, not trained: the typical size of the Gaussians that the model was started from, world units; 0 before.
    pub size: Param<Tensor<1>>,
    /// `[A]`, not trained: factors of the bits that the densities expect of each attribute.
    pub corrections: Param<Tensor<1>>,
    #[module(skip)]
    attributes: Vec<CodedAttribute>,
}

impl AttributeEntropy {
    /// An untrained model of these attributes.
    ///
    /// # Panics
    /// If a step is not positive.
    pub fn new(attributes: Vec<CodedAttribute>, device: &Device) -> Self {
        assert!(attributes.iter().all(|attribute| attribute.step > 0.0), "steps must be positive: {attributes:?}");
        let log_steps: Vec<f32> = attributes.iter().map(|attribute| attribute.step.ln()).collect();
        let widths: Vec<usize> =
            attributes.iter().filter(|attribute| has_density(&attribute.name)).map(|a| a.width).collect();
        Self {
            mixture: LogisticMixtureConfig::new(widths.iter().sum()).with_components(COMPONENTS).init(device),
            prediction: ChannelPrediction::new(&widths, device),
            log_steps: Param::from_tensor(Tensor::from_floats(log_steps.as_slice(), device)),
            size: Param::from_tensor(Tensor::zeros([1], device)),
            corrections: Param::from_tensor(Tensor::ones([attributes.len()], device)),
            attributes,
        }
    }

    /// Begins at the values of these Gaussians: the best predictions, densities as wide as the residuals, and positions in
    /// units of the Gaussians' size.
    pub fn start_from(&mut self, gaussians: &GaussianTensors) {
        let size = Tensor::from_floats([size_of(gaussians)], &off_tape(self.size.val()).device());
        replace(&mut self.size, size);
        let gaussians = gaussians.clone().inner();
        let rows: Vec<u32> = (0..gaussians.means.dims()[0] as u32).collect();
        let neighbors = neighbors_of(self.places(gaussians.means.clone()).order.as_ref(), &rows);
        let tables = self.tables(gaussians);
        let numbers: Vec<f32> = Tensor::cat(tables.clone(), 1).into_data().iter().collect();
        let weights = self.prediction.fit(&numbers, &neighbors);
        replace(&mut self.prediction.weights, off_tape(weights));
        let inputs = neighborhoods(tables, Neighborhoods::new(&rows, &neighbors, rows.len()));
        let values = off_tape(self.prediction.residuals(on_tape_of(&self.size.val(), inputs)));
        let least = self.by_channel(off_tape(self.log_steps.val()).exp()) * LEAST_SPREAD;
        // [C, 1].
        let means = values.clone().mean_dim(1);
        let spreads = (values - means.clone()).square().mean_dim(1).sqrt().max_pair(least);
        // A logistic's standard deviation is its scale times 1.81; the components are a factor of 2.5 apart.
        let scales: Vec<f32> = (0..COMPONENTS).map(|k| (0.55 * 2.5f32.powi(k as i32 - 1)).ln()).collect();
        let scales = Tensor::<1>::from_floats(scales.as_slice(), &means.device()).unsqueeze::<2>();
        replace(&mut self.mixture.means, means.repeat_dim(1, COMPONENTS));
        replace(&mut self.mixture.log_scales, spreads.log() + scales);
    }

    /// Whether [`AttributeEntropy::start_from`] has been called. Before that, there are no learned steps.
    pub fn is_started(&self) -> bool {
        self.size.val().into_scalar::<f32>() > 0.0
    }

    /// The Gaussians with uniform noise as wide as the steps, off the tape. The same seed gives the same noise.
    pub fn add_noise(&self, gaussians: GaussianTensors, seed: u64) -> GaussianTensors {
        /// The place of an attribute that gets noise.
        fn place<const D: usize>(model: &AttributeEntropy, name: &str, values: &Tensor<D>) -> Option<usize> {
            // With spherical harmonics of degree 0 alone, `sh_rest` is empty.
            model.place(name).filter(|_| values.shape().num_elements() > 0)
        }
        struct Take<'a> {
            model: &'a AttributeEntropy,
            seed: u64,
            values: Vec<Tensor<1>>,
            draws: Vec<NoiseDraw>,
        }
        impl AttributeMapper for Take<'_> {
            fn map<const D: usize>(&mut self, attribute: &Attribute, values: Tensor<D>) -> Tensor<D> {
                if let Some(width) = place(self.model, &attribute.name, &values) {
                    // Attributes are as far apart in the seeds as can be (the golden ratio in 64 bits).
                    let seed = self.seed.wrapping_add((width as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
                    // The step of positions counts in the Gaussians' size.
                    self.draws.push(NoiseDraw { width, in_units: !has_density(&attribute.name), seed });
                    self.values.push(off_tape(values.clone()).reshape([-1]));
                }
                values
            }
        }
        struct Replace<'a> {
            model: &'a AttributeEntropy,
            noisy: std::vec::IntoIter<Tensor<1>>,
        }
        impl AttributeMapper for Replace<'_> {
            fn map<const D: usize>(&mut self, attribute: &Attribute, values: Tensor<D>) -> Tensor<D> {
                if place(self.model, &attribute.name, &values).is_none() {
                    return untracked(values);
                }
                let noisy = self.noisy.next().expect("as many as were taken").reshape(values.dims());
                if values.device().is_autodiff() { Tensor::from_inner(noisy) } else { noisy }
            }
        }
        let mut taken = Take { model: self, seed, values: Vec::new(), draws: Vec::new() };
        let _ = gaussians.clone().map(&mut taken);
        let steps = off_tape(self.log_steps.val()).exp();
        let noisy = add_uniform_noise(taken.values, steps, off_tape(self.size.val()), taken.draws);
        gaussians.map(&mut Replace { model: self, noisy: noisy.into_iter() })
    }

    /// An estimate of the bits of all Gaussians, from some rows: of the positions, then of each number with a density, `[1 + C]`,
    /// all times `weight`. The densities see only these rows and their neighbors, and positions count as uniform in their box.
    /// `places` are those of the same Gaussians. Differentiable in the Gaussians, the steps, the predictions and the densities.
    ///
    /// A loss is the sum. On a GPU it is better not to make it: a backward pass from several numbers is that of their sum.
    pub fn bits(&self, gaussians: GaussianTensors, places: &GaussianPlaces, rows: &[u32], weight: f32) -> Tensor<1> {
        self.bits_of_parts(gaussians, places, Some(rows), weight)
    }

    /// Bits of each attribute, `[A]`, from all rows: of noisy Gaussians in training, of quantized ones in an evaluation.
    /// Differentiable in the same inputs as [`AttributeEntropy::bits`].
    pub fn bits_of_each(&self, gaussians: GaussianTensors) -> Tensor<1> {
        let places = self.places(gaussians.means.clone());
        let bits = self.bits_of_parts(gaussians, &places, None, 1.0);
        let mut first = 1;
        let each = self.attributes.iter().map(|attribute| match has_density(&attribute.name) {
            true => {
                first += attribute.width;
                bits.clone().narrow(0, first - attribute.width, attribute.width).sum()
            }
            false => bits.clone().narrow(0, 0, 1),
        });
        Tensor::cat(each.collect(), 0)
    }

    /// Bits of the positions, then of each number with a density, `[1 + C]`, times `weight`.
    fn bits_of_parts(
        &self,
        gaussians: GaussianTensors,
        places: &GaussianPlaces,
        rows: Option<&[u32]>,
        weight: f32,
    ) -> Tensor<1> {
        let count = gaussians.means.dims()[0];
        let GaussianPlaces { order, extent } = places;
        let positions = self.place(&MEANS.name).map(|place| PositionSet {
            place,
            extent: *extent,
            count,
            coded: order.as_ref().filter(|_| rows.is_none()).map(CodingOrder::position_bits),
        });
        let all: Vec<u32>;
        let rows = match rows {
            Some(rows) => rows,
            None => {
                all = (0..count as u32).collect();
                &all
            }
        };
        let chosen = Neighborhoods::new(rows, &neighbors_of(order.as_ref(), rows), count);
        let inputs = AttributeBitsInputs {
            numbers: neighborhoods(self.tables(gaussians), chosen),
            prediction: self.prediction.weights.val(),
            log_steps: self.log_steps.val(),
            weight_logits: self.mixture.weight_logits.val(),
            means: self.mixture.means.val(),
            log_scales: self.mixture.log_scales.val(),
            factors: untracked(self.corrections.val()),
        };
        let counted = CountedBits {
            attributes: self.channels(),
            positions,
            bound: LIKELIHOOD_BOUND,
            share: (count as f64 / rows.len().max(1) as f64) as f32,
            weight,
        };
        attribute_bits(inputs, counted)
    }

    /// The attributes that have densities, with their channels.
    fn channels(&self) -> Vec<AttributeChannels> {
        let mut first = 0;
        let attributes = self.attributes.iter().enumerate().filter(|(_, attribute)| has_density(&attribute.name));
        let channels = attributes.map(|(place, attribute)| {
            first += attribute.width;
            AttributeChannels { channels: first - attribute.width..first, place }
        });
        channels.collect()
    }

    /// Finds neighbors and box of positions `[N, 3]`, on the host, which waits for a GPU.
    ///
    /// # Panics
    /// With a [`GpuError`] if they cannot be read.
    pub fn places(&self, means: Tensor<2>) -> GaussianPlaces {
        // Together, since a GPU waits for each.
        let values = Transaction::default()
            .register(off_tape(means))
            .register(off_tape(self.log_steps.val()))
            .register(off_tape(self.size.val()));
        let read = GpuError::read("the positions for the rate", values).unwrap_or_else(|error| error.raise());
        let read: Vec<Vec<f32>> =
            read.into_iter().map(|data| data.try_into_vec().expect("parameters are float32")).collect();
        let [means, log_steps, size] = <[_; 3]>::try_from(read).expect("three tensors were registered");
        let (means, size) = (means.as_chunks().0, size[0]);
        let step = self.place(&MEANS.name).map_or(0.0, |place| log_steps[place].exp() * size);
        let extent = [0, 1, 2].map(|axis| {
            let along = means.iter().map(|mean: &[f32; 3]| mean[axis]);
            let [least, most] = [along.clone().fold(f32::INFINITY, f32::min), along.fold(f32::NEG_INFINITY, f32::max)];
            (most - least).max(0.0) / size
        });
        GaussianPlaces { order: CodingOrder::new(means, step).ok(), extent }
    }

    /// The steps as the codec takes them, for Gaussians with these logarithms of scales: those of `given` for attributes
    /// without a learned one.
    pub fn steps(&self, given: AttributeSteps, log_scales: &[[f32; 3]]) -> AttributeSteps {
        let steps = self.step_values();
        let learned = self.attributes.iter().zip(steps).filter(|(attribute, _)| given.of(&attribute.name).is_some());
        // The Gaussians' size has changed since the model was started.
        let change = self.size.val().into_scalar::<f32>() / typical_size(log_scales);
        let relative = |name: &str, step: f32| if has_density(name) { step } else { step * change };
        learned
            .fold(given.clone(), |all, (attribute, step)| all.with(&attribute.name, relative(&attribute.name, step)))
            .clamped()
    }

    /// Multiplies the expected bits of each attribute by its factor, in the order of [`AttributeEntropy::attributes`]. The
    /// factor of positions has no effect: they have no density.
    ///
    /// # Panics
    /// If there are not as many factors as attributes.
    pub fn correct(&mut self, factors: &[f32]) {
        assert_eq!(factors.len(), self.attributes.len(), "one factor for each attribute");
        let corrections = off_tape(self.corrections.val());
        let factors = Tensor::from_floats(factors, &corrections.device());
        replace(&mut self.corrections, corrections * factors);
    }

    /// All steps become coarser by a factor.
    pub fn scale_steps(&mut self, factor: f32) {
        let steps = off_tape(self.log_steps.val()) + factor.ln();
        replace(&mut self.log_steps, steps);
    }

    /// The learned step of an attribute by name, if it has one; that of the positions in units of `size`.
    pub fn step(&self, attribute: &str) -> Option<f32> {
        self.place(attribute).map(|place| self.step_values()[place])
    }

    /// The attributes, in the order of [`AttributeEntropy::log_steps`].
    pub fn attributes(&self) -> &[CodedAttribute] {
        &self.attributes
    }

    fn step_values(&self) -> Vec<f32> {
        self.log_steps.val().into_data().iter::<f32>().map(f32::exp).collect()
    }

    fn place(&self, attribute: &str) -> Option<usize> {
        self.attributes.iter().position(|coded| coded.name == attribute)
    }

    /// Numbers of the attributes, `[A]`, as numbers of their channels, `[C, 1]`.
    fn by_channel(&self, numbers: Tensor<1>) -> Tensor<2> {
        let places =
            self.channels().into_iter().flat_map(|AttributeChannels { channels, place }| channels.map(move |_| place));
        let places: Vec<i64> = places.map(|place| place as i64).collect();
        let places = Tensor::<1, Int>::from_data(TensorData::from(places.as_slice()), &numbers.device());
        numbers.select(0, places).unsqueeze_dim(1)
    }

    /// All numbers with a density: a table for each attribute, with N rows, and C columns together.
    fn tables(&self, gaussians: GaussianTensors) -> Vec<Tensor<2>> {
        struct Collect<'a>(&'a AttributeEntropy, Vec<Option<Tensor<2>>>);
        impl AttributeMapper for Collect<'_> {
            fn map<const D: usize>(&mut self, attribute: &Attribute, values: Tensor<D>) -> Tensor<D> {
                if let Some(place) = self.0.place(&attribute.name).filter(|_| has_density(&attribute.name)) {
                    let shape = [values.dims()[0], self.0.attributes[place].width];
                    self.1[place] = Some(values.clone().reshape(shape));
                }
                values
            }
        }
        let mut found = Collect(self, vec![None; self.attributes.len()]);
        let _ = gaussians.map(&mut found);
        found.1.into_iter().flatten().collect()
    }
}

/// The neighbors of Gaussians, and the size of their box, on which their bits depend.
#[derive(Clone, Debug)]
pub struct GaussianPlaces {
    /// The order in which the codec would code them; `None` if positions are not finite. The trainer reports these later.
    order: Option<CodingOrder>,
    /// Of their box, in units of the Gaussians' size.
    extent: [f32; 3],
}

/// Positions are coded as a set; every other number has a density.
fn has_density(attribute: &str) -> bool {
    attribute != MEANS.name
}

/// The typical size of Gaussians, as the codec computes it.
fn size_of(gaussians: &GaussianTensors) -> f32 {
    let numbers: Vec<f32> = gaussians.log_scales.clone().into_data().iter().collect();
    typical_size(numbers.as_chunks().0)
}

/// A new value for a parameter, which is trained as before.
fn replace<const D: usize>(parameter: &mut Param<Tensor<D>>, value: Tensor<D>) {
    let learns = parameter.is_require_grad();
    let value = if parameter.val().device().is_autodiff() { Tensor::from_inner(value) } else { value };
    *parameter = Param::initialized(parameter.id, value.set_require_grad(learns));
}

/// The same values on the tape's back end of another tensor, as constants.
fn on_tape_of<const D: usize, const E: usize>(other: &Tensor<E>, values: Tensor<D>) -> Tensor<D> {
    if other.device().is_autodiff() { Tensor::from_inner(values) } else { values }
}
