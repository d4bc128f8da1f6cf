//! Files for other programs: glTF against the rules of `KHR_gaussian_splatting`, 4dgs with the reader of its own crate.

use std::path::Path;

use light4gs_data::{
    GaussianPly, GlbOptions, Influence, Joint, JointPose, MotionSample, Skin, glb_bytes, write_four_dgs, write_glb,
};
use serde_json::Value;

fn example(count: usize) -> GaussianPly {
    let random = |i: usize| ((i as f32 * 12.9898).sin() * 43_758.547).fract();
    let triple = |i: usize| [random(3 * i), random(3 * i + 1), random(3 * i + 2)];
    GaussianPly {
        means: (0..count).map(triple).collect(),
        sh_dc: (0..count).map(|i| triple(i + 100)).collect(),
        sh_rest: (0..count).map(|i| std::array::from_fn(|k| triple(i * 15 + k + 999))).collect(),
        opacity_logits: (0..count).map(|i| 4.0 * random(i + 7)).collect(),
        log_scales: (0..count).map(|i| triple(i + 200).map(|v| v - 3.0)).collect(),
        quats: (0..count).map(|i| [2.0, random(i), random(i + 1), random(i + 2)]).collect(),
        further: Vec::new(),
    }
}

/// The two chunks of a GLB.
fn chunks(bytes: &[u8]) -> (Value, &[u8]) {
    let number = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!((&bytes[..4], number(4), number(8)), (&b"glTF"[..], 2, bytes.len()));
    let json = number(12);
    assert_eq!((&bytes[16..20], json % 4), (&b"JSON"[..], 0));
    let binary = number(20 + json);
    assert_eq!((&bytes[24 + json..28 + json], binary % 4), (&b"BIN\0"[..], 0));
    assert_eq!(28 + json + binary, bytes.len());
    (serde_json::from_slice(&bytes[20..20 + json]).unwrap(), &bytes[28 + json..])
}

/// Rows of an accessor, which is checked against glTF's rules.
fn accessor_rows(json: &Value, binary: &[u8], number: &Value, kind: &str, target: Option<u64>) -> Vec<Vec<f32>> {
    let accessor = &json["accessors"][number.as_u64().expect("the number of an accessor") as usize];
    assert_eq!(accessor["type"].as_str().unwrap(), kind);
    let view = &json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
    let width = match kind {
        "SCALAR" => 1,
        "MAT4" => 16,
        vector => vector[3..].parse().unwrap(),
    };
    let whole = |key: &str| view[key].as_u64().unwrap() as usize;
    let (begin, length) = (whole("byteOffset"), whole("byteLength"));
    let bytes = &binary[begin..begin + length];
    let values: Vec<f32> = match accessor["componentType"].as_u64().unwrap() {
        5121 => bytes.iter().map(|byte| f32::from(*byte)).collect(),
        5123 => bytes.as_chunks().0.iter().map(|bytes| f32::from(u16::from_le_bytes(*bytes))).collect(),
        5126 => bytes.as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect(),
        other => panic!("component type {other}"),
    };
    let count = accessor["count"].as_u64().unwrap() as usize;
    assert_eq!((begin % 4, length % 4, values.len(), view["target"].as_u64()), (0, 0, width * count, target));
    values.chunks_exact(width).map(<[f32]>::to_vec).collect()
}

/// Rows of an attribute.
fn rows(json: &Value, binary: &[u8], name: &str, kind: &str) -> Vec<Vec<f32>> {
    let attributes = &json["meshes"][0]["primitives"][0]["attributes"];
    accessor_rows(json, binary, &attributes[name], kind, Some(34962))
}

fn assert_near(found: &[Vec<f32>], expected: impl Iterator<Item = Vec<f32>>) {
    let expected: Vec<_> = expected.collect();
    assert_eq!(found.len(), expected.len());
    for (a, b) in found.iter().flatten().zip(expected.iter().flatten()) {
        assert!((a - b).abs() < 1e-6, "{a} against {b}");
    }
}

