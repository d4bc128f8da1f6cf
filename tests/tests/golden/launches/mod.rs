//! Launches of the wgpu back end on golden scenes, written down for other implementations of WebGPU: each kernel's text, what
//! it was given and what it made of it here, and what the golden vectors say must come out in the end. `.ci/webgpu` runs them
//! in Chromium.
//!
//! `LIGHT4GS_LAUNCHES` names the folder that they are written to. Without it the test checks only that every kernel which is
//! launched is in the list of all kernels, and that every shader is launched.

mod transcript;

use std::path::Path;

use burn::tensor::{Device, Tensor};
use light4gs_model::gpu::{Communication, RecordedLaunch, Team, record, with_team};
use light4gs_model::ops::activation::{bounded_exponential, sigmoid};
use light4gs_model::ops::adam::{AdamStep, adam_step};
use light4gs_model::ops::columns::columns;
use light4gs_model::ops::image_difference::{Difference, mean_difference};
use light4gs_model::ops::lower_bound::lower_bound;
use light4gs_model::ops::node_poses::{NodeParameters, pose};
use light4gs_model::ops::node_regularizer::{Regularization, regularize};
use light4gs_model::ops::normal_cdf::normal_cdf;
use light4gs_model::ops::rate::mixture_bits::{MixtureInputs, mixture_bits};
use light4gs_model::ops::rate::neighborhoods::{Neighborhoods, neighborhoods};
use light4gs_model::ops::rate::uniform_noise::add_uniform_noise;
use light4gs_model::ops::skinning::{MOST_AFFINITIES, SkinningInputs, skin};
use light4gs_model::{PlaneTensors, Significance, Splatter};
use light4gs_tests::golden::{Golden, values_of};
use light4gs_tests::odd_scenes::dots;
use light4gs_tests::planes::plane_sets;
use light4gs_tests::random::Random;
use light4gs_tests::raster::{Leaves, camera_of};

use super::geometry::hexplane_of;
use super::raster::{SCORES, channels_last, raw_gaussians, significance_scene};
use transcript::{Outcome, Transcript};

/// More Gaussians in one cell than one launch blends.
const DOTS: usize = 33_000;

#[test]
fn launches_of_golden_scenes() {
    let mut transcript = Transcript::new();
    blending(&mut transcript, "workgroup memory", Team::WITHOUT_SUBGROUPS);
    crowded(&mut transcript);
    planes(&mut transcript);
    skinning(&mut transcript);
    control_nodes(&mut transcript);
    rate(&mut transcript);
    elementwise(&mut transcript);
    transcript.assert_complete();
    // SwiftShader's subgroups have four members, for which the program has no team. Here a workgroup of four is a part of a
    // subgroup, and computes the same.
    for communication in [Communication::SubgroupOfFew, Communication::SubgroupOfMany] {
        let team = Team { members: 4, communication, cell: 4 };
        blending(&mut transcript, &format!("{communication:?}"), team);
    }
    if let Some(folder) = std::env::var_os("LIGHT4GS_LAUNCHES") {
        transcript.write(Path::new(&folder));
    }
}

fn device() -> Device {
    Device::wgpu(Default::default())
}

/// Images, gradients and scores of the rasterizer's golden scenes.
fn blending(transcript: &mut Transcript, how: &str, team: Team) {
    for (case, gradients) in [("c08_raster", "grad"), ("c08_raster_edge", "grad_autograd")] {
        let golden = Golden::open(case);
        for camera in (0..).map(|k| format!("cam{k}")).take_while(|camera| golden.has(&format!("{camera}.image"))) {
            let (outcomes, launches) = record(|| with_team(team, || image(&golden, &camera, gradients)));
            transcript.add(&format!("{case} {camera}, {how}"), launches, outcomes);
        }
        let (outcomes, launches) = record(|| with_team(team, || scores(case)));
        transcript.add(&format!("scores of {case}, {how}"), launches, outcomes);
    }
}

