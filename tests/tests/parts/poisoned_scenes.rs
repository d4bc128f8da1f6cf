//! The rasterizer on scenes that nobody would make on purpose: compared with a plain float64 twin, and repeated with
//! the same result.

use burn::tensor::Tensor;
use light4gs_data::{Camera, PointCloud};
use light4gs_model::{
    DeformationConfig, DynamicSceneConfig, GaussianTensors, GaussiansConfig, HexPlaneConfig, HexPlaneField,
    HexPlaneFieldConfig, Splatter,
};
use light4gs_tests::golden::{cpu_devices, devices, values_of};
use light4gs_tests::odd_scenes::{BACKGROUND, Run, SIZES, make_odd, point_in_view, poison, run};
use light4gs_tests::random::Random;
use light4gs_tests::splat_scene::{
    ATTRIBUTES, MEANS, QUATS, Ranges, SCALES, SCREEN_OFFSETS, SH_DC, SH_REST, SplatScene, WIDTHS, image_of,
    random_camera,
};
use light4gs_tests::twin;

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|v| v.to_bits()).collect()
}

#[track_caller]
fn assert_finite(what: &str, run: &Run) {
    let finite = |name: &str, values: &[f32]| {
        if let Some(i) = values.iter().position(|v| !v.is_finite()) {
            panic!("{what}: {name}[{i}] is {}", values[i]);
        }
    };
    finite("image", &run.image);
    for (name, gradient) in ATTRIBUTES.iter().zip(&run.gradients) {
        finite(name, gradient);
    }
    let alphas = run.image.iter().skip(3).step_by(5);
    assert!(alphas.clone().all(|alpha| (0.0..=1.0).contains(alpha)), "{what}: alpha outside of [0, 1]");
}

/// Equality of images, radii and gradients, bit by bit.
#[track_caller]
fn assert_same(what: &str, a: &Run, b: &Run) {
    assert_eq!(bits(&a.image), bits(&b.image), "{what}: image");
    assert_eq!(a.radii, b.radii, "{what}: radii");
    for (k, name) in ATTRIBUTES.iter().enumerate() {
        assert_eq!(bits(&a.gradients[k]), bits(&b.gradients[k]), "{what}: gradient of {name}");
    }
}

/// The number of Gaussians of each random scene. The scenes differ in everything else too.
const COUNTS: [usize; 12] = [1, 2, 3, 7, 16, 40, 100, 333, 511, 513, 1200, 2000];

#[test]
fn poisoned_gaussians_are_counted_and_leave_no_trace() {
    for (seed, count) in COUNTS.into_iter().cycle().take(36).enumerate() {
        let mut random = Random::new(1000 + seed as u64);
        let [width, height] = SIZES[random.below(SIZES.len())];
        let camera = random_camera(width, height, &mut random);
        let mut scene = SplatScene::random(count, &Ranges::default(), &mut random);
        let mut keep = vec![true; count];
        let mut done = Vec::new();
        for i in 0..count {
            match random.below(4) {
                0 => {
                    keep[i] = false;
                    done.push(poison(&mut scene, i, &camera, &mut random));
                }
                1 => make_odd(&mut scene, i, &camera, &mut random),
                _ => {}
            }
        }
        done.truncate(8);
        let clean = scene.filtered(&keep);
        for (name, device) in devices() {
            let what = format!("{name} seed {seed}, {count} Gaussians, {width}x{height}, {done:?}");
            let found = run(&scene, &camera, 3, &device);
            assert_finite(&what, &found);
            assert_eq!(found.invalid, keep.iter().filter(|keep| !**keep).count(), "{what}: invalid");
            for (i, keep) in keep.iter().enumerate() {
                assert_eq!(found.radii[i] == -1, !keep, "{what}: radius of {i}");
            }
            let expected = run(&clean, &camera, 3, &device);
            assert_eq!(expected.invalid, 0, "{what}");
            assert_eq!(bits(&found.image), bits(&expected.image), "{what}: image");
            // The gradients of the other Gaussians are the same too; those of the poisoned ones are zero.
            for (k, width) in WIDTHS.into_iter().enumerate() {
                let rows = found.gradients[k].chunks_exact(width).zip(&keep);
                let of_kept: Vec<f32> = rows.clone().filter(|(_, k)| **k).flat_map(|(r, _)| r.to_vec()).collect();
                assert_eq!(bits(&of_kept), bits(&expected.gradients[k]), "{what}: gradient of {}", ATTRIBUTES[k]);
                let mut of_poisoned = rows.filter(|(_, keep)| !**keep).flat_map(|(row, _)| row);
                assert!(of_poisoned.all(|g| *g == 0.0), "{what}: gradient of a poisoned Gaussian's {}", ATTRIBUTES[k]);
            }
        }
    }
}

