//! How long a rate term takes, forward and backward, beside a matrix product on the same machine. Not a check but a
//! measurement: `cargo test --release --workspace --test rate_speed -- --ignored --nocapture`.

use std::time::Instant;

use burn::tensor::{Device, Distribution, Tensor};
use light4gs_model::{
    ContextModelConfig, HexPlaneConfig, Latent, PlaneSteps, ShAutoregressiveConfig, ShBottleneckConfig, ShEntropy,
    ShEntropyConfig, ShKnown, ShMixtureConfig,
};
use light4gs_tests::golden::{devices, values_of};

/// The fastest of several runs, in milliseconds: what else runs on the machine only adds.
fn fastest(mut run: impl FnMut()) -> f64 {
    run();
    let times = (0..7).map(|_| {
        let start = Instant::now();
        run();
        start.elapsed().as_secs_f64() * 1e3
    });
    times.fold(f64::INFINITY, f64::min)
}

fn matrix_product(device: &Device) -> f64 {
    let [a, b] = [(); 2].map(|()| Tensor::<2>::random([1024, 1024], Distribution::Default, device));
    fastest(|| drop(values_of(&a.clone().matmul(b.clone()))))
}

#[test]
#[ignore = "a measurement"]
fn context_model() {
    let channels = 16;
    for (name, device) in devices() {
        println!("{name}: matrix product 1024×1024 in {:.1} ms", matrix_product(&device));
        let device = device.autodiff();
        let config = HexPlaneConfig::new().with_channels(channels).with_resolution([32, 32, 32, 32]);
        let hexplane = config.init(&device);
        let planes: Vec<_> = hexplane.planes.iter().map(|plane| plane.val()).collect();
        let steps = PlaneSteps::fixed(&[0.05; 12], &device);
        for (config_name, config) in
            [("compact", ContextModelConfig::compact(channels)), ("reference", ContextModelConfig::reference(channels))]
        {
            let model = config.init(&device);
            let selections: [(&str, &[usize]); 5] = [
                ("all planes", &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]),
                ("a third", &[1, 2, 7, 10]),
                ("one space-time plane below", &[2]),
                ("one space-only plane below", &[1]),
                ("one space-only plane above", &[7]),
            ];
            for (selected, selection) in selections {
                let forward = |back: bool| {
                    let rates = model.rate(&steps.add_noise(&planes), &steps, selection, Latent::Noise);
                    let bits = rates.into_iter().map(|rate| rate.total()).reduce(|sum, bits| sum + bits).unwrap();
                    if back {
                        drop(bits.backward());
                    } else {
                        values_of(&bits);
                    }
                };
                let [once, both] = [false, true].map(|back| fastest(|| forward(back)));
                println!("{name} {config_name} {selected}: forward {once:.1} ms, with backward {both:.1} ms");
            }
        }
    }
}

#[test]
#[ignore = "a measurement"]
fn spherical_harmonics() {
    const COUNT: usize = 4096;
    for (name, device) in devices() {
        println!("{name}: matrix product 1024×1024 in {:.1} ms", matrix_product(&device));
        let device = device.autodiff();
        let values = Tensor::<3>::random([COUNT, 15, 3], Distribution::Normal(0.0, 0.1), &device).require_grad();
        let known = ShKnown {
            sh_dc: Tensor::random([COUNT, 1, 3], Distribution::Default, &device),
            positions: Tensor::zeros([COUNT, 3], &device),
            planes: Vec::new(),
        };
        for (config_name, config) in [
            ("factorised", ShEntropyConfig::Factorized(ShBottleneckConfig::new())),
            ("mixture", ShEntropyConfig::Mixture(ShMixtureConfig::new())),
            ("autoregressive", ShEntropyConfig::Autoregressive(ShAutoregressiveConfig::new())),
        ] {
            let model = config.init(&device);
            let both = fastest(|| drop(model.bits(model.add_noise(values.clone()), &known).sum().backward()));
            println!("{name} {config_name} {COUNT} Gaussians: forward and backward {both:.1} ms");
        }
    }
}
