//! Checkpoints of 4DGaussians and of the public code of Light4GS, and plain PLY files: they are read, rendered with the
//! same result, and coded.

use std::path::Path;

use burn::tensor::{Device, Tensor, TensorData};
use light4gs_codec::plane_layout::PlaneAxes;
use light4gs_data::{Frame, GaussianPly, SplitFrames};
use light4gs_model::{DeformationField, DynamicScene, HexPlaneField, PlaneTensors, Splatter, StillField};
use light4gs_tests::golden::{Golden, assert_close_relative, cpu_devices, devices, values_of};
use light4gs_tests::pytorch::{StateDict, save_state_dict};
use light4gs_tests::random::Random;
use light4gs_train::compression::{ConfiguredModels, TrainedScene, code_scene};
use light4gs_train::config::Config;
use light4gs_train::import::still::{self, StillScene};
use light4gs_train::import::{reference, scene_around};
use light4gs_train::run::{Checkpoint, RunFolder};

const GRID: &str = "deformation_net.grid";

fn triples(values: &[f32]) -> Vec<[f32; 3]> {
    values.as_chunks().0.to_vec()
}

/// Planes of a golden case in the reference's names.
fn golden_planes(golden: &Golden, prefix: &str, state: &mut StateDict) {
    for scale in (0..).take_while(|scale| golden.has(&format!("{prefix}scale{scale}.plane0"))) {
        for plane in 0..6 {
            let key = format!("{prefix}scale{scale}.plane{plane}");
            state.insert(format!("{GRID}.grids.{scale}.{plane}"), (golden.shape(&key), golden.values(&key)));
        }
    }
}

fn principal_axes(state: &mut StateDict, mean: Vec<f32>, rotation: Vec<f32>, std: Vec<f32>) {
    state.insert(format!("{GRID}.pca_mean"), (vec![3], mean));
    state.insert(format!("{GRID}.rotation_matrix"), (vec![3, 3], rotation));
    state.insert(format!("{GRID}.variance"), (vec![3], std));
}

/// A network of the reference with all five heads.
fn random_network(state: &mut StateDict, features: usize, width: usize, random: &mut Random, size: f64) {
    let mut add = |name: &str, inputs: usize, outputs: usize| {
        let mut values = |count: usize| (0..count).map(|_| (size * random.normal()) as f32).collect::<Vec<_>>();
        state.insert(format!("deformation_net.{name}.weight"), (vec![outputs, inputs], values(outputs * inputs)));
        state.insert(format!("deformation_net.{name}.bias"), (vec![outputs], values(outputs)));
    };
    add("feature_out.0", features, width);
    for (head, outputs) in
        [("pos_deform", 3), ("scales_deform", 3), ("rotations_deform", 4), ("opacity_deform", 1), ("shs_deform", 48)]
    {
        add(&format!("{head}.1"), width, width);
        add(&format!("{head}.3"), width, outputs);
    }
}

fn write_checkpoint(folder: &Path, gaussians: &GaussianPly, state: &StateDict, settings: &str) {
    gaussians.write(&folder.join("point_cloud.ply")).unwrap();
    save_state_dict(&folder.join("deformation.pth"), state);
    let table = (vec![gaussians.len()], vec![1.0; gaussians.len()]);
    save_state_dict(&folder.join("deformation_table.pth"), &StateDict::from([("table".to_owned(), table)]));
    std::fs::write(folder.join("cfg_args"), settings).unwrap();
}