/// Each kind of poison alone, so that no kind hides the effect of another.
#[test]
fn every_attribute_can_be_poisoned() {
    for (name, device) in devices() {
        let mut random = Random::new(5);
        let camera = random_camera(24, 20, &mut random);
        let clean = SplatScene::random(20, &Ranges::default(), &mut random);
        let expected = run(&clean, &camera, 3, &device);
        for (attribute, width) in WIDTHS.into_iter().enumerate() {
            for component in 0..width {
                for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                    let mut scene = clean.clone();
                    scene.push_random(&Ranges { half_size: 0.3, ..Ranges::default() }, &mut random);
                    scene.row_mut(attribute, 20)[component] = value;
                    let what = format!("{name} {value} in {}[{component}]", ATTRIBUTES[attribute]);
                    let found = run(&scene, &camera, 3, &device);
                    assert_finite(&what, &found);
                    assert_eq!(found.invalid, 1, "{what}");
                    assert_eq!(bits(&found.image), bits(&expected.image), "{what}");
                }
            }
        }
    }
}

/// Scenes in which half of the Gaussians have finite numbers of any size, 1e-37 to 10^`largest`, in some attributes.
/// Only one property of their images is known: they are finite. Returns the images that are not.
fn failures_at_extremes(attributes: &[usize], largest: f64) -> Vec<String> {
    let mut failures = Vec::new();
    for seed in 0..60 {
        let mut random = Random::new(3000 + seed);
        let [width, height] = SIZES[seed as usize % SIZES.len()];
        let camera = random_camera(width, height, &mut random);
        let mut scene = SplatScene::random(60, &Ranges::default(), &mut random);
        for i in (0..60).step_by(2) {
            let attribute = attributes[random.below(attributes.len())];
            let magnitude = 10f64.powf(random.uniform(-37.0, largest));
            let sign = if attribute == SCALES || random.below(2) == 0 { 1.0 } else { -1.0 };
            let value = f64::from((sign * magnitude) as f32);
            let row = scene.row_mut(attribute, i);
            match random.below(2) {
                0 => row.fill(value),
                _ => row[random.below(WIDTHS[attribute])] = value,
            }
        }
        for (name, device) in devices() {
            let found = run(&scene, &camera, 3, &device);
            let parts = std::iter::once(("image", &found.image)).chain(ATTRIBUTES.into_iter().zip(&found.gradients));
            for (part, values) in parts {
                let bad = values.iter().filter(|v| !v.is_finite()).count();
                if bad > 0 {
                    failures.push(format!("{name} seed {seed} {width}x{height}: {bad} values of {part}"));
                }
            }
        }
    }
    failures
}

#[test]
fn extreme_geometry_gives_finite_results() {
    let failures = failures_at_extremes(&[MEANS, QUATS, SCALES, SCREEN_OFFSETS], 38.0);
    assert!(failures.is_empty(), "{failures:#?}");
}

/// Colors above 1e30 are not tested: products of several of them overflow float32 in the backward pass.
#[test]
fn extreme_colors_give_finite_results() {
    let failures = failures_at_extremes(&[SH_DC, SH_REST], 30.0);
    assert!(failures.is_empty(), "{failures:#?}");
}

