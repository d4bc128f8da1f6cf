//! Hand-written derivatives of the custom operations against central finite differences, on every back end.
//!
//! There are two references for each operation, since each has what the other lacks:
//!
//! - *Differences of the operation itself*, along random directions. They see the very function that is trained, but
//!   it is float32, whose rounding a step h magnifies by 1/h, while the central difference is off by the order of h².
//!   Steps between 2.5e-4 and 1.6e-2 were tried: at 1e-3 neither matters, and the worst error is 1e-3 of the
//!   gradient's norm, in the quaternions. 3e-3 is allowed. The weights of the loss are smooth: white noise has smaller gradients
//!   with the same rounding (7e-3). Scenes are such that no jump (alpha below 1/255, opaque pixel, edge of the 3-sigma
//!   box, two Gaussians changing their order) lies within a step, since the derivative by definition ignores jumps.
//! - *Differences of a plain float64 twin*, one coordinate at a time, with a step of 1e-6 or less: thresholds are
//!   almost never crossed, and the twin tells when one is, so the scenes are ordinary ones where everything happens.

use burn::tensor::{Device, Tensor, TensorData};
use light4gs_codec::plane_layout::PlaneAxes;
use light4gs_data::Camera;
use light4gs_model::ops::lower_bound::lower_bound;
use light4gs_model::ops::normal_likelihood::{NormalBounds, normal_likelihood};
use light4gs_model::{FeaturePlanes, PlaneTensors};
use light4gs_tests::golden::{assert_close_relative, devices, values_of};
use light4gs_tests::random::Random;
use light4gs_tests::splat_scene::{
    ATTRIBUTES, MEANS, Ranges, SH_DC, SplatScene, image_of, random_camera, with_principal_point,
};
use light4gs_tests::twin;

const BACKGROUND: [f32; 3] = [0.2, 0.5, 0.9];

fn dot(a: impl IntoIterator<Item = f64>, b: &[f64]) -> f64 {
    a.into_iter().zip(b).map(|(a, b)| a * b).sum()
}

fn wide(values: &[f32]) -> impl Iterator<Item = f64> {
    values.iter().map(|v| f64::from(*v))
}

/// `values + step · direction`, rounded to float32 like all inputs of the operation.
fn moved(values: &[f64], direction: &[f64], step: f64) -> Vec<f64> {
    values.iter().zip(direction).map(|(v, d)| f64::from((v + step * d) as f32)).collect()
}

/// Derivative of `loss` along a direction: central difference with the steps that were really made, since rounding to
/// float32 changes small ones.
fn along(values: &[f64], direction: &[f64], step: f64, loss: impl Fn(Vec<f64>) -> f64) -> f64 {
    (loss(moved(values, direction, step)) - loss(moved(values, direction, -step))) / (2.0 * step)
}

/// Compares a gradient with differences along three random directions. For normal directions the derivative has the
/// size of the gradient's norm, so the tolerance is a share of that and not of the derivative, which may cancel.
fn check_directions(
    what: &str,
    values: &[f64],
    gradient: &[f32],
    step: f64,
    random: &mut Random,
    loss: impl Fn(Vec<f64>) -> f64,
) {
    let norm = wide(gradient).map(|g| g * g).sum::<f64>().sqrt();
    assert!(norm > 1e-2, "{what}: a gradient of {norm} tests nothing");
    for _ in 0..3 {
        let direction = random.normals(values.len());
        let found = dot(wide(gradient), &direction);
        let expected = along(values, &direction, step, &loss);
        let error = (found - expected).abs() / norm;
        assert!(error < 3e-3, "{what}: {found} against {expected}, off by {error:e} of the gradient's norm {norm}");
    }
}

/// Weights `[H, W, 5]` that vary slowly over the image: contributions of the pixels then add up, and their rounding
/// errors matter less.
fn smooth_weights(camera: &Camera, random: &mut Random) -> Vec<f64> {
    let (width, height) = (f64::from(camera.width), f64::from(camera.height));
    let waves: [[f64; 3]; 5] = std::array::from_fn(|_| [0; 3].map(|_| random.uniform(-3.0, 3.0)));
    let pixels = (0..camera.height).flat_map(|y| (0..camera.width).map(move |x| (f64::from(x), f64::from(y))));
    pixels
        .flat_map(|(x, y)| waves.map(|[a, b, c]| f64::from((a * x / width + b * y / height + c).cos() as f32)))
        .collect()
}