/// The extension's table of attributes: names, types, which ones are required, and that degrees are complete.
#[test]
fn a_glb_follows_the_extension() {
    let gaussians = example(7);
    for degree in 0..=3u8 {
        let options = GlbOptions { sh_degree: degree, z_is_up: degree == 1 };
        let bytes = glb_bytes(Path::new("a.glb"), &gaussians, None, &options).unwrap();
        let (json, binary) = chunks(&bytes);
        assert_eq!(json["asset"]["version"], "2.0");
        assert_eq!(json["extensionsUsed"], serde_json::json!(["KHR_gaussian_splatting"]));
        assert_eq!(json["buffers"][0]["byteLength"].as_u64().unwrap() as usize, binary.len());
        assert_eq!(json["nodes"][0].get("rotation").is_some(), degree == 1);
        let primitive = &json["meshes"][0]["primitives"][0];
        assert_eq!(primitive["mode"], 0, "POINTS");
        let extension = primitive["extensions"]["KHR_gaussian_splatting"].as_object().unwrap();
        // The schema: two required strings, two optional ones, nothing else from us.
        assert_eq!(extension["kernel"], "ellipse");
        assert_eq!(extension["colorSpace"], "srgb_rec709_display");
        let known = ["kernel", "colorSpace", "projection", "sortingMethod"];
        assert!(extension.iter().all(|(key, value)| known.contains(&key.as_str()) && value.is_string()));

        let get = |name: &str, kind: &str| rows(&json, binary, &format!("KHR_gaussian_splatting:{name}"), kind);
        let positions = rows(&json, binary, "POSITION", "VEC3");
        assert_near(&positions, gaussians.means.iter().map(|mean| mean.to_vec()));
        let accessor = &json["accessors"][primitive["attributes"]["POSITION"].as_u64().unwrap() as usize];
        for (bound, pick) in [("min", f32::min as fn(f32, f32) -> f32), ("max", f32::max)] {
            let expected = positions.iter().map(|row| row[1]).reduce(pick).unwrap();
            assert_eq!(accessor[bound][1].as_f64().unwrap() as f32, expected);
        }
        for (quat, given) in get("ROTATION", "VEC4").iter().zip(&gaussians.quats) {
            assert!((quat.iter().map(|v| v * v).sum::<f32>() - 1.0).abs() < 1e-6);
            assert!((quat[3] * given[1] - quat[0] * given[0]).abs() < 1e-6, "x, y, z, w");
        }
        assert_near(&get("SCALE", "VEC3"), gaussians.log_scales.iter().map(|scale| scale.map(f32::exp).to_vec()));
        let opacities = get("OPACITY", "SCALAR");
        assert!(opacities.iter().all(|row| (0.0..=1.0).contains(&row[0])));
        assert_near(&opacities, gaussians.opacity_logits.iter().map(|logit| vec![1.0 / (1.0 + (-logit).exp())]));
        assert_near(&get("SH_DEGREE_0_COEF_0", "VEC3"), gaussians.sh_dc.iter().map(|dc| dc.to_vec()));
        for l in 1..=usize::from(degree) {
            for n in 0..2 * l + 1 {
                let expected = gaussians.sh_rest.iter().map(|rest| rest[l * l - 1 + n].to_vec());
                assert_near(&get(&format!("SH_DEGREE_{l}_COEF_{n}"), "VEC3"), expected);
            }
        }
        let names = primitive["attributes"].as_object().unwrap();
        assert_eq!(names.len(), 6 + (1..=usize::from(degree)).map(|l| 2 * l + 1).sum::<usize>());
        // Application-specific attributes have the prefix of glTF or that of the extension.
        assert!(names.keys().all(|name| name == "POSITION" || name == "COLOR_0" || name.contains(':')));
    }
}

#[test]
fn what_a_glb_cannot_hold_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.glb");
    let message = |gaussians: &GaussianPly, options: &GlbOptions| {
        write_glb(&path, gaussians, None, options).unwrap_err().to_string()
    };
    let empty = message(&example(0), &GlbOptions::default());
    assert!(empty.contains("a.glb") && empty.contains("no Gaussians"), "{empty}");
    let mut odd = example(3);
    odd.log_scales[1][0] = 1000.0;
    assert!(message(&odd, &GlbOptions::default()).contains("infinite"));
    assert!(message(&example(1), &GlbOptions { sh_degree: 4, z_is_up: false }).contains("sh_degree"));
    assert!(!path.exists());
    let mut still = example(2);
    still.quats[0] = [0.0; 4];
    write_glb(&path, &still, None, &GlbOptions::default()).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let (json, binary) = chunks(&bytes);
    assert_eq!(rows(&json, binary, "KHR_gaussian_splatting:ROTATION", "VEC4")[0], [0.0, 0.0, 0.0, 1.0]);
}

