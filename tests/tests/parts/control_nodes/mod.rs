//! Control nodes: the description in a file is the field that trains, and hostile descriptions are refused.

mod golden;
mod motion;
mod survey;

use burn::module::Param;
use burn::tensor::{Device, Distribution, Tensor};
use glam::{Quat, Vec3};
use light4gs_codec::network::{Layer, Operation, Value};
use light4gs_codec::{MotionArrays, MotionEvaluator, MotionNetwork, SceneMeta, decode, encode};
use light4gs_data::PointCloud;
use light4gs_model::parameters::{ParameterMapper, map_parameters};
use light4gs_model::{
    BuiltInField, DeformationField, DynamicScene, DynamicSceneConfig, FinePosition, GaussiansConfig, MOST_KNOTS,
    MOST_NODES, NodesField, NodesFieldConfig, SceneAtRest,
};
use light4gs_tests::golden::{assert_close, devices, values_of};

const POSITION: FinePosition =
    FinePosition { iteration: 0, iterations: 100, times: 20, window: [0.0, 1.0], window_before: [0.0, 1.0], seed: 7 };
const EXTENT: f32 = 3.0;

/// Trajectories, radii and stillness far from their start.
struct Shaken;

impl ParameterMapper for Shaken {
    fn map<const D: usize>(&mut self, path: &str, parameter: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let shaken =
            ["translations", "rotations", "log_radii", "stillness", "lifetime", "quats", "affinity", "affinities"];
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
    many(200, config, device)
}

fn many(gaussians: usize, config: NodesFieldConfig, device: &Device) -> DynamicScene<NodesField> {
    device.seed(3);
    let cloud = PointCloud::random(gaussians, 1.0, 4);
    let mut scene = DynamicSceneConfig::<NodesField>::new(GaussiansConfig::new(), config).init(&cloud, device);
    let DynamicScene { gaussians, coordinates, field, .. } = &mut scene;
    field.begin_motion(&SceneAtRest { gaussians, coordinates, extent: EXTENT }, &POSITION);
    scene
}

fn configurations() -> [NodesFieldConfig; 7] {
    let config = |count| NodesFieldConfig { count, ..NodesFieldConfig::default() };
    [
        config(9),
        NodesFieldConfig { stillness: false, ..config(9) },
        NodesFieldConfig { times_a_knot: 20.0, ..config(1) },
        NodesFieldConfig { lifetime: true, ..config(5) },
        NodesFieldConfig { affinities: 2, ..config(9) },
        NodesFieldConfig { affinities: 3, stillness: false, lifetime: true, ..config(7) },
        NodesFieldConfig { affinities: 2, lifetime: true, ..config(7) },
    ]
}

#[test]
fn nothing_moves_when_motion_begins() {
    for config in configurations() {
        let scene = scene(config.clone(), &Device::flex());
        assert_eq!(scene.field.nodes(), config.count);
        let moved = scene.at(0.3);
        assert_close("means", &values_of(&moved.means), &values_of(&scene.gaussians.means.val()), 1e-5);
        assert_close("quats", &values_of(&moved.quats), &values_of(&scene.gaussians.quats.val()), 1e-5);
    }
}

/// The codec runs the description in a file, and moves the Gaussians as the model does.
#[test]
fn the_codec_moves_gaussians_as_the_model_does() {
    for (name, device) in devices() {
        for config in configurations() {
            let scene = map_parameters(scene(config.clone(), &device), &mut Shaken);
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
                assert_close(name, exact.sh_dc.as_flattened(), &values_of(&moved.sh_dc), 1e-4);
                assert_eq!(exact.sh_dc, data.gaussians.sh_dc, "{name}: colors");
            }
            let again = DynamicScene::<BuiltInField>::from_arrays(&data, &device).unwrap();
            assert_eq!(again.to_arrays(SceneMeta::default()).unwrap(), data, "{name}");
        }
    }
}

