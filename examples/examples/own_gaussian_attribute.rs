//! An attribute of the Gaussians in your own crate: a lifetime. No file of Light4GS is edited.
//!
//! Each Gaussian has a center and a width in time, and its opacity is multiplied by a bell curve around that center:
//! things can appear and vanish without moving. The field asks for the attribute. From then on it is trained, copied
//! where Gaussians are cloned and split, stored in checkpoints, and coded with its own quantization step. The network
//! in the file reads it by name, so any player shows its effect.

use burn::module::Module;
use burn::tensor::{Device, s};
use light4gs::codec::network::{Operation, Value};
use light4gs::codec::{
    GaussianArrays, MotionArrays, MotionEvaluator, MotionNetwork, MotionOutput, MotionSource, Network, decode,
};
use light4gs::data::Scene;
use light4gs::model::{
    Attribute, DeformationField, DynamicScene, FeaturePlanes, GaussianTensors, ModelError, ScenePoints,
};
use light4gs::train::dataset::load_options;
use light4gs::train::run::RunFolder;
use light4gs::train::trainer::Trainer;
use light4gs_examples::{Outcome, first_and_last, tiny_config, tiny_scene};

/// The name of the attribute, in checkpoints and in files: center, and logarithm of the width, in time.
const LIFETIME: &str = "lifetime";

/// A field that moves nothing, but lets Gaussians appear and vanish.
#[derive(Module, Debug)]
struct Lifetimes;

impl DeformationField for Lifetimes {
    type Config = ();

    const KINDS: &'static [&'static str] = &["lifetimes"];

    /// The attribute that every Gaussian has in addition to the usual ones. It begins in the middle of the scene's
    /// time, with the length of that time.
    fn attributes((): &()) -> Vec<Attribute> {
        let lifetime = Attribute::new(LIFETIME, 2).with_start(vec![0.5, 0.0]);
        vec![lifetime.with_learning_rate(1e-2).with_step(0.01).constant()]
    }

    fn init((): &(), _: &Device) -> Self {
        Self
    }

    /// With the opacity `1 / (1 + e)`, where `e = exp(-logit)`, and the bell curve `b`, the new logit is
    /// `log b - log(1 - b + e)`.
    fn deform(&self, canonical: GaussianTensors, _: ScenePoints<'_>, time: f32) -> GaussianTensors {
        let lifetime = canonical.further(LIFETIME).expect("the field has asked for it").clone();
        let center = lifetime.clone().slice(s![.., 0..1]);
        let width = lifetime.slice(s![.., 1..2]).exp();
        let distance = (center.neg() + time) / width;
        let log_bell = distance.powi_scalar(2) * -0.5;
        let e = canonical.opacity_logits.clone().neg().exp();
        let opacity_logits = log_bell.clone() - (log_bell.exp().neg() + 1.0 + e).log();
        GaussianTensors { opacity_logits, ..canonical }
    }

    /// The same as data: the codec refers to attributes by their names.
    fn to_arrays(&self) -> Result<MotionArrays, ModelError> {
        let (mut network, [logit, lifetime, time]) = Network::new([1, 2, 1]);
        let affine = |network: &mut Network, value: Value, scale: f32, offset: f32| {
            network.node(Operation::Affine { scale, offset }, &[value])
        };
        let center = network.node(Operation::Select(vec![0]), &[lifetime]);
        let width = network.node(Operation::Select(vec![1]), &[lifetime]);
        let width = network.node(Operation::Exponential, &[width]);
        let distance = network.node(Operation::Subtract, &[center, time]);
        let distance = network.node(Operation::Divide, &[distance, width]);
        let squared = network.node(Operation::Multiply, &[distance, distance]);
        let log_bell = affine(&mut network, squared, -0.5, 0.0);
        let bell = network.node(Operation::Exponential, &[log_bell]);
        let e = affine(&mut network, logit, -1.0, 0.0);
        let e = network.node(Operation::Exponential, &[e]);
        let rest = affine(&mut network, bell, -1.0, 1.0);
        let rest = network.node(Operation::Add, &[rest, e]);
        let rest = network.node(Operation::Logarithm, &[rest]);
        let faded = network.node(Operation::Subtract, &[log_bell, rest]);
        network.output(faded);
        let attribute = |name: &str| MotionSource::Attribute(name.to_owned());
        let sources = vec![attribute("opacity_logits"), attribute(LIFETIME), MotionSource::Time];
        let network = MotionNetwork { network, sources, outputs: vec![MotionOutput::NewOpacityLogit] };
        Ok(MotionArrays { kind: self.kind().to_owned(), network: Some(network), tensors: Vec::new() })
    }

    /// The field has no numbers of its own; the attribute comes with the Gaussians.
    fn from_arrays(arrays: &MotionArrays, _planes: Option<FeaturePlanes>, _: &Device) -> Result<Self, ModelError> {
        match *arrays == Self.to_arrays()? {
            true => Ok(Self),
            false => Err(ModelError::Motion("another network, expected that of lifetimes".to_owned())),
        }
    }
}

