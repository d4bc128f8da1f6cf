//! Golden cases c04 (entropy bottlenecks) and c05 (Gaussian conditional) on every back end.

use burn::tensor::{Device, Distribution, Gradients, Tensor};
use light4gs_model::gaussian_conditional::{
    LIKELIHOOD_BOUND, NormalParameters, bits, gaussian_bits, gaussian_likelihood,
};
use light4gs_model::ops::lower_bound::lower_bound;
use light4gs_model::{
    EntropyBottleneck, EntropyBottleneckConfig, FactorizedDensity, Latent, PlainDensity, PlaneTensors, ShBottleneck,
    ShBottleneckConfig, ShEntropy, ShKnown, ShTables,
};
use light4gs_tests::golden::{Golden, assert_close, assert_close_relative, devices, values_of};
use light4gs_tests::named::{compare_density, load, load_density};

/// `[B, C, H, W]` in the shape of the bottleneck: `[C, B · H, W]`.
fn channels_first(tensor: Tensor<4>) -> Tensor<3> {
    let [batch, channels, height, width] = tensor.dims();
    tensor.swap_dims(0, 1).reshape([channels, batch * height, width])
}

fn latent(golden: &Golden, name: &str, device: &Device) -> Tensor<3> {
    channels_first(golden.tensor(name, device))
}

fn bottleneck_of(golden: &Golden, device: &Device) -> EntropyBottleneck {
    let mut bottleneck = EntropyBottleneckConfig::new(golden.shape("x")[1]).init(device);
    load_density(&mut bottleneck.density, golden, "param.");
    load(&mut bottleneck, golden, |path| (path == "quantiles").then(|| "param.quantiles".to_owned()));
    bottleneck
}

#[test]
fn bottleneck_starts_as_compressai() {
    let golden = Golden::open("c04_entropy_bottleneck");
    let bottleneck = EntropyBottleneckConfig::new(3).init(&Device::flex());
    let first = |density: &FactorizedDensity| -> Vec<f32> {
        density.matrices().iter().map(|matrix| values_of(matrix)[0]).collect()
    };
    assert_close("matrices", &first(&bottleneck.density), &golden.values("init.matrix_value"), 1e-6);
    assert_eq!(values_of(&bottleneck.quantiles.val())[..3], golden.values("param.quantiles_initial")[..3]);
    let sh = Golden::open("c04_sh_bottleneck");
    let found = first(&ShBottleneckConfig::new().init(&Device::flex()).density);
    for density in [&bottleneck.density, &ShBottleneckConfig::new().init(&Device::flex()).density] {
        let uniform = |matrix: &Tensor<3>| values_of(matrix).windows(2).all(|pair| pair[0] == pair[1]);
        assert!(density.matrices().iter().all(uniform));
        let biases: Vec<f32> = density.biases().iter().flat_map(values_of).collect();
        assert!(biases.iter().all(|bias| bias.abs() <= 0.5) && biases.iter().any(|bias| bias.abs() > 0.3));
        assert!(density.factors().iter().flat_map(values_of).all(|factor| factor == 0.0));
    }
    assert_close("sh matrices", &found, &sh.values("init.matrix_value"), 1e-6);
}

#[test]
fn bottleneck_rounds_around_the_median() {
    let golden = Golden::open("c04_entropy_bottleneck");
    for (name, device) in devices() {
        let bottleneck = bottleneck_of(&golden, &device);
        let x = latent(&golden, "x", &device);
        let (out, likelihood) = bottleneck.forward(x.clone(), Latent::Rounded);
        let expected = |key: &str| values_of(&latent(&golden, key, &device));
        assert_close(&format!("{name} out"), &values_of(&out), &expected("eval.out"), 1e-5);
        assert_close(&format!("{name} likelihood"), &values_of(&likelihood), &expected("eval.likelihood"), 5e-7);
        let total = bits(likelihood).sum().into_scalar::<f32>();
        assert_close_relative(&format!("{name} bits"), &[total], &golden.values("eval.bits"), 1e-4);
        assert_eq!(values_of(&bottleneck.symbols(x)), expected("code.symbols"), "{name} symbols");
    }
}