/// Another program that skins by weights and positions of the nodes moves the Gaussians as the model does.
#[test]
fn weights_and_places_of_the_nodes_are_those_of_skinning() {
    for (name, device) in devices() {
        for config in configurations() {
            let scene = map_parameters(scene(config.clone(), &device), &mut Shaken);
            let canonical = scene.gaussians.tensors();
            let weights = values_of(&scene.field.weights(&canonical));
            let weights: Vec<&[f32]> = weights.chunks_exact(config.count + 1).collect();
            let some = values_of(&scene.field.weights(&canonical.rows(7..20)));
            assert_close("weights of some rows", &some, &weights[7..20].concat(), 1e-6);
            let anchors = values_of(&scene.field.world_anchors());
            let means = values_of(&scene.gaussians.means.val());
            for time in [0.0, 0.37, 1.0] {
                let (places, quats) = scene.field.places(time);
                let (places, quats) = (values_of(&places), values_of(&quats));
                let by_node = |mean: Vec3, node: usize| {
                    let [w, x, y, z] = quats.as_chunks().0[node];
                    let [anchor, place] = [&anchors, &places].map(|all| Vec3::from_slice(&all[3 * node..]));
                    Quat::from_xyzw(x, y, z, w) * (mean - anchor) + place
                };
                let moved = means.as_chunks().0.iter().zip(&weights).flat_map(|(mean, weights)| {
                    assert!((weights.iter().sum::<f32>() - 1.0).abs() < 1e-5, "{name}: {weights:?}");
                    assert!(config.stillness || weights[config.count] == 0.0);
                    let mean = Vec3::from_array(*mean);
                    let of_nodes: Vec3 = (0..config.count).map(|node| by_node(mean, node) * weights[node]).sum();
                    (of_nodes + mean * weights[config.count]).to_array()
                });
                assert_close(name, &moved.collect::<Vec<f32>>(), &values_of(&scene.at(time).means), 1e-5);
            }
        }
    }
}

/// Before a sampler's window holds all times, nothing fades.
#[test]
fn gaussians_fade_once_all_times_are_seen() {
    let device = Device::flex().autodiff();
    let config = NodesFieldConfig { count: 3, lifetime: true, ..Default::default() };
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
    let config = NodesFieldConfig { count: 1, stillness: false, ..Default::default() };
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
    let config = NodesFieldConfig { stillness_start: 30.0, ..Default::default() };
    let mut scene = map_parameters(scene(config, &device), &mut Shaken);
    let canonical = scene.gaussians.means.val();
    assert_close("means", &values_of(&scene.at(0.6).means), &values_of(&canonical), 1e-5);
    let far = Param::from_tensor(canonical * 1e3);
    scene.gaussians.means = far.clone();
    assert_close("far from every node", &values_of(&scene.at(0.6).means), &values_of(&far.val()), 1e-5);
}

/// Every configuration that is accepted gives a file that everybody reads.
#[test]
fn the_largest_field_is_within_the_limits_for_strangers() {
    let device = Device::flex();
    let config = NodesFieldConfig { count: MOST_NODES, times_a_knot: 0.01, lifetime: true, ..Default::default() };
    let scene = many(1000, config, &device);
    let data = scene.to_arrays(SceneMeta::default()).unwrap();
    let knots = data.motion.network.as_ref().unwrap().network.layers().map(|layer| layer.inputs).max();
    assert_eq!((scene.field.nodes(), knots), (MOST_NODES, Some(MOST_KNOTS as u32)));
    assert!(decode(&encode(&data).unwrap()).unwrap() == data);
}