/// Joints on a line that move up; each Gaussian follows its number of them.
fn skin(joints: usize, gaussians: usize) -> Skin {
    let joint = |index: usize| {
        let pose = |up: f32| JointPose { position: [index as f32, up, 0.0], rotation: [2.0, 0.0, up, 0.0] };
        Joint { anchor: [index as f32, 0.0, 0.0], poses: vec![pose(0.0), pose(0.25), pose(1.0)] }
    };
    let mut all: Vec<Joint> = (0..joints - 1).map(joint).collect();
    all.push(Joint { anchor: [0.0; 3], poses: Vec::new() });
    let weights = |gaussian: usize| {
        let follows = |joint: usize| if joint <= gaussian % joints { 1.0 + (joint as f32 * 1.7).sin() } else { 0.0 };
        (0..joints).map(follows).collect::<Vec<f32>>()
    };
    let influences = (0..gaussians).map(|gaussian| Influence::strongest(&weights(gaussian))).collect();
    Skin::new(all, vec![0.0, 0.5, 2.0], influences).unwrap()
}

/// What glTF demands of skins and animations, for few joints and for more than a byte counts.
#[test]
fn a_skin_follows_the_specification() {
    for (joints, sets, component) in [(3, 1, 5121), (20, 2, 5121), (256, 2, 5121), (257, 2, 5123)] {
        let gaussians = example(joints);
        let z_is_up = joints == 20;
        let options = GlbOptions { sh_degree: 0, z_is_up };
        let bytes = glb_bytes(Path::new("a.glb"), &gaussians, Some(&skin(joints, joints)), &options).unwrap();
        let (json, binary) = chunks(&bytes);
        let numbers = |number: &Value, kind: &str| accessor_rows(&json, binary, number, kind, None);

        // The Gaussians are those at rest, and the joints have a root beside them that is turned as they are.
        assert_near(&rows(&json, binary, "POSITION", "VEC3"), gaussians.means.iter().map(|mean| mean.to_vec()));
        let nodes = json["nodes"].as_array().unwrap();
        assert_eq!(json["scenes"][0]["nodes"], serde_json::json!([0, 1]));
        assert_eq!((&nodes[0]["mesh"], &nodes[0]["skin"]), (&Value::from(0), &Value::from(0)));
        assert_eq!((nodes[0].get("rotation").is_some(), nodes[0].get("rotation")), (z_is_up, nodes[1].get("rotation")));
        let skin = &json["skins"][0];
        assert_eq!((&skin["joints"], &skin["skeleton"]), (&nodes[1]["children"], &Value::from(1)));
        let own: Vec<usize> = serde_json::from_value(skin["joints"].clone()).unwrap();
        assert_eq!(own, (2..nodes.len()).collect::<Vec<_>>());
        assert_eq!(own.len(), joints);
        let matrices = numbers(&skin["inverseBindMatrices"], "MAT4");
        assert_eq!(matrices.len(), joints);
        assert!(matrices.iter().all(|matrix| [3, 7, 11, 15].map(|at| matrix[at]) == [0.0, 0.0, 0.0, 1.0]));
        assert_eq!(matrices[1][12..15], [-1.0, 0.0, 0.0]);

        let all = json["accessors"].as_array().unwrap();
        let attributes = &json["meshes"][0]["primitives"][0]["attributes"];
        assert!(
            attributes.get(format!("JOINTS_{sets}")).is_none() && attributes.get(format!("WEIGHTS_{sets}")).is_none()
        );
        let mut followed = vec![Vec::new(); joints];
        for set in 0..sets {
            let name = format!("JOINTS_{set}");
            assert_eq!(all[attributes[&name].as_u64().unwrap() as usize]["componentType"], component);
            let weights = rows(&json, binary, &format!("WEIGHTS_{set}"), "VEC4");
            for (row, (joints, weights)) in rows(&json, binary, &name, "VEC4").into_iter().zip(weights).enumerate() {
                followed[row].extend(joints.into_iter().zip(weights));
            }
        }
        for (row, followed) in followed.iter().enumerate() {
            let used = followed.iter().filter(|(_, weight)| *weight > 0.0).count();
            let sum: f32 = followed.iter().map(|(_, weight)| weight).sum();
            assert!((sum - 1.0).abs() < 2e-7 * used as f32, "{row}: {sum}");
            assert!(followed.windows(2).all(|pair| pair[0].1 >= pair[1].1), "{row}: {followed:?}");
            assert!(followed[used..].iter().all(|pair| *pair == (0.0, 0.0)), "{row}: {followed:?}");
            let mut joints_of: Vec<u32> = followed[..used].iter().map(|(joint, _)| *joint as u32).collect();
            joints_of.sort_unstable();
            joints_of.dedup();
            assert_eq!(joints_of.len(), used, "{row}: a joint twice");
            assert!(joints_of.iter().all(|joint| *joint as usize <= row));
        }

        let animation = &json["animations"][0];
        let (channels, samplers) =
            (animation["channels"].as_array().unwrap(), animation["samplers"].as_array().unwrap());
        // The last joint never moves.
        assert_eq!((channels.len(), samplers.len()), (2 * (joints - 1), 2 * (joints - 1)));
        for channel in channels {
            let sampler = &samplers[channel["sampler"].as_u64().unwrap() as usize];
            assert_eq!(numbers(&sampler["input"], "SCALAR"), [[0.0], [0.5], [2.0]]);
            let input = &all[sampler["input"].as_u64().unwrap() as usize];
            assert_eq!((&input["min"], &input["max"]), (&serde_json::json!([0.0]), &serde_json::json!([2.0])));
            assert_eq!(sampler["interpolation"], "LINEAR");
            let node = channel["target"]["node"].as_u64().unwrap() as usize;
            assert!(own.contains(&node) && node < nodes.len() - 1);
            let path = channel["target"]["path"].as_str().unwrap();
            let output = numbers(&sampler["output"], if path == "rotation" { "VEC4" } else { "VEC3" });
            // A joint's own pose is the first one.
            let at_first: Vec<f32> = serde_json::from_value(nodes[node][path].clone()).unwrap();
            assert_near(&output[..1], [at_first].into_iter());
            match path {
                "translation" => assert_eq!(output[2], [(node - 2) as f32, 1.0, 0.0]),
                "rotation" => {
                    let parts = [0.0, 0.2_f32.sqrt(), 0.0, 0.8_f32.sqrt()];
                    assert_near(&output[2..], [parts.to_vec()].into_iter());
                }
                other => panic!("{other}"),
            }
        }
    }
}