/// `full.*` of c03, as a checkpoint: planes, a network with five heads and the Gaussians, in the public code's coordinates.
#[test]
fn the_reference_deforms_as_its_golden_vectors_say() {
    let golden = Golden::open("c03_deform");
    let folder = tempfile::tempdir().unwrap();
    let mut state = StateDict::new();
    golden_planes(&golden, "full.", &mut state);
    let corners = [golden.values("full.aabb_max"), golden.values("full.aabb_min")].concat();
    state.insert(format!("{GRID}.aabb"), (vec![2, 3], corners));
    principal_axes(&mut state, vec![0.0; 3], vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], vec![1.0; 3]);
    for name in golden.names().iter().filter_map(|name| name.strip_prefix("depth1.param.")) {
        let key = format!("depth1.param.{name}");
        state.insert(format!("deformation_net.{name}"), (golden.shape(&key), golden.values(&key)));
    }
    let shs = golden.values("full.in.shs");
    let gaussians = GaussianPly {
        means: triples(&golden.values("full.in.xyz")),
        sh_dc: shs.chunks_exact(48).map(|row| [row[0], row[1], row[2]]).collect(),
        sh_rest: shs.chunks_exact(48).map(|row| triples(&row[3..]).try_into().unwrap()).collect(),
        opacity_logits: golden.values("full.in.opacity"),
        log_scales: triples(&golden.values("full.in.scales")),
        quats: golden.values("full.in.rotations").as_chunks().0.to_vec(),
        further: Vec::new(),
    };
    write_checkpoint(folder.path(), &gaussians, &state, "Namespace(no_do=False, no_dshs=False)");
    let time = golden.scalar("full.t");
    for (name, device) in devices() {
        let imported = reference::read(folder.path(), &device).unwrap();
        assert_eq!(imported.background, [1.0; 3]);
        let moved = imported.scene.at(time);
        let count = gaussians.len();
        let shs = Tensor::cat(vec![moved.sh_dc, moved.sh_rest], 1).reshape([count, 48]);
        for (key, found) in [
            ("xyz", moved.means),
            ("scales", moved.log_scales),
            ("rotations", moved.quats),
            ("opacity", moved.opacity_logits),
            ("shs", shs),
        ] {
            let key = format!("full.out.{key}");
            assert_close_relative(&format!("{name} {key}"), &values_of(&found), &golden.values(&key), 1e-5);
        }
    }
}

/// Features of an imported scene at points, each with its own time.
fn features(scene: &DynamicScene<HexPlaneField>, points: Tensor<2>, times: &[f32]) -> Tensor<2> {
    let device = points.device();
    let times: Vec<f32> = times.iter().map(|time| 2.0 * scene.coordinates.field_time(*time) - 1.0).collect();
    let times = Tensor::<2>::from_data(TensorData::new(times.clone(), [times.len(), 1]), &device);
    scene.field.hexplane.query(Tensor::cat(vec![scene.coordinates.normalize(points), times], 1))
}

fn one_gaussian() -> GaussianPly {
    GaussianPly {
        means: vec![[0.0; 3]],
        sh_dc: vec![[0.5; 3]],
        sh_rest: vec![[[0.0; 3]; 15]],
        opacity_logits: vec![0.0],
        log_scales: vec![[-2.0; 3]],
        quats: vec![[1.0, 0.0, 0.0, 0.0]],
        further: Vec::new(),
    }
}

/// `ref.*` of c02: principal axes, a box, the contraction to [0, 1].
#[test]
fn the_public_codes_coordinates_are_kept() {
    let golden = Golden::open("c02_hexplane");
    let folder = tempfile::tempdir().unwrap();
    let mut state = StateDict::new();
    golden_planes(&golden, "", &mut state);
    state.insert(
        format!("{GRID}.aabb"),
        (vec![2, 3], [golden.values("ref.aabb_max"), golden.values("ref.aabb_min")].concat()),
    );
    principal_axes(&mut state, golden.values("ref.mean"), golden.values("ref.rotation"), golden.values("ref.std"));
    let width = golden.shape("ref.out")[1];
    random_network(&mut state, width, 8, &mut Random::new(1), 0.1);
    write_checkpoint(folder.path(), &one_gaussian(), &state, "Namespace()");
    for (name, device) in devices() {
        let imported = reference::read(folder.path(), &device).unwrap();
        assert!(imported.scene.field.deformation.opacity.is_none(), "the program's default has no opacity head");
        let points = golden.tensor::<2>("ref.xyz", &device);
        let found = features(&imported.scene, points, &golden.values("ref.t"));
        assert_close_relative(&format!("{name} ref.out"), &values_of(&found), &golden.values("ref.out"), 1e-5);
    }
}

