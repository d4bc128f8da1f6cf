use burn::tensor::{Distribution, Tensor};
use light4gs_model::gaussian_conditional::*;
use light4gs_model::ops::normal_cdf::normal_cdf;
use light4gs_model::*;
use light4gs_tests::golden::{devices, values_of};
use std::time::Instant;
fn fastest(mut run: impl FnMut()) -> f64 {
    run();
    (0..9)
        .map(|_| {
            let s = Instant::now();
            run();
            s.elapsed().as_secs_f64() * 1e3
        })
        .fold(f64::INFINITY, f64::min)
}
#[test]
fn profile() {
    for (name, device) in devices() {
        let shape = [16usize, 64, 64];
        let plain = device.clone();
        let device = device.autodiff();
        let r = |n: usize| Tensor::<3>::random([n, 64, 64], Distribution::Normal(0.0, 1.0), &device).require_grad();
        let [y, m] = [r(16), r(16)];
        println!(
            "{name} noise {:.2}",
            fastest(|| drop(Tensor::<3>::random(shape, Distribution::Uniform(-0.5, 0.5), &plain)))
        );
        let p = Tensor::<3>::random(shape, Distribution::Normal(0.0, 1.0), &plain);
        println!("{name} add {:.3}", fastest(|| drop(p.clone() + p.clone())));
        println!("{name} mul scalar {:.3}", fastest(|| drop(p.clone() * 2.0)));
        println!("{name} exp {:.3}", fastest(|| drop(p.clone().exp())));
        println!("{name} log {:.3}", fastest(|| drop((p.clone()).log())));
        println!("{name} recip {:.3}", fastest(|| drop((p.clone()).recip())));
        println!("{name} ge {:.3}", fastest(|| drop(p.clone().greater_equal_elem(0.0))));
        let mask = p.clone().greater_equal_elem(0.0);
        println!("{name} mask_where {:.3}", fastest(|| drop(p.clone().mask_where(mask.clone(), p.clone()))));
        println!("{name} cdf {:.3}", fastest(|| drop(normal_cdf(p.clone()))));
        println!("{name} lik f {:.2}", fastest(|| drop(gaussian_likelihood(p.clone(), p.clone(), p.clone()))));
        println!(
            "{name} bits fb {:.2}",
            fastest(|| drop(bits(gaussian_likelihood(y.clone(), m.clone(), y.clone())).sum().backward()))
        );
        let lower = Tensor::<3>::random([16, 32, 32], Distribution::Normal(0.0, 1.0), &device).require_grad();
        println!(
            "{name} up f {:.2} fb {:.2}",
            fastest(|| drop(values_of(&upsample(lower.clone(), [64, 64])))),
            fastest(|| drop(upsample(lower.clone(), [64, 64]).sum().backward()))
        );
        for (n, c) in [
            ("dw3 m2", PlaneConvConfig::new(16, 32, 3).with_groups(16)),
            ("dw5 cb", PlaneConvConfig::new(16, 32, 5).with_groups(16).with_checkerboard(true)),
            ("full5", PlaneConvConfig::new(16, 32, 5)),
            ("full5 cb", PlaneConvConfig::new(16, 32, 5).with_checkerboard(true)),
            ("1x1 24-24", PlaneConvConfig::new(16, 24, 1)),
        ] {
            let conv = c.init(&device);
            println!(
                "{name} {n} f {:.2} fb {:.2}",
                fastest(|| drop(values_of(&conv.forward(y.clone())))),
                fastest(|| drop(conv.forward(y.clone()).sum().backward()))
            );
            let o = burn::tensor::ops::ConvOptions::new([1; 2], [c.kernel / 2; 2], [1, 1], c.groups);
            let f = || {
                burn::tensor::module::conv2d(
                    y.clone().unsqueeze::<4>(),
                    conv.weight.val(),
                    Some(conv.bias.val()),
                    o.clone(),
                )
            };
            println!(
                "{name} {n} burn f {:.2} fb {:.2}",
                fastest(|| drop(values_of(&f()))),
                fastest(|| drop(f().sum().backward()))
            );
        }
        let ep = EntropyParametersConfig::new(16, [24, 24]).init(&device);
        let x = r(32);
        println!(
            "{name} ep f {:.2} fb {:.2}",
            fastest(|| drop(values_of(&ep.forward(Some(x.clone()), None, [64, 64]).means))),
            fastest(|| drop({
                let g = ep.forward(Some(x.clone()), None, [64, 64]);
                (g.means.sum() + g.scales.sum()).backward()
            }))
        );
        let h = HyperpriorConfig::new(16, 4, [4, 4]).init(&device);
        println!("{name} h_a fb {:.2}", fastest(|| drop(h.analyze(y.clone()).sum().backward())));
        let z = Tensor::<3>::random([4, 16, 16], Distribution::Normal(0.0, 1.0), &device).require_grad();
        println!("{name} h_s fb {:.2}", fastest(|| drop(h.synthesize(z.clone()).sum().backward())));
        println!("{name} eb fb {:.2}", fastest(|| drop(h.bottleneck.likelihood(z.clone()).sum().backward())));
    }
}
