//! Compression across the crates: the Burn modules against the codec's exact executor, the rate's estimate, and whole
//! scenes into files and back.

use burn::tensor::{Device, Distribution, Tensor};
use light4gs_codec::{PlaneCoding, SceneMeta, decode, plane_distributions};
use light4gs_data::PointCloud;
use light4gs_model::{
    ContextModel, ContextModelConfig, ContextPart, DynamicScene, FeaturePlanes, Latent, PlaneEntropy, PlaneSteps,
    PlaneTensors,
};
use light4gs_tests::golden::{assert_close_relative, devices, values_of};
use light4gs_tests::planes::plane_sets;
use light4gs_train::compression::{
    AttributeRecord, Compression, ConfiguredModels, EncodedScene, encode, encoded_so_far, freeze_planes,
};
use light4gs_train::config::Config;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const CHANNELS: usize = 4;

/// A scene's file in the profile of a configuration, which codes something.
fn coded(scene: &DynamicScene, compression: &Compression, config: &Config, device: &Device) -> EncodedScene {
    let data = scene.to_arrays(SceneMeta::default()).unwrap();
    let profile = config.compression.profile.coded().unwrap();
    encode(scene, &data, compression, &config.compression, profile, None, device).unwrap()
}

/// The whole model, and the models that each lack one part.
fn compositions() -> Vec<ContextModelConfig> {
    let parts = ContextPart::PAPER.map(|part| ContextPart::paper_without(&[part]));
    let parts = parts.into_iter().chain([ContextPart::PAPER.to_vec(), ContextPart::ALL.to_vec(), Vec::new()]);
    let compact = parts.map(|parts| ContextModelConfig::compact(CHANNELS).with_parts(parts));
    compact.chain([ContextModelConfig::reference(CHANNELS)]).collect()
}

/// Weights far from their initial values, so that every path through the networks affects the result.
fn shaken(mut model: ContextModel, planes: &PlaneTensors, steps: &PlaneSteps) -> ContextModel {
    model.start_from(planes, steps);
    let [.., last] = &mut model.entropy_parameters.layers;
    let weight = last.weight.val();
    let noise = Tensor::random(weight.dims(), Distribution::Normal(0.0, 0.3), &weight.device());
    last.weight = burn::module::Param::from_tensor((weight + noise).detach());
    model.update_quantiles();
    model
}

/// What a decoder computes with plain arithmetic is what the modules compute, to float tolerance.
#[test]
fn modules_and_exact_executor_agree() {
    for (name, device) in devices() {
        device.seed(3);
        let sets = plane_sets();
        // The hexplane with each composition, and every other set of planes with the whole model.
        let cases = sets.iter().enumerate().flat_map(|(place, set)| {
            let count = if place == 0 { usize::MAX } else { 1 };
            compositions().into_iter().enumerate().take(count).map(move |config| (set, config))
        });
        for ((set, layout), (which, config)) in cases {
            let planes = FeaturePlanes::init(layout, CHANNELS, &device)
                .tensors()
                .map(|_, plane| plane.clone() + Tensor::random(plane.dims(), Distribution::Normal(0.0, 0.3), &device));
            let steps = PlaneSteps::fixed(&vec![0.1; layout.len()], &device);
            let model = shaken(config.init(&device), &planes, &steps);
            let quantized = model.quantize(&planes, &steps);
            let decoded = planes.map(|plane, _| quantized[plane].decoded.clone());
            let latent_symbols = model
                .latent_symbols(&decoded, &steps)
                .into_iter()
                .map(|plane| plane.map_or_else(Vec::new, |plane| values_of(&plane).iter().map(|v| *v as i32).collect()))
                .collect();
            let coding = PlaneCoding {
                model: model.to_arrays(planes.layout()).unwrap(),
                steps: steps.to_groups(planes.layout()),
                latent_symbols,
            };
            let arrays = FeaturePlanes::from_tensors(decoded.clone()).to_arrays();
            let all: Vec<usize> = (0..layout.len()).collect();
            for (plane, gaussians) in
                model.plane_parameters(&decoded, &steps, &all, Latent::Rounded).into_iter().enumerate()
            {
                let exact = plane_distributions(&arrays, &coding, plane).unwrap();
                let what = |part: &str| format!("{name}, {set}, composition {which}, plane {plane}: {part}");
                assert_close_relative(&what("means"), &values_of(&gaussians.means()), &exact.means, 1e-4);
                assert_close_relative(&what("scales"), &values_of(&gaussians.scales()), &exact.scales, 1e-4);
            }
        }
    }
}

