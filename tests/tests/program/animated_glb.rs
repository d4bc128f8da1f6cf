//! `export` of control nodes to glTF: skin and animation as another program runs them, against the scene itself.

use std::fs;
use std::path::Path;

use burn::tensor::{Device, Tensor};
use glam::{DMat4, DQuat, DVec3};
use light4gs_model::{BuiltInField, DynamicScene, NodesField};
use light4gs_tests::golden::values_of;
use light4gs_tests::program::{Workspace, assert_refused, assert_success};
use serde_json::Value;

use crate::{PROGRAM, trained};

pub(crate) const NODES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/golden-streams/nodes.l4gs");
const LIFETIMES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/golden-streams/lifetimes.l4gs");
/// Twelve nodes, and one joint that never moves.
const JOINTS: usize = 13;
const FPS: f64 = 25.0;
/// Bound of the rounding in float32, with which the model computes.
const ROUNDING: f64 = 2e-6;

/// A program that knows glTF 2.0 and nothing else; no part of it is shared with the writer.
pub(crate) struct Player {
    pub(crate) json: Value,
    binary: Vec<u8>,
}

impl Player {
    pub(crate) fn open(path: &Path) -> Self {
        let bytes = fs::read(path).unwrap();
        let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
        let json = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
        Self { json, binary: bytes[28 + length..].to_vec() }
    }

    fn numbers(&self, accessor: &Value) -> Vec<f64> {
        let accessor = &self.json["accessors"][accessor.as_u64().unwrap() as usize];
        let view = &self.json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
        let [begin, length] = ["byteOffset", "byteLength"].map(|key| view[key].as_u64().unwrap() as usize);
        let bytes = &self.binary[begin..begin + length];
        match accessor["componentType"].as_u64().unwrap() {
            5121 => bytes.iter().map(|byte| f64::from(*byte)).collect(),
            5126 => bytes.as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes).into()).collect(),
            other => panic!("component type {other}"),
        }
    }

    pub(crate) fn attribute(&self, name: &str) -> Option<Vec<f64>> {
        let accessor = &self.json["meshes"][0]["primitives"][0]["attributes"][name];
        (!accessor.is_null()).then(|| self.numbers(accessor))
    }

    /// Appendix C of the specification.
    fn sampled(&self, sampler: &Value, seconds: f64) -> Vec<f64> {
        let (times, values) = (self.numbers(&sampler["input"]), self.numbers(&sampler["output"]));
        let width = values.len() / times.len();
        let row = |keyframe: usize| &values[width * keyframe..width * (keyframe + 1)];
        let next = times.partition_point(|time| *time <= seconds);
        if next == 0 || next == times.len() {
            return row(next.saturating_sub(1)).to_vec();
        }
        let (from, to) = (row(next - 1), row(next));
        let share = (seconds - times[next - 1]) / (times[next] - times[next - 1]);
        let dot: f64 = from.iter().zip(to).map(|(from, to)| from * to).sum();
        let angle = dot.abs().min(1.0).acos();
        let (keep, take) = if width == 4 && angle > 1e-6 {
            ((angle * (1.0 - share)).sin() / angle.sin(), dot.signum() * (angle * share).sin() / angle.sin())
        } else {
            (1.0 - share, share)
        };
        from.iter().zip(to).map(|(from, to)| keep * from + take * to).collect()
    }

    /// The transformation of vertices by each joint.
    fn joint_matrices(&self, seconds: f64) -> Vec<DMat4> {
        let mut nodes = self.json["nodes"].as_array().unwrap().clone();
        let animation = &self.json["animations"][0];
        for channel in animation["channels"].as_array().unwrap() {
            let target = &channel["target"];
            let sampler = &animation["samplers"][channel["sampler"].as_u64().unwrap() as usize];
            let value = self.sampled(sampler, seconds);
            nodes[target["node"].as_u64().unwrap() as usize][target["path"].as_str().unwrap()] = value.into();
        }
        let local = |node: &Value| {
            let part = |key: &str| serde_json::from_value::<Vec<f64>>(node[key].clone()).ok();
            let rotation = part("rotation").map_or(DQuat::IDENTITY, |q| DQuat::from_slice(&q).normalize());
            DMat4::from_rotation_translation(
                rotation,
                part("translation").map_or(DVec3::ZERO, |t| DVec3::from_slice(&t)),
            )
        };
        let skin = &self.json["skins"][0];
        let root = local(&nodes[skin["skeleton"].as_u64().unwrap() as usize]);
        let inverse = self.numbers(&skin["inverseBindMatrices"]);
        let joints = skin["joints"].as_array().unwrap().iter().zip(inverse.chunks_exact(16));
        let matrix = |(joint, inverse): (&Value, &[f64])| {
            root * local(&nodes[joint.as_u64().unwrap() as usize]) * DMat4::from_cols_slice(inverse)
        };
        joints.map(matrix).collect()
    }

    /// Joints and weights of each vertex, from as many sets as there are.
    pub(crate) fn influences(&self) -> Vec<Vec<(usize, f64)>> {
        let mut all = vec![Vec::new(); self.positions_at_rest().len()];
        for set in 0.. {
            let Some(joints) = self.attribute(&format!("JOINTS_{set}")) else { break };
            let weights = self.attribute(&format!("WEIGHTS_{set}")).unwrap();
            for (at, pair) in joints.into_iter().map(|joint| joint as usize).zip(weights).enumerate() {
                all[at / 4].push(pair);
            }
        }
        all
    }

    pub(crate) fn positions_at_rest(&self) -> Vec<DVec3> {
        self.attribute("POSITION").unwrap().chunks_exact(3).map(DVec3::from_slice).collect()
    }

    pub(crate) fn positions(&self, seconds: f64) -> Vec<DVec3> {
        let matrices = self.joint_matrices(seconds);
        let moved = |(position, influences): (DVec3, Vec<(usize, f64)>)| {
            influences.into_iter().map(|(joint, weight)| matrices[joint].transform_point3(position) * weight).sum()
        };
        self.positions_at_rest().into_iter().zip(self.influences()).map(moved).collect()
    }
}