/// A checkpoint of 4DGaussians with `times` rows of time and `channels` features at two scales.
fn four_d_gaussians(folder: &Path, gaussians: &GaussianPly, times: usize, channels: usize, size: f64) -> StateDict {
    let mut random = Random::new(times as u64);
    let mut state = StateDict::new();
    for scale in 0..2 {
        let sides = [8, 12, 16].map(|side| side << scale).into_iter().chain([times]).collect::<Vec<usize>>();
        let pairs = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];
        for (plane, [across, down]) in pairs.into_iter().enumerate() {
            let shape = vec![1, channels, sides[down], sides[across]];
            let count = shape.iter().product::<usize>();
            let center = if down == 3 { 1.0 } else { 0.3 };
            let values = (0..count).map(|_| (center + 0.1 * random.normal()) as f32).collect();
            state.insert(format!("{GRID}.grids.{scale}.{plane}"), (shape, values));
        }
    }
    state.insert(format!("{GRID}.aabb"), (vec![2, 3], vec![1.2, 1.5, 1.1, -1.3, -0.9, -1.4]));
    random_network(&mut state, 2 * channels, 16, &mut random, size);
    // Parameters that the program saves too and that are not used.
    state.insert("timenet.0.weight".into(), (vec![2, 9], vec![0.0; 18]));
    state.insert("time_poc".into(), (vec![4], vec![1.0, 2.0, 4.0, 8.0]));
    write_checkpoint(folder, gaussians, &state, "Namespace(no_do=True, white_background=False)");
    state
}

/// The program's own query: space from a box to [-1, 1], with the far corner at -1; the time as it is; all planes.
fn expected_features(state: &StateDict, points: &[[f32; 3]], time: f32, device: &Device) -> Tensor<2> {
    let aabb = &state[&format!("{GRID}.aabb")].1;
    let row = |point: &[f32; 3]| {
        let at = |axis: usize| (point[axis] - aabb[axis]) * (2.0 / (aabb[3 + axis] - aabb[axis])) - 1.0;
        [at(0), at(1), at(2), time]
    };
    let rows: Vec<f32> = points.iter().flat_map(row).collect();
    let points = Tensor::<2>::from_data(TensorData::new(rows, [points.len(), 4]), device);
    let plane = |index: usize| {
        let (shape, values) = &state[&format!("{GRID}.grids.{}.{}", index / 6, index % 6)];
        Tensor::<3>::from_data(TensorData::new(values.clone(), [shape[1], shape[2], shape[3]]), device)
    };
    PlaneTensors::at_scales(&PlaneAxes::ALL, (0..12).map(plane).collect()).query(points)
}

#[test]
fn the_coordinates_of_4dgaussians_are_kept_for_every_number_of_times() {
    for (name, device) in cpu_devices() {
        for times in [2, 3, 4, 7, 24, 25, 75, 150] {
            let folder = tempfile::tempdir().unwrap();
            let state = four_d_gaussians(folder.path(), &one_gaussian(), times, 3, 0.1);
            let imported = reference::read(folder.path(), &device).unwrap();
            assert_eq!(imported.background, [0.0; 3]);
            let rows = imported.scene.field.hexplane.layout().planes()[2].size[0];
            assert!(rows.is_multiple_of(4) && rows as usize <= (times / 2 + 2).next_multiple_of(4), "{times}: {rows}");
            let mut random = Random::new(5);
            // Some points are outside the box, where the values at the border are used.
            let points: Vec<[f32; 3]> = (0..200).map(|_| [0; 3].map(|_| random.uniform(-2.0, 2.0) as f32)).collect();
            for time in [0.0f32, 0.013, 0.5, 0.77, 1.0] {
                let tensor = Tensor::<2>::from_data(TensorData::new(points.concat(), [200, 3]), &device);
                let found = features(&imported.scene, tensor, &vec![time; 200]);
                let expected = expected_features(&state, &points, time, &device);
                let what = format!("{name} {times} at {time}");
                assert_close_relative(&what, &values_of(&found), &values_of(&expected), 2e-5);
            }
        }
    }
}