/// Four joints, or eight where four would lose more than 1 %; what is kept sums to 1.
#[test]
fn the_strongest_joints_are_kept() {
    let kept = |weights: &[f32]| Influence::strongest(weights).iter().collect::<Vec<_>>();
    assert_eq!(kept(&[0.0, 2.0, 0.0, 6.0]), [(3, 0.75), (1, 0.25)]);
    assert_eq!(kept(&[0.25, 0.25, 0.25, 0.24, 0.001, 0.001, 0.001, 0.001, 0.001]).len(), 4);
    assert_eq!(kept(&[0.25, 0.25, 0.25, 0.24, 0.003, 0.003, 0.003, 0.003, 0.003]).len(), 8);
    assert_eq!(kept(&[1.0; 30]), (0..8).map(|joint| (joint, 0.125)).collect::<Vec<_>>());
}

#[test]
fn positions_of_a_skin_are_those_between_keyframes() {
    let pose = |position, rotation| JointPose { position, rotation };
    // Moves by 1 along x and turns by a right angle about z, around (1, 0, 0).
    let half = 0.5_f32.sqrt();
    let poses = vec![pose([1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]), pose([2.0, 0.0, 0.0], [-half, 0.0, 0.0, -half])];
    let joints = vec![Joint { anchor: [1.0, 0.0, 0.0], poses }, Joint { anchor: [0.0; 3], poses: Vec::new() }];
    let influences = [[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]].map(|weights| Influence::strongest(&weights));
    let skin = Skin::new(joints, vec![0.0, 1.0], influences.to_vec()).unwrap();
    let means = [[2.0, 0.0, 3.0]; 3];
    let expected = |moment: f32, x: f32, y: f32| {
        let found = skin.positions(&means, moment);
        let rows: Vec<Vec<f32>> = found.iter().map(|row| row.to_vec()).collect();
        let moved = vec![x, y, 3.0];
        let mean = vec![(x + 2.0) / 2.0, y / 2.0, 3.0];
        rows.iter().flatten().zip([moved, vec![2.0, 0.0, 3.0], mean].iter().flatten()).for_each(|(found, expected)| {
            assert!((found - expected).abs() < 1e-3, "{moment}: {rows:?}");
        });
    };
    expected(0.0, 2.0, 0.0);
    expected(0.5, 1.5 + half, half);
    expected(1.0, 2.0, 1.0);
    expected(7.0, 2.0, 1.0);
}

