//! Golden cases c07 (spherical harmonics) and c08 (rasterizer, and its corner cases) on every back end.

use burn::tensor::{Device, Tensor, s};
use light4gs_data::Camera;
use light4gs_model::spherical_harmonics::{basis, basis_gradient, coefficient_count};
use light4gs_model::{GaussianTensors, PixelContribution, Significance, Splatter, VolumeWeight, least_significant};
use light4gs_tests::golden::{Golden, assert_close, assert_close_relative, devices, values_of};
use light4gs_tests::raster::{Leaves, camera_of};

/// `[3, H, W]` to `[H, W, 3]`.
pub(super) fn channels_last(values: &[f32]) -> Vec<f32> {
    let pixels = values.len() / 3;
    (0..pixels).flat_map(|p| (0..3).map(move |c| (p, c))).map(|(p, c)| values[c * pixels + p]).collect()
}

#[test]
fn spherical_harmonics() {
    let golden = Golden::open("c07_sh");
    let directions = golden.values("dirs");
    let sh = golden.values("sh");
    let coefficients = golden.shape("sh")[1];
    for degree in 0..=3 {
        let (weights, count) = (golden.values(&format!("deg{degree}.w")), coefficient_count(degree));
        let (mut colors, mut grad_dirs, mut grad_sh) = (Vec::new(), Vec::new(), vec![0.0; sh.len()]);
        for (n, direction) in directions.as_chunks::<3>().0.iter().enumerate() {
            let sh = |k: usize, c: usize| (n * coefficients + k) * 3 + c;
            let (b, d) = (basis(degree, *direction), basis_gradient(degree, *direction));
            let mut grad_dir = [0.0; 3];
            for c in 0..3 {
                let raw = 0.5 + (0..count).map(|k| b[k] * golden_sh(&golden, sh(k, c))).sum::<f32>();
                colors.push(raw.max(0.0));
                let weight = if raw < 0.0 { 0.0 } else { weights[3 * n + c] };
                for k in 0..count {
                    grad_sh[sh(k, c)] = weight * b[k];
                    for axis in 0..3 {
                        grad_dir[axis] += weight * d[k][axis] * golden_sh(&golden, sh(k, c));
                    }
                }
            }
            grad_dirs.extend(grad_dir);
        }
        let key = |name: &str| format!("deg{degree}.{name}");
        assert_close(&key("color"), &colors, &golden.values(&key("color")), 1e-5);
        assert_close_relative(&key("grad_sh"), &grad_sh, &golden.values(&key("grad_sh")), 1e-4);
        assert_close_relative(&key("grad_dirs"), &grad_dirs, &golden.values(&key("grad_dirs")), 1e-4);
    }
}

fn golden_sh(golden: &Golden, at: usize) -> f32 {
    thread_local!(static SH: std::cell::OnceCell<Vec<f32>> = const { std::cell::OnceCell::new() });
    SH.with(|sh| sh.get_or_init(|| golden.values("sh"))[at])
}

/// Images, radii and gradients of one camera. `grads` is the prefix of the gradients to compare with.
fn check_camera(golden: &Golden, camera_name: &str, grads_key: &str, with_depth: bool) {
    let key = |name: &str| format!("{camera_name}.{name}");
    let size = golden.integers(&key("width_height"));
    let camera = camera_of(golden, &format!("{camera_name}."), size[0] as u32, size[1] as u32);
    let background: [f32; 3] = golden.values(&key("background")).try_into().unwrap();
    for (name, device) in devices() {
        let device = device.autodiff();
        let leaves = Leaves::read(golden, &device);
        let what = |tensor: &str| format!("{name} {camera_name}.{tensor}");

        for degree in 0..3 {
            let image_key = key(&format!("image_deg{degree}"));
            if golden.has(&image_key) {
                let image = leaves.render(&camera, background, degree).image;
                assert_close(&what(&image_key), &values_of(&image), &channels_last(&golden.values(&image_key)), 2e-5);
            }
        }
        let rendering = leaves.render(&camera, background, 3);
        let image = channels_last(&golden.values(&key("image")));
        assert_close(&what("image"), &values_of(&rendering.image), &image, 2e-5);
        let radii: Vec<i64> = rendering.radii.to_data().iter::<i64>().collect();
        assert_eq!(radii, golden.integers(&key("radii")), "{}", what("radii"));
        assert_eq!(rendering.invalid_count(), 0);
        if golden.has(&key("final_T")) {
            let transmittance: Vec<f32> = values_of(&rendering.alpha).iter().map(|a| 1.0 - a).collect();
            assert_close(&what("final_T"), &transmittance, &golden.values(&key("final_T")), 1e-5);
        }
        assert_close_relative(&what("depth"), &values_of(&rendering.depth), &golden.values(&key("depth_image")), 2e-5);

        let weights = channels_last(&golden.values(&key("w")));
        let weights = Tensor::<1>::from_floats(&weights[..], &device).reshape(rendering.image.dims());
        let mut loss = (rendering.image * weights).sum();
        if with_depth {
            loss = loss + (rendering.depth * golden.tensor(&key("w_depth"), &device)).sum();
        }
        let grads = loss.backward();
        let check = |tensor: &str, gradient: Vec<f32>| {
            let key = key(&format!("{grads_key}.{tensor}"));
            if golden.has(&key) {
                assert_close_relative(&format!("{name} {key}"), &gradient, &golden.values(&key), 1e-3);
            }
        };
        check("means", values_of(&leaves.means.grad(&grads).unwrap()));
        check("quats", values_of(&leaves.quats.grad(&grads).unwrap()));
        check("scales", values_of(&leaves.scales.grad(&grads).unwrap()));
        check("opacity", values_of(&leaves.opacities.grad(&grads).unwrap()));
        check("sh", values_of(&leaves.sh.grad(&grads).unwrap()));
        check("mean2D_ndc", values_of(&leaves.screen_offsets.grad(&grads).unwrap()));
    }
}