#[test]
fn what_is_wrong_with_a_checkpoint_is_said_by_file_and_tensor() {
    let device = Device::flex();
    let refused = |change: &dyn Fn(&Path, StateDict), parts: &[&str]| {
        let folder = tempfile::tempdir().unwrap();
        let state = four_d_gaussians(folder.path(), &one_gaussian(), 8, 2, 0.1);
        change(folder.path(), state);
        let message = reference::read(folder.path(), &device).unwrap_err().to_string();
        parts.iter().for_each(|part| assert!(message.contains(part), "{part:?} in {message}"));
    };
    let pth = |folder: &Path| folder.join("deformation.pth");
    let with = |change: fn(&mut StateDict)| {
        move |folder: &Path, mut state: StateDict| {
            change(&mut state);
            save_state_dict(&folder.join("deformation.pth"), &state);
        }
    };
    refused(
        &with(|state| drop(state.remove("deformation_net.grid.aabb"))),
        &["deformation.pth", "grid.aabb", "missing", "iteration_14000"],
    );
    refused(&with(|state| drop(state.remove("deformation_net.pos_deform.3.bias"))), &["pos_deform.3.bias", "missing"]);
    refused(&with(|state| drop(state.remove("deformation_net.grid.grids.1.4"))), &["grids.1.4", "missing"]);
    refused(
        &with(|state| state.get_mut("deformation_net.grid.grids.0.3").unwrap().0 = vec![1, 2, 12, 16]),
        &["grids.0.3", "[1, 2, 12, 16]"],
    );
    refused(
        &with(|state| state.get_mut("deformation_net.feature_out.0.weight").unwrap().0 = vec![4, 16]),
        &["feature_out.0.weight", "[4, 16]", "expected [any number, 4]"],
    );
    refused(
        &with(|state| state.get_mut("deformation_net.grid.grids.0.0").unwrap().1[5] = f32::NAN),
        &["grids.0.0", "NaN"],
    );
    refused(&with(|state| state.get_mut("deformation_net.grid.aabb").unwrap().1[0] = -1.3), &["aabb", "empty box"]);
    refused(
        &with(|state| drop(state.insert("deformation_net.static_mlp.1.weight".into(), (vec![1], vec![0.0])))),
        &["static_mlp", "not supported"],
    );
    refused(
        &|folder, _| std::fs::write(folder.join("cfg_args"), "Namespace(apply_rotation=True)").unwrap(),
        &["apply_rotation", "True"],
    );
    refused(
        &|folder, _| {
            let bytes = std::fs::read(pth(folder)).unwrap();
            std::fs::write(pth(folder), &bytes[..bytes.len() / 2]).unwrap();
        },
        &["deformation.pth", "truncated", "save it anew"],
    );
    refused(&|folder, _| std::fs::write(pth(folder), b"hello").unwrap(), &["deformation.pth", "no PyTorch file"]);
    refused(&|folder, _| std::fs::remove_file(pth(folder)).unwrap(), &["deformation.pth"]);
    refused(&|folder, _| std::fs::remove_file(folder.join("point_cloud.ply")).unwrap(), &["point_cloud.ply"]);
    refused(
        &|folder, _| {
            let table = StateDict::from([("t".to_owned(), (vec![3], vec![1.0; 3]))]);
            save_state_dict(&folder.join("deformation_table.pth"), &table);
        },
        &["deformation_table.pth", "3 entries", "1 Gaussians"],
    );
    let empty = tempfile::tempdir().unwrap();
    let message = reference::read(empty.path(), &device).unwrap_err().to_string();
    assert!(message.contains("no deformation.pth") && message.contains("iteration_14000"), "{message}");
}

