//! Calls to the deformation field other than moving the Gaussians: its hooks, its regularizer, its learning rates.

use std::collections::BTreeMap;

use burn::module::Param;
use burn::tensor::Tensor;
use light4gs_model::parameters::{ParameterVisitor, visit_parameters};
use light4gs_model::{DeformationField, DynamicScene, FinePosition, SceneAtRest};
use rand::Rng;

use super::Trainer;
use super::learning_rates::GroupRates;
use crate::compression::EntropyModels;
use crate::optimization::gradients::GradientSums;
use crate::optimization::parameters::ParameterGroup;
use crate::randomness::{Purpose, generator};
use crate::stage::Stage;

/// Prefix of the paths of a field's parameters in the scene.
const FIELD: &str = "field";

impl<F: DeformationField, E: EntropyModels> Trainer<F, E> {
    /// The position in the fine stage. The device's generator is seeded for the iteration as well, for a field that
    /// draws random numbers there.
    fn fine_position(&self, iteration: usize) -> FinePosition {
        let seed = generator(self.config.seed, Purpose::Motion, Stage::Fine, iteration).random();
        self.device.seed(seed);
        let window = |iteration| self.sampler.window(&self.batch_request(Stage::Fine, iteration));
        FinePosition {
            iteration,
            iterations: self.config.train.iterations(Stage::Fine),
            times: self.candidates.times.len(),
            window: window(iteration),
            window_before: window(iteration.saturating_sub(1)),
            seed,
        }
    }

    /// Lets the field make parameters from the Gaussians that it is going to move.
    pub(super) fn begin_motion(&mut self) {
        let position = self.fine_position(0);
        let (field, scene) = parts(&mut self.state.scene, self.data.extent);
        field.begin_motion(&scene, &position);
    }

    /// Calls the field before an iteration of the fine stage.
    pub(super) fn begin_motion_step(&mut self, iteration: usize) {
        let position = self.fine_position(iteration);
        let (field, scene) = parts(&mut self.state.scene, self.data.extent);
        field.begin_step(&scene, &position);
    }

    /// Adds the gradients of the field's own regularizer, and returns its value, `[1]`.
    pub(super) fn add_field_regularizer(
        &self,
        stage: Stage,
        iteration: usize,
        gradients: &mut GradientSums,
    ) -> Option<Tensor<1>> {
        if stage == Stage::Coarse {
            return None;
        }
        let position = self.fine_position(iteration);
        let mut scene = self.state.scene.clone();
        if self.planes_are_frozen(stage, iteration) {
            for plane in scene.planes_mut().into_iter().flat_map(|hexplane| &mut hexplane.planes) {
                *plane = plane.clone().set_require_grad(false);
            }
        }
        let (field, at_rest) = parts(&mut scene, self.data.extent);
        let term = field.regularizer(&at_rest, &position)?;
        let value = term.clone().inner();
        gradients.add_module(&scene, &mut term.backward());
        self.profile.lap("regularizers");
        Some(value)
    }

    /// Learning rates of the field's parameters at an iteration, by their paths in the scene, for those that differ
    /// from the default.
    pub(super) fn field_rates(&self, rates: &GroupRates) -> BTreeMap<String, f64> {
        let mut own = OwnRates { field: &self.state.scene.field, rates, found: BTreeMap::new() };
        visit_parameters(&self.state.scene.field, &mut own);
        own.found
    }
}

/// A field, and the scene that it moves.
fn parts<F: DeformationField>(scene: &mut DynamicScene<F>, extent: f32) -> (&mut F, SceneAtRest<'_>) {
    let DynamicScene { gaussians, coordinates, field, .. } = scene;
    (field, SceneAtRest { gaussians, coordinates, extent })
}

struct OwnRates<'a, F> {
    field: &'a F,
    rates: &'a GroupRates,
    found: BTreeMap<String, f64>,
}