/// A small scene that moves, with spherical harmonics that differ.
fn scene(config: &Config, device: &Device) -> DynamicScene {
    device.seed(5);
    let mut random = ChaCha8Rng::seed_from_u64(9);
    let positions = (0..300).map(|_| std::array::from_fn(|_| random.random_range(-1.0..1.0))).collect();
    let colors = (0..300).map(|_| std::array::from_fn(|_| random.random())).collect();
    let mut scene = config.model.build().init(&PointCloud { positions, colors }, device);
    let rest = scene.gaussians.sh_rest.dims();
    let noise = Tensor::random(rest, Distribution::Normal(0.0, 0.1), device);
    scene.gaussians.sh_rest = burn::module::Param::from_tensor(noise);
    scene
}

fn config(overrides: &[&str]) -> Config {
    let small = ["model.hexplane.channels=4", "model.hexplane.resolution=[8,8,8,4]", "model.deformation.width=8"];
    let overrides: Vec<String> = small.iter().chain(overrides).map(|key| (*key).to_owned()).collect();
    Config::load("hexplane-dnerf-cpu", &overrides).unwrap()
}

/// Averaged over many draws, the estimate from a part of the planes is the rate of all planes.
#[test]
fn the_rate_on_a_part_is_unbiased() {
    let device = Device::flex().autodiff();
    let config = config(&[]);
    let scene = scene(&config, &device);
    let compression = Compression::new(&ConfiguredModels, &config, scene.planes(), &device).unwrap();
    let noisy = compression.noisy(&scene, false, true, 0);
    // The hyperprior's noise is drawn anew each time. Seeding it gives all draws the same noise.
    let estimate = |fraction: f64, seed: u64| {
        device.seed(1);
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        let rate = compression.rate(&noisy, fraction, true, None, 0.0, &mut generator);
        let [planes, sh] = [rate.planes, rate.sh].map(|part| part.unwrap().bits().into_scalar::<f64>());
        (planes, sh)
    };
    let (planes, sh) = estimate(1.0, 0);
    const DRAWS: u64 = 400;
    let (mut planes_sum, mut sh_sum) = (0.0, 0.0);
    for draw in 0..DRAWS {
        let (planes, sh) = estimate(0.25, draw);
        planes_sum += planes / DRAWS as f64;
        sh_sum += sh / DRAWS as f64;
    }
    assert!((planes_sum / planes - 1.0).abs() < 0.05, "planes: {planes_sum} on parts, {planes} on all");
    assert!((sh_sum / sh - 1.0).abs() < 0.02, "spherical harmonics: {sh_sum} on parts, {sh} on all");
}

