//! A deformation field in your own crate: trained, coded, decoded. No file of Light4GS is edited.
//!
//! The field has no planes. The whole scene shares a few trajectories over time, and each place mixes them: offset = W
//! · (where(x, y, z) × when(t)), a product of two small branches. The codec does not know this field. The field
//! describes its network as a list of layers, the stream contains the list, and any decoder can run it.

use burn::config::Config;
use burn::module::Module;
use burn::nn::{Linear, LinearConfig};
use burn::tensor::activation::leaky_relu;
use burn::tensor::{Device, Tensor};
use light4gs::codec::network::Operation;
use light4gs::codec::{MotionArrays, MotionNetwork, MotionOutput, MotionSource, Network, decode};
use light4gs::data::Scene;
use light4gs::model::{
    DeformationField, DynamicScene, FeaturePlanes, GaussianTensors, HexPlaneField, ModelError, ScenePoints,
};
use light4gs::train::dataset::load_options;
use light4gs::train::trainer::Trainer;
use light4gs_examples::{Outcome, first_and_last, linear_from_layer, linear_to_layer, tiny_config, tiny_scene};

/// Slope of the activations where they are negative.
const SLOPE: f32 = 0.25;

/// Configuration of a [`SharedTrajectories`].
#[derive(Config, Debug)]
struct SharedTrajectoriesConfig {
    /// Width of both branches.
    #[config(default = 32)]
    width: usize,
    /// Number of trajectories.
    #[config(default = 8)]
    trajectories: usize,
}

/// The field.
#[derive(Module, Debug)]
struct SharedTrajectories {
    /// `[3]` to `[W]` to `[K]`: how much each trajectory contributes at a place.
    place: [Linear; 2],
    /// `[1]` to `[W]` to `[K]`: how far along each trajectory a time is.
    pace: [Linear; 2],
    /// `[K]` to `[3]`: the directions of the trajectories.
    directions: Linear,
}

impl SharedTrajectories {
    /// Every layer, in the order in which [`DeformationField::to_arrays`] describes them.
    fn layers_mut(&mut self) -> [&mut Linear; 5] {
        let ([place_1, place_2], [pace_1, pace_2]) = (&mut self.place, &mut self.pace);
        [place_1, place_2, pace_1, pace_2, &mut self.directions]
    }
}

impl DeformationField for SharedTrajectories {
    type Config = SharedTrajectoriesConfig;