#[test]
fn bottleneck_gradients() {
    let golden = Golden::open("c04_entropy_bottleneck");
    for (name, device) in devices() {
        let device = device.autodiff();
        let bottleneck = bottleneck_of(&golden, &device);

        let x = golden.tensor::<4>("x", &device).require_grad();
        let noisy = channels_first(x.clone()) + latent(&golden, "noise.noise", &device);
        let (received, likelihood) = bottleneck.forward(noisy, Latent::Exact);
        let expected = |key: &str| values_of(&latent(&golden, key, &device));
        assert_close(&format!("{name} out"), &values_of(&received), &expected("noise.out"), 1e-5);
        assert_close(&format!("{name} likelihood"), &values_of(&likelihood), &expected("noise.likelihood"), 5e-7);
        let loss = (likelihood * latent(&golden, "noise.w", &device)).sum();
        check_bottleneck(&format!("{name} noise"), &bottleneck, &golden, "noise", &x, &loss.backward());

        let x = golden.tensor::<4>("x", &device).require_grad();
        let (_, likelihood) = bottleneck.forward(bits_input(&golden, &x, &device), Latent::Exact);
        let loss = bits(likelihood).sum();
        assert_close_relative(&format!("{name} bits"), &values_of(&loss), &golden.values("bits.total"), 1e-4);
        check_bottleneck(&format!("{name} bits"), &bottleneck, &golden, "bits", &x, &loss.backward());
    }
}

fn bits_input(golden: &Golden, x: &Tensor<4>, device: &Device) -> Tensor<3> {
    channels_first(x.clone()) + latent(golden, "noise.noise", device)
}

fn check_bottleneck(
    what: &str,
    bottleneck: &EntropyBottleneck,
    golden: &Golden,
    prefix: &str,
    x: &Tensor<4>,
    gradients: &Gradients,
) {
    let found = values_of(&x.grad(gradients).unwrap());
    assert_close_relative(&format!("{what} grad_x"), &found, &golden.values(&format!("{prefix}.grad_x")), 1e-4);
    let compared = compare_density(what, &bottleneck.density, gradients, 1e-4, golden, &format!("{prefix}.grad."));
    assert_eq!(compared, 5 + 5 + 4, "{what}: compared parameters");
}

/// CompressAI's integer tables (README of the golden vectors; NOTES 20): rounding, rescaling, then for each empty
/// symbol one is taken from the smallest frequency above one.
fn quantized_cdf(pmf: &[f64], tail: f64) -> Vec<i64> {
    const TOTAL: i64 = 1 << 16;
    let frequencies: Vec<i64> = pmf.iter().chain([&tail]).map(|p| (*p as f32 * TOTAL as f32).round() as i64).collect();
    let sum: i64 = frequencies.iter().sum();
    let mut cdf = vec![0];
    for frequency in frequencies {
        cdf.push(cdf[cdf.len() - 1] + TOTAL * frequency / sum);
    }
    *cdf.last_mut().unwrap() = TOTAL;
    for i in 0..cdf.len() - 1 {
        if cdf[i] == cdf[i + 1] {
            let width = |j: usize| cdf[j + 1] - cdf[j];
            let donor = (0..cdf.len() - 1).filter(|j| width(*j) > 1).min_by_key(|j| width(*j)).unwrap();
            if donor < i {
                cdf[donor + 1..=i].iter_mut().for_each(|c| *c -= 1);
            } else {
                cdf[i + 1..=donor].iter_mut().for_each(|c| *c += 1);
            }
        }
    }
    cdf
}

/// The tables that CompressAI makes from the bottleneck's quantiles. Its upper tail begins at the end of the longest
/// row.
fn tables(bottleneck: &EntropyBottleneck) -> Vec<(i64, Vec<i64>)> {
    let density = bottleneck.density.to_plain();
    let medians: Vec<f64> = bottleneck.medians().into_data().iter::<f64>().collect();
    let ranges = bottleneck.symbol_ranges();
    let longest = ranges.iter().map(|range| range.clone().count()).max().unwrap();
    let sigmoid = |x: f64| 1.0 / (1.0 + (-x).exp());
    let channels = ranges.into_iter().enumerate().map(|(channel, range)| {
        let first = f64::from(*range.start()) + medians[channel];
        let last = first + (longest - 1) as f64;
        let tail = sigmoid(density.logit(channel, first - 0.5)) + sigmoid(-density.logit(channel, last + 0.5));
        let pmf = bottleneck.pmf(range.clone());
        (i64::from(*range.start()), quantized_cdf(&pmf[channel], tail))
    });
    channels.collect()
}

