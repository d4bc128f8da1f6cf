//! Every back end draws the same images and computes the same gradients. The scenes are of all sizes, and have odd and
//! broken Gaussians among them.
//!
//! Back ends round differently, and at a threshold (alpha 1/255, transmittance 1e-4) the last bit decides. The float64
//! twin says at which pixels that may happen. Those pixels have no weight in the loss and are left out of the
//! comparison. Gaussians whose tiles or place in the order depend on the last bit are not in the scenes at all.

use burn::tensor::{Tensor, TensorData};
use light4gs_data::Camera;
use light4gs_model::{ActivatedGaussians, Splatter};
use light4gs_tests::golden::{assert_close_relative, devices, values_of};
use light4gs_tests::odd_scenes::{BACKGROUND, Run, SIZES, make_odd, point_in_view, poison, run_weighed};
use light4gs_tests::random::Random;
use light4gs_tests::splat_scene::{ATTRIBUTES, MEANS, Ranges, SCALES, SplatScene, random_camera, with_principal_point};
use light4gs_tests::twin;

const IMAGE: f32 = 2e-4;
const GRADIENT: f32 = 1e-3;

/// `keep` says which Gaussians can be drawn. At most `doubtful` of the pixels may be left out.
#[track_caller]
fn assert_agreement(
    what: &str,
    scene: &SplatScene,
    keep: &[bool],
    camera: &Camera,
    degree: usize,
    doubtful: f64,
    random: &mut Random,
) {
    let twin = twin::render(&scene.filtered(keep), camera, BACKGROUND, degree);
    let share = twin.doubtful.iter().filter(|d| **d).count() as f64 / twin.doubtful.len() as f64;
    assert!(share <= doubtful, "{what}: {share} of the pixels are within rounding of a threshold");
    let mut weights = random.normals(twin.doubtful.len() * 5);
    for (weights, doubtful) in weights.chunks_exact_mut(5).zip(&twin.doubtful) {
        if *doubtful {
            weights.fill(0.0);
        }
    }
    let runs: Vec<(&str, Run)> = devices()
        .into_iter()
        .map(|(name, device)| (name, run_weighed(scene, camera, degree, &device, &weights)))
        .collect();
    let (first, expected) = &runs[0];
    let depth_scale = twin.values.iter().skip(4).step_by(5).fold(1.0f32, |m, v| m.max(*v as f32));
    for (name, found) in &runs[1..] {
        assert_eq!(found.invalid, expected.invalid, "{what}: invalid on {name} and {first}");
        assert_eq!(found.radii, expected.radii, "{what}: radii on {name} and {first}");
        let pixels = found.image.chunks_exact(5).zip(expected.image.chunks_exact(5)).zip(&twin.doubtful);
        for (pixel, ((found, expected), _)) in pixels.enumerate().filter(|(_, (_, doubtful))| !**doubtful) {
            for c in 0..5 {
                let error = (found[c] - expected[c]).abs() / if c == 4 { depth_scale } else { 1.0 };
                assert!(
                    error <= IMAGE,
                    "{what}: pixel {pixel} channel {c} is {} on {name}, {} on {first}",
                    found[c],
                    expected[c]
                );
            }
        }
        for (k, attribute) in ATTRIBUTES.iter().enumerate() {
            let what = format!("{what}: gradient of {attribute} on {name} and {first}");
            assert_close_relative(&what, &found.gradients[k], &expected.gradients[k], GRADIENT);
        }
    }
}

/// A scene without Gaussians whose tiles or order depend on rounding, some of them made odd, some broken; and which of
/// them can be drawn.
fn odd_scene(count: usize, camera: &Camera, ranges: &Ranges, random: &mut Random) -> (SplatScene, Vec<bool>) {
    let mut scene = SplatScene::random(count, ranges, random);
    for i in 0..count {
        if random.below(6) == 0 {
            let ordinary = scene.row_mut(SCALES, i).to_vec();
            make_odd(&mut scene, i, camera, random);
            // Far larger than the scene: in float32 its covariance keeps three digits or fewer on every back end.
            if scene.row_mut(SCALES, i).iter().any(|scale| *scale > 1.0) {
                scene.row_mut(SCALES, i).copy_from_slice(&ordinary);
            }
        }
    }
    let (mut scene, _) = twin::render_without_doubt(&scene, camera, BACKGROUND, 3);
    let mut keep = vec![true; scene.len()];
    for i in 0..scene.len() {
        if random.below(10) == 0 {
            keep[i] = false;
            poison(&mut scene, i, camera, random);
        }
    }
    (scene, keep)
}

#[test]
fn two_hundred_small_scenes() {
    const COUNTS: [usize; 10] = [1, 2, 5, 12, 30, 64, 65, 150, 300, 600];
    for seed in 0..200 {
        let mut random = Random::new(9000 + seed);
        let count = COUNTS[seed as usize % COUNTS.len()];
        let size = SIZES[random.below(SIZES.len())];
        let degree = random.below(4);
        let ranges = Ranges { half_size: random.uniform(0.3, 2.0), ..Ranges::default() };
        let camera = random_camera(size[0], size[1], &mut random);
        let (scene, keep) = odd_scene(count, &camera, &ranges, &mut random);
        let what = format!("seed {seed}, {count} Gaussians, {size:?}, degree {degree}");
        assert_agreement(&what, &scene, &keep, &camera, degree, 1.0, &mut random);
    }
}