/// The lifetimes of Gaussians, `[N, 2]` row-major.
fn lifetimes(gaussians: &GaussianArrays) -> Vec<f32> {
    gaussians.attribute(LIFETIME).expect("every Gaussian has one").values.to_vec()
}

pub(crate) fn main() -> Outcome {
    let folder = tempfile::tempdir()?;
    let mut config = tiny_config()?;
    config.train.checkpoint_interval = 25;
    let data = Scene::open(&tiny_scene(folder.path())?, &load_options(&config))?;
    let builder = || Trainer::<Lifetimes>::builder_with_field(config.clone(), data.clone(), ());

    // Trained: the trainer gets the attribute from the field.
    let mut trainer = builder().build()?;
    let begin = trainer.scene().gaussians.len();
    let mut losses = Vec::new();
    while let Some(step) = trainer.step()? {
        losses.push(step.loss);
    }
    let (first, last) = first_and_last(&losses);
    println!("loss: {first:.3} in the first tenth of the run, {last:.3} in the last");
    assert!(last < 0.7 * first);

    // Densified: Gaussians have been added and removed, and each has its own lifetime.
    let trained = trainer.scene().gaussians.to_arrays();
    let spread = |values: &[f32]| values.iter().fold(0.0, |most: f32, value| most.max((value - values[0]).abs()));
    println!("{begin} Gaussians became {}", trained.len());
    assert!(trained.len() != begin && lifetimes(&trained).len() == 2 * trained.len());
    assert!(spread(&lifetimes(&trained)) > 0.05, "all lifetimes are alike");
    let bytes = trainer.encode()?.bytes;

    // Resumed: a run that is stopped in the middle continues from its checkpoint, with the same bits.
    let run = folder.path().join("run");
    let mut given_up = builder().run_folder(RunFolder::create(&run, None, &config, false)?).build()?;
    for _ in 0..80 {
        given_up.step()?;
    }
    drop(given_up);
    let mut resumed = builder().run_folder(RunFolder::open(&run)?.0).resume()?;
    let mut iterations = 0;
    while resumed.step()?.is_some() {
        iterations += 1;
    }
    println!("{iterations} of {} iterations after the checkpoint", losses.len());
    assert_eq!(resumed.scene().gaussians.to_arrays(), trained);
    assert_eq!(resumed.encode()?.bytes, bytes);

    // Coded and decoded: the stream returns the attribute by name, with an error of at most half a step.
    let arrays = decode(&bytes)?;
    println!("{} bytes for {} Gaussians", bytes.len(), arrays.gaussians.len());
    let decoded = arrays.gaussians.attribute(LIFETIME).expect("the stream has it");
    assert_eq!((decoded.width, decoded.optional), (2, false));
    let sum = |values: &[f32]| values.iter().map(|value| f64::from(*value)).sum::<f64>() / values.len() as f64;
    assert!((sum(decoded.values) - sum(&lifetimes(&trained))).abs() < 0.005);

    // Played: the codec alone fades the Gaussians as the field does.
    let scene = DynamicScene::<Lifetimes>::from_arrays(&arrays, &Device::flex())?;
    let player = MotionEvaluator::new(&arrays)?;
    for time in [0.0, 0.3, 1.0] {
        let mut moved = arrays.gaussians.clone();
        player.apply(&arrays.gaussians, time, 0..moved.len(), &mut moved);
        let ours = scene.at(time).to_arrays();
        let pairs = moved.opacity_logits.iter().zip(&ours.opacity_logits);
        let difference = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        println!("at time {time}: largest difference between Burn and the codec {difference:e}");
        assert!(difference < 1e-4);
        assert!(ours.opacity_logits != arrays.gaussians.opacity_logits, "nothing fades");
    }

    // A program that does not know the effect of the attribute refuses to show the scene, and names the attribute.
    let mut unsaid = arrays;
    unsaid.motion = MotionArrays::default();
    let refused = MotionEvaluator::new(&unsaid).unwrap_err().to_string();
    assert!(refused.contains("`lifetime`"), "{refused}");
    Ok(())
}
