//! A large scene for measuring the player, made of the synthetic one: each Gaussian is replaced by smaller ones.

use light4gs_codec::{GaussianArrays, encode, read_file};

/// Gaussians of the large scene.
const COUNT: usize = 100_000;

/// Writes the scene to the path in LIGHT4GS_LARGE: `LIGHT4GS_LARGE=FILE cargo test --release --package light4gs-web
/// --test large_scene -- --ignored`. The environment may name another scene to make it of, in LIGHT4GS_WEB_SCENE.
#[test]
#[ignore = "writes a file of 25 MB to LIGHT4GS_LARGE"]
fn write() {
    let path = std::env::var("LIGHT4GS_LARGE").expect("a path in LIGHT4GS_LARGE");
    let source = std::env::var("LIGHT4GS_WEB_SCENE")
        .unwrap_or_else(|_| concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/quickstart.l4gs").to_owned());
    let mut scene = read_file(source.as_ref()).expect("a scene");
    scene.gaussians = divided(&scene.gaussians, COUNT);
    let bytes = encode(&scene).expect("the scene is valid");
    std::fs::write(path, bytes).expect("the file can be written");
}

/// `count` Gaussians in place of fewer. The parts of one have its opacity and colors, a normal distribution around its
/// center, and together its area and its covariance.
fn divided(gaussians: &GaussianArrays, count: usize) -> GaussianArrays {
    let sources = gaussians.len();
    assert!((1..=count).contains(&sources), "{sources} Gaussians");
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

/// Turned vectors keep their length, and a quarter turn around z takes x to y.
#[test]
fn vectors_are_turned() {
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let turned = rotated([2.0 * half, 0.0, 0.0, 2.0 * half], [1.0, 0.0, 0.5]);
    for (found, expected) in turned.iter().zip([0.0, 1.0, 0.5]) {
        assert!((found - expected).abs() < 1e-6, "{turned:?}");
    }
}