fn depth_of(scene: &mut SplatScene, i: usize, camera: &Camera) -> f64 {
    let mean = glam::DVec3::from_slice(scene.row_mut(MEANS, i));
    (camera.rotation.as_dmat3() * mean + camera.translation.as_dvec3()).z
}

/// Large, rather transparent Gaussians, so that no threshold is met in the image, or can be reached by a step.
fn smooth_scene(camera: &Camera, random: &mut Random) -> SplatScene {
    let ranges = Ranges { half_size: 0.7, scales: [1.6, 2.6], opacities: [0.2, 0.6], sh: [0.3, 0.1], offset: 0.1 };
    loop {
        let mut scene = SplatScene::random(7, &ranges, random);
        // One far to the side, where the projection's Jacobian is clamped.
        let axis = camera.rotation.transpose().x_axis * 2.6;
        scene.row_mut(MEANS, 3).copy_from_slice(&[axis.x, axis.y, axis.z].map(f64::from));
        // One whose green is clamped at zero.
        scene.row_mut(SH_DC, 5)[1] = -5.0;
        let image = twin::render(&scene, camera, BACKGROUND, 3);
        let mut depths: Vec<f64> = (0..scene.len()).map(|i| depth_of(&mut scene, i, camera)).collect();
        depths.sort_by(f64::total_cmp);
        let smooth = depths.windows(2).all(|pair| pair[1] - pair[0] > 0.02)
            && image.smallest_alpha > 2.0 / 255.0
            && image.largest_alpha < 0.9
            && image.smallest_transmittance > 1e-3
            && image.radii.iter().all(|radius| *radius > 0);
        if smooth {
            return scene;
        }
    }
}

/// The camera, or one whose principal point is outside of the image.
fn off_axis(moved: bool, camera: Camera) -> Camera {
    if moved { with_principal_point(&camera, [1.6, -0.4]) } else { camera }
}

#[test]
fn splat_along_random_directions() {
    for (name, device) in devices() {
        for seed in 0..6 {
            let mut random = Random::new(seed);
            let camera = off_axis(seed >= 4, random_camera(20, 18, &mut random));
            let scene = smooth_scene(&camera, &mut random);
            let weights = smooth_weights(&camera, &mut random);
            let tape = device.clone().autodiff();
            let leaves = scene.leaves(&tape);
            let gradients = leaves.gradients(leaves.render(&camera, BACKGROUND, 3), &weights);
            for (k, gradient) in gradients.iter().enumerate() {
                let what = format!("{name} seed {seed} {}", ATTRIBUTES[k]);
                check_directions(&what, &scene.attributes[k], gradient, 1e-3, &mut random, |values| {
                    let mut scene = scene.clone();
                    scene.attributes[k] = values;
                    let rendering = scene.leaves(&tape).render(&camera, BACKGROUND, 3);
                    dot(wide(&image_of(&rendering)), &weights)
                });
            }
        }
    }
}

/// Ordinary scenes, every coordinate of every input. Besides rounding, the results differ at pixels where float32
/// decides a threshold differently from float64: one pixel of one Gaussian, of weight 1/255. Hence the tolerance of
/// 2e-3 of the largest entry.
#[test]
fn splat_against_the_twin() {
    for seed in 10..16 {
        let mut random = Random::new(seed);
        let (width, height) = [(37, 19), (16, 33), (25, 25), (1, 40)][seed as usize % 4];
        let degree = seed as usize % 4;
        let camera = off_axis(seed >= 14, random_camera(width, height, &mut random));
        let ranges = Ranges { scales: [0.05, 0.5], ..Ranges::default() };
        let scene = SplatScene::random(14, &ranges, &mut random);
        let weights = random.normals((width * height * 5) as usize);
        let mut expected: [Vec<f32>; 7] = Default::default();
        for k in 0..ATTRIBUTES.len() {
            for i in 0..scene.attributes[k].len() {
                let at = |step: f64| {
                    let mut scene = scene.clone();
                    scene.attributes[k][i] += step;
                    let image = twin::render(&scene, &camera, BACKGROUND, degree);
                    (dot(image.values, &weights), image.decisions)
                };
                // Smaller and smaller steps until none of the thresholds is crossed.
                let difference = [1e-6, 1e-7, 1e-8].into_iter().find_map(|step| {
                    let ((above, decided_above), (below, decided_below)) = (at(step), at(-step));
                    (decided_above == decided_below).then(|| (above - below) / (2.0 * step))
                });
                let difference = difference.unwrap_or_else(|| panic!("{} {i}: on a threshold", ATTRIBUTES[k]));
                expected[k].push(difference as f32);
            }
        }
        for (name, device) in devices() {
            let leaves = scene.leaves(&device.autodiff());
            let gradients = leaves.gradients(leaves.render(&camera, BACKGROUND, degree), &weights);
            for (k, gradient) in gradients.iter().enumerate() {
                let what = format!("{name} seed {seed} {}", ATTRIBUTES[k]);
                assert_close_relative(&what, gradient, &expected[k], 2e-3);
            }
        }
    }
}

