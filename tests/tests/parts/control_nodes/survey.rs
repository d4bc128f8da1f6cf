//! Ways that a survey of all times has found stay when the window narrows; rotations do not.

use burn::module::Param;
use burn::tensor::{Device, Tensor, TensorData};
use glam::{Quat, Vec3};
use light4gs_data::PointCloud;
use light4gs_model::parameters::{ParameterMapper, map_parameters};
use light4gs_model::{DeformationField, DynamicScene, DynamicSceneConfig, FinePosition, GaussiansConfig};
use light4gs_model::{NodesField, NodesFieldConfig, SceneAtRest};
use light4gs_tests::golden::{assert_close, devices, values_of};
use light4gs_tests::random::Random;

use super::{EXTENT, POSITION};

/// Gaussians of two balls in turn, and their middles.
const COUNT: usize = 120;
const MIDDLES: [Vec3; 2] = [Vec3::new(-1.0, 0.2, 0.0), Vec3::new(1.0, 0.0, 0.3)];
const WINDOW: [f32; 2] = [0.4, 0.6];

/// How far a ball has gone at a knot: it comes, bounces, and goes.
fn way(ball: usize, knot: f32) -> Vec3 {
    let bounce = [Vec3::new(0.1, 0.0, 0.2), Vec3::new(-0.05, 0.15, 0.1)][ball];
    bounce * (knot - [2.0, 5.0][ball]).abs()
}

/// How a ball is turned at a knot.
fn turn(ball: usize, knot: f32, speed: f32) -> Quat {
    Quat::from_axis_angle([Vec3::Z, Vec3::X][ball], speed * (knot - 4.0))
}

/// Gives the nodes of each ball its way and its turns.
struct Thrown {
    anchors: Vec<Vec3>,
    speed: f32,
}

impl ParameterMapper for Thrown {
    fn map<const D: usize>(&mut self, path: &str, parameter: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let [knots, _] = parameter.dims()[..] else { return parameter };
        let number = |knot: usize, anchor: &Vec3| -> Vec<f32> {
            let ball = usize::from(anchor.x > 0.0);
            let turn = turn(ball, knot as f32, self.speed);
            if path.ends_with("rotations") {
                return vec![turn.w - 1.0, turn.x, turn.y, turn.z];
            }
            let arm = *anchor - MIDDLES[ball];
            ((way(ball, knot as f32) + turn * arm - arm) / EXTENT).to_array().to_vec()
        };
        if !["translations", "rotations"].iter().any(|name| path.ends_with(name)) {
            return parameter;
        }
        let values: Vec<f32> =
            (0..knots).flat_map(|knot| self.anchors.iter().flat_map(move |anchor| number(knot, anchor))).collect();
        let value = Tensor::from_data(TensorData::new(values, parameter.dims()), &parameter.val().device());
        Param::initialized(parameter.id, value.require_grad())
    }
}

fn thrown(speed: f32, device: &Device) -> DynamicScene<NodesField> {
    let mut random = Random::new(5);
    let mut coordinate = || random.uniform(-0.25, 0.25) as f32;
    let positions = (0..COUNT).map(|i| (MIDDLES[i % 2] + Vec3::from_array([(); 3].map(|()| coordinate()))).to_array());
    let cloud = PointCloud { positions: positions.collect(), colors: vec![[0.5; 3]; COUNT] };
    let config = NodesFieldConfig { count: 8, stillness: false, ..Default::default() };
    let mut scene = DynamicSceneConfig::<NodesField>::new(GaussiansConfig::new(), config).init(&cloud, device);
    let DynamicScene { gaussians, coordinates, field, .. } = &mut scene;
    field.begin_motion(&SceneAtRest { gaussians, coordinates, extent: EXTENT }, &POSITION);
    let anchors = values_of(&scene.field.world_anchors()).as_chunks().0.iter().map(|a| Vec3::from_array(*a)).collect();
    map_parameters(scene, &mut Thrown { anchors, speed })
}

fn narrow(scene: &mut DynamicScene<NodesField>) {
    let DynamicScene { gaussians, coordinates, field, .. } = scene;
    let at_rest = SceneAtRest { gaussians, coordinates, extent: EXTENT };
    field.begin_step(&at_rest, &FinePosition { iteration: 50, window: WINDOW, ..POSITION });
    let window_before = WINDOW;
    field.begin_step(&at_rest, &FinePosition { iteration: 51, window: WINDOW, window_before, ..POSITION });
}

/// The middles of both balls at a time.
fn middles(scene: &DynamicScene<NodesField>, time: f32) -> Vec<f32> {
    let means = values_of(&scene.at(time).means);
    let sums = means.as_chunks().0.iter().enumerate().fold([Vec3::ZERO; 2], |mut sums, (i, mean)| {
        sums[i % 2] += Vec3::from_array(*mean);
        sums
    });
    sums.iter().flat_map(|sum| (*sum * 2.0 / COUNT as f32).to_array()).collect()
}

#[test]
fn what_bounces_without_turning_stays_where_it_is() {
    for (name, device) in devices() {
        let mut scene = thrown(0.0, &device.autodiff());
        let times = [0.0, 0.13, 0.3, 0.5, 0.71, 1.0];
        let before = times.map(|time| values_of(&scene.at(time).means));
        narrow(&mut scene);
        for (time, before) in times.into_iter().zip(before) {
            assert_close(&format!("{name} at {time}"), &values_of(&scene.at(time).means), &before, 2e-3);
        }
    }
}

/// Rotations are taken back, around the middle of the object.
#[test]
fn what_turns_stays_on_its_way() {
    let mut scene = thrown(0.5, &Device::flex().autodiff());
    let times = [0.0, 0.13, 0.3, 0.5, 0.71, 1.0];
    let before = times.map(|time| middles(&scene, time));
    let quats = |scene: &DynamicScene<NodesField>, time: f32| values_of(&scene.at(time).quats);
    assert_ne!(quats(&scene, 0.1), quats(&scene, 0.9));
    narrow(&mut scene);
    for (time, before) in times.into_iter().zip(before) {
        assert_close(&format!("at {time}"), &middles(&scene, time), &before, 0.02);
        assert_close("turns", &quats(&scene, time), &quats(&scene, 0.5), 1e-4);
    }
}

/// Without a survey, nothing is known beyond the window.
#[test]
fn a_window_that_was_never_open_has_no_ways() {
    let mut scene = thrown(0.0, &Device::flex().autodiff());
    let before = middles(&scene, 1.0);
    let DynamicScene { gaussians, coordinates, field, .. } = &mut scene;
    let at_rest = SceneAtRest { gaussians, coordinates, extent: EXTENT };
    field.begin_step(&at_rest, &FinePosition { window: WINDOW, window_before: WINDOW, ..POSITION });
    let off = middles(&scene, 1.0).iter().zip(&before).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(off > 0.1, "{off}");
}