#[test]
fn bottleneck_tables() {
    let golden = Golden::open("c04_entropy_bottleneck");
    let device = Device::flex();
    let mut bottleneck = bottleneck_of(&golden, &device);
    let check = |bottleneck: &EntropyBottleneck, prefix: &str| {
        let cdf = golden.integers(&format!("{prefix}.quantized_cdf"));
        let offsets = golden.integers(&format!("{prefix}.offset"));
        let lengths = golden.integers(&format!("{prefix}.cdf_length"));
        let row = cdf.len() / lengths.len();
        for (channel, (offset, found)) in tables(bottleneck).into_iter().enumerate() {
            assert_eq!(offset, offsets[channel], "{prefix} offset of channel {channel}");
            assert_eq!(found, cdf[channel * row..][..lengths[channel] as usize], "{prefix} channel {channel}");
        }
    };
    assert_close("medians", &values_of(&bottleneck.medians()), &golden.values("table.medians"), 1e-5);
    check(&bottleneck, "table");
    // The search finds the quantiles that CompressAI's search has found.
    let expected = golden.values("param.quantiles");
    bottleneck.update_quantiles();
    assert_close_relative("quantiles", &values_of(&bottleneck.quantiles.val()), &expected, 1e-3);

    load(&mut bottleneck, &golden, |path| (path == "quantiles").then(|| "param.quantiles_initial".to_owned()));
    check(&bottleneck, "table_default_quantiles");
}

#[test]
fn bottleneck_cumulative_and_auxiliary_loss() {
    let golden = Golden::open("c04_entropy_bottleneck");
    let places = golden.values("cumulative.x");
    let expected = golden.values("cumulative.logits");
    for (name, device) in devices() {
        let device = device.autodiff();
        let mut bottleneck = bottleneck_of(&golden, &device);
        let channels = bottleneck.density.channels();
        let x = golden.tensor::<2>("cumulative.x", &device).expand([channels, places.len()]);
        let logits = values_of(&bottleneck.density.logits(x));
        assert_close_relative(&format!("{name} logits"), &logits, &expected, 1e-5);
        let plain: PlainDensity = bottleneck.density.to_plain();
        let logits: Vec<f32> = (0..channels)
            .flat_map(|channel| places.iter().map(|x| plain.logit(channel, f64::from(*x)) as f32).collect::<Vec<_>>())
            .collect();
        assert_close_relative("plain logits", &logits, &expected, 1e-6);

        load(&mut bottleneck, &golden, |path| (path == "quantiles").then(|| "param.quantiles_initial".to_owned()));
        let loss = bottleneck.auxiliary_loss();
        assert_close_relative(&format!("{name} aux"), &values_of(&loss), &golden.values("aux_loss_initial"), 1e-4);
        let gradients = loss.backward();
        let gradient = values_of(&bottleneck.quantiles.val().grad(&gradients).unwrap());
        let expected = golden.values("aux_loss_initial_grad_quantiles");
        assert_close_relative(&format!("{name} grad quantiles"), &gradient, &expected, 1e-4);
        assert!(bottleneck.density.parameters.val().grad(&gradients).is_none());
    }
}

fn sh_of(golden: &Golden, device: &Device) -> ShBottleneck {
    let mut model = ShBottleneckConfig::new().with_step(golden.scalar("Q")).init(device);
    load_density(&mut model.density, golden, "param.");
    model
}

fn nothing_known(values: &Tensor<3>) -> ShKnown {
    let (count, device) = (values.dims()[0], values.device());
    ShKnown {
        sh_dc: Tensor::zeros([count, 1, 3], &device),
        positions: Tensor::zeros([count, 3], &device),
        planes: PlaneTensors::default(),
    }
}

#[test]
fn sh_bottleneck() {
    let golden = Golden::open("c04_sh_bottleneck");
    for (name, device) in devices() {
        let device = device.autodiff();
        let model = sh_of(&golden, &device);
        let step = golden.scalar("Q");
        for prefix in ["noise", "symbols"] {
            let what = format!("{name} {prefix}");
            let x = golden.tensor::<3>("x", &device).require_grad();
            let known = nothing_known(&x);
            let values = match prefix {
                "noise" => x.clone() + golden.tensor::<3>("noise.unit_noise", &device) * step,
                // The straight-through gradient.
                _ => x.clone() + (model.quantize(x.clone(), &known) - x.clone()).detach(),
            };
            let expected = |key: &str| golden.values(&format!("{prefix}.{key}"));
            assert_close(&format!("{what} out"), &values_of(&values), &expected("out"), 1e-5);
            let likelihood = model.likelihood(values.clone());
            assert_close(&format!("{what} likelihood"), &values_of(&likelihood), &expected("likelihood"), 1e-6);
            let found = model.bits(values, &known);
            assert_close_relative(&format!("{what} bits"), &values_of(&found), &expected("bits_per_symbol"), 1e-4);
            let total = found.sum();
            assert_close_relative(&format!("{what} total"), &values_of(&total), &expected("total_bits"), 1e-4);
            let gradients = total.backward();
            let gradient = values_of(&x.grad(&gradients).unwrap());
            assert_close_relative(&format!("{what} grad_x"), &gradient, &expected("grad_x"), 1e-4);
            let prefix = format!("{prefix}.grad.");
            let compared = compare_density(&what, &model.density, &gradients, 1e-4, &golden, &prefix);
            assert_eq!(compared, 3 * 4, "{what}: compared parameters");
        }
    }
}