/// The folder of a whole model has a folder for each iteration. The last one is read, and never one of the coarse
/// stage.
#[test]
fn the_last_iteration_of_a_model_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    for (name, count) in [("iteration_3000", 1), ("iteration_14000", 2), ("coarse_iteration_99000", 3)] {
        let below = folder.path().join("point_cloud").join(name);
        std::fs::create_dir_all(&below).unwrap();
        four_d_gaussians(&below, &blob(count), 8, 2, 0.1);
    }
    let imported = reference::read(folder.path(), &Device::flex()).unwrap();
    assert_eq!(imported.scene.gaussians.len(), 2);
    assert!(imported.source.ends_with("point_cloud/iteration_14000"));
}

fn blob(count: usize) -> GaussianPly {
    let mut random = Random::new(3);
    let mut triple = |low: f64, high: f64| [0; 3].map(|_| random.uniform(low, high) as f32);
    GaussianPly {
        means: (0..count).map(|_| triple(-0.8, 0.8)).collect(),
        sh_dc: (0..count).map(|_| triple(-1.5, 1.5)).collect(),
        sh_rest: (0..count).map(|_| std::array::from_fn(|_| triple(-0.1, 0.1))).collect(),
        opacity_logits: (0..count).map(|_| triple(0.0, 4.0)[0]).collect(),
        log_scales: (0..count).map(|_| triple(-3.5, -2.0)).collect(),
        quats: (0..count).map(|_| [1.0, triple(-1.0, 1.0)[0], triple(-1.0, 1.0)[1], triple(-1.0, 1.0)[2]]).collect(),
        further: Vec::new(),
    }
}

fn small_fit(preset: &str) -> Config {
    Config::load(preset, &["compression.context.fit_iterations=150".to_owned(), "device=flex".to_owned()]).unwrap()
}

/// The PSNR that coding costs on views that the coder did not use. The ground truth is the imported scene, with an
/// error as large as that of a good training.
fn cost_in_db(before: &dyn Fn(&Frame) -> Vec<f32>, after: &dyn Fn(&Frame) -> Vec<f32>, frames: &SplitFrames) -> f64 {
    let mut random = Random::new(9);
    let (mut own, mut coded, mut count) = (0.0, 0.0, 0);
    for frame in &frames.test {
        for (a, b) in before(frame).into_iter().zip(after(frame)) {
            // 38 dB: a deviation of 0.0126.
            let truth = f64::from(a) + 0.0126 * random.normal();
            own += (f64::from(a) - truth).powi(2);
            coded += (f64::from(b) - truth).powi(2);
            count += 1;
        }
    }
    assert!(count > 0);
    10.0 * (coded / own).log10()
}

/// Views between those that [`scene_around`] gives, at other times.
fn other_views(gaussians: &light4gs_codec::GaussianArrays, root: &Path) -> SplitFrames {
    let mut frames = scene_around(gaussians, root, [0.0; 3]).unwrap().train;
    let turn = glam::Mat3::from_rotation_z(0.4);
    for frame in &mut frames {
        frame.camera.rotation *= turn;
        frame.time = 0.9 * frame.time + 0.03;
    }
    SplitFrames { test: frames, ..SplitFrames::default() }
}

fn pixels<F: DeformationField>(scene: &DynamicScene<F>, background: [f32; 3], frame: &Frame) -> Vec<f32> {
    let splatter = Splatter::new(background, 3);
    values_of(&splatter.render(scene.at(frame.time), &frame.camera, None).image.clamp(0.0, 1.0))
}