    /// The field's name in the stream. A program that cannot read the field's files names it in the error.
    const KINDS: &'static [&'static str] = &["shared-trajectories"];

    fn init(config: &SharedTrajectoriesConfig, device: &Device) -> Self {
        let linear = |inputs, outputs| LinearConfig::new(inputs, outputs).init(device);
        let &SharedTrajectoriesConfig { width, trajectories } = config;
        Self {
            place: [linear(3, width), linear(width, trajectories)],
            pace: [linear(1, width), linear(width, trajectories)],
            directions: linear(trajectories, 3),
        }
    }

    fn deform(&self, canonical: GaussianTensors, points: ScenePoints<'_>, time: f32) -> GaussianTensors {
        let branch =
            |[first, second]: &[Linear; 2], input| second.forward(leaky_relu(first.forward(input), SLOPE.into()));
        let points = points.normalized();
        let [count, _] = points.dims();
        let time = Tensor::full([count, 1], time, &points.device());
        let along = branch(&self.place, points) * branch(&self.pace, time);
        GaussianTensors { means: canonical.means.clone() + self.directions.forward(along), ..canonical }
    }

    fn to_arrays(&self) -> Result<MotionArrays, ModelError> {
        // The same as `deform`, as data. `Point` and `Time` are the codec's names for these inputs.
        let (mut network, [point, time]) = Network::new([3, 1]);
        let branch = |network: &mut Network, [first, second]: &[Linear; 2], input| {
            let hidden = network.layer(input, linear_to_layer(first));
            let hidden = network.leaky_relu(hidden, SLOPE);
            network.layer(hidden, linear_to_layer(second))
        };
        let place = branch(&mut network, &self.place, point);
        let pace = branch(&mut network, &self.pace, time);
        let along = network.node(Operation::Multiply, &[place, pace]);
        let offset = network.layer(along, linear_to_layer(&self.directions));
        network.output(offset);
        let sources = vec![MotionSource::Point, MotionSource::Time];
        let network = MotionNetwork { network, sources, outputs: vec![MotionOutput::Position] };
        Ok(MotionArrays { kind: self.kind().to_owned(), network: Some(network), tensors: Vec::new() })
    }

    fn from_arrays(arrays: &MotionArrays, _planes: Option<FeaturePlanes>, device: &Device) -> Result<Self, ModelError> {
        let wrong = |what: &str| ModelError::Motion(format!("{what}, expected those of shared trajectories"));
        let motion = arrays.network.as_ref().ok_or_else(|| wrong("no network"))?;
        let layers: Vec<_> = motion.network.layers().collect();
        let &[place, _, _, _, directions] = layers.as_slice() else { return Err(wrong("other layers")) };
        // A file may come from anybody. The field is made with the file's sizes, which the codec has checked and
        // bounded. It is compared with the file node by node before its numbers are taken.
        let (width, trajectories) = (place.outputs as usize, directions.inputs as usize);
        let mut field = Self::init(&SharedTrajectoriesConfig { width, trajectories }, device);
        let ours = field.to_arrays()?.network.expect("this kind has a network");
        if !ours.network.has_structure_of(&motion.network) || ours.sources != motion.sources {
            return Err(wrong("other nodes"));
        }
        for (linear, layer) in field.layers_mut().into_iter().zip(layers) {
            *linear = linear_from_layer(layer, device);
        }
        Ok(field)
    }
}

pub(crate) fn main() -> Outcome {
    let folder = tempfile::tempdir()?;
    let config = tiny_config()?;
    let data = Scene::open(&tiny_scene(folder.path())?, &load_options(&config))?;

    // Trained by the usual trainer, which finds the parameters by itself.
    let field = SharedTrajectoriesConfig::new();
    let mut trainer = Trainer::<SharedTrajectories>::builder_with_field(config, data, field).build()?;
    let mut losses = Vec::new();
    while let Some(step) = trainer.step()? {
        losses.push(step.loss);
    }
    let (first, last) = first_and_last(&losses);
    println!("loss: {first:.3} in the first tenth of the run, {last:.3} in the last");
    assert!(last < 0.7 * first);
    let moved = |scene: &DynamicScene<SharedTrajectories>| scene.at(0.9).means - scene.at(0.1).means;
    assert!(moved(trainer.scene()).abs().max().into_scalar::<f32>() > 1e-3, "nothing moves");

    // Coded: in the profile of the configuration, everything quantized and entropy coded.
    let bytes = trainer.encode()?.bytes;
    println!("{} bytes", bytes.len());

    // Decoded: the arrays name the kind of field, and the field is made from them.
    let arrays = decode(&bytes)?;
    assert_eq!(arrays.motion.kind, "shared-trajectories");
    let device = Device::flex();
    let decoded = DynamicScene::<SharedTrajectories>::from_arrays(&arrays, &device)?;
    assert_eq!(decoded.field.to_arrays()?, arrays.motion);

    // The codec runs the network too, without Burn and exactly: the two agree to float tolerance.
    let ours: Vec<f32> = decoded.at(0.3).means.into_data().iter::<f32>().collect();
    let exact = arrays.positions_at(0.3)?.concat();
    let difference = ours.iter().zip(&exact).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    println!("largest difference between Burn and the codec: {difference:e}");
    assert!(difference < 1e-4);

    // Another model refuses the file and names its field.
    let refused = DynamicScene::<HexPlaneField>::from_arrays(&arrays, &device).unwrap_err().to_string();
    assert!(refused.contains("shared-trajectories"), "{refused}");
    Ok(())
}
