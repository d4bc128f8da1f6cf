//! `cargo bench`: the kernels on every back end that is built, on the generated scenes of `light4gs bench`.

use burn::module::Module;
use burn::tensor::{Device, Distribution, Tensor};
use criterion::{BatchSize, BenchmarkId, Criterion, criterion_group, criterion_main};
use light4gs_model::ops::adam::{AdamStep, adam_step};
use light4gs_model::ops::skinning::skin;
use light4gs_model::{HexPlaneConfig, Splatter};
use light4gs_train::benchmark::{BenchScene, skinning_inputs};
use light4gs_train::device::{built_in, device_by_name};

const GAUSSIANS: usize = 20_000;
const SIZE: u32 = 400;

/// Waits for what a device was asked to do: a graphics card answers before it has done it.
fn finished<T>(device: &Device, output: T) -> T {
    let _ = device.sync();
    output
}

fn splatting(criterion: &mut Criterion) {
    let scene = BenchScene::generate(GAUSSIANS, SIZE);
    let mut group = criterion.benchmark_group("splat 20k @ 400²");
    group.sample_size(10);
    for name in built_in() {
        let device = device_by_name(name).expect("a built-in device");
        let splatter = Splatter::new([1.0; 3], 3);
        let still = scene.gaussians(&device);
        group.bench_function(BenchmarkId::new("forward", name), |bencher| {
            bencher.iter(|| finished(&device, splatter.render(still.tensors(), scene.camera(), None).image));
        });
        let trained = scene.gaussians(&device.clone().autodiff());
        let loss = || finished(&device, splatter.render(trained.tensors(), scene.camera(), None).image.sum());
        group.bench_function(BenchmarkId::new("backward", name), |bencher| {
            bencher.iter_batched(loss, |loss| finished(&device, loss.backward()), BatchSize::PerIteration);
        });
    }
    group.finish();
}

fn hexplane(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("hexplane 20k points, 32 channels, 64³·24, scales 1 and 2");
    group.sample_size(10);
    for name in built_in() {
        let device = device_by_name(name).expect("a built-in device").autodiff();
        let planes = HexPlaneConfig { resolution: [64, 64, 64, 24], ..Default::default() }.init(&device);
        let points = Tensor::<2>::random([GAUSSIANS, 4], Distribution::Uniform(-1.0, 1.0), &device).require_grad();
        // Off the tape, which no backward pass would clear.
        let (still_planes, still_points) = (planes.valid(), points.clone().inner());
        group.bench_function(BenchmarkId::new("forward", name), |bencher| {
            bencher.iter(|| finished(&device, still_planes.query(still_points.clone())));
        });
        group.bench_function(BenchmarkId::new("backward", name), |bencher| {
            let loss = || finished(&device, planes.query(points.clone()).sum());
            bencher.iter_batched(loss, |loss| finished(&device, loss.backward()), BatchSize::PerIteration);
        });
    }
    group.finish();
}

fn skinning(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("skinning 10k Gaussians");
    group.sample_size(10);
    for (name, nodes) in built_in().into_iter().flat_map(|name| [32, 128].map(|nodes| (name, nodes))) {
        let device = device_by_name(name).expect("a built-in device");
        let still = skinning_inputs(10_000, nodes, &device);
        group.bench_function(BenchmarkId::new(format!("{nodes} nodes, forward"), name), |bencher| {
            bencher.iter(|| finished(&device, skin(still.clone())));
        });
        let trained = skinning_inputs(10_000, nodes, &device.clone().autodiff());
        let loss = || finished(&device, skin(trained.clone()).sum());
        group.bench_function(BenchmarkId::new(format!("{nodes} nodes, backward"), name), |bencher| {
            bencher.iter_batched(loss, |loss| finished(&device, loss.backward()), BatchSize::PerIteration);
        });
    }
    group.finish();
}

fn adam(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("Adam, a million values");
    let step = AdamStep { learning_rate: 1e-3, beta_1: 0.9, beta_2: 0.999, epsilon: 1e-15, time: 10 };
    for name in built_in() {
        let device = device_by_name(name).expect("a built-in device");
        let random = || Tensor::<1>::random([1_000_000], Distribution::Default, &device);
        let gradient = random();
        group.bench_function(BenchmarkId::from_parameter(name), |bencher| {
            let tensors = || finished(&device, [random(), random(), random()]);
            bencher.iter_batched(
                tensors,
                |tensors| finished(&device, adam_step(tensors, gradient.clone(), step)),
                BatchSize::PerIteration,
            );
        });
    }
    group.finish();
}

criterion_group!(kernels, splatting, hexplane, skinning, adam);
criterion_main!(kernels);
