//! The Burn modules against the codec's exact executor, which runs their descriptions: spherical harmonics and motion.
//! The context model's networks are compared in `compression.rs`.

use burn::module::Param;
use burn::tensor::{Device, Distribution, Tensor, TensorData};
use light4gs_codec::{Distributions, GaussianArrays, SceneMeta, decode, encode, sh_distributions};
use light4gs_data::PointCloud;
use light4gs_model::gaussian_conditional::{NormalParameters, bits, gaussian_likelihood};
use light4gs_model::{
    DeformationConfig, DynamicScene, DynamicSceneConfig, GaussiansConfig, HexPlaneConfig, HexPlaneField,
    HexPlaneFieldConfig, ShAutoregressiveConfig, ShEntropy, ShEntropyConfig, ShHexPlaneCoupledConfig, ShKnown,
};
use light4gs_tests::golden::{assert_close, assert_close_relative, devices, values_of};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const COUNT: usize = 61;

/// A scene whose planes and networks are far from their initial values, and in which every attribute changes over time.
fn scene(depth: usize, device: &Device) -> DynamicScene<HexPlaneField> {
    device.seed(5);
    let mut random = ChaCha8Rng::seed_from_u64(9);
    let positions = (0..COUNT).map(|_| std::array::from_fn(|_| random.random_range(-2.0..2.0))).collect();
    let colors = (0..COUNT).map(|_| std::array::from_fn(|_| random.random())).collect();
    let hexplane = HexPlaneConfig { channels: 4, resolution: [8, 12, 4, 8], ..Default::default() };
    let deformation = DeformationConfig { width: 16, depth, opacity: true, sh: true, ..Default::default() };
    let field = HexPlaneFieldConfig { hexplane, deformation };
    let config = DynamicSceneConfig::<HexPlaneField>::new(GaussiansConfig::new(), field);
    let mut scene = config.init(&PointCloud { positions, colors }, device);
    for plane in &mut scene.field.hexplane.planes {
        let noise = Tensor::random(plane.dims(), Distribution::Normal(0.0, 0.5), device);
        *plane = Param::from_tensor(plane.val() + noise);
    }
    let rest = scene.gaussians.sh_rest.dims();
    scene.gaussians.sh_rest = Param::from_tensor(Tensor::random(rest, Distribution::Normal(0.0, 0.1), device));
    scene
}

/// The codec runs the network of a file, and places the Gaussians where the model places them.
#[test]
fn positions_are_those_of_the_model() {
    for (name, device) in devices() {
        for depth in [1, 3] {
            let scene = scene(depth, &device);
            let data = decode(&encode(&scene.to_arrays(SceneMeta::default()).unwrap()).unwrap()).unwrap();
            for time in [0.0, 0.3, 1.0] {
                let exact = data.positions_at(time).unwrap();
                let moved = exact.iter().zip(&data.gaussians.means).any(|(a, b)| a != b);
                assert!(moved, "{name}: nothing moves");
                assert_close(name, exact.as_flattened(), &values_of(&scene.at(time).means), 2e-5);
            }
            let again: DynamicScene<HexPlaneField> = DynamicScene::from_arrays(&data, &device).unwrap();
            assert_eq!(again.to_arrays(SceneMeta::default()).unwrap(), data, "{name}");
        }
    }
}

/// The bits under the distributions that the codec computes are the bits that the model gives.
#[test]
fn spherical_harmonics_cost_what_the_model_says() {
    for (name, device) in devices() {
        let scene = scene(1, &device);
        let planes = scene.field.hexplane.tensors();
        let known = ShKnown {
            sh_dc: scene.gaussians.sh_dc.val(),
            positions: scene.coordinates.normalize(scene.gaussians.means.val()),
            planes: planes.clone(),
        };
        let data = scene.to_arrays(SceneMeta::default()).unwrap();
        let configs = [
            ShEntropyConfig::Autoregressive(ShAutoregressiveConfig::new()),
            ShEntropyConfig::HexPlaneCoupled(ShHexPlaneCoupledConfig::new(8)),
        ];
        for config in configs {
            let model = config.init(&device);
            let values = model.quantize(scene.gaussians.sh_rest.val(), &known);
            let sh_rest = values_of(&values);
            let coding = model.to_coding(&sh_rest).unwrap();
            let gaussians = GaussianArrays { sh_rest, ..data.gaussians.clone() };
            let Distributions { scales, means } =
                sh_distributions(&gaussians, &coding, &data.coordinates, &data.feature_planes).unwrap();
            let tensor = |values: Vec<f32>| Tensor::<3>::from_data(TensorData::new(values, [COUNT, 15, 3]), &device);
            let parameters = NormalParameters::new(tensor(means), tensor(scales));
            let exact = bits(gaussian_likelihood(values.clone() / model.step(), parameters));
            assert_close_relative(name, &values_of(&exact), &values_of(&model.bits(values, &known)), 1e-3);
        }
    }
}
