//! A set of feature planes of your own: a tri-plane (xy, xz, yz) instead of a hexplane, and a small network whose
//! inputs are its features and the time. Trained with the rate in its loss, coded under the context model, decoded. No
//! file of Light4GS is edited.
//!
//! A field says which planes it has with a [`PlaneLayout`], and gives access to them with `planes` and `planes_mut`.
//! Noise, rate, regularizers, context model and file then work on these planes. Where a part of the context model needs
//! planes that do not exist, here those over time, the next part is used.

use burn::config::Config;
use burn::module::{Module, Param};
use burn::nn::{Linear, LinearConfig};
use burn::tensor::activation::leaky_relu;
use burn::tensor::{Device, Tensor};
use light4gs::codec::network::Operation;
use light4gs::codec::plane_layout::{PlaneAxes, PlaneLayout};
use light4gs::codec::{
    MotionArrays, MotionNetwork, MotionOutput, MotionSource, Network, PlaneCoding, decode, plane_distributions,
};
use light4gs::data::Scene;
use light4gs::model::{
    DeformationField, DynamicScene, FeaturePlanes, GaussianTensors, Latent, ModelError, PlaneEntropy, ScenePoints,
};
use light4gs::train::compression::PlaneModels;
use light4gs::train::dataset::load_options;
use light4gs::train::trainer::Trainer;
use light4gs_examples::{Outcome, first_and_last, linear_from_layer, linear_to_layer, tiny_config, tiny_scene};

/// Slope of the activation where it is negative.
const SLOPE: f32 = 0.1;

/// Configuration of a [`TriPlaneField`].
#[derive(Config, Debug)]
struct TriPlaneFieldConfig {
    /// Channels of each plane.
    #[config(default = 4)]
    channels: usize,
    /// Width of the hidden layer.
    #[config(default = 16)]
    width: usize,
}

impl TriPlaneFieldConfig {
    /// Three planes at two scales; no axis of time.
    fn layout() -> PlaneLayout {
        PlaneLayout::multiscale(&PlaneAxes::SPACE_ONLY, [16, 16, 16, 4], &[1, 2])
    }
}

/// The field: a network whose inputs are features of the places, and the time.
#[derive(Module, Debug)]
struct TriPlaneField {
    planes: FeaturePlanes,
    /// Features and time `[F + 1]` to `[W]`.
    hidden: Linear,
    /// `[W]` to `[3]`.
    output: Linear,
}

impl DeformationField for TriPlaneField {
    type Config = TriPlaneFieldConfig;

    const KINDS: &'static [&'static str] = &["tri-plane"];

    fn init(config: &TriPlaneFieldConfig, device: &Device) -> Self {
        let planes = FeaturePlanes::init(&TriPlaneFieldConfig::layout(), config.channels, device);
        let hidden = LinearConfig::new(planes.feature_size() + 1, config.width).init(device);
        let mut output = LinearConfig::new(config.width, 3).init(device);
        // Nothing moves at first.
        output.weight = Param::from_tensor(output.weight.val().zeros_like());
        output.bias = output.bias.map(|bias| Param::from_tensor(bias.val().zeros_like()));
        Self { planes, hidden, output }
    }

    fn deform(&self, canonical: GaussianTensors, points: ScenePoints<'_>, time: f32) -> GaussianTensors {
        let points = points.normalized();
        let [count, _] = points.dims();
        let time = Tensor::full([count, 1], time, &points.device());
        let known = Tensor::cat(vec![self.planes.tensors().query_space(points), time], 1);
        let offset = self.output.forward(leaky_relu(self.hidden.forward(known), SLOPE.into()));
        GaussianTensors { means: canonical.means.clone() + offset, ..canonical }
    }

    fn planes(&self) -> Option<&FeaturePlanes> {
        Some(&self.planes)
    }

    fn planes_mut(&mut self) -> Option<&mut FeaturePlanes> {
        Some(&mut self.planes)
    }

    fn to_arrays(&self) -> Result<MotionArrays, ModelError> {
        // The same as `deform`. `Features` are the products of the existing planes; the file has the planes in another
        // section.
        let (mut network, [features, time]) = Network::new([self.planes.feature_size() as u32, 1]);
        let known = network.node(Operation::Concatenate, &[features, time]);
        let hidden = network.layer(known, linear_to_layer(&self.hidden));
        let hidden = network.leaky_relu(hidden, SLOPE);
        let position = network.layer(hidden, linear_to_layer(&self.output));
        network.output(position);
        let sources = vec![MotionSource::Features, MotionSource::Time];
        let network = MotionNetwork { network, sources, outputs: vec![MotionOutput::Position] };
        Ok(MotionArrays { kind: self.kind().to_owned(), network: Some(network), tensors: Vec::new() })
    }

    fn from_arrays(arrays: &MotionArrays, planes: Option<FeaturePlanes>, device: &Device) -> Result<Self, ModelError> {
        let wrong = |what: &str| ModelError::Motion(format!("{what}, expected that of a tri-plane field"));
        let planes = planes.ok_or_else(|| ModelError::Planes("none, but a tri-plane field needs some".into()))?;
        let motion = arrays.network.as_ref().ok_or_else(|| wrong("no network"))?;
        let layers: Vec<_> = motion.network.layers().collect();
        let &[hidden, output] = layers.as_slice() else { return Err(wrong("another network")) };
        let (hidden, output) = (linear_from_layer(hidden, device), linear_from_layer(output, device));
        let field = Self { planes, hidden, output };
        // A file may come from anybody: the structure is compared before the field is used.
        let ours = field.to_arrays()?.network.expect("this kind has a network");
        if !ours.network.has_structure_of(&motion.network) || ours.sources != motion.sources {
            return Err(wrong("another network"));
        }
        Ok(field)
    }
}

