//! `import --from ply` of files that other programs show: outliers keep nobody else from being precise, and what is changed
//! or cannot be seen is said.

use light4gs_codec::{GaussianArrays, Limits};
use light4gs_data::GaussianPly;
use light4gs_tests::program::{Workspace, assert_refused, assert_success};
use light4gs_tests::random::Random;

use crate::PROGRAM;

/// Gaussians within 0.9 of the origin, all of different opacities.
fn gaussians() -> GaussianPly {
    let mut random = Random::new(4);
    let mut triple = |low: f64, high: f64| [0; 3].map(|_| random.uniform(low, high) as f32);
    const COUNT: usize = 80;
    GaussianPly {
        means: (0..COUNT).map(|_| triple(-0.9, 0.9)).collect(),
        sh_dc: (0..COUNT).map(|_| triple(-1.0, 1.0)).collect(),
        sh_rest: vec![[[0.0; 3]; 15]; COUNT],
        opacity_logits: (0..COUNT).map(|i| 1.0 + i as f32 / 40.0).collect(),
        log_scales: (0..COUNT).map(|_| triple(-2.6, -2.2)).collect(),
        quats: (0..COUNT).map(|_| [1.0, triple(-1.0, 1.0)[0], triple(-1.0, 1.0)[1], triple(-1.0, 1.0)[2]]).collect(),
        further: Vec::new(),
    }
}

/// Imports changed Gaussians. Returns those in the file, and what is said on stderr.
fn imported(w: &Workspace, change: impl FnOnce(&mut GaussianPly)) -> (GaussianArrays, String) {
    let mut source = gaussians();
    change(&mut source);
    source.write(&w.path("scene.ply")).unwrap();
    let output = w.run(["import", "scene.ply", "--from", "ply", "--out", "scene.l4gs", "--overwrite"]);
    assert_success(&output);
    assert!(String::from_utf8_lossy(&output.stdout).contains("motion: none\n"), "{output:?}");
    let decoded = light4gs_codec::read_file_with_limits(&w.path("scene.l4gs"), &Limits::default()).unwrap();
    (decoded.gaussians, String::from_utf8_lossy(&output.stderr).into_owned())
}

/// The largest distance from one of the means to the nearest one in the file.
fn farthest(means: &[[f32; 3]], found: &GaussianArrays) -> f32 {
    let distance = |a: &[f32; 3], b: &[f32; 3]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f32>().sqrt();
    let nearest = |mean| found.means.iter().map(|other| distance(mean, other)).fold(f32::INFINITY, f32::min);
    means.iter().map(nearest).fold(0.0, f32::max)
}

/// The largest error of an opacity's logit. Logits of the file are in another order.
fn opacity_error(logits: &[f32], found: &GaussianArrays) -> f32 {
    let sorted = |values: &[f32]| {
        let mut values = values.to_vec();
        values.sort_by(f32::total_cmp);
        values
    };
    sorted(logits).iter().zip(sorted(&found.opacity_logits)).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

#[test]
fn ordinary_values_keep_their_precision_beside_outliers() {
    let w = Workspace::new(PROGRAM);
    let plain = gaussians();
    type Change = fn(&mut GaussianPly);
    let cases: [(&str, Change, &str); 5] = [
        ("as they are", |_| {}, ""),
        ("one far away", |g| g.means[0] = [1e9, 0.0, 0.0], "1 of 80 Gaussians has a distance"),
        ("one at the end of float32", |g| g.means[0] = [3e38, -3e38, 0.0], "1 of 80 Gaussians has a distance"),
        ("one huge", |g| g.log_scales[0] = [20.0; 3], "1 of 80 Gaussians has a scale"),
        ("all huge", |g| g.log_scales.fill([20.0; 3]), "times as large as the scene"),
    ];
    for (what, change, said) in cases {
        let (found, told) = imported(&w, change);
        assert!(told.contains(said) && told.is_empty() == said.is_empty(), "{what}: {told}");
        let error = farthest(&plain.means[1..], &found);
        assert!(error < 0.04, "{what}: a mean is off by {error}");
        let error = opacity_error(&plain.opacity_logits, &found);
        assert!(error < 0.25, "{what}: the logit of an opacity is off by {error}");
    }
}

#[test]
fn a_scene_in_one_place_or_of_any_size_is_seen() {
    let w = Workspace::new(PROGRAM);
    let plain = gaussians();
    let (found, told) = imported(&w, |g| g.means.fill([0.5; 3]));
    assert_eq!((told.as_str(), farthest(&[[0.5; 3]], &found) < 1e-3), ("", true));
    assert!(opacity_error(&plain.opacity_logits, &found) < 0.25);
    for size in [1e-4f32, 1e5] {
        let (found, told) = imported(&w, |g| {
            g.means.iter_mut().flatten().for_each(|value| *value *= size);
            g.log_scales.iter_mut().flatten().for_each(|value| *value += size.ln());
        });
        assert_eq!(told, "", "{size}");
        let means: Vec<_> = plain.means.iter().map(|mean| mean.map(|value| value * size)).collect();
        assert!(farthest(&means, &found) < 0.04 * size, "{size}");
        assert!(opacity_error(&plain.opacity_logits, &found) < 0.25, "{size}");
    }
}

#[test]
fn values_that_other_programs_show_are_kept() {
    let w = Workspace::new(PROGRAM);
    let (found, told) = imported(&w, |g| {
        g.log_scales[1][2] = f32::NEG_INFINITY;
        g.opacity_logits[2] = f32::INFINITY;
        g.opacity_logits[3] = f32::NEG_INFINITY;
        g.quats[4] = [0.0; 4];
        g.quats.iter_mut().skip(5).flatten().for_each(|value| *value *= 1e38);
    });
    assert_eq!(found.len(), 80);
    for said in [
        "1 of 80 Gaussians has a scale of 0",
        "2 of 80 Gaussians have an opacity",
        "1 of 80 Gaussians has a quaternion",
    ] {
        assert!(told.contains(said), "{told}");
    }
    let lengths = found.quats.iter().map(|q| q.iter().map(|q| q * q).sum::<f32>().sqrt());
    assert!(lengths.into_iter().all(|length| (0.8..1.2).contains(&length)));
}

#[test]
fn a_scene_that_no_view_shows_is_said_and_keeps_its_precision() {
    let w = Workspace::new(PROGRAM);
    let plain = gaussians();
    let (found, told) = imported(&w, |g| g.opacity_logits.fill(-9.0));
    assert!(told.contains("show nothing of it"), "{told}");
    assert!(farthest(&plain.means, &found) < 0.01);
}

#[test]
fn what_is_refused_is_named_with_file_and_place() {
    let w = Workspace::new(PROGRAM);
    let mut source = gaussians();
    source.means[7][1] = f32::INFINITY;
    source.write(&w.path("bad.ply")).unwrap();
    let import = |file: &str| w.run(["import", file, "--from", "ply", "--out", "never.l4gs"]);
    assert_refused(&import("bad.ply"), &["bad.ply", "`y` of Gaussian 7", "inf", "remove such Gaussians"]);
    assert!(!w.path("never.l4gs").exists());
}