/// Points, and the six planes of one scale.
#[derive(Clone)]
struct Query {
    channels: usize,
    /// Along x, y, z, t.
    resolution: [usize; 4],
    /// `[N, 4]`, then the planes `[C, H, W]`.
    inputs: [Vec<f64>; 7],
}

const QUERY_INPUTS: [&str; 7] = ["points", "xy", "xz", "xt", "yz", "yt", "zt"];
const AXES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

impl Query {
    /// Points lie inside the cells, not on their borders, where the query has a kink; `outside` of them are moved out
    /// of [-1, 1] along one axis, where they are clamped and the derivative along that axis is zero.
    fn random(channels: usize, resolution: [usize; 4], outside: usize, random: &mut Random) -> Self {
        let count = 40;
        let mut points: Vec<f64> = (0..4 * count)
            .map(|i| {
                let last = resolution[i % 4] - 1;
                let place = random.below(last) as f64 + random.uniform(0.1, 0.9);
                f64::from((place / last as f64 * 2.0 - 1.0) as f32)
            })
            .collect();
        for n in 0..outside {
            points[4 * n + n % 4] = if n % 2 == 0 { 1.25 } else { -1.5 };
        }
        let mut inputs: [Vec<f64>; 7] = Default::default();
        inputs[0] = points;
        for (plane, [across, down]) in AXES.into_iter().enumerate() {
            let size = channels * resolution[across] * resolution[down];
            inputs[plane + 1] = (0..size).map(|_| random.uniform(0.4, 1.4)).collect();
        }
        Self { channels, resolution, inputs }
    }

    /// Features and leaves, with the operation.
    fn run(&self, device: &Device) -> (Tensor<2>, Tensor<2>, FeaturePlanes) {
        let data = |k: usize, shape: Vec<usize>| {
            TensorData::new(self.inputs[k].iter().map(|v| *v as f32).collect::<Vec<_>>(), shape)
        };
        let planes = AXES.into_iter().enumerate().map(|(plane, [across, down])| {
            let shape = vec![self.channels, self.resolution[down], self.resolution[across]];
            Tensor::<3>::from_data(data(plane + 1, shape), device)
        });
        let hexplane = FeaturePlanes::from_tensors(PlaneTensors::at_scales(&PlaneAxes::ALL, planes.collect()));
        let points = Tensor::<2>::from_data(data(0, vec![self.inputs[0].len() / 4, 4]), device).require_grad();
        (hexplane.query(points.clone()), points, hexplane)
    }

    /// Gradients of `sum(features · weights)` with the operation.
    fn gradients(&self, device: &Device, weights: &[f64]) -> [Vec<f32>; 7] {
        let (features, points, hexplane) = self.run(device);
        let values: Vec<f32> = weights.iter().map(|w| *w as f32).collect();
        let weights = Tensor::<2>::from_data(TensorData::new(values, features.dims()), device);
        let grads = (features * weights).sum().backward();
        std::array::from_fn(|k| match k {
            0 => values_of(&points.grad(&grads).unwrap()),
            plane => values_of(&hexplane.planes[plane - 1].val().grad(&grads).unwrap()),
        })
    }

    /// Features in float64, written plainly: align-corners, border clamp.
    fn twin(&self) -> Vec<f64> {
        let points = self.inputs[0].chunks_exact(4);
        points.flat_map(|point| (0..self.channels).map(|c| self.twin_feature(point, c)).collect::<Vec<_>>()).collect()
    }

    fn twin_feature(&self, point: &[f64], channel: usize) -> f64 {
        let mut product = 1.0;
        for (plane, [across, down]) in AXES.into_iter().enumerate() {
            let (width, height) = (self.resolution[across], self.resolution[down]);
            let place = |axis: usize| {
                let last = (self.resolution[axis] - 1) as f64;
                ((point[axis] + 1.0) / 2.0 * last).clamp(0.0, last)
            };
            let mut sample = 0.0;
            for (row, column) in (0..height).flat_map(|row| (0..width).map(move |column| (row, column))) {
                // Tent functions: only the four cells around the point have weight.
                let tent = |place: f64, cell: usize| (1.0 - (place - cell as f64).abs()).max(0.0);
                let weight = tent(place(across), column) * tent(place(down), row);
                sample += weight * self.inputs[plane + 1][(channel * height + row) * width + column];
            }
            product *= sample;
        }
        product
    }
}