fn points(tensor: &Tensor<2>) -> Vec<DVec3> {
    values_of(tensor).as_chunks::<3>().0.iter().map(|point| DVec3::from_array(point.map(f64::from))).collect()
}

/// The transformations of the scene's own joints.
fn exact_matrices(nodes: &NodesField, time: f32) -> Vec<DMat4> {
    let (places, quats) = nodes.places(time);
    let rotations = values_of(&quats);
    let rotations = rotations.as_chunks::<4>().0.iter().map(|quat| {
        let [w, x, y, z] = quat.map(f64::from);
        DQuat::from_xyzw(x, y, z, w).normalize()
    });
    let moves = points(&places).into_iter().zip(rotations).zip(points(&nodes.world_anchors()));
    let matrix = |((place, rotation), anchor): ((DVec3, DQuat), DVec3)| {
        DMat4::from_rotation_translation(rotation, place) * DMat4::from_translation(-anchor)
    };
    moves.map(matrix).chain([DMat4::IDENTITY]).collect()
}

struct Errors {
    /// Of a Gaussian's position.
    largest: f64,
    /// Of the position, between keyframes, that a single joint gives a Gaussian.
    of_joints: f64,
}

/// Compares at the keyframes and halfway between them. The bound of each position follows from the weights that were
/// left out, since those joints would move the Gaussian elsewhere.
fn compare(player: &Player, scene: &DynamicScene, keyframes: usize) -> Errors {
    let BuiltInField::Nodes(nodes) = &scene.field else { panic!("no nodes") };
    let weights = values_of(&nodes.weights(&scene.gaussians.tensors()));
    let (at_rest, influences) = (player.positions_at_rest(), player.influences());
    let mut errors = Errors { largest: 0.0, of_joints: 0.0 };
    for half in 0..2 * keyframes - 1 {
        let moment = half as f64 / 2.0;
        let time = (moment / (keyframes - 1) as f64) as f32;
        let (written, exact) =
            (player.joint_matrices(moment / FPS), exact_matrices(nodes, scene.coordinates.field_time(time)));
        let (found, expected) = (player.positions(moment / FPS), points(&scene.at(time).means));
        for (gaussian, weights) in weights.chunks_exact(JOINTS).enumerate() {
            let by = |matrices: &[DMat4], joint: usize| matrices[joint].transform_point3(at_rest[gaussian]);
            let followed: Vec<usize> =
                influences[gaussian].iter().filter(|(_, weight)| *weight > 0.0).map(|(joint, _)| *joint).collect();
            let off = |joint: &usize| by(&written, *joint).distance(by(&exact, *joint));
            let of_joints = followed.iter().map(off).fold(0.0, f64::max);
            let left_out = (0..JOINTS).filter(|joint| !followed.contains(joint));
            let reach = |joint: usize| by(&exact, joint).distance(found[gaussian]) + of_joints;
            let bound: f64 = of_joints + left_out.map(|joint| f64::from(weights[joint]) * reach(joint)).sum::<f64>();
            let error = found[gaussian].distance(expected[gaussian]);
            assert!(error <= bound + ROUNDING, "{gaussian} at {moment}: {error}, expected at most {bound}");
            if half % 2 == 0 {
                assert!(of_joints < ROUNDING, "keyframe {moment}: {of_joints}");
            }
            errors.largest = errors.largest.max(error);
            errors.of_joints = errors.of_joints.max(of_joints);
        }
    }
    errors
}