#[test]
fn a_coded_checkpoint_costs_no_more_than_0_05_db() {
    let folder = tempfile::tempdir().unwrap();
    four_d_gaussians(folder.path(), &blob(400), 25, 8, 0.25);
    let device = Device::flex().autodiff();
    let imported = reference::read(folder.path(), &device.clone().inner()).unwrap();
    let config = imported.config(&small_fit("imported")).unwrap();
    let run = folder.path().join("run");
    let scene = imported.scene.clone();
    imported.write_run(&run, None, &small_fit("imported"), false).unwrap();
    let (folder_of_run, record, read) = RunFolder::open(&run).unwrap();
    assert_eq!(read, config);
    assert!(record.dataset().unwrap_err().to_string().contains("--scene"));
    let checkpoint = folder_of_run.last_checkpoint().unwrap();
    let loaded: Checkpoint =
        Checkpoint::load(&checkpoint, &read, &read.model.build(), &ConfiguredModels, &device).unwrap();
    let frames = other_views(&scene.gaussians.to_arrays(), folder.path());
    let before = |frame: &Frame| pixels(&scene, config.data.background, frame);
    for frame in &frames.test {
        assert_eq!(values_of(&loaded.scene.at(frame.time).inner().means), values_of(&scene.at(frame.time).means));
    }
    let data = scene_around(&scene.gaussians.to_arrays(), folder.path(), config.data.background).unwrap();
    let trained = TrainedScene {
        scene: &loaded.scene,
        compression: None,
        models: &ConfiguredModels,
        config: &read,
        data: &data,
        images: None,
        backdrop: None,
        device: &device,
    };
    let coded = code_scene(&trained, &mut |_, _| Ok(())).unwrap();
    let decoded = light4gs_codec::decode(&coded.bytes).unwrap();
    let again = DynamicScene::<HexPlaneField>::from_arrays(&decoded, &device.clone().inner()).unwrap();
    assert_eq!(again.coordinates.mapping(), scene.coordinates.mapping());
    let cost = cost_in_db(&before, &|frame| pixels(&again, config.data.background, frame), &frames);
    let plain = light4gs_codec::encode(&scene.to_arrays(light4gs_codec::SceneMeta::default()).unwrap()).unwrap().len();
    println!("{cost:.4} dB, {} bytes in place of {plain}", coded.bytes.len());
    assert!(cost < 0.05, "{cost} dB");
    assert!(coded.bytes.len() * 2 < plain, "{} bytes in place of {plain}", coded.bytes.len());
    // The codec moves the Gaussians as the model does, the mapping of coordinates included.
    let moved = decoded.positions_at(0.37).unwrap().concat();
    assert_close_relative("positions", &moved, &values_of(&again.at(0.37).means), 1e-4);
}

#[test]
fn a_ply_becomes_a_file_that_renders_alike() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("blob.ply");
    blob(500).write(&path).unwrap();
    let device = Device::flex().autodiff();
    let StillScene { scene, notes, step_share } = still::read(&path, &device).unwrap();
    assert!(notes.is_empty() && step_share == 1.0, "{notes:?} {step_share}");
    let config = small_fit("imported");
    let data = scene_around(&scene.gaussians.to_arrays(), folder.path(), [0.0; 3]).unwrap();
    let trained = TrainedScene {
        scene: &scene,
        compression: None,
        models: &ConfiguredModels,
        config: &config,
        data: &data,
        images: None,
        backdrop: None,
        device: &device,
    };
    let coded = code_scene(&trained, &mut |_, _| Ok(())).unwrap();
    let decoded = light4gs_codec::decode(&coded.bytes).unwrap();
    assert!(decoded.motion.kind.is_empty() && decoded.feature_planes.planes.is_empty());
    let again = DynamicScene::<StillField>::from_arrays(&decoded, &device.clone().inner()).unwrap();
    let frames = other_views(&scene.gaussians.to_arrays(), folder.path());
    let cost = cost_in_db(&|frame| pixels(&scene, [0.0; 3], frame), &|frame| pixels(&again, [0.0; 3], frame), &frames);
    let ply = std::fs::metadata(&path).unwrap().len();
    println!("{cost:.4} dB, {} bytes in place of {ply}", coded.bytes.len());
    assert!(cost < 0.05 && (coded.bytes.len() as u64) * 3 < ply, "{cost} dB, {} bytes of {ply}", coded.bytes.len());

    let empty = folder.path().join("empty.ply");
    blob(0).write(&empty).unwrap();
    let message = still::read(&empty, &device).unwrap_err().to_string();
    assert!(message.contains("empty.ply") && message.contains("no Gaussians"), "{message}");
}