/// With every part switched off, every model of the spherical harmonics, both profiles and every degree, the file
/// decodes to the values that the encoder reported and has the size that the models expect.
#[test]
fn every_configuration_makes_a_file_that_decodes() {
    let device = Device::flex().autodiff();
    for overrides in [
        &[][..],
        &["compression.profile=paper"],
        &["compression.context.architecture=reference"],
        &["compression.context.parts=['hyperprior', 'inter_plane', 'inter_scale']"],
        &["compression.context.parts=['hyperprior', 'checkerboard', 'inter_scale']"],
        &["compression.context.parts=['hyperprior', 'checkerboard', 'inter_plane']"],
        &["compression.context.parts=['checkerboard', 'inter_plane', 'inter_scale']"],
        &["compression.context.parts=['hyperprior', 'inter_scale', 'high_scale_hyperprior']"],
        &["compression.context.parts=[]"],
        &["compression.sh.model=mixture_of_logistics"],
        &["compression.sh.model=mixture_of_logistics", "compression.profile=paper"],
        &["compression.sh.model=channel_autoregressive"],
        &["compression.sh.model=hexplane_coupled"],
        &["model.sh_degree=0"],
        &["model.sh_degree=2"],
        &["model.hexplane.multipliers=[1]"],
        &["model.hexplane.multipliers=[1,2,4]"],
    ] {
        let config = config(overrides);
        let scene = scene(&config, &device);
        let mut compression = Compression::new(&ConfiguredModels, &config, scene.planes(), &device).unwrap();
        compression.start_from(scene.planes());
        let EncodedScene { file, estimate, .. } = coded(&scene, &compression, &config, &device);
        let decoded = decode(&file.bytes).unwrap();
        assert_eq!(decoded, file.decoded, "{overrides:?}");
        assert_eq!(decoded.gaussians.len(), scene.gaussians.len());
        let planes = &file.info.plane_bytes;
        let bytes: u64 = planes.iter().map(|plane| plane.total()).sum();
        let (expected, found) = (estimate.planes, 8.0 * bytes as f64);
        // The bytes that the sub-streams of a plane lose to whole words at their ends, and quantized weights.
        let slack = 60.0 * planes.len() as f64 + 0.002 * found;
        assert!((expected - found).abs() < slack, "{overrides:?}: {expected} bits, {found} in the file");
        if file.sh_is_an_attribute() {
            // Coded adaptively, without the model.
            assert_eq!(estimate.sh, 0.0, "{overrides:?}");
            continue;
        }
        let sh_bytes: u64 = file.sh.degrees.iter().sum();
        let (expected, found) = (estimate.sh, 8.0 * sh_bytes as f64);
        let slack = 60.0 * file.sh.degrees.len() as f64 + 0.002 * found;
        assert!((expected - found).abs() <= slack, "{overrides:?}: {expected} bits of harmonics, {found} in the file");
    }
}

/// The coder learns its statistics and knows more than a density. So it writes another number of bits than expected,
/// until the expected bits are corrected.
#[test]
fn corrected_bits_are_those_that_are_written() {
    let device = Device::flex().autodiff();
    let config = config(&["model.sh_degree=1", "compression.rate.attributes=true", "compression.rate.lambda=0.007"]);
    let scene = scene(&config, &device);
    let mut compression = Compression::of_run(&ConfiguredModels, &config, &scene, &device).unwrap().unwrap();
    compression.start_attributes_from(&scene.gaussians);
    let ratios = |compression: &_| {
        let EncodedScene { file, attributes, .. } = coded(&scene, compression, &config, &device);
        let in_file = |record: &&AttributeRecord| file.info.attributes.iter().any(|found| found.name == record.name);
        let ratio = |record: &AttributeRecord| record.estimated_bits / record.coded_bits;
        attributes.iter().filter(in_file).map(ratio).collect::<Vec<f64>>()
    };
    let before = ratios(&compression);
    assert!(before.iter().any(|ratio| (ratio - 1.0).abs() > 0.02), "{before:?}");
    let so_far = encoded_so_far(&scene, &compression, SceneMeta::default(), &config.compression).unwrap();
    compression.correct_expected_bits(&so_far, &device);
    let after = ratios(&compression);
    // What a factor of more than 2 would have to mend, and positions, which are counted already.
    let within = |(before, after): (&f64, &f64)| *before > 1.9 || *before < 0.55 || (after - 1.0).abs() < 0.01;
    assert!(before.iter().zip(&after).skip(1).all(within), "{before:?}, corrected {after:?}");
}

