//! Control nodes: what a file describes of them is what trains, and hostile descriptions are refused.

use burn::module::Param;
use burn::tensor::{Device, Distribution, Tensor};
use light4gs_codec::network::Operation;
use light4gs_codec::{MotionArrays, MotionEvaluator, SceneMeta, decode, encode};
use light4gs_data::PointCloud;
use light4gs_model::parameters::{ParameterMapper, map_parameters};
use light4gs_model::{
    BuiltInField, DeformationField, DynamicScene, DynamicSceneConfig, FinePosition, GaussiansConfig, NodesField,
    NodesFieldConfig, SceneAtRest,
};
use light4gs_tests::golden::{assert_close, devices, values_of};

const POSITION: FinePosition = FinePosition { iteration: 0, iterations: 100, times: 20, window: [0.0, 1.0], seed: 7 };
const EXTENT: f32 = 3.0;

/// Trajectories, radii and stillness far from their start.
struct Shaken;

impl ParameterMapper for Shaken {
    fn map<const D: usize>(&mut self, path: &str, parameter: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let shaken = ["translations", "rotations", "log_radii", "stillness", "lifetime", "quats"];
        if !shaken.iter().any(|name| path.ends_with(name)) {
            return parameter;
        }
        let value = parameter.val();
        let noise = Tensor::random(value.dims(), Distribution::Normal(0.0, 0.3), &value.device());
        Param::initialized(parameter.id, value + noise)
    }
}

/// A cloud of 200 Gaussians and nodes among them.
fn scene(config: NodesFieldConfig, device: &Device) -> DynamicScene<NodesField> {
    device.seed(3);
    let cloud = PointCloud::random(200, 1.0, 4);
    let mut scene = DynamicSceneConfig::<NodesField>::new(GaussiansConfig::new(), config).init(&cloud, device);
    let DynamicScene { gaussians, coordinates, field, .. } = &mut scene;
    field.begin_motion(&SceneAtRest { gaussians, coordinates, extent: EXTENT }, &POSITION);
    scene
}

fn configurations() -> [NodesFieldConfig; 4] {
    let config = NodesFieldConfig::new;
    [
        config().with_nodes(9),
        config().with_nodes(9).with_stillness(None),
        config().with_nodes(1).with_times_a_knot(20.0),
        config().with_nodes(5).with_lifetime(true),
    ]
}

#[test]
fn nothing_moves_when_motion_begins() {
    for config in configurations() {
        let scene = scene(config.clone(), &Device::flex());
        assert_eq!(scene.field.nodes(), config.nodes);
        let moved = scene.at(0.3);
        assert_close("means", &values_of(&moved.means), &values_of(&scene.gaussians.means.val()), 1e-5);
        assert_close("quats", &values_of(&moved.quats), &values_of(&scene.gaussians.quats.val()), 1e-5);
    }
}

/// The codec runs what a file describes, and finds the Gaussians where the model has them.
#[test]
fn the_codec_moves_gaussians_as_the_model_does() {
    for (name, device) in devices() {
        for config in configurations() {
            let scene = map_parameters(scene(config, &device), &mut Shaken);
            let data = decode(&encode(&scene.to_arrays(SceneMeta::default()).unwrap()).unwrap()).unwrap();
            let evaluator = MotionEvaluator::new(&data).unwrap();
            for time in [0.0, 0.37, 1.0] {
                let mut exact = data.gaussians.clone();
                evaluator.apply(&data.gaussians, time, 0..exact.len(), &mut exact);
                let moved = scene.at(time);
                assert!(exact.means != data.gaussians.means, "{name}: nothing moves");
                assert_close(name, exact.means.as_flattened(), &values_of(&moved.means), 1e-4);
                assert_close(name, exact.quats.as_flattened(), &values_of(&moved.quats), 1e-4);
                assert_close(name, &exact.opacity_logits, &values_of(&moved.opacity_logits), 1e-4);
            }
            let again = DynamicScene::<BuiltInField>::from_arrays(&data, &device).unwrap();
            assert_eq!(again.to_arrays(SceneMeta::default()).unwrap(), data, "{name}");
        }
    }
}