#[test]
fn a_glb_of_control_nodes_moves_as_the_scene_does() {
    let w = Workspace::new(PROGRAM);
    let data = light4gs_codec::read_file(Path::new(NODES)).unwrap();
    let scene: DynamicScene = DynamicScene::from_arrays(&data, &Device::flex()).unwrap();
    let errors = [11usize, 21, 41].map(|keyframes| {
        let (fps, count) = (FPS.to_string(), keyframes.to_string());
        let output = w.run(["export", NODES, "--out", "a.glb", "--frames", &count, "--fps", &fps, "--device", "flex"]);
        assert_success(&output);
        let player = Player::open(&w.path("a.glb"));
        let errors = compare(&player, &scene, keyframes);
        let text = String::from_utf8(output.stdout).unwrap();
        let seconds = (keyframes - 1) as f64 / FPS;
        assert!(text.contains(&format!("{JOINTS} joints, {keyframes} keyframes in {seconds:.2} s")), "{text}");
        assert!(!text.contains("without"), "{text}");
        let said = text.split("mean, by ").nth(1).and_then(|rest| rest.split(' ').next()).expect("a distance");
        let said: f64 = said.parse().unwrap();
        assert!((said - errors.largest).abs() < 1e-5, "{said}, found {}", errors.largest);
        errors
    });
    // Linear interpolation: twice as many keyframes, a quarter of the error.
    for pair in errors.windows(2) {
        assert!(pair[1].of_joints < 0.35 * pair[0].of_joints, "{} {}", pair[0].of_joints, pair[1].of_joints);
    }
    let most_weights_kept = errors[2].largest;
    assert!(most_weights_kept < 0.02, "{most_weights_kept}");
}

#[test]
fn the_root_of_the_joints_turns_what_the_scene_has_upright() {
    let w = Workspace::new(PROGRAM);
    assert_success(&w.run(["export", NODES, "--out", "a.glb", "--frames", "3", "--device", "flex"]));
    assert_success(&w.run(["export", NODES, "--out", "up.glb", "--frames", "3", "--z-up", "--device", "flex"]));
    let [plain, up] = ["a.glb", "up.glb"].map(|name| Player::open(&w.path(name)).positions(0.01));
    for (plain, up) in plain.into_iter().zip(up) {
        assert!(up.distance(DVec3::new(plain.x, plain.z, -plain.y)) < 1e-6, "{plain} {up}");
    }
}

#[test]
fn a_time_makes_a_glb_that_stands_still() {
    let w = Workspace::new(PROGRAM);
    let output = w.run(["export", LIFETIMES, "--out", "moving.glb", "--frames", "2", "--device", "flex"]);
    assert_success(&output);
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("without the attributes lifetime") && !text.contains("stillness"), "{text}");
    assert_success(&w.run(["export", LIFETIMES, "--out", "still.glb", "--time", "0.5", "--device", "flex"]));
    let player = Player::open(&w.path("still.glb"));
    assert!(["skins", "animations"].iter().all(|key| player.json.get(key).is_none()));
    assert!(player.attribute("JOINTS_0").is_none());
    let data = light4gs_codec::read_file(Path::new(LIFETIMES)).unwrap();
    let scene: DynamicScene = DynamicScene::from_arrays(&data, &Device::flex()).unwrap();
    let exact = points(&scene.at(0.5).means);
    assert!(player.positions_at_rest().iter().zip(exact).all(|(found, exact)| found.distance(exact) < 1e-6));
    assert_refused(&w.run(["export", LIFETIMES, "--out", "no.glb", "--time", "0.5", "--frames", "3"]), &["--time"]);
    assert_refused(&w.run(["export", NODES, "--out", "no.glb", "--fps", "1e-9"]), &["--fps", "0.001"]);

    // Other fields have no joints.
    let w = trained();
    assert_success(&w.run(["export", "run/scene.l4gs", "--out", "a.glb"]));
    assert!(Player::open(&w.path("a.glb")).json.get("skins").is_none());
}