#[test]
fn no_gaussians_at_all() {
    for (name, device) in devices() {
        for [width, height] in SIZES {
            let camera = random_camera(width, height, &mut Random::new(1));
            let found = run(&SplatScene::default(), &camera, 3, &device);
            let [r, g, b] = BACKGROUND;
            let expected = [r, g, b, 0.0, 0.0].repeat((width * height) as usize);
            assert_eq!(found.image, expected, "{name} {width}x{height}");
            assert_eq!((found.invalid, found.radii.len()), (0, 0), "{name}");
            assert!(found.gradients.iter().all(Vec::is_empty), "{name}");
        }
    }
}

#[test]
fn all_behind_the_camera() {
    for (name, device) in devices() {
        let mut random = Random::new(2);
        let camera = random_camera(40, 30, &mut random);
        let mut scene = SplatScene::random(300, &Ranges::default(), &mut random);
        for i in 0..scene.len() {
            let (x, y) = (random.uniform(-1.0, 1.0) as f32, random.uniform(-1.0, 1.0) as f32);
            // The nearest of them lie just before the near plane.
            let depth = if i % 2 == 0 { 0.19 } else { -random.uniform(0.0, 5.0) };
            scene.row_mut(MEANS, i).copy_from_slice(&point_in_view(&camera, x, y, depth as f32));
        }
        let found = run(&scene, &camera, 3, &device);
        let [r, g, b] = BACKGROUND;
        assert_eq!(found.image, [r, g, b, 0.0, 0.0].repeat(40 * 30), "{name}");
        assert!(found.radii.iter().all(|radius| *radius == 0), "{name}: outside, yet not invalid");
        assert!(found.gradients.iter().flatten().all(|g| *g == 0.0), "{name}");
    }
}

#[test]
fn twenty_thousand_gaussians_in_one_tile() {
    let mut random = Random::new(3);
    let camera = random_camera(16, 16, &mut random);
    let ranges = Ranges { half_size: 0.4, scales: [0.01, 0.2], opacities: [0.005, 0.05], ..Ranges::default() };
    // More than needed, since those at almost equal depths are left out.
    let scene = SplatScene::random(30_000, &ranges, &mut random);
    let (scene, _) = twin::render_without_doubt(&scene, &camera, BACKGROUND, 3);
    let visible: Vec<bool> = twin::render(&scene, &camera, BACKGROUND, 3).radii.iter().map(|r| *r > 0).collect();
    let mut scene = scene.filtered(&visible);
    assert!(scene.len() >= 20_000, "{} left", scene.len());
    let first: Vec<bool> = (0..scene.len()).map(|i| i < 20_000).collect();
    scene = scene.filtered(&first);
    let twin = twin::render(&scene, &camera, BACKGROUND, 3);
    for (name, device) in devices() {
        let found = run(&scene, &camera, 3, &device);
        assert_finite(name, &found);
        // Thousands of blended splats a pixel: their rounding adds up, so a few times the usual tolerance.
        assert_twin(name, &found, &twin, 1e-3, 0.15);
    }
}

/// Pixels agree, except those where a threshold is within rounding; these are at most `doubtful` of all pixels.
#[track_caller]
fn assert_twin(what: &str, found: &Run, twin: &twin::TwinImage, tolerance: f64, doubtful: f64) {
    assert_eq!(found.radii, twin.radii, "{what}: radii");
    let depth_scale = twin.values.iter().skip(4).step_by(5).fold(1.0f64, |m, v| m.max(*v));
    let mut left_out = 0;
    for (pixel, (found, expected)) in found.image.chunks_exact(5).zip(twin.values.chunks_exact(5)).enumerate() {
        if twin.doubtful[pixel] {
            left_out += 1;
            continue;
        }
        for c in 0..5 {
            let error = (f64::from(found[c]) - expected[c]).abs() / if c == 4 { depth_scale } else { 1.0 };
            assert!(
                error <= tolerance,
                "{what}: pixel {pixel} channel {c} is {} against {}, off by {error:e}",
                found[c],
                expected[c]
            );
        }
    }
    let share = f64::from(left_out) / twin.doubtful.len() as f64;
    assert!(share <= doubtful, "{what}: {share} of the pixels are within rounding of a threshold");
}

