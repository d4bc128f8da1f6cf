//! Coded attributes: what comes back, what is refused, what damage does.

use light4gs_codec::{
    GaussianArrays, Limits,
    attributes::{self, AttributeSteps},
};
use proptest::prelude::*;

/// `count` Gaussians whose numbers lie within `spread`.
fn gaussians(count: impl Into<prop::collection::SizeRange>, spread: f32) -> impl Strategy<Value = GaussianArrays> {
    prop::collection::vec(prop::array::uniform14(-spread..=spread), count).prop_map(|rows| from_rows(&rows))
}

/// Gaussians from rows of mean, log scales, quaternion, opacity, color.
fn from_rows(rows: &[[f32; 14]]) -> GaussianArrays {
    GaussianArrays {
        means: rows.iter().map(|r| [r[0], r[1], r[2]]).collect(),
        log_scales: rows.iter().map(|r| [r[3], r[4], r[5]]).collect(),
        quats: rows.iter().map(|r| [r[6], r[7], r[8], r[9]]).collect(),
        opacity_logits: rows.iter().map(|r| r[10]).collect(),
        sh_dc: rows.iter().map(|r| [r[11], r[12], r[13]]).collect(),
        ..GaussianArrays::default()
    }
}

/// A cloud with some structure, from a fixed stream of numbers.
fn cloud(count: usize) -> GaussianArrays {
    let mut state = 7_u64;
    let mut number = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 40) as f32 / (1 << 23) as f32 - 1.0
    };
    let rows: Vec<[f32; 14]> = (0..count)
        .map(|_| {
            let mut row = std::array::from_fn(|_| number());
            row[2] = row[0] * row[1];
            row[3] -= 4.0;
            row[12] = row[11] + 0.1 * row[12];
            row
        })
        .collect();
    from_rows(&rows)
}

/// Encodes, decodes, compares, and gives the bytes.
fn round_trip(given: &GaussianArrays, steps: &AttributeSteps) -> Vec<u8> {
    let encoded = attributes::encode(given, steps).unwrap();
    let decoded = attributes::decode(&encoded.bytes, &Limits::default()).unwrap();
    assert_eq!(decoded, attributes::quantized(given, steps).unwrap());

    let mut indices = encoded.order.clone();
    indices.sort_unstable();
    assert!(indices.iter().copied().eq(0..given.len() as u32), "the order is no permutation");
    let within =
        |a: &[f32], b: &[f32], step: f32| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 0.5001 * step + 1e-5 * a.abs());
    for (new, &old) in encoded.order.iter().enumerate() {
        let old = old as usize;
        assert!(within(&given.log_scales[old], &decoded.log_scales[new], steps.log_scale));
        assert!(within(&given.quats[old], &decoded.quats[new], steps.quaternion));
        assert!(within(&[given.opacity_logits[old]], &[decoded.opacity_logits[new]], steps.opacity_logit));
        assert!(within(&given.sh_dc[old], &decoded.sh_dc[new], steps.sh_dc));
    }
    let attributes::AttributeSizes { overhead, means, log_scales, opacity_logits, quats, sh_dc } = encoded.sizes;
    assert_eq!(overhead + means + log_scales + opacity_logits + quats + sh_dc, encoded.bytes.len());
    encoded.bytes
}

proptest! {
    #[test]
    fn any_gaussians_come_back(given in prop_oneof![gaussians(0..20, 3.0), gaussians(0..300, 20.0), gaussians(0..20, 1e4)]) {
        round_trip(&given, &AttributeSteps::default());
    }

    #[test]
    fn any_steps_work(
        given in gaussians(0..20, 3.0),
        position in 1e-12_f32..1e12, log_scale in 1e-5_f32..1e9, quaternion in 1e-5_f32..1e9, sh_dc in 1e-5_f32..1e9)
    {
        round_trip(&given, &AttributeSteps { position, log_scale, quaternion, opacity_logit: 1e30, sh_dc });
    }

    #[test]
    fn any_finite_numbers_come_back_or_are_refused(
        rows in prop::collection::vec(prop::array::uniform14(prop::num::f32::ANY), 0..10))
    {
        let given = from_rows(&rows);
        let steps = AttributeSteps::default();
        match attributes::encode(&given, &steps) {
            Ok(encoded) => prop_assert_eq!(
                attributes::decode(&encoded.bytes, &Limits::default()).unwrap(),
                attributes::quantized(&given, &steps).unwrap()
            ),
            Err(error) => prop_assert!(error.to_string().starts_with("gaussians: "), "{}", error),
        }
    }

    #[test]
    fn any_bytes_end(bytes in prop::collection::vec(any::<u8>(), 0..400), count in 0..3000_u32) {
        let _ = attributes::decode(&bytes, &Limits::default());
        // Most bytes fail at their head; these get to the streams.
        let mut sound = attributes::encode(&cloud(300), &AttributeSteps::default()).unwrap().bytes;
        sound[..4].copy_from_slice(&count.to_le_bytes());
        let streams = sound.len() - 400..;
        for (place, byte) in sound[streams].iter_mut().zip(bytes) {
            *place ^= byte;
        }
        let _ = attributes::decode(&sound, &Limits::default());
    }
}