/// Frozen planes are the planes of the file, bit for bit, so that the rest of the scene is trained around the values
/// that it will have.
#[test]
fn frozen_planes_are_those_of_the_file() {
    for (name, device) in devices() {
        let device = device.autodiff();
        let config = config(&["model.hexplane.resolution=[16,16,16,8]", "compression.steps.space_time=0.01"]);
        let mut scene = scene(&config, &device);
        for plane in &mut scene.planes_mut().unwrap().planes {
            let noise = Tensor::random(plane.dims(), Distribution::Normal(0.0, 0.05), &device);
            *plane = burn::module::Param::from_tensor((plane.val() + noise).detach());
        }
        let mut compression = Compression::new(&ConfiguredModels, &config, scene.planes(), &device).unwrap();
        let mut models = compression.planes.unwrap();
        models.context =
            shaken(models.context, &scene.planes().unwrap().tensors(), &models.quantization.steps_without_gradient());
        compression.planes = Some(models);
        let before = scene.planes().unwrap().to_arrays();
        *scene.planes_mut().unwrap() =
            freeze_planes(&scene, &compression, &config.compression, &device).unwrap().unwrap();
        let frozen = scene.planes().unwrap().to_arrays();
        assert_ne!(frozen, before, "{name}");
        let encoded = coded(&scene, &compression, &config, &device);
        assert_eq!(encoded.file.decoded.feature_planes, frozen, "{name}");
    }
}

/// A hyperprior that is sensitive to rounding gives other symbols each time that decoded planes are coded again.
/// However often that happens, no value changes by more than rounding.
#[test]
fn freezing_does_not_carry_planes_away() {
    let device = Device::flex().autodiff();
    device.seed(5);
    let config = config(&["model.hexplane.resolution=[16,16,16,8]"]);
    let mut scene = scene(&config, &device);
    for plane in &mut scene.planes_mut().unwrap().planes {
        let noise = Tensor::random(plane.dims(), Distribution::Normal(0.0, 0.2), &device);
        *plane = burn::module::Param::from_tensor((plane.val() + noise).detach());
    }
    let mut compression = Compression::new(&ConfiguredModels, &config, scene.planes(), &device).unwrap();
    let mut models = compression.planes.unwrap();
    let steps = models.quantization.steps_without_gradient();
    models.context = shaken(models.context, &scene.planes().unwrap().tensors(), &steps);
    models.context.hyperprior = models.context.hyperprior.map(|mut hyperprior| {
        let [.., last] = &mut hyperprior.analysis;
        last.weight = burn::module::Param::from_tensor((last.weight.val() * 40.0).detach());
        let weight = &mut hyperprior.synthesis_out.weight;
        *weight = burn::module::Param::from_tensor((weight.val() * 100.0).detach());
        hyperprior
    });
    let steps: Vec<f32> = (0..scene.planes().unwrap().planes.len()).map(|i| steps.of(i).into_scalar()).collect();
    compression.planes = Some(models);
    let before = scene.planes().unwrap().to_arrays();
    let frozen = freeze_planes(&scene, &compression, &config.compression, &device).unwrap().unwrap().to_arrays();
    for ((before, frozen), step) in before.planes.iter().zip(&frozen.planes).zip(steps) {
        let moved = before.values.iter().zip(&frozen.values).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(moved > 0.1 * step && moved < 0.501 * step, "a value moved by {} of a step", moved / step);
    }
}

#[test]
fn a_scene_without_gaussians_is_a_file_too() {
    let device = Device::flex().autodiff();
    let config = config(&[]);
    let full = scene(&config, &device).to_arrays(SceneMeta::default()).unwrap();
    let mut empty = full;
    empty.gaussians = light4gs_codec::GaussianArrays { sh_degree: 3, ..Default::default() };
    let scene: DynamicScene = DynamicScene::from_arrays(&empty, &device).unwrap();
    let compression = Compression::new(&ConfiguredModels, &config, scene.planes(), &device).unwrap();
    let encoded = coded(&scene, &compression, &config, &device);
    assert!(decode(&encoded.file.bytes).unwrap().gaussians.is_empty());
}