#[test]
fn a_skin_that_contradicts_itself_is_refused() {
    let joint = |poses: usize| {
        let pose = JointPose { position: [0.0; 3], rotation: [1.0, 0.0, 0.0, 0.0] };
        Joint { anchor: [0.0; 3], poses: vec![pose; poses] }
    };
    let one = || vec![Influence::strongest(&[1.0, 1.0])];
    let message = |joints: Vec<Joint>, seconds: Vec<f32>| Skin::new(joints, seconds, one()).unwrap_err().to_string();
    assert!(message(Vec::new(), vec![0.0]).contains("0 joints, expected 1 to 65536"));
    assert!(message(vec![joint(2); 2], vec![0.0]).contains("2 poses, expected one for each of 1 keyframes"));
    assert!(message(vec![joint(1)], vec![0.0]).contains("joint 1, expected less than 1"));
    for seconds in [vec![], vec![0.0, 0.0], vec![-1.0], vec![f32::NAN], vec![0.0, f32::NAN]] {
        assert!(message(vec![joint(0); 2], seconds).contains("ascending"));
    }
    let skin = Skin::new(vec![joint(1); 2], vec![0.0], one()).unwrap();
    let options = GlbOptions::default();
    let error = |gaussians: &GaussianPly, skin: &Skin| {
        glb_bytes(Path::new("a.glb"), gaussians, Some(skin), &options).unwrap_err().to_string()
    };
    assert!(error(&example(3), &skin).contains("of 1 Gaussians, expected 3"));
    let odd = Skin::new(vec![joint(1); 2], vec![0.0], vec![Influence::strongest(&[0.0, f32::NAN])]).unwrap();
    assert!(error(&example(1), &odd).contains("NaN"));
}

fn write_samples(
    path: &Path,
    samples: impl Iterator<Item = MotionSample>,
    duration: f64,
) -> Result<(), light4gs_data::DataError> {
    write_four_dgs(path, &example(50), samples.map(Ok), duration)
}