#[test]
fn small_sets() {
    let steps = AttributeSteps::default();
    for count in [0, 1, 2, 5, 199, 200, 1000] {
        round_trip(&cloud(count), &steps);
    }
}

#[test]
fn all_alike_take_one_bit_each() {
    let given = from_rows(&[[0.25; 14]; 10_000]);
    let bytes = round_trip(&given, &AttributeSteps::default());
    assert_eq!(bytes.len(), 1250);
    let mut noisy = bytes.clone();
    *noisy.last_mut().unwrap() = 1;
    assert!(attributes::decode(&noisy, &Limits::default()).is_err());
}

#[test]
fn duplicates_keep_their_order() {
    let mut given = cloud(50);
    given.means.fill([1.0, 2.0, 3.0]);
    assert!(attributes::encode(&given, &AttributeSteps::default()).unwrap().order.is_sorted());
    round_trip(&given, &AttributeSteps::default());
}

#[test]
fn what_cannot_be_coded_is_named() {
    let steps = AttributeSteps::default();
    let message = |change: &dyn Fn(&mut GaussianArrays)| {
        let mut given = cloud(3);
        change(&mut given);
        attributes::encode(&given, &steps).unwrap_err().to_string()
    };
    assert!(message(&|g| g.quats[1][2] = f32::NAN).contains("value 6 of quats is NaN"));
    assert!(message(&|g| g.means[2][0] = f32::INFINITY).contains("value 6 of means is inf"));
    assert!(message(&|g| g.means[0][1] = -2e30).contains("means is -2e30 in value 1"));
    assert!(message(&|g| g.opacity_logits[2] = 1e30).contains("opacity_logits is 1e30 in value 2"));
    assert!(message(&|g| g.log_scales[0][0] = -1e30).contains("log_scales is -1e30 in value 0"));
    assert!(message(&|g| g.sh_dc.truncate(2)).contains("sh_dc"));
    let zero = AttributeSteps { sh_dc: 0.0, ..steps };
    assert!(attributes::encode(&cloud(3), &zero).unwrap_err().to_string().contains("step of sh_dc is 0"));
}

#[test]
fn damage_never_panics() {
    let bytes = attributes::encode(&cloud(220), &AttributeSteps::default()).unwrap().bytes;
    for end in 0..bytes.len() {
        assert!(attributes::decode(&bytes[..end], &Limits::default()).is_err(), "cut at {end}");
    }
    // A step prime to 8 meets every bit of a byte.
    for bit in (0..8 * bytes.len()).step_by(3) {
        let mut flipped = bytes.clone();
        flipped[bit / 8] ^= 1 << (bit % 8);
        if let Ok(gaussians) = attributes::decode(&flipped, &Limits::default()) {
            assert!(gaussians.len() <= 8 * bytes.len());
            assert!(gaussians.means.as_flattened().iter().all(|value| value.is_finite()));
            assert!(gaussians.quats.as_flattened().iter().all(|value| value.is_finite()));
        }
    }
}

#[test]
fn a_count_must_be_paid_for() {
    let mut bytes = attributes::encode(&cloud(10), &AttributeSteps::default()).unwrap().bytes;
    bytes[..4].copy_from_slice(&60_000_000_u32.to_le_bytes());
    assert!(attributes::decode(&bytes, &Limits::default()).unwrap_err().to_string().contains("at most 8 a byte"));
    let few = Limits { gaussians: 9, ..Limits::default() };
    bytes[..4].copy_from_slice(&10_u32.to_le_bytes());
    assert!(attributes::decode(&bytes, &few).unwrap_err().to_string().contains("at most 9"));
}

/// Bytes and times on trained scenes: `LIGHT4GS_SCENES="a.l4gs b.l4gs" cargo test --release -p light4gs-codec --test streams
/// attributes -- --ignored --nocapture`.
#[test]
#[ignore = "needs trained scenes"]
fn measured_on_trained_scenes() {
    let steps = AttributeSteps::default();
    for path in std::env::var("LIGHT4GS_SCENES").expect("paths in LIGHT4GS_SCENES").split_whitespace() {
        let given = light4gs_codec::read_file(path.as_ref()).unwrap().gaussians;
        let bytes = round_trip(&given, &steps);
        let fastest = |work: &dyn Fn()| {
            let time = |_| {
                let start = std::time::Instant::now();
                work();
                start.elapsed()
            };
            (0..5).map(time).min().unwrap()
        };
        let encode = fastest(&|| drop(attributes::encode(&given, &steps).unwrap()));
        let decode = fastest(&|| drop(attributes::decode(&bytes, &Limits::default()).unwrap()));
        let sizes = attributes::encode(&given, &steps).unwrap().sizes;
        let a_gaussian = |bytes: usize| bytes as f64 / given.len() as f64;
        println!(
            "{path}: {} Gaussians, {:.2} bytes each: means {:.2}, log_scales {:.2}, opacity {:.2}, quats {:.2}, dc {:.2}, \
             overhead {} bytes; encode {encode:.1?}, decode {decode:.1?}",
            given.len(),
            a_gaussian(bytes.len()),
            a_gaussian(sizes.means),
            a_gaussian(sizes.log_scales),
            a_gaussian(sizes.opacity_logits),
            a_gaussian(sizes.quats),
            a_gaussian(sizes.sh_dc),
            sizes.overhead,
        );
    }
}
