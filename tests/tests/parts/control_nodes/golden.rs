//! The golden streams of control nodes: how they were made, and that the model reads them as the codec does.
//!
//! The codec's own tests compare what they decode to, and their frames, bit by bit (`light4gs-codec/tests/streams/golden.rs`).

use burn::module::Param;
use burn::tensor::{Device, Distribution, Tensor};
use light4gs_codec::{MotionEvaluator, SceneMeta, decode};
use light4gs_data::PointCloud;
use light4gs_model::parameters::{ParameterMapper, map_parameters};
use light4gs_model::{DeformationField, DynamicScene, FinePosition, SceneAtRest};
use light4gs_tests::golden::{assert_close, values_of};
use light4gs_train::compression::{Compression, ConfiguredModels, encode};
use light4gs_train::config::Config;

const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/golden-streams");
/// Names, and the key that each has beside those of all.
const STREAMS: [(&str, &str); 3] =
    [("nodes", "affinities=0"), ("lifetimes", "lifetime=true"), ("affinities", "affinities=2")];
const GAUSSIANS: usize = 150;

/// Everything that differs between Gaussians and nodes, far from its start.
struct Shaken;

impl ParameterMapper for Shaken {
    fn map<const D: usize>(&mut self, path: &str, parameter: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let spreads = [
            ("translations", 0.2),
            ("rotations", 0.3),
            ("log_radii", 0.2),
            ("stillness", 6.0),
            ("lifetime", 1.2),
            ("affinity", 1.0),
            ("quats", 0.5),
            ("sh", 0.2),
        ];
        let name = path.rsplit('.').next().unwrap_or(path);
        let Some((_, spread)) = spreads.iter().find(|(start, _)| name.starts_with(start)) else { return parameter };
        let value = parameter.val();
        let noise = Tensor::random(value.dims(), Distribution::Normal(0.0, *spread), &value.device());
        Param::initialized(parameter.id, (value + noise).detach())
    }
}

/// Twelve nodes with small radii, so that most weights are 0, and Gaussians that stand more or less still.
fn scene(config: &Config, device: &Device) -> DynamicScene {
    device.seed(24);
    let cloud = PointCloud::random(GAUSSIANS, 1.0, 24);
    let mut scene: DynamicScene = config.model.build().init(&cloud, device);
    let DynamicScene { gaussians, coordinates, field, .. } = &mut scene;
    let position = FinePosition {
        iteration: 0,
        iterations: 100,
        times: 20,
        window: [0.0, 1.0],
        window_before: [0.0, 1.0],
        seed: 24,
    };
    field.begin_motion(&SceneAtRest { gaussians, coordinates, extent: 2.0 }, &position);
    map_parameters(scene, &mut Shaken)
}

#[test]
#[ignore = "writes the golden streams anew, which only a change of the format may ask for"]
fn write_golden_nodes() {
    let device = Device::flex().autodiff();
    for (name, own) in STREAMS {
        let keys = ["model.field=nodes", "model.nodes.count=12", "model.nodes.radius=0.25", "model.sh_degree=1"];
        let mut keys = keys.map(str::to_owned).to_vec();
        keys.push(format!("model.nodes.{own}"));
        let config = Config::load("hexplane-dnerf-cpu", &keys).unwrap();
        let scene = scene(&config, &device);
        let compression = Compression::new(&ConfiguredModels, &config, scene.planes(), &device).unwrap();
        let profile = config.compression.profile.coded().unwrap();
        let data = scene.to_arrays(SceneMeta { name: name.into(), ..SceneMeta::default() }).unwrap();
        let encoded = encode(&scene, &data, &compression, &config.compression, profile, None, &device).unwrap();
        std::fs::write(format!("{FOLDER}/{name}.l4gs"), encoded.file.bytes).unwrap();
    }
}

#[test]
fn the_model_reads_the_golden_nodes_as_the_codec_does() {
    for (name, _) in STREAMS {
        let data = decode(&std::fs::read(format!("{FOLDER}/{name}.l4gs")).unwrap()).unwrap();
        let evaluator = MotionEvaluator::new(&data).unwrap();
        let scene: DynamicScene = DynamicScene::from_arrays(&data, &Device::flex()).unwrap();
        assert_eq!(scene.to_arrays(data.meta.clone()).unwrap(), data);
        for time in [0.0, 0.37, 1.0] {
            let mut exact = data.gaussians.clone();
            evaluator.apply(&data.gaussians, time, 0..exact.len(), &mut exact);
            assert!(exact.means != data.gaussians.means, "nothing moves");
            assert_eq!(
                exact.opacity_logits != data.gaussians.opacity_logits,
                name == "lifetimes",
                "{name}: what fades"
            );
            assert_eq!(exact.sh_dc, data.gaussians.sh_dc, "{name}: colors");
            let moved = scene.at(time);
            assert_close("means", exact.means.as_flattened(), &values_of(&moved.means), 1e-4);
            assert_close("quats", exact.quats.as_flattened(), &values_of(&moved.quats), 1e-4);
            assert_close("opacities", &exact.opacity_logits, &values_of(&moved.opacity_logits), 1e-4);
            assert_close("colors", exact.sh_dc.as_flattened(), &values_of(&moved.sh_dc), 1e-4);
        }
    }
}