/// Numbers of channels that fill the vector lanes and that do not, odd resolutions, an axis of two cells.
fn queries() -> Vec<(String, Query, Random)> {
    let cases = [(3, [5, 4, 6, 3]), (8, [4, 4, 4, 4]), (9, [7, 3, 5, 2])];
    let seeded = cases.into_iter().enumerate().map(|(seed, (channels, resolution))| {
        let mut random = Random::new(100 + seed as u64);
        let query = Query::random(channels, resolution, 6, &mut random);
        (format!("{channels} channels {resolution:?}"), query, random)
    });
    seeded.collect()
}

#[test]
fn hexplane_query_along_random_directions() {
    for (name, device) in devices() {
        let device = device.autodiff();
        for (case, query, mut random) in queries() {
            let weights = random.normals(query.inputs[0].len() / 4 * query.channels);
            let gradients = query.gradients(&device, &weights);
            for (k, gradient) in gradients.iter().enumerate() {
                let what = format!("{name} {case} {}", QUERY_INPUTS[k]);
                check_directions(&what, &query.inputs[k], gradient, 1e-3, &mut random, |values| {
                    let mut query = query.clone();
                    query.inputs[k] = values;
                    dot(wide(&values_of(&query.run(&device).0)), &weights)
                });
            }
        }
    }
}

/// Every coordinate. The features are products of bilinear functions without thresholds, so only rounding is left.
#[test]
fn hexplane_query_against_the_twin() {
    const STEP: f64 = 1e-5;
    for (case, query, mut random) in queries() {
        let weights = random.normals(query.inputs[0].len() / 4 * query.channels);
        let mut expected: [Vec<f32>; 7] = Default::default();
        for k in 0..QUERY_INPUTS.len() {
            for i in 0..query.inputs[k].len() {
                let at = |step: f64| {
                    let mut query = query.clone();
                    query.inputs[k][i] += step;
                    dot(query.twin(), &weights)
                };
                expected[k].push(((at(STEP) - at(-STEP)) / (2.0 * STEP)) as f32);
            }
        }
        for (name, device) in devices() {
            let device = device.autodiff();
            let features = values_of(&query.run(&device).0);
            let twin: Vec<f32> = query.twin().into_iter().map(|v| v as f32).collect();
            assert_close_relative(&format!("{name} {case} features"), &features, &twin, 1e-5);
            for (k, gradient) in query.gradients(&device, &weights).iter().enumerate() {
                let what = format!("{name} {case} {}", QUERY_INPUTS[k]);
                assert_close_relative(&what, gradient, &expected[k], 1e-4);
            }
        }
    }
}

/// Elementwise operations, at values that are not all in the tails and not on a threshold.
fn check_elementwise(
    what: &str,
    values: &[f64],
    operation: impl Fn(Tensor<1>) -> Tensor<1>,
    device: &Device,
    random: &mut Random,
) {
    let tensor = |values: &[f64]| {
        let values: Vec<f32> = values.iter().map(|v| *v as f32).collect();
        Tensor::<1>::from_floats(values.as_slice(), device)
    };
    let weights = random.normals(values.len());
    let leaf = tensor(values).require_grad();
    let grads = (operation(leaf.clone()) * tensor(&weights)).sum().backward();
    let gradient = values_of(&leaf.grad(&grads).unwrap());
    check_directions(what, values, &gradient, 1e-3, random, |values| {
        dot(wide(&values_of(&operation(tensor(&values)))), &weights)
    });
}

/// Only above the bound: below it the result is not a derivative. Golden cases c04 and c05 test that part.
#[test]
fn lower_bound_above_the_bound() {
    for (name, device) in devices() {
        let mut random = Random::new(200);
        let values: Vec<f64> = (0..50).map(|_| random.uniform(0.15, 2.0)).collect();
        let what = format!("{name} lower bound");
        check_elementwise(&what, &values, |x| lower_bound(x, 0.11), &device.autodiff(), &mut random);
    }
}

/// No bound is near.
const BOUNDS: NormalBounds = NormalBounds { scale: 0.01, likelihood: 1e-37 };