/// The reference's float tables: cumulative sums of the probabilities, from the lowest symbol on.
#[test]
fn sh_bottleneck_tables() {
    let golden = Golden::open("c04_sh_bottleneck");
    let model = sh_of(&golden, &Device::flex());
    let header = golden.integers("torchac.header_i32");
    let pmf = model.pmf(header[5] as i32..=header[6] as i32);
    let found: Vec<f32> = pmf
        .iter()
        .flat_map(|pmf| {
            let mut sum = 0.0;
            let sums = pmf.iter().map(move |p| {
                sum += p;
                (sum as f32).clamp(0.0, 1.0)
            });
            [0.0].into_iter().chain(sums)
        })
        .collect();
    assert_close("cdf", &found, &golden.values("torchac.cdf_f32"), 1e-6);
}

#[test]
fn gaussian_conditional() {
    let golden = Golden::open("c05_gaussian_conditional");
    for (name, device) in devices() {
        let device = device.autodiff();
        let read = |key: &str| golden.tensor::<4>(key, &device);
        let leaf = |key: &str| read(key).require_grad();

        let means = read("in.means");
        let rounded = (read("in.y") - means.clone()).round() + means.clone();
        assert_close(&format!("{name} eval.out"), &values_of(&rounded), &golden.values("eval.out"), 1e-5);
        let likelihood = gaussian_likelihood(rounded, NormalParameters::new(means, read("in.scales")));
        let expected = golden.values("eval.likelihood");
        assert_close(&format!("{name} eval.likelihood"), &values_of(&likelihood), &expected, 3e-7);
        let total = bits(likelihood).sum();
        assert_close_relative(&format!("{name} eval.bits"), &values_of(&total), &golden.values("eval.bits"), 1e-5);

        let noisy = read("in.y") + read("noise.noise");
        let likelihood =
            gaussian_likelihood(noisy.clone(), NormalParameters::new(noisy.zeros_like(), read("in.scales")));
        let expected = golden.values("noise.likelihood_no_means");
        assert_close(&format!("{name} no means"), &values_of(&likelihood), &expected, 3e-7);

        for prefix in ["noise", "bits"] {
            let [y, means, scales] = ["in.y", "in.means", "in.scales"].map(leaf);
            // Relative to the means: the sum of value and noise alone, in float32, is wrong by more than the tolerance.
            let origin = read("in.means");
            let values = (y.clone() - origin.clone()) + read("noise.noise");
            let parameters = NormalParameters::new(means.clone() - origin, scales.clone());
            let loss = if prefix == "noise" {
                let likelihood = gaussian_likelihood(values, parameters);
                let expected = golden.values("noise.likelihood");
                assert_close(&format!("{name} noise.likelihood"), &values_of(&likelihood), &expected, 3e-7);
                (likelihood * read("noise.w")).sum()
            } else {
                let total = gaussian_bits(values, parameters).sum();
                assert_close_relative(&format!("{name} bits"), &values_of(&total), &golden.values("bits.total"), 1e-5);
                total
            };
            let gradients = loss.backward();
            for (input, leaf) in [("y", y), ("means", means), ("scales", scales)] {
                let key = format!("{prefix}.grad_{input}");
                let gradient = values_of(&leaf.grad(&gradients).unwrap());
                assert_close_relative(&format!("{name} {key}"), &gradient, &golden.values(&key), 1e-4);
            }
        }
    }
}

/// The gradient below the bound: it is passed if gradient descent would raise the value, and blocked otherwise. At the
/// bound it is always passed.
#[test]
fn lower_bound_gradient() {
    for (name, device) in devices() {
        let device = device.autodiff();
        let x = Tensor::<1>::random([200], Distribution::Uniform(-1.0, 1.0), &device);
        let x = Tensor::cat(vec![x, Tensor::from_floats([LIKELIHOOD_BOUND, 0.25], &device)], 0).require_grad();
        let w = Tensor::<1>::random([202], Distribution::Uniform(-1.0, 1.0), &device);
        let gradients = (lower_bound(x.clone(), 0.25) * w.clone()).sum().backward();
        let found = values_of(&x.grad(&gradients).unwrap());
        let (x, w) = (values_of(&x), values_of(&w));
        let expected: Vec<f32> = x.iter().zip(&w).map(|(x, w)| if *x >= 0.25 || *w < 0.0 { *w } else { 0.0 }).collect();
        assert_eq!(found, expected, "{name}");
    }
}