pub(crate) fn main() -> Outcome {
    let folder = tempfile::tempdir()?;
    let mut config = tiny_config()?;
    config.compression.rate.lambda = 0.03;
    config.compression.rate.from = 10;
    let data = Scene::open(&tiny_scene(folder.path())?, &load_options(&config))?;

    // Trained: planes have noise, and their rate is in the loss.
    let field = TriPlaneFieldConfig::new();
    let mut trainer = Trainer::<TriPlaneField>::builder_with_field(config, data, field).build()?;
    let mut losses = Vec::new();
    while let Some(step) = trainer.step()? {
        losses.push(step.loss);
    }
    let (first, last) = first_and_last(&losses);
    println!("loss: {first:.3} in the first tenth of the run, {last:.3} in the last");
    assert!(last < 0.7 * first);
    let moved = trainer.scene().at(0.9).means - trainer.scene().at(0.1).means;
    assert!(moved.abs().max().into_scalar::<f32>() > 1e-3, "nothing moves");

    // Coded: the file is as large as the model expects, and contains the list of its planes.
    let coded = trainer.encode()?;
    let (record, maps) = coded.coding.expect("the profile is a coded one");
    let [planes, ..] = record.parts();
    println!("planes: {:.0} bits expected, {:.0} in the file", planes.expected, planes.coded);
    assert!((planes.expected / planes.coded - 1.0).abs() < 0.05);
    let names: Vec<String> = coded.info.planes.planes().iter().map(|plane| plane.name()).collect();
    assert_eq!(names, ["0.xy", "0.xz", "0.yz", "1.xy", "1.xz", "1.yz"]);
    assert!(maps.iter().map(|map| &map.name).eq(&names), "a map of bits for each plane");

    // Decoded: the field is made from the file, and the codec moves the Gaussians as the field does.
    let arrays = decode(&coded.bytes)?;
    let device = Device::flex();
    let decoded = DynamicScene::<TriPlaneField>::from_arrays(&arrays, &device)?;
    assert_eq!(decoded.field.planes.to_arrays(), arrays.feature_planes);
    let ours: Vec<f32> = decoded.at(0.3).means.into_data().iter::<f32>().collect();
    let exact = arrays.positions_at(0.3)?.concat();
    let difference = ours.iter().zip(&exact).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    println!("largest difference of a position between Burn and the codec: {difference:e}");
    assert!(difference < 1e-4);

    // The context model gives the same values to both, plane by plane.
    let PlaneModels { context: mut model, quantization } =
        trainer.compression().cloned().and_then(|models| models.planes).expect("the rate is in the loss").valid();
    model.base_mut().update_quantiles();
    let steps = quantization.steps_without_gradient();
    let planes = decoded.field.planes.tensors();
    let symbols = |latent: Tensor<3>| latent.into_data().iter::<f32>().map(|symbol| symbol as i32).collect();
    let latents = model.latent_symbols(&planes, &steps).into_iter();
    let coding = PlaneCoding {
        model: model.to_arrays(planes.layout())?,
        steps: steps.to_groups(planes.layout()),
        latent_symbols: latents.map(|latent| latent.map_or_else(Vec::new, symbols)).collect(),
    };
    for (plane, name) in names.iter().enumerate() {
        let exact = plane_distributions(&arrays.feature_planes, &coding, plane)?;
        let ours = model.plane_parameters(&planes, &steps, &[plane], Latent::Rounded).remove(0);
        for (ours, exact) in [(ours.means(), exact.means), (ours.scales(), exact.scales)] {
            let ours: Vec<f32> = ours.into_data().iter::<f32>().collect();
            let worst = ours.iter().zip(&exact).map(|(a, b)| (a - b).abs() / b.abs().max(1.0)).fold(0.0, f32::max);
            assert!(worst < 1e-4, "plane {name}: Burn and the codec differ by {worst:e}");
        }
    }
    Ok(())
}