#[test]
fn normal_likelihood_along_random_directions() {
    for (name, device) in devices() {
        let device = device.autodiff();
        let mut random = Random::new(201);
        let [values, means]: [Vec<f64>; 2] = [(); 2].map(|()| (0..50).map(|_| random.uniform(-1.5, 1.5)).collect());
        let scales: Vec<f64> = (0..50).map(|_| random.uniform(0.2, 2.0)).collect();
        let tensor = |values: &[f64]| {
            let values: Vec<f32> = values.iter().map(|v| *v as f32).collect();
            Tensor::<1>::from_floats(values.as_slice(), &device)
        };
        let inputs = [values, means, scales];
        for (k, what) in ["values", "means", "scales"].into_iter().enumerate() {
            let operation = |x: Tensor<1>| {
                let mut tensors = inputs.each_ref().map(|input| tensor(input));
                tensors[k] = x;
                let [values, means, scales] = tensors;
                normal_likelihood(values, Tensor::cat(vec![scales, means], 0), BOUNDS)
            };
            let what = format!("{name} normal likelihood, {what}");
            check_elementwise(&what, &inputs[k], operation, &device, &mut random);
        }
    }
}

/// The standard normal density, the derivative of the distribution function.
fn normal_density_twin(x: f64) -> f64 {
    (-0.5 * x * x).exp() / std::f64::consts::TAU.sqrt()
}

/// The mass between two places: the density integrated by Simpson's rule.
fn normal_mass_twin(low: f64, high: f64) -> f64 {
    const CELLS: usize = 20_000;
    let step = (high - low) / CELLS as f64;
    let inner = (1..CELLS).map(|i| normal_density_twin(low + i as f64 * step) * if i % 2 == 1 { 4.0 } else { 2.0 });
    (normal_density_twin(low) + inner.sum::<f64>() + normal_density_twin(high)) * step / 3.0
}

/// Relative errors, down to probabilities at which nothing is coded any more: the bits of a symbol are a logarithm.
#[test]
fn normal_likelihood_against_the_twin() {
    for (name, device) in devices() {
        let device = device.autodiff();
        for scale in [0.4, 1.0, 3.0] {
            let places: Vec<f64> = (-90..=90).map(|i| f64::from((f64::from(i) * 0.1 * scale) as f32)).collect();
            let values: Vec<f32> = places.iter().map(|v| *v as f32).collect();
            let leaf = Tensor::<1>::from_floats(values.as_slice(), &device).require_grad();
            let parameters = Tensor::cat(vec![leaf.ones_like() * scale, leaf.zeros_like()], 0);
            let found = normal_likelihood(leaf.clone(), parameters, BOUNDS);
            let gradient = values_of(&leaf.grad(&found.clone().sum().backward()).unwrap());
            for ((x, found), gradient) in places.iter().zip(values_of(&found)).zip(gradient) {
                let scale = f64::from(scale as f32);
                let [low, high] = [-0.5, 0.5].map(|half| (x + half) / scale);
                let expected = normal_mass_twin(low, high);
                // It is a difference of two masses below, the larger of which ends at the edge next to the mean.
                let edge = (0.5 - x.abs()) / scale;
                let error = (f64::from(found) - expected).abs() / normal_mass_twin(edge.min(0.0) - 12.0, edge);
                // Sum and quotient of the edge are rounded; the logarithm of the mass has the slope `edge` there, far out.
                let allowed = 5e-6 + edge * edge * f64::from(f32::EPSILON);
                assert!(error < allowed, "{name} at {x} in {scale}: {found} against {expected}, off by {error:e}");
                let [at_low, at_high] = [low, high].map(|place| normal_density_twin(place) / scale);
                let error = (f64::from(gradient) - (at_high - at_low)).abs() / (at_high + at_low);
                assert!(error < 5e-6, "{name} slope at {x}: {gradient}, off by {error:e} of the densities");
            }
        }
    }
}

/// A value, a mean or a standard deviation that is not a number does not become a likelihood at the bound.
#[test]
fn normal_likelihood_of_what_is_no_number() {
    for (name, device) in devices() {
        let row = |place: usize| {
            let numbers: Vec<f32> = (0..3).map(|k| if k == place { f32::NAN } else { 1.0 }).collect();
            Tensor::<1>::from_floats(numbers.as_slice(), &device)
        };
        let parameters = Tensor::cat(vec![row(1), row(2)], 0);
        let found = values_of(&normal_likelihood(row(0), parameters, BOUNDS));
        assert!(found.iter().all(|likelihood| likelihood.is_nan()), "{name}: {found:?}");
    }
}
