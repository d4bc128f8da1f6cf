//! Files for other programs: glTF against the rules of `KHR_gaussian_splatting`, 4dgs with the reader of its own crate.

use std::path::Path;

use light4gs_data::{GaussianPly, GlbOptions, MotionSample, glb_bytes, write_four_dgs, write_glb};
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

/// Rows of an attribute; its accessor and buffer view are checked against glTF's rules.
fn rows(json: &Value, binary: &[u8], name: &str, kind: &str) -> Vec<Vec<f32>> {
    let primitive = &json["meshes"][0]["primitives"][0];
    let accessor =
        &json["accessors"][primitive["attributes"][name].as_u64().unwrap_or_else(|| panic!("{name}")) as usize];
    assert_eq!(
        (accessor["type"].as_str().unwrap(), accessor["componentType"].as_u64().unwrap()),
        (kind, 5126),
        "{name}"
    );
    let view = &json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
    let width = ["SCALAR", "VEC2", "VEC3", "VEC4"].iter().position(|known| *known == kind).unwrap() + 1;
    let (begin, length) =
        (view["byteOffset"].as_u64().unwrap() as usize, view["byteLength"].as_u64().unwrap() as usize);
    let count = accessor["count"].as_u64().unwrap() as usize;
    assert_eq!((begin % 4, length, view["target"].as_u64()), (0, 4 * width * count, Some(34962)), "{name}");
    let values: Vec<f32> =
        binary[begin..begin + length].as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
    values.chunks_exact(width).map(<[f32]>::to_vec).collect()
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
        let bytes = glb_bytes(Path::new("a.glb"), &gaussians, &options).unwrap();
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
    let message =
        |gaussians: &GaussianPly, options: &GlbOptions| write_glb(&path, gaussians, options).unwrap_err().to_string();
    let empty = message(&example(0), &GlbOptions::default());
    assert!(empty.contains("a.glb") && empty.contains("no Gaussians"), "{empty}");
    let mut odd = example(3);
    odd.log_scales[1][0] = 1000.0;
    assert!(message(&odd, &GlbOptions::default()).contains("infinite"));
    assert!(message(&example(1), &GlbOptions { sh_degree: 4, z_is_up: false }).contains("sh_degree"));
    assert!(!path.exists());
    let mut still = example(2);
    still.quats[0] = [0.0; 4];
    write_glb(&path, &still, &GlbOptions::default()).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let (json, binary) = chunks(&bytes);
    assert_eq!(rows(&json, binary, "KHR_gaussian_splatting:ROTATION", "VEC4")[0], [0.0, 0.0, 0.0, 1.0]);
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
    let samples: Vec<MotionSample> =
        (0..frames).map(|k| MotionSample { begin: k as f64 / fps, gaussians: at(k) }).collect();
    write_four_dgs(&path, &samples, frames as f64 / fps).unwrap();
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
    let error = write_four_dgs(&path, &samples[3..], 2.0).unwrap_err().to_string();
    assert!(error.contains("a.4dgs") && error.contains("t0"), "{error}");
    assert_eq!(std::fs::read(&path).unwrap(), bytes);
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