#[test]
fn a_four_dgs_file_reads_back_at_every_time() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.4dgs");
    let (frames, fps) = (20usize, 10.0);
    let at = |k: usize| {
        let mut gaussians = example(50);
        gaussians.means.iter_mut().for_each(|mean| mean[0] += 0.1 * k as f32);
        gaussians.log_scales.iter_mut().for_each(|scale| scale[1] += 0.01 * k as f32);
        gaussians
    };
    let sample = |k: usize| MotionSample { begin: k as f64 / fps, anew: false, gaussians: at(k) };
    write_samples(&path, (0..frames).map(sample), frames as f64 / fps).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let (streamed, (indexed, _)) = (
        fourdgs::keyframe_delta_file::decode_streamed(&bytes).unwrap(),
        fourdgs::keyframe_delta_file::decode_indexed(&bytes).unwrap(),
    );
    assert!(bytes.len() < 50 * frames * 20, "changes are smaller than samples: {} bytes", bytes.len());
    for sequence in [streamed, indexed] {
        for k in 0..frames {
            let time = (k as f64 + 0.5) / fps;
            let chunk = fourdgs::keyframe_delta_file::state_covering(&sequence.chunks, time);
            let state = fourdgs::keyframe_delta_file::reconstruct_at(&sequence, &chunk.state, time);
            let expected = at(k);
            assert_eq!(state.ids, (0..50).collect::<Vec<i64>>());
            for (i, mean) in expected.means.iter().enumerate() {
                for axis in 0..3 {
                    let (center, scale) = (state.centers[3 * i + axis], state.scales[3 * i + axis]);
                    assert!((center - f64::from(mean[axis])).abs() < 2e-3, "{k} {i}: {center} {}", mean[axis]);
                    let given = f64::from(expected.log_scales[i][axis]).exp();
                    assert!((scale / given - 1.0).abs() < 0.05, "{k} {i}: {scale} {given}");
                }
                let opacity = 1.0 / (1.0 + f64::from(-expected.opacity_logits[i]).exp());
                assert!((state.opacity[i] - opacity).abs() < 0.01, "{k} {i}: {} {opacity}", state.opacity[i]);
            }
        }
    }
    // Samples out of order are refused by name, and the file stays as it was.
    let error = write_samples(&path, (3..frames).map(sample), 2.0).unwrap_err().to_string();
    assert!(error.contains("a.4dgs") && error.contains("t0"), "{error}");
    assert!(std::fs::read(&path).unwrap() == bytes, "the file has changed");
    // As are other samples that cannot be.
    let mut odd = example(50);
    odd.means[7][1] = f32::INFINITY;
    let odd = MotionSample { begin: 0.0, anew: false, gaussians: odd };
    assert!(write_samples(&path, [odd].into_iter(), 1.0).unwrap_err().to_string().contains("not finite"));
    for (samples, duration) in [(0, 1.0), (2, 0.1), (2, 0.0), (2, f64::NAN)] {
        assert!(write_samples(&path, (0..samples).map(sample), duration).is_err(), "{samples} in {duration} s");
    }
    let broken = [Ok(sample(0)), Err(light4gs_data::DataError::Options { option: "time", problem: "is over".into() })];
    assert!(write_four_dgs(&path, &example(50), broken, 2.0).unwrap_err().to_string().contains("is over"));
    assert!(std::fs::read(&path).unwrap() == bytes, "the file has changed");
}

/// The crate's own writer, which holds all samples at once, writes the same bytes.
#[test]
fn a_four_dgs_file_is_that_of_the_containers_own_writer() {
    use fourdgs::keyframe_delta_file::{KeyframeDeltaOptions, Sample, write_sequence};
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.4dgs");
    // The first sample has the lowest positions and the median scale of all, by which that writer chooses its steps.
    let at = |k: usize| {
        let mut gaussians = example(50);
        gaussians.log_scales = vec![[-3.0; 3]; 50];
        gaussians.means.iter_mut().skip(20).for_each(|mean| mean[0] += 0.05 * k as f32);
        gaussians.quats.iter_mut().skip(30).for_each(|quat| quat[1] += 0.2 * k as f32);
        gaussians.opacity_logits.iter_mut().skip(40).for_each(|logit| *logit -= 0.1 * k as f32);
        gaussians
    };
    let (frames, duration) = (20usize, 5.0);
    let begin = |k: usize| k as f64 / 4.0;
    let sample = |k: usize| MotionSample { begin: begin(k), anew: false, gaussians: at(k) };
    let samples = (0..frames).map(sample).map(Ok::<_, light4gs_data::DataError>);
    write_four_dgs(&path, &at(0), samples, duration).unwrap();
    let theirs = |k: usize| {
        let GaussianPly { means, sh_dc, opacity_logits, log_scales, quats, .. } = at(k);
        let count = means.len();
        let linear = |value: f32| {
            let value = (value * 0.282_094_8 + 0.5).clamp(0.0, 1.0);
            if value <= 0.040_45 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
        };
        let rotation = |[w, x, y, z]: [f32; 4]| {
            let length = (w * w + x * x + y * y + z * z).sqrt();
            [x, y, z, w].map(|part| part / length)
        };
        let gaussians = fourdgs::GaussianSet {
            positions: means.concat(),
            scales: log_scales.concat().into_iter().map(f32::exp).collect(),
            rotations: quats.into_iter().flat_map(rotation).collect(),
            colors: sh_dc
                .into_iter()
                .zip(opacity_logits)
                .flat_map(|([r, g, b], logit)| [linear(r), linear(g), linear(b), 1.0 / (1.0 + (-logit).exp())])
                .collect(),
            motions: vec![0.0; 3 * count],
            mu_t: vec![begin(k - k % 8) as f32; count],
            sigma_t: vec![1000.0 * duration as f32; count],
            win_lo: vec![0.0; count],
            win_hi: vec![duration as f32; count],
            ..fourdgs::GaussianSet::default()
        };
        Sample { t0: begin(k), ids: (0..count as i64).collect(), gaussians }
    };
    let options = KeyframeDeltaOptions {
        profile: fourdgs::quantization::Profile::Fine,
        library: concat!("Light4GS ", env!("CARGO_PKG_VERSION")).to_owned(),
        ..KeyframeDeltaOptions::default()
    };
    let expected = write_sequence(&(0..frames).map(theirs).collect::<Vec<_>>(), duration, &options).unwrap();
    let found = std::fs::read(&path).unwrap();
    let first_other = found.iter().zip(&expected).position(|(found, expected)| found != expected);
    assert_eq!((first_other, found.len()), (None, expected.len()));
}

