//! Makes a large scene from a small one, for tests and measurements of the player: large_scene FILE OUT GAUSSIANS
//! [LAYERS].
//!
//! Each Gaussian is replaced by smaller ones around it. Without LAYERS the file is without loss. With them it is compressed, so
//! its Gaussians are made to differ; planes, motion and what belongs to them are copied byte by byte.

use std::process::ExitCode;

use light4gs_codec::{
    CompressionInput, GaussianArrays, GaussianLayers, Profile, SceneData, ShCoding, WeightPrecisions,
    attributes::AttributeSteps, decode, encode, encode_compressed, info,
};

const PRELUDE: usize = 32;
const ENTRY: usize = 16;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [file, out, gaussians, layers @ ..] = &arguments[..] else {
        eprintln!("usage: large_scene FILE OUT GAUSSIANS [LAYERS]");
        return ExitCode::from(64);
    };
    let made =
        make(file, gaussians, layers.first()).and_then(|bytes| std::fs::write(out, bytes).map_err(|e| e.to_string()));
    match made {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn make(file: &str, gaussians: &str, layers: Option<&String>) -> Result<Vec<u8>, String> {
    let number = |text: &str| text.parse::<u32>().map_err(|error| format!("{text}: {error}"));
    let bytes = std::fs::read(file).map_err(|error| format!("{file}: {error}"))?;
    let scene = decode(&bytes).map_err(|error| format!("{file}: {error}"))?;
    let count = number(gaussians)? as usize;
    let Some(layers) = layers else {
        let gaussians = divided(&scene.gaussians, count);
        return encode(&SceneData { gaussians, ..scene }).map_err(|error| error.to_string());
    };
    let input = CompressionInput {
        profile: Profile::Compact,
        planes: None,
        sh: ShCoding::Channels { step: 0.0001 },
        // Finer than by default: a reader allows a time that depends on the bytes, so each Gaussian has to have some.
        attributes: AttributeSteps::default().with("log_scales", 0.0005).with("quats", 0.0001).with("sh_dc", 0.00025),
        weights: WeightPrecisions::default(),
        layers: GaussianLayers::new(number(layers)?),
    };
    let gaussians = different(divided(&of_degree_1(&scene.gaussians), count));
    let still = SceneData { meta: scene.meta, gaussians, ..SceneData::default() };
    let coded = encode_compressed(&still, &input).map_err(|error| error.to_string())?;
    let bytes = with_shared(&bytes, &coded.bytes);
    decode(&bytes).map_err(|error| error.to_string())?;
    Ok(bytes)
}

/// Layers of Gaussians, with the other sections of another file.
fn with_shared(from: &[u8], layers: &[u8]) -> Vec<u8> {
    let sections = |bytes: &[u8], layered: bool| -> Vec<(Vec<u8>, Vec<u8>)> {
        let table = PRELUDE + u32::from_le_bytes(bytes[16..20].try_into().unwrap_or_default()) as usize;
        let all = info(bytes).map(|info| info.sections).unwrap_or_default();
        let chosen = all.iter().enumerate().filter(|(_, s)| matches!(s.name, "gaussians" | "sh") == layered);
        let row = |(index, section): (usize, &light4gs_codec::SectionInfo)| {
            let entry = bytes[table + ENTRY * index..][..ENTRY].to_vec();
            (entry, bytes[section.offset as usize..][..section.bytes as usize].to_vec())
        };
        chosen.map(row).collect()
    };
    let mut all = sections(from, false);
    all.extend(sections(layers, true));
    let meta = u32::from_le_bytes(layers[16..20].try_into().unwrap_or_default()) as usize;
    let mut bytes = layers[..PRELUDE + meta].to_vec();
    all.iter().for_each(|(entry, _)| bytes.extend(entry));
    let header = bytes.len();
    all.iter().for_each(|(_, payload)| bytes.extend(payload));
    let length = bytes.len() as u64;
    bytes[12..16].copy_from_slice(&(all.len() as u32).to_le_bytes());
    bytes[20..28].copy_from_slice(&length.to_le_bytes());
    let checksum = crc32c::crc32c_append(crc32c::crc32c(&bytes[..28]), &bytes[PRELUDE..header]);
    bytes[28..PRELUDE].copy_from_slice(&checksum.to_le_bytes());
    bytes
}

/// The Gaussians without the harmonics beyond degree 1: with these, large files would exceed the limits of readers.
fn of_degree_1(gaussians: &GaussianArrays) -> GaussianArrays {
    let rest = gaussians.sh_rest.len() / gaussians.len().max(1);
    let kept = gaussians.sh_rest.chunks_exact(rest.max(1)).flat_map(|row| row.iter().copied().chain([0.0; 9]).take(9));
    let sh_rest: Vec<f32> = if rest > 0 { kept.collect() } else { vec![0.0; 9 * gaussians.len()] };
    GaussianArrays { sh_degree: 1, sh_rest, ..gaussians.clone() }
}

/// `count` Gaussians instead of fewer. The parts of one have its opacity and colors and a normal distribution around
/// its center; their total area and covariance are those of the one.
fn divided(gaussians: &GaussianArrays, count: usize) -> GaussianArrays {
    let sources = gaussians.len().max(1);
    let indices: Vec<u32> = (0..count).map(|index| (index % sources) as u32).collect();
    let mut parts = gaussians.gathered(&indices);
    let mut random = Random(1);
    for index in 0..count {
        let share = 1.0 / (index % sources..count).step_by(sources).len() as f32;
        let scales = parts.log_scales[index].map(f32::exp);
        let offset = scales.map(|scale| scale * (1.0 - share).sqrt() * random.normal());
        let offset = rotated(parts.quats[index], offset);
        parts.means[index].iter_mut().zip(offset).for_each(|(mean, offset)| *mean += offset);
        parts.log_scales[index].iter_mut().for_each(|scale| *scale += 0.5 * share.ln());
    }
    parts
}

/// Gaussians of degree 1 with numbers of their own, which take bytes.
fn different(mut gaussians: GaussianArrays) -> GaussianArrays {
    let mut random = Random(2);
    let mut vary = |numbers: &mut [f32], by: f32| numbers.iter_mut().for_each(|number| *number += by * random.normal());
    vary(gaussians.log_scales.as_flattened_mut(), 0.1);
    vary(gaussians.quats.as_flattened_mut(), 0.05);
    vary(gaussians.sh_dc.as_flattened_mut(), 0.05);
    vary(&mut gaussians.sh_rest, 0.05);
    gaussians
}

/// A vector turned by a quaternion of any length but 0.
fn rotated(quaternion: [f32; 4], [x, y, z]: [f32; 3]) -> [f32; 3] {
    let length = quaternion.iter().map(|q| q * q).sum::<f32>().sqrt().max(f32::MIN_POSITIVE);
    let [w, a, b, c] = quaternion.map(|q| q / length);
    // v + 2 q × (q × v + w v)
    let cross = [b * z - c * y + w * x, c * x - a * z + w * y, a * y - b * x + w * z];
    [
        x + 2.0 * (b * cross[2] - c * cross[1]),
        y + 2.0 * (c * cross[0] - a * cross[2]),
        z + 2.0 * (a * cross[1] - b * cross[0]),
    ]
}

/// The same numbers everywhere.
struct Random(u32);

impl Random {
    /// In (0, 1).
    fn uniform(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        ((self.0 >> 9) as f32 + 0.5) / (1 << 23) as f32
    }

    fn normal(&mut self) -> f32 {
        (-2.0 * self.uniform().ln()).sqrt() * (std::f32::consts::TAU * self.uniform()).cos()
    }
}