#[test]
fn forty_scenes_with_a_principal_point_anywhere() {
    for seed in 0..40 {
        let mut random = Random::new(9300 + seed);
        let size = SIZES[random.below(SIZES.len())];
        let share = [0; 2].map(|_| random.uniform(-1.5, 2.5) as f32);
        let camera = with_principal_point(&random_camera(size[0], size[1], &mut random), share);
        let (scene, keep) = odd_scene(100, &camera, &Ranges::default(), &mut random);
        let what = format!("seed {seed}, {size:?}, principal point at {share:?}");
        assert_agreement(&what, &scene, &keep, &camera, 3, 1.0, &mut random);
    }
}

#[test]
fn large_scenes() {
    for (seed, count, size, doubtful) in [
        (1, 3_000, [131, 70], 0.1),
        (2, 8_000, [97, 101], 0.1),
        (3, 20_000, [64, 51], 0.1),
        (4, 20_000, [129, 33], 0.1),
    ] {
        let mut random = Random::new(seed);
        let ranges = Ranges { scales: [0.005, 0.05], ..Ranges::default() };
        let camera = random_camera(size[0], size[1], &mut random);
        let (scene, keep) = odd_scene(count, &camera, &ranges, &mut random);
        let what = format!("{count} Gaussians, {size:?}");
        assert_agreement(&what, &scene, &keep, &camera, 3, doubtful, &mut random);
    }
}

/// Blending takes more than one launch on the GPU: a cell's list is longer than a part (32768).
#[test]
fn seventy_thousand_gaussians_in_one_tile() {
    let mut random = Random::new(6);
    let camera = random_camera(9, 7, &mut random);
    let ranges = Ranges { scales: [0.05, 0.3], opacities: [0.004, 0.006], ..Ranges::default() };
    let mut scene = SplatScene::random(75_000, &ranges, &mut random);
    for i in 0..scene.len() {
        let (x, y) = (random.uniform(-0.5, 0.5) as f32, random.uniform(-0.5, 0.5) as f32);
        // Depths so far apart that no rounding changes their order.
        let depth = 3.0 * (3e-6 * i as f64).exp();
        scene.row_mut(MEANS, i).copy_from_slice(&point_in_view(&camera, x, y, depth as f32));
    }
    let (scene, _) = twin::render_without_doubt(&scene, &camera, BACKGROUND, 0);
    assert!(scene.len() > 66_000, "{} left", scene.len());
    let keep = vec![true; scene.len()];
    assert_agreement("one tile", &scene, &keep, &camera, 0, 1.0, &mut random);
}

#[test]
fn all_but_one_behind_the_camera() {
    let mut random = Random::new(7);
    let camera = random_camera(40, 30, &mut random);
    let mut scene = SplatScene::random(100, &Ranges::default(), &mut random);
    for i in 1..scene.len() {
        let place = point_in_view(&camera, 0.1, 0.2, -random.uniform(0.0, 5.0) as f32);
        scene.row_mut(MEANS, i).copy_from_slice(&place);
    }
    assert_agreement("behind", &scene, &[true; 100], &camera, 3, 0.1, &mut random);
}

/// Enough Gaussians that the pairs of a tile and a Gaussian are sorted, blended and summed in more than one launch.
#[test]
fn a_million_gaussians_in_one_tile() {
    const COUNT: usize = 1_000_000;
    let mut random = Random::new(8);
    let camera = random_camera(11, 13, &mut random);
    let mut column = |width: usize, low: f64, high: f64| -> Vec<f32> {
        (0..COUNT * width).map(|_| random.uniform(low, high) as f32).collect()
    };
    let columns = [
        (column(3, -0.3, 0.3), 3),
        (column(4, 0.1, 1.0), 4),
        (column(3, 0.05, 0.3), 3),
        (column(1, 0.02, 0.05), 1),
        (column(3, -1.0, 1.0), 3),
    ];
    let runs: Vec<(&str, Vec<Vec<f32>>)> = devices()
        .into_iter()
        .map(|(name, device)| {
            let device = device.autodiff();
            let leaves: Vec<Tensor<2>> = columns
                .iter()
                .map(|(values, width)| {
                    Tensor::from_data(TensorData::new(values.clone(), [COUNT, *width]), &device).require_grad()
                })
                .collect();
            let [means, quats, scales, opacities, dc] = std::array::from_fn(|k| leaves[k].clone());
            let (sh_dc, sh_rest) = (dc.reshape([COUNT, 1, 3]), Tensor::<3>::zeros([COUNT, 0, 3], &device));
            let gaussians = ActivatedGaussians { means, quats, scales, opacities, sh_dc, sh_rest };
            let splatter = Splatter::new(BACKGROUND, 0);
            let rendering = splatter.render_activated(gaussians, &camera, None);
            let image = values_of(&rendering.image);
            let gradients = (rendering.image.sum() + rendering.depth.sum()).backward();
            let of_leaves = leaves.iter().map(|leaf| values_of(&leaf.grad(&gradients).expect("a gradient")));
            (name, std::iter::once(image).chain(of_leaves).collect())
        })
        .collect();
    let (first, expected) = &runs[0];
    for (name, found) in &runs[1..] {
        for (k, (found, expected)) in found.iter().zip(expected).enumerate() {
            let tolerance = if k == 0 { IMAGE } else { GRADIENT };
            assert_close_relative(&format!("output {k} on {name} and {first}"), found, expected, tolerance);
        }
    }
}