impl<F: DeformationField> ParameterVisitor for OwnRates<'_, F> {
    fn visit<const D: usize>(&mut self, path: &str, _: &Param<Tensor<D>>) {
        let joined = format!("{FIELD}.{path}");
        if ParameterGroup::of(&joined) != Some(ParameterGroup::Deformation) {
            return;
        }
        let usual = self.rates.deformation();
        let own = self.field.learning_rate(path, usual);
        if own != usual {
            self.found.insert(joined, self.rates.at(own));
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use burn::module::Module;
    use burn::tensor::{Device, TensorData, s};
    use light4gs_data::{Camera, Frame, PointCloud, RgbImage8, Scene, SplitFrames};
    use light4gs_model::{GaussianTensors, LearningRate, ModelError, ScenePoints};
    use rand::SeedableRng;

    use super::*;
    use crate::config::{Config, DeviceName};
    use crate::dataset::MemoryImages;
    use crate::error::TrainError;
    use crate::run::RunFolder;
    use crate::trainer::TrainerBuilder;

    /// Shifts that are made when motion begins, one for each Gaussian at that time. Its coding is not implemented.
    #[derive(Module, Debug)]
    struct Shifts {
        /// `[1, 3]` before motion begins, then `[N, 3]`.
        shifts: Param<Tensor<2>>,
        /// Trained ten times as fast.
        fast: Param<Tensor<1>>,
        /// Not trained, since its rate is 0.
        slow: Param<Tensor<1>>,
        /// `[2]`, a constant: how often motion began, and the number of steps.
        calls: Param<Tensor<1>>,
    }

    impl DeformationField for Shifts {
        type Config = ();

        const KINDS: &'static [&'static str] = &["shifts"];

        fn init((): &(), device: &Device) -> Self {
            Self {
                shifts: Param::from_tensor(Tensor::zeros([1, 3], device)),
                fast: Param::from_tensor(Tensor::zeros([1], device)),
                slow: Param::from_tensor(Tensor::zeros([1], device)),
                calls: Param::from_tensor(Tensor::zeros([2], device)).set_require_grad(false),
            }
        }

        fn deform(&self, canonical: GaussianTensors, points: ScenePoints<'_>, time: f32) -> GaussianTensors {
            assert_eq!(points.normalized().dims(), canonical.means.dims());
            let shift = self.shifts.val().mean_dim(0) + (self.fast.val() + self.slow.val()).unsqueeze::<2>();
            GaussianTensors { means: canonical.means.clone() + shift * time, ..canonical }
        }

        fn begin_motion(&mut self, scene: &SceneAtRest<'_>, position: &FinePosition) {
            assert_eq!((position.iteration, position.iterations), (0, 6));
            assert!(scene.extent > 0.0);
            let means = scene.gaussians.means.val();
            // Not from the device's generator, which the tests beside this one draw from as well.
            let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(position.seed);
            let noise = (0..means.dims()[0] * 3).map(|_| random.random_range(0.0..1e-3f32)).collect();
            let noise = Tensor::from_data(TensorData::new(noise, means.dims()), &means.device());
            self.shifts =
                Param::from_tensor(Tensor::from_data((means * 1e-3 + noise).into_data(), &self.fast.device()));
            self.count([1.0, 0.0]);
        }

        fn begin_step(&mut self, _: &SceneAtRest<'_>, position: &FinePosition) {
            self.count([0.0, 1.0]);
            let [_, steps] = self.calls()[..] else { unreachable!() };
            assert_eq!(steps as usize, position.iteration);
        }

        fn regularizer(&self, scene: &SceneAtRest<'_>, _: &FinePosition) -> Option<Tensor<1>> {
            assert_eq!(scene.coordinates.normalize(scene.gaussians.means.val()).dims()[1], 3);
            Some(self.shifts.val().powi_scalar(2).sum() + 100.0)
        }

        fn learning_rate(&self, path: &str, usual: LearningRate) -> LearningRate {
            match path {
                "fast" => usual.times(10.0),
                "slow" => usual.times(0.0),
                _ => usual,
            }
        }

        fn resize(&mut self, shapes: &BTreeMap<String, Vec<usize>>) -> Result<(), ModelError> {
            let Some(&[rows, 3]) = shapes.get("shifts").map(Vec::as_slice) else {
                return Err(ModelError::Motion("shifts are not [N, 3]".into()));
            };
            self.shifts = Param::from_tensor(Tensor::zeros([rows, 3], &self.fast.device()));
            Ok(())
        }
    }

    impl Shifts {
        fn calls(&self) -> Vec<f32> {
            self.calls.val().into_data().iter().collect()
        }

        fn count(&mut self, more: [f32; 2]) {
            let sum = self.calls.val() + Tensor::from_floats(more, &self.calls.device());
            self.calls = Param::initialized(self.calls.id, sum.detach().set_require_grad(false));
        }
    }

    /// Four gray images of a gray cloud, in memory.
    fn builder(iterations: usize) -> TrainerBuilder<Shifts> {
        let frame = |k: usize| {
            let (sin, cos) = (k as f32 * 1.57).sin_cos();
            let camera = Camera::look_at(
                [4.0 * cos, 4.0 * sin, 0.5].into(),
                [0.0; 3].into(),
                [0.0, 0.0, 1.0].into(),
                0.7,
                24,
                24,
            );
            Frame::without_image(format!("view-{k}"), camera, k as f32 / 3.0)
        };
        let frames: Vec<Frame> = (0..4).map(frame).collect();
        let image = RgbImage8 { width: 24, height: 24, pixels: vec![100; 24 * 24 * 3] };
        let images: MemoryImages = frames.iter().map(|frame| (frame.name.clone(), image.clone())).collect();
        let frames = SplitFrames { test: frames.clone(), train: frames, ..SplitFrames::default() };
        let cloud = PointCloud::random(60, 0.8, 0);
        let data = Scene::new("memory", Path::new("gray"), frames, cloud, [1.0; 3]).unwrap();
        Trainer::<Shifts>::builder_with_field(config(iterations), data, ()).images(images)
    }

    fn config(iterations: usize) -> Config {
        let mut config = Config::from_preset("hexplane-dnerf-cpu").unwrap();
        config.device = DeviceName::Flex;
        config.train.coarse_iterations = 2;
        config.train.fine_iterations = iterations;
        config.train.checkpoint_interval = 3;
        config.train.prune.fraction = 0.0;
        config.eval.interval = 0;
        config
    }

    fn parameters(trainer: &Trainer<Shifts>) -> Vec<TensorData> {
        let Shifts { shifts, fast, slow, calls } = trainer.scene().valid().field;
        vec![shifts.val().into_data(), fast.val().into_data(), slow.val().into_data(), calls.val().into_data()]
    }

    #[test]
    fn a_field_is_asked_and_trained_before_it_says_how_it_is_coded() {
        let mut trainer = builder(6).build().unwrap();
        let mut losses = Vec::new();
        while let Some(step) = trainer.step().unwrap() {
            losses.push(step.loss);
        }
        assert!(
            losses[..2].iter().all(|loss| *loss < 10.0) && losses[2..].iter().all(|loss| *loss > 99.0),
            "{losses:?}"
        );
        let field = &trainer.scene().field;
        assert_eq!(field.calls(), [1.0, 6.0]);
        let size = |value: Tensor<1>| value.abs().max().into_scalar::<f32>();
        let [fast, slow] = [&field.fast, &field.slow].map(|parameter| size(parameter.val()));
        assert!(fast > 0.0 && slow == 0.0, "{fast} {slow}");
        let rows = trainer.scene().gaussians.len();
        assert_eq!(field.shifts.dims(), [rows, 3]);
        let message = trainer.encode().unwrap_err().to_string();
        assert!(message.contains("`shifts` cannot be written to a file") && message.contains("to_arrays"), "{message}");
    }

    /// A resumed run reads what was made when motion began, and makes it only once.
    #[test]
    fn motion_begins_once_in_a_run_that_is_resumed() {
        let mut whole = builder(6).build().unwrap();
        while whole.step().unwrap().is_some() {}
        let folder = tempfile::tempdir().unwrap();
        // Stopped at the end of the coarse stage, and after three iterations of the fine one.
        for iterations in [2, 5] {
            let root = folder.path().join(iterations.to_string());
            let run = RunFolder::create(&root, None, &config(6), false).unwrap();
            let mut first = builder(6).run_folder(run.clone()).build().unwrap();
            for _ in 0..iterations {
                first.step().unwrap().unwrap();
            }
            drop(first);
            let mut second = builder(6).run_folder(run.clone()).resume().unwrap();
            assert_eq!(second.position().1, if iterations == 2 { 2 } else { 3 });
            while second.step().unwrap().is_some() {}
            assert_eq!(parameters(&second), parameters(&whole));
            assert_eq!(second.scene().gaussians.means.val().slice(s![0..1, ..]).dims(), [1, 3]);
            // Resuming at the end of a run makes no further call.
            let third = builder(6).run_folder(run).resume().unwrap();
            assert_eq!(parameters(&third), parameters(&whole));
        }
    }

    #[test]
    fn shapes_that_a_field_cannot_have_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let run = RunFolder::create(&folder.path().join("run"), None, &config(6), false).unwrap();
        let mut trainer = builder(6).run_folder(run.clone()).build().unwrap();
        for _ in 0..4 {
            trainer.step().unwrap().unwrap();
        }
        trainer.state.scene.field.shifts = Param::from_tensor(Tensor::zeros([5, 4], &trainer.device));
        trainer.save_checkpoint().unwrap();
        drop(trainer);
        match builder(6).run_folder(run).resume() {
            Err(TrainError::Checkpoint { problem, .. }) => assert!(problem.contains("not [N, 3]"), "{problem}"),
            Err(other) => panic!("{other}"),
            Ok(_) => panic!("it is resumed"),
        }
    }
}