/// Before a sampler's window holds all times, nothing fades.
#[test]
fn gaussians_fade_once_all_times_are_seen() {
    let device = Device::flex().autodiff();
    let config = NodesFieldConfig::new().with_nodes(3).with_lifetime(true);
    let mut scene = map_parameters(scene(config, &device), &mut Shaken);
    let at_rest = values_of(&scene.gaussians.opacity_logits.val());
    let mut at_the_end = |window: [f32; 2]| {
        let DynamicScene { gaussians, coordinates, field, .. } = &mut scene;
        let position = FinePosition { window, ..POSITION };
        field.begin_step(&SceneAtRest { gaussians, coordinates, extent: EXTENT }, &position);
        values_of(&scene.at(1.0).opacity_logits)
    };
    assert_eq!(at_the_end([0.3, 1.0]), at_rest);
    let faded = at_the_end([0.0, 1.0]);
    assert!(faded.iter().zip(&at_rest).all(|(faded, before)| *faded < before + 1e-5));
    assert!(faded.iter().zip(&at_rest).any(|(faded, before)| *faded < before - 0.1));
}

/// One node that is turned turns everything, wherever it is.
#[test]
fn motion_is_rigid() {
    let device = Device::flex();
    let config = NodesFieldConfig::new().with_nodes(1).with_stillness(None);
    let scene = map_parameters(scene(config, &device), &mut Shaken);
    let before = values_of(&scene.gaussians.means.val());
    let after = values_of(&scene.at(0.6).means);
    let distance = |points: &[f32], a: usize, b: usize| -> f32 {
        (0..3).map(|axis| (points[3 * a + axis] - points[3 * b + axis]).powi(2)).sum::<f32>().sqrt()
    };
    assert!(before.iter().zip(&after).any(|(a, b)| (a - b).abs() > 0.05));
    for (a, b) in [(0, 1), (5, 150), (77, 20)] {
        assert!((distance(&before, a, b) - distance(&after, a, b)).abs() < 1e-4);
    }
}

/// A Gaussian that stands still entirely is not moved at all.
#[test]
fn what_stands_still_stands_still() {
    let device = Device::flex();
    let config = NodesFieldConfig::new().with_stillness(Some(30.0));
    let mut scene = map_parameters(scene(config, &device), &mut Shaken);
    let canonical = scene.gaussians.means.val();
    assert_close("means", &values_of(&scene.at(0.6).means), &values_of(&canonical), 1e-5);
    let far = Param::from_tensor(canonical * 1e3);
    scene.gaussians.means = far.clone();
    assert_close("far from every node", &values_of(&scene.at(0.6).means), &values_of(&far.val()), 1e-5);
}

#[test]
fn other_networks_are_refused() {
    let scene = scene(NodesFieldConfig::new().with_nodes(4), &Device::flex());
    let refused = |spoil: &dyn Fn(&mut MotionArrays)| {
        let mut arrays = scene.field.to_arrays().unwrap();
        spoil(&mut arrays);
        let error = NodesField::from_arrays(&arrays, None, &Device::flex()).unwrap_err().to_string();
        assert!(error.contains("control nodes"), "{error}");
    };
    refused(&|arrays| arrays.network = None);
    refused(&|arrays| drop(arrays.network.as_mut().unwrap().network.nodes.pop()));
    refused(&|arrays| drop(arrays.network.as_mut().unwrap().sources.pop()));
    refused(&|arrays| arrays.network.as_mut().unwrap().network.layers_mut().for_each(|layer| layer.inputs = 0));
    refused(&|arrays| arrays.network.as_mut().unwrap().network.layers_mut().for_each(|layer| layer.outputs = u32::MAX));
    refused(&|arrays| arrays.network.as_mut().unwrap().network.layers_mut().for_each(|layer| layer.bias.truncate(1)));
    refused(&|arrays| arrays.network.as_mut().unwrap().network.layers_mut().for_each(|layer| layer.bias[0] += 1.0));
    refused(&|arrays| arrays.network.as_mut().unwrap().network.nodes[1].operation = Operation::Exponential);
}