#[test]
fn rasterizer() {
    let golden = Golden::open("c08_raster");
    for camera in (0..).map(|k| format!("cam{k}")).take_while(|camera| golden.has(&format!("{camera}.image"))) {
        check_camera(&golden, &camera, "grad", false);
        if golden.has(&format!("{camera}.w_depth")) {
            check_camera(&golden, &camera, "grad_with_depth", true);
        }
    }
}

#[test]
fn rasterizer_corner_cases() {
    let golden = Golden::open("c08_raster_edge");
    check_camera(&golden, "cam0", "grad_autograd", false);
}

pub(super) const SCORES: [(&str, PixelContribution); 3] = [
    ("count", PixelContribution::PixelCount),
    ("sum_T_alpha", PixelContribution::BlendingWeight),
    ("sum_T_opacity", PixelContribution::TransmittanceOpacity),
];

/// Checks the scores under `prefix` and returns them in the order of [`SCORES`].
fn check_scores(golden: &Golden, what: &str, prefix: &str, significance: &Significance) -> Vec<Vec<f64>> {
    let check = |(name, score): (&str, PixelContribution)| {
        let key = format!("{prefix}.{name}");
        let found = significance.sums(score);
        let as_f32: Vec<f32> = found.iter().map(|v| *v as f32).collect();
        match score {
            PixelContribution::PixelCount => assert_eq!(as_f32, golden.values(&key), "{what} {key}"),
            _ => assert_close_relative(&format!("{what} {key}"), &as_f32, &golden.values(&key), 2e-5),
        }
        found
    };
    SCORES.map(check).into()
}

pub(super) fn significance_scene(case: &str) -> (Golden, Vec<Camera>) {
    let golden = Golden::open(case);
    let cameras = (0..)
        .map(|k| format!("cam{k}"))
        .take_while(|camera| golden.has(&format!("{camera}.sig.count")))
        .map(|camera| {
            let size = golden.integers(&format!("{camera}.width_height"));
            camera_of(&golden, &format!("{camera}."), size[0] as u32, size[1] as u32)
        })
        .collect();
    (golden, cameras)
}

#[test]
fn significance_of_each_image() {
    for case in ["c08_raster", "c08_raster_edge"] {
        let (golden, cameras) = significance_scene(case);
        for (name, device) in devices() {
            let gaussians = raw_gaussians(&golden, &device.autodiff());
            for (k, camera) in cameras.iter().enumerate() {
                let mut significance = Significance::new(gaussians.means.dims()[0]);
                significance.add(&Splatter::new([0.0; 3], 3), gaussians.clone(), camera);
                check_scores(&golden, &format!("{name} {case}"), &format!("cam{k}.sig"), &significance);
            }
        }
    }
}

#[test]
fn significance_over_views_with_volumes_and_masks() {
    let (golden, cameras) = significance_scene("c08_raster");
    let volumes: Vec<f64> =
        golden.values("scales").as_chunks::<3>().0.iter().map(|s| s.iter().map(|v| f64::from(*v)).product()).collect();
    for (name, device) in devices() {
        // The leaves are on the tape; the scores must not be.
        let gaussians = raw_gaussians(&golden, &device.autodiff());
        let mut significance = Significance::new(gaussians.means.dims()[0]);
        for camera in &cameras {
            significance.add(&Splatter::new([0.0; 3], 3), gaussians.clone(), camera);
        }
        let totals = check_scores(&golden, name, "sig_total", &significance);
        for ((score, _), total) in SCORES.into_iter().zip(&totals).skip(1) {
            let key = format!("sig_volume.clipped_{score}");
            let weights = VolumeWeight::Clamped { exponent: 0.1 }.of(&volumes);
            let found: Vec<f32> = weights.iter().zip(total).map(|(factor, score)| (factor * score) as f32).collect();
            assert_close_relative(&format!("{name} {key}"), &found, &golden.values(&key), 2e-5);
        }
        for percent in [19, 40] {
            let key = format!("sig_prune.mask_{percent}");
            let expected: Vec<bool> = golden.values(&key).iter().map(|v| *v != 0.0).collect();
            assert_eq!(least_significant(&totals[2], f64::from(percent) / 100.0), expected, "{name} {key}");
        }
    }
}

#[test]
fn least_significant_rows_with_ties() {
    let golden = Golden::open("c11_densify");
    let scores: Vec<f64> = golden.values("sigprune.score").iter().map(|v| f64::from(*v)).collect();
    for percent in ["05", "40", "60"] {
        let key = format!("sigprune.mask_{percent}");
        let expected: Vec<bool> = golden.values(&key).iter().map(|v| *v != 0.0).collect();
        let share = percent.parse::<f64>().unwrap() / 100.0;
        assert_eq!(least_significant(&scores, share), expected, "{key}");
    }
}

/// The scene's activated attributes, converted back to raw ones.
pub(super) fn raw_gaussians(golden: &Golden, device: &Device) -> GaussianTensors {
    let Leaves { means, quats, scales, opacities, sh, .. } = Leaves::read(golden, device);
    let [_, coefficients, _] = sh.dims();
    GaussianTensors {
        means,
        quats,
        log_scales: scales.log(),
        opacity_logits: (opacities.clone() / (opacities.neg() + 1.0)).log(),
        sh_dc: sh.clone().slice(s![.., 0..1, ..]),
        sh_rest: sh.slice(s![.., 1..coefficients, ..]),
        further: Vec::new(),
    }
}