#[test]
fn the_plain_twin_agrees() {
    for (seed, count) in COUNTS.into_iter().cycle().take(48).enumerate() {
        let mut random = Random::new(5000 + seed as u64);
        let [width, height] = SIZES[1 + random.below(SIZES.len() - 1)];
        let degree = random.below(4);
        let camera = random_camera(width, height, &mut random);
        let ranges = Ranges { half_size: random.uniform(0.3, 2.5), ..Ranges::default() };
        let mut scene = SplatScene::random(count, &ranges, &mut random);
        for i in (0..count).step_by(5) {
            make_odd(&mut scene, i, &camera, &mut random);
            // Neither is smooth enough for two precisions to agree on: at 0.201 the projection magnifies rounding by
            // hundreds of pixels, and a thin splat of hundreds of pixels has an ill-conditioned inverse.
            let steep = scene.row_mut(SCALES, i).iter().any(|scale| *scale > 1.0);
            if steep {
                scene.row_mut(SCALES, i).fill(1.5);
            }
            let mean = glam::Vec3::from_slice(&scene.row_mut(MEANS, i).iter().map(|v| *v as f32).collect::<Vec<_>>());
            let depth = (camera.rotation * mean + camera.translation).z;
            if (0.0..1.0).contains(&depth) {
                scene.row_mut(MEANS, i).copy_from_slice(&point_in_view(&camera, 0.3, 0.2, 1.0 + depth));
            }
        }
        let (scene, twin) = twin::render_without_doubt(&scene, &camera, BACKGROUND, degree);
        // Otherwise the two might agree on almost nothing.
        assert!(scene.len() + 2 + count / 5 >= count, "seed {seed}: {} of {count} Gaussians left", scene.len());
        for (name, device) in devices() {
            let what = format!("{name} seed {seed}, {} Gaussians, {width}x{height}, degree {degree}", scene.len());
            assert_twin(&what, &run(&scene, &camera, degree, &device), &twin, 2e-4, 0.15);
        }
    }
}

/// Scenes for the tests of reproducibility: several tiles, several chunks of Gaussians, odd ones among them.
fn busy_scene(seed: u64, count: usize) -> (SplatScene, Camera) {
    let mut random = Random::new(7000 + seed);
    let camera = random_camera(75, 50, &mut random);
    let mut scene = SplatScene::random(count, &Ranges::default(), &mut random);
    for i in (0..count).step_by(9) {
        make_odd(&mut scene, i, &camera, &mut random);
    }
    (scene, camera)
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let pool = |threads: usize| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let pools = [pool(1), pool(2), pool(5)];
    for (name, device) in devices() {
        for (seed, count) in [(0, 1), (1, 700), (2, 5000)] {
            let (scene, camera) = busy_scene(seed, count);
            let runs = pools.each_ref().map(|pool| pool.install(|| run(&scene, &camera, 3, &device)));
            for (k, other) in runs.iter().enumerate().skip(1) {
                assert_same(&format!("{name} {count} Gaussians, pool {k}"), &runs[0], other);
            }
        }
    }
}

/// The CPU back ends share their kernels. A graphics driver rounds differently: see `back_ends_agree.rs`.
#[test]
fn back_ends_of_the_cpu_agree_bit_by_bit() {
    for (seed, count) in [(10, 1), (11, 60), (12, 700), (13, 5000)] {
        let (scene, camera) = busy_scene(seed, count);
        let runs: Vec<_> =
            cpu_devices().into_iter().map(|(name, device)| (name, run(&scene, &camera, 3, &device))).collect();
        for (name, other) in &runs[1..] {
            assert_same(&format!("{count} Gaussians: {} and {name}", runs[0].0), &runs[0].1, other);
        }
    }
}