fn image(golden: &Golden, camera_name: &str, gradients: &str) -> Vec<Outcome> {
    let key = |name: &str| format!("{camera_name}.{name}");
    let size = golden.integers(&key("width_height"));
    let camera = camera_of(golden, &key(""), size[0] as u32, size[1] as u32);
    let device = device().autodiff();
    let leaves = Leaves::read(golden, &device);
    let rendering = leaves.render(&camera, golden.values(&key("background")).try_into().unwrap(), 3);
    let transmittance = golden.values(&key("final_T"));
    let mut outcomes = vec![
        Outcome::within("image", values_of(&rendering.image), channels_last(&golden.values(&key("image"))), 2e-5),
        Outcome::within("alpha", values_of(&rendering.alpha), transmittance.iter().map(|t| 1.0 - t).collect(), 1e-5),
        Outcome::within_share("depth", values_of(&rendering.depth), golden.values(&key("depth_image")), 2e-5),
    ];
    let weights = Tensor::<1>::from_floats(channels_last(&golden.values(&key("w"))).as_slice(), &device);
    let gradient = (rendering.image.clone() * weights.reshape(rendering.image.dims())).sum().backward();
    let [_, coefficients, _] = leaves.sh.dims();
    let mut check = |name: &str, found: Option<Vec<f32>>| {
        let expected = golden.values(&key(&format!("{gradients}.{name}")));
        outcomes.push(Outcome::within_share(&format!("gradient of {name}"), found.unwrap(), expected, 1e-3));
    };
    check("means", leaves.means.grad(&gradient).map(|g| values_of(&g)));
    check("quats", leaves.quats.grad(&gradient).map(|g| values_of(&g)));
    check("scales", leaves.scales.grad(&gradient).map(|g| values_of(&g)));
    check("opacity", leaves.opacities.grad(&gradient).map(|g| values_of(&g)));
    check("mean2D_ndc", leaves.screen_offsets.grad(&gradient).map(|g| values_of(&g)));
    // The kernel writes the first coefficient and the others to two places.
    let split = |values: Vec<f32>| {
        let rows = values.chunks_exact(3 * coefficients);
        (rows.clone().flat_map(|row| row[..3].to_vec()).collect(), rows.flat_map(|row| row[3..].to_vec()).collect())
    };
    let found: (Vec<f32>, Vec<f32>) = split(values_of(&leaves.sh.grad(&gradient).unwrap()));
    let expected = split(golden.values(&key(&format!("{gradients}.sh"))));
    outcomes.push(Outcome::within_share("gradient of sh_dc", found.0, expected.0, 1e-3));
    outcomes.push(Outcome::within_share("gradient of sh_rest", found.1, expected.1, 1e-3));
    outcomes
}

fn scores(case: &str) -> Vec<Outcome> {
    let (golden, cameras) = significance_scene(case);
    let gaussians = raw_gaussians(&golden, &device().autodiff());
    let count = gaussians.means.dims()[0];
    let of_camera = |(k, camera)| {
        let mut significance = Significance::new(count);
        significance.add(&Splatter::new([0.0; 3], 3), gaussians.clone(), camera);
        let expected = SCORES.map(|(name, _)| golden.values(&format!("cam{k}.sig.{name}")));
        let found = SCORES.map(|(_, score)| significance.sums(score));
        // [N, 3], as the kernel writes them.
        let found = (0..count).flat_map(|i| found.each_ref().map(|score| score[i] as f32));
        let expected = (0..count).flat_map(|i| expected.each_ref().map(|score| score[i]));
        Outcome::within_share(&format!("scores of cam{k}"), found.collect(), expected.collect(), 2e-5)
    };
    cameras.iter().enumerate().map(of_camera).collect()
}

/// A cell with more splats than one launch blends, and more values than one workgroup adds up.
fn crowded(transcript: &mut Transcript) {
    let splatter = Splatter::new([0.0; 3], 0);
    let draw = |device: &Device| {
        let (gaussians, camera) = dots(DOTS, &device.clone().autodiff());
        let opacity_logits = gaussians.opacity_logits.clone().require_grad();
        let gaussians = light4gs_model::GaussianTensors { opacity_logits: opacity_logits.clone(), ..gaussians };
        let rendering = splatter.render(gaussians, &camera, None);
        let gradient = rendering.image.clone().sum().backward();
        (values_of(&rendering.alpha), values_of(&opacity_logits.grad(&gradient).unwrap()))
    };
    let (expected, _) = draw(&Device::flex());
    let (outcomes, launches) = record(|| {
        with_team(Team::WITHOUT_SUBGROUPS, || {
            let (found, _) = draw(&device());
            let (gaussians, camera) = dots(DOTS, &device());
            Significance::new(DOTS).add(&splatter, gaussians, &camera);
            vec![Outcome::within("alpha", found, expected, 1e-4)]
        })
    });
    transcript.add("a crowded cell", launches, outcomes);
}