/// Segments of a take: Gaussians that stand still, and others that are new in each segment.
#[test]
fn gaussians_of_a_four_dgs_file_may_be_others_from_a_sample_on() {
    use fourdgs::keyframe_delta_validate::{ValidationMode, validate};
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.4dgs");
    let counts = |k: usize| [50, 50, 30, 0][k / 5];
    let at = |k: usize| {
        let mut gaussians = example(counts(k));
        gaussians.means.iter_mut().skip(40).for_each(|mean| mean[0] += 0.1 * k as f32);
        gaussians
    };
    let sample = |k: usize| MotionSample { begin: k as f64, anew: k == 5, gaussians: at(k) };
    write_samples(&path, (0..20).map(sample), 20.0).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    for mode in [ValidationMode::Streamed, ValidationMode::Indexed] {
        let mut identities = Vec::new();
        let mut source = fourdgs::BytesReadable::new(&bytes);
        let summary = validate(&mut source, mode, |_, identity| {
            identities.push(identity);
            Ok(())
        });
        let Ok(summary) = summary else { panic!("not valid") };
        assert_eq!(identities, (0..130).collect::<Vec<u32>>(), "each comes once");
        assert_eq!(summary.declared_gaussian_count, 130);
    }
    let (sequence, _) = fourdgs::keyframe_delta_file::decode_indexed(&bytes).unwrap();
    for k in 0..20 {
        let chunk = &sequence.chunks[k];
        let begins = k % 5 == 0;
        assert_eq!((chunk.t0, chunk.t1, chunk.kind == 0), (k as f64, (k + 1) as f64, begins), "{k}");
        // Only what moves is stored again.
        let moving = counts(k).saturating_sub(40) as u32;
        assert_eq!(chunk.update_count, (!begins).then_some(moving), "{k}");
        let state = fourdgs::keyframe_delta_file::reconstruct_at(&sequence, &chunk.state, k as f64 + 0.5);
        let means = at(k).means.concat();
        assert_eq!(state.centers.len(), means.len());
        let off = |(found, expected): (&f64, f32)| (found - f64::from(expected)).abs();
        assert!(state.centers.iter().zip(means).map(off).fold(0.0, f64::max) < 2e-3, "{k}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn readers_refuse_a_pipe() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe.ply");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let errors = [
        light4gs_data::read_pytorch(&pipe).unwrap_err().to_string(),
        light4gs_data::GaussianPly::read(&pipe).unwrap_err().to_string(),
    ];
    for text in errors {
        assert!(text.contains("pipe.ply") && text.contains("expected a regular file"), "{text}");
    }
}