/// The values that are not finite after a bad raw value in one of two Gaussians.
#[derive(Default)]
struct RawFailures {
    image: Vec<String>,
    /// In the gradients of the Gaussian that has the value.
    own: Vec<String>,
    /// In the gradients of the other one.
    other: Vec<String>,
}

const RAW_ATTRIBUTES: [(&str, usize); 6] =
    [("means", 3), ("quats", 4), ("log_scales", 3), ("opacity_logits", 1), ("sh_dc", 3), ("sh_rest", 45)];

fn raw_failures() -> RawFailures {
    let mut failures = RawFailures::default();
    let camera = random_camera(20, 20, &mut Random::new(8));
    for (name, device) in devices() {
        let device = device.autodiff();
        for (attribute, _) in RAW_ATTRIBUTES {
            for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 100.0, -200.0] {
                let mut random = Random::new(9);
                let leaves = RAW_ATTRIBUTES.map(|(key, width)| {
                    let mut values: Vec<f32> = (0..2 * width).map(|_| 0.3 * random.normal() as f32).collect();
                    if key == attribute {
                        values[0] = value;
                    }
                    Tensor::<1>::from_floats(&values[..], &device).reshape([2, width]).require_grad()
                });
                let [means, quats, log_scales, opacity_logits, sh_dc, sh_rest] = leaves.clone();
                let gaussians = GaussianTensors {
                    means,
                    quats,
                    log_scales,
                    opacity_logits,
                    sh_dc: sh_dc.reshape([2, 1, 3]),
                    sh_rest: sh_rest.reshape([2, 15, 3]),
                    further: Vec::new(),
                };
                let rendering = Splatter::new(BACKGROUND, 3).render(gaussians, &camera, None);
                let what = format!("{name}: {value} in {attribute}");
                if !image_of(&rendering).iter().all(|v| v.is_finite()) {
                    failures.image.push(what.clone());
                }
                let grads = (rendering.image.sum() + rendering.depth.sum()).backward();
                for ((key, width), leaf) in RAW_ATTRIBUTES.iter().zip(&leaves) {
                    let gradient = values_of(&leaf.grad(&grads).unwrap());
                    let (own, other) = gradient.split_at(*width);
                    // A value that is not finite may have a derivative that is not finite: the value is lost in any
                    // case.
                    if value.is_finite() && !own.iter().all(|g| g.is_finite()) {
                        failures.own.push(format!("{what}: gradient of {key}"));
                    }
                    if !other.iter().all(|g| g.is_finite()) {
                        failures.other.push(format!("{what}: gradient of {key}"));
                    }
                }
            }
        }
    }
    failures
}

/// Raw attributes go through exp and sigmoid first. Whatever one Gaussian holds, the image and the other Gaussians stay
/// correct.
#[test]
fn bad_raw_attributes_do_not_reach_other_gaussians() {
    let RawFailures { image, other, .. } = raw_failures();
    assert!(image.is_empty() && other.is_empty(), "{image:#?} {other:#?}");
}

#[test]
fn finite_raw_attributes_have_finite_gradients() {
    let RawFailures { own, .. } = raw_failures();
    assert!(own.is_empty(), "{own:#?}");
}

/// A file may legally hold no Gaussians: it renders as background at every time.
#[test]
fn a_scene_without_gaussians_renders_the_background() {
    let hexplane = HexPlaneConfig { channels: 4, resolution: [8, 8, 8, 4], ..Default::default() };
    let field = HexPlaneFieldConfig { hexplane, deformation: DeformationConfig { width: 8, ..Default::default() } };
    let config = DynamicSceneConfig::<HexPlaneField>::new(GaussiansConfig::new(), field);
    for (name, device) in devices() {
        let scene = config.init(&PointCloud::default(), &device);
        let camera = random_camera(20, 12, &mut Random::new(8));
        let image = Splatter::new(BACKGROUND, 3).render(scene.at(0.5), &camera, None).image;
        let values = values_of(&image);
        assert!(values.chunks_exact(3).all(|pixel| pixel == BACKGROUND), "{name}");
    }
}