/// The query of the golden hexplane, and of other sets of planes.
fn planes(transcript: &mut Transcript) {
    let golden = Golden::open("c02_hexplane");
    let (outcomes, launches) = record(|| {
        let device = device().autodiff();
        let hexplane = hexplane_of(&golden, "", &device);
        let out = hexplane.query(golden.tensor::<2>("direct.pts", &device).require_grad());
        let [points, features] = out.dims();
        let each = features / hexplane.layout().scales();
        let columns = |values: &[f32], scale: usize| {
            let rows = values.chunks_exact(features);
            rows.flat_map(|row| row[scale * each..(scale + 1) * each].to_vec()).collect::<Vec<_>>()
        };
        let (found, expected) = (values_of(&out), golden.values("direct.out"));
        assert_eq!(found.len(), points * features);
        let mut outcomes: Vec<Outcome> = (0..hexplane.layout().scales())
            .map(|scale| {
                let (found, expected) = (columns(&found, scale), columns(&expected, scale));
                Outcome::within_share(&format!("features of scale {scale}"), found, expected, 1e-5)
            })
            .collect();
        let gradient = (out * golden.tensor("direct.w", &device)).sum().backward();
        outcomes.extend(hexplane.planes.iter().enumerate().map(|(i, plane)| {
            let expected = golden.values(&format!("direct.grad.scale{}.plane{}", i / 6, i % 6));
            let found = values_of(&plane.val().grad(&gradient).unwrap());
            Outcome::within_share(&format!("gradient of plane {i}"), found, expected, 1e-4)
        }));
        outcomes
    });
    transcript.add("c02_hexplane", launches, outcomes);

    let mut random = Random::new(7);
    for (name, layout) in plane_sets() {
        let ((), launches) = record(|| {
            let device = device().autodiff();
            let mut tensor = |count: usize, low: f64, high: f64| {
                let values: Vec<f32> = (0..count).map(|_| random.uniform(low, high) as f32).collect();
                Tensor::<1>::from_floats(values.as_slice(), &device)
            };
            let planes = layout.planes().iter().map(|plane| {
                let [height, width] = plane.size;
                tensor(11 * height * width, 0.4, 1.4).reshape([11, height, width]).require_grad()
            });
            let planes = PlaneTensors::new(layout.clone(), planes.collect());
            let points = tensor(300 * 4, -1.1, 1.1).reshape([300, 4]).require_grad();
            let features = planes.query(points);
            (features.clone() * features).sum().backward();
        });
        transcript.add(name, launches, Vec::new());
    }
}

fn skinning(transcript: &mut Transcript) {
    for affinities in [0, MOST_AFFINITIES] {
        let mut random = Random::new(8);
        let ((), launches) = record(|| {
            let device = device().autodiff();
            let mut tensor = |rows: usize, columns: usize, low: f64, high: f64| {
                let values: Vec<f32> = (0..rows * columns).map(|_| random.uniform(low, high) as f32).collect();
                Tensor::<1>::from_floats(values.as_slice(), &device).reshape([rows, columns]).require_grad()
            };
            let (gaussians, nodes) = (777, 21);
            let moved = skin(SkinningInputs {
                means: tensor(gaussians, 3, -1.0, 1.0),
                quats: tensor(gaussians, 4, -1.0, 1.0),
                stillness: tensor(gaussians, 1, -3.0, 1.0),
                affinities: (affinities > 0).then(|| tensor(gaussians, affinities, -3.0, 1.0)),
                nodes: tensor(nodes, 20 + affinities, 0.0, 1.0),
            });
            (moved.clone() * moved).sum().backward();
        });
        transcript.add(&format!("skinning, {affinities} affinities"), launches, Vec::new());
    }
}

