//! `cargo bench --bench rate`: what the rate term costs, forward and backward, for the context model by selections of
//! planes and for the entropy models of the spherical harmonics.

use burn::tensor::{Device, Distribution, Tensor};
use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use light4gs_model::{
    ContextModelConfig, HexPlaneConfig, Latent, PlaneEntropy, PlaneSteps, PlaneTensors, ShAutoregressiveConfig,
    ShBottleneckConfig, ShEntropy, ShEntropyConfig, ShKnown, ShMixtureConfig,
};
use light4gs_train::device::{built_in, device_by_name};

/// Channels of a plane, as in the small presets.
const CHANNELS: usize = 16;
/// Gaussians whose spherical harmonics are rated.
const GAUSSIANS: usize = 4096;

/// Waits for what a device was asked to do: a graphics card answers before it has done it.
fn wait_for(device: &Device) {
    let _ = device.sync();
}

fn context_model(criterion: &mut Criterion) {
    let selections: [(&str, &[usize]); 5] = [
        ("all planes", &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]),
        ("a third", &[1, 2, 7, 10]),
        ("one space-time plane below", &[2]),
        ("one space-only plane below", &[1]),
        ("one space-only plane above", &[7]),
    ];
    for name in built_in() {
        let device = device_by_name(name).expect("a built-in device").autodiff();
        let config = HexPlaneConfig { channels: CHANNELS, resolution: [32; 4], ..Default::default() };
        let planes = config.init(&device).tensors();
        let steps = PlaneSteps::fixed(&[0.05; 12], &device);
        for (sizes, config) in
            [("compact", ContextModelConfig::compact(CHANNELS)), ("reference", ContextModelConfig::reference(CHANNELS))]
        {
            let model = config.init(&device);
            let mut group = criterion.benchmark_group(format!("context model, {sizes}, {name}"));
            group.sample_size(10);
            for (selected, selection) in selections {
                group.bench_function(BenchmarkId::from_parameter(selected), |bencher| {
                    bencher.iter(|| {
                        let rates = model.rate(&steps.add_noise(&planes), &steps, selection, Latent::Noise);
                        let bits = rates.into_iter().map(|rate| rate.total()).reduce(|sum, bits| sum + bits);
                        drop(bits.expect("some planes").backward());
                        wait_for(&device);
                    });
                });
            }
            group.finish();
        }
    }
}

fn spherical_harmonics(criterion: &mut Criterion) {
    for name in built_in() {
        let device = device_by_name(name).expect("a built-in device").autodiff();
        let values = Tensor::<3>::random([GAUSSIANS, 15, 3], Distribution::Normal(0.0, 0.1), &device).require_grad();
        let known = ShKnown {
            sh_dc: Tensor::random([GAUSSIANS, 1, 3], Distribution::Default, &device),
            positions: Tensor::zeros([GAUSSIANS, 3], &device),
            planes: PlaneTensors::default(),
        };
        let mut group = criterion.benchmark_group(format!("spherical harmonics of {GAUSSIANS} Gaussians, {name}"));
        group.sample_size(10);
        for (model_name, config) in [
            ("factorized", ShEntropyConfig::Factorized(ShBottleneckConfig::new())),
            ("mixture", ShEntropyConfig::Mixture(ShMixtureConfig::new())),
            ("autoregressive", ShEntropyConfig::Autoregressive(ShAutoregressiveConfig::new())),
        ] {
            let model = config.init(&device);
            group.bench_function(BenchmarkId::from_parameter(model_name), |bencher| {
                bencher.iter(|| {
                    drop(model.bits(model.add_noise(values.clone()), &known).sum().backward());
                    wait_for(&device);
                });
            });
        }
        group.finish();
    }
}

criterion_group!(rate, context_model, spherical_harmonics);
criterion_main!(rate);