/// Every field is named, before memory is taken for it.
#[test]
fn other_networks_are_refused() {
    let scene = scene(NodesFieldConfig { count: 4, ..Default::default() }, &Device::flex());
    let refused = |expected: &str, spoil: &dyn Fn(&mut MotionNetwork)| {
        let mut arrays = scene.field.to_arrays().unwrap();
        spoil(arrays.network.as_mut().unwrap());
        let error = NodesField::from_arrays(&arrays, None, &Device::flex()).unwrap_err().to_string();
        assert!(error.contains("the network is not that of control nodes") && error.contains(expected), "{error}");
    };
    let none = MotionArrays { network: None, ..scene.field.to_arrays().unwrap() };
    assert!(NodesField::from_arrays(&none, None, &Device::flex()).unwrap_err().to_string().contains("there is none"));

    let layer = |motion: &mut MotionNetwork, index: usize, spoil: &dyn Fn(&mut Layer)| {
        spoil(motion.network.layers_mut().nth(index).unwrap());
    };
    let [anchors, translations, rotations, radii] = [0, 1, 2, 3];
    refused("6 layers, expected 4", &|motion| {
        motion.network.constant(Value(0), 1, vec![1.0]);
        motion.network.constant(Value(0), 1, vec![1.0]);
    });
    refused("0 nodes, expected 1 to 512", &|motion| layer(motion, radii, &|layer| layer.outputs = 0));
    refused("4294967295 nodes", &|motion| layer(motion, radii, &|layer| layer.outputs = u32::MAX));
    refused("3 knots, expected 4 to 512", &|motion| layer(motion, translations, &|layer| layer.inputs = 3));
    refused("4294967295 knots", &|motion| layer(motion, translations, &|layer| layer.inputs = u32::MAX));
    refused("of the anchors are [12, 1, 12], expected [12, 12, 12]", &|motion| {
        layer(motion, anchors, &|layer| layer.bias.truncate(1));
    });
    refused("of the translations are [12, 12, 1]", &|motion| {
        layer(motion, translations, &|layer| layer.weight.truncate(1))
    });
    refused("of the rotations are [4294967295, 16", &|motion| {
        layer(motion, rotations, &|layer| layer.outputs = u32::MAX)
    });
    refused("of the logarithms of radii are [4, 5, 4]", &|motion| layer(motion, radii, &|layer| layer.bias.push(0.0)));
    refused("one of the weights of the anchors is 1", &|motion| layer(motion, anchors, &|layer| layer.weight[3] = 1.0));
    refused("weights of the logarithms", &|motion| layer(motion, radii, &|layer| layer.weight[0] = f32::NAN));
    refused("biases of the translations", &|motion| layer(motion, translations, &|layer| layer.bias[0] = 1.0));
    refused("biases of the rotations", &|motion| layer(motion, rotations, &|layer| layer.bias[0] = f32::INFINITY));
    let with_affinities =
        self::scene(NodesFieldConfig { count: 4, affinities: 2, ..Default::default() }, &Device::flex());
    let affinities = |spoil: &dyn Fn(&mut Layer)| {
        let mut arrays = with_affinities.field.to_arrays().unwrap();
        layer(arrays.network.as_mut().unwrap(), 4, spoil);
        NodesField::from_arrays(&arrays, None, &Device::flex()).unwrap_err().to_string()
    };
    for (expected, error) in [
        ("0 affinities, expected 1 to 4", affinities(&|layer| layer.inputs = 0)),
        ("4294967295 affinities", affinities(&|layer| layer.inputs = u32::MAX)),
        ("of the affinities are [4, 4, 1], expected [4, 4, 8]", affinities(&|layer| layer.weight.truncate(1))),
        ("of the affinities are [4294967295, 4", affinities(&|layer| layer.outputs = u32::MAX)),
        ("one of the biases of the affinities is 1", affinities(&|layer| layer.bias[0] = 1.0)),
    ] {
        assert!(error.contains(expected), "{error}");
    }
    let others = "operations, sources or outputs are others";
    refused(others, &|motion| drop(motion.network.nodes.pop()));
    refused(others, &|motion| drop(motion.sources.pop()));
    refused(others, &|motion| motion.outputs.swap(0, 1));
    refused(others, &|motion| motion.network.nodes[1].operation = Operation::Exponential);
}