/// Poses of nodes and their regularizer, with gradients.
fn control_nodes(transcript: &mut Transcript) {
    for affinities in [0, MOST_AFFINITIES] {
        let mut random = Random::new(9);
        let ((), launches) = record(|| {
            let device = device().autodiff();
            let mut tensor = |rows: usize, columns: usize| {
                let values: Vec<f32> = (0..rows * columns).map(|_| random.uniform(-0.7, 0.7) as f32).collect();
                Tensor::<1>::from_floats(values.as_slice(), &device).reshape([rows, columns]).require_grad()
            };
            let (nodes, knots) = (77, 9);
            let parameters = NodeParameters {
                anchors: tensor(nodes, 3),
                log_radii: tensor(nodes, 1),
                translations: tensor(knots, 3 * nodes),
                rotations: tensor(knots, 4 * nodes),
                affinities: (affinities > 0).then(|| tensor(nodes, affinities)),
                unit: Tensor::from_floats([2.5], &device),
            };
            let posed = pose(parameters.clone(), 0.3);
            let regularization = Regularization { rigidity: 0.75, smoothness: 0.5, time: 0.6 };
            let loss = regularize(parameters, regularization);
            ((posed.clone() * posed).sum() + loss).backward();
        });
        transcript.add(&format!("control nodes, {affinities} affinities"), launches, Vec::new());
    }
}

/// Bits of rows of a table and of their neighbors, some of which are chosen several times, and their derivative.
fn rate(transcript: &mut Transcript) {
    let mut random = Random::new(10);
    let ((), launches) = record(|| {
        let device = device().autodiff();
        let mut tensor = |rows: usize, columns: usize, low: f64, high: f64| {
            let values: Vec<f32> = (0..rows * columns).map(|_| random.uniform(low, high) as f32).collect();
            Tensor::<1>::from_floats(values.as_slice(), &device).reshape([rows, columns]).require_grad()
        };
        let (count, columns, components) = (321, 3, 3);
        let channels = 3 * columns;
        let rows: Vec<u32> = (0..500).map(|place| place * place % count as u32).collect();
        let neighbors: Vec<_> = rows.iter().map(|row| [row / 2, row / 3, row / 3, row / 5]).collect();
        let table = tensor(count, columns, -2.0, 2.0);
        let inputs = MixtureInputs {
            values: neighborhoods(table, Neighborhoods::new(&rows, &neighbors, count)),
            widths: tensor(channels, 1, 0.01, 0.5),
            weight_logits: tensor(channels, components, -1.0, 1.0),
            means: tensor(channels, components, -0.5, 0.5),
            log_scales: tensor(channels, components, -3.0, 0.0),
        };
        let bits = mixture_bits(inputs, 1e-9);
        (bits.clone() * bits).sum().backward();
    });
    transcript.add("rate of attributes", launches, Vec::new());
}

/// The entropy models' functions far into their tails, and a step of the optimizer.
fn elementwise(transcript: &mut Transcript) {
    let places: Vec<f32> = (0..2600).map(|i| i as f32 * 0.01 - 13.0).collect();
    let leaf = |device: &Device| Tensor::<1>::from_floats(places.as_slice(), device);
    let functions = [normal_cdf as fn(Tensor<1>) -> Tensor<1>, |x| lower_bound(x, 0.11), sigmoid, bounded_exponential];
    let ((), launches): (_, Vec<RecordedLaunch>) = record(|| {
        for function in functions {
            let upstream = leaf(&device().autodiff()).sin();
            (function(leaf(&device().autodiff()).require_grad()) * upstream).sum().backward();
        }
        for difference in [Difference::Absolute, Difference::Squared] {
            let image = leaf(&device().autodiff()).require_grad();
            mean_difference(difference, image, leaf(&device().autodiff()).cos()).backward();
        }
        columns(leaf(&device().autodiff()).reshape([1, -1]).require_grad(), 1..3).sum().backward();
        let step = AdamStep { learning_rate: 0.1, beta_1: 0.9, beta_2: 0.999, epsilon: 1e-15, time: 3 };
        let moments = [leaf(&device()).cos(), leaf(&device()).sin() * 0.1, leaf(&device()).abs() * 0.01];
        adam_step(moments, leaf(&device()), step);
        add_uniform_noise(leaf(&device()), Tensor::from_floats([0.5, 0.25], &device()), 1, 1 << 40 | 5);
    });
    transcript.add("elementwise", launches, Vec::new());
}
