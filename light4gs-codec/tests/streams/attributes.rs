//! Coded attributes: round trips, refusals, damage.

use light4gs_codec::{
    FurtherAttribute, GaussianArrays, Limits,
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

/// A further attribute of numbers around 0.
fn further(name: &str, width: u32, count: usize) -> FurtherAttribute {
    let number = |i: usize| ((i as f32 * 12.9898).sin() * 43_758.547).fract();
    FurtherAttribute {
        name: name.into(),
        width,
        values: (0..count * width as usize).map(number).collect(),
        optional: false,
    }
}

/// Encodes, decodes, compares, and returns the bytes.
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
        for (given, decoded) in given.attributes().zip(decoded.attributes()).skip(1) {
            assert_eq!((given.name, given.width, given.optional), (decoded.name, decoded.width, decoded.optional));
            let row = |values: &[f32], row: usize| values[row * given.width..][..given.width].to_vec();
            let (given_row, decoded_row) = (row(given.values, old), row(decoded.values, new));
            match steps.of(given.name) {
                Some(step) => assert!(within(&given_row, &decoded_row, step), "{}", given.name),
                None => assert_eq!(given_row, decoded_row, "{}", given.name),
            }
        }
    }
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
        let steps = AttributeSteps::default().with("means", position).with("log_scales", log_scale);
        let steps = steps.with("quats", quaternion).with("opacity_logits", 1e30).with("sh_dc", sh_dc);
        round_trip(&given, &steps);
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
        // Most random bytes fail at the head; these get as far as the streams.
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
fn further_attributes_follow_their_gaussians() {
    for count in [0, 1, 7, 300] {
        let mut given = cloud(count);
        given.further = vec![further("lifetime", 2, count), further("a", 1, count), further("features", 20, count)];
        given.further[1].optional = true;
        // Attributes without a step are float32.
        for steps in [AttributeSteps::default(), AttributeSteps::default().with("lifetime", 0.01).with("features", 0.1)]
        {
            round_trip(&given, &steps);
        }
    }
}

/// A further attribute has bytes of its own: the bytes of the others stay the same.
#[test]
fn a_further_attribute_changes_no_other_stream() {
    let steps = AttributeSteps::default().with("lifetime", 0.01);
    let without = attributes::encode(&cloud(300), &steps).unwrap();
    let mut given = cloud(300);
    given.further = vec![further("lifetime", 2, 300)];
    let with = attributes::encode(&given, &steps).unwrap();
    assert_eq!(with.attributes[..5], without.attributes);
    let (begin, length) = (without.overhead(), without.bytes.len() - without.overhead());
    assert_eq!(with.bytes[with.overhead()..][..length], without.bytes[begin..]);
}

/// A row of the list in a section: name, width, coder with the mark that it may be left out, bytes of the stream.
fn row(name: &[u8], width: &[u8], coder: u8, bytes: &[u8]) -> Vec<u8> {
    [&[name.len() as u8], name, width, &[coder], bytes].concat()
}

/// Ten Gaussians with these rows in place of those of the further attributes, and these bytes after all others.
fn forged(rows: &[Vec<u8>], behind: &[u8]) -> Result<GaussianArrays, String> {
    let encoded = attributes::encode(&cloud(10), &AttributeSteps::default()).unwrap();
    let (head, streams) = encoded.bytes.split_at(encoded.overhead());
    assert_eq!(head[4], 5);
    let bytes = [&head[..4], &[5 + rows.len() as u8], &head[5..], &rows.concat(), streams, behind].concat();
    attributes::decode(&bytes, &Limits::default()).map_err(|error| error.to_string())
}

#[test]
fn what_a_stream_says_of_further_attributes_is_checked() {
    let numbers = [0; 40];
    let plain = |name: &[u8]| row(name, &[1], 0, &[]);
    let decoded = forged(&[plain(b"age")], &numbers).unwrap();
    assert_eq!((&decoded.further[0].name[..], decoded.further[0].values.len()), ("age", 10));

    let refused = |rows: &[Vec<u8>], text: &str| {
        let error = forged(rows, &numbers).expect_err(text);
        assert!(error.starts_with("gaussians: ") && error.contains(text), "{error}");
    };
    for name in [&b""[..], b"Age", b"a.b", b"\xff\xfe", b"\x1b[31m"] {
        refused(&[plain(name)], "name of an attribute is");
    }
    refused(&[plain(b"age"), plain(b"age")], "\"age\" twice");
    refused(&[plain(b"quats")], "\"quats\" twice");
    refused(&[plain(b"sh_rest")], "\"sh_rest\" twice");
    refused(&[plain(&[b'a'; 65])], "length of an attribute's name is 65, at most 64");
    refused(&[row(b"age", &[0], 0, &[])], "width of age is 0");
    refused(&[row(b"age", &[0x81, 2], 0, &[])], "width of age is 257, at most 256");
    refused(&[row(b"age", &[2], 0, &[])], "age needs 80 bytes, 40 are left");
    refused(&[row(b"age", &[1], 1, &[40])], "coder of age is 1 (grid)");
    refused(&[row(b"age", &[1], 3, &[40])], "coder of age is 3 (colors)");
    refused(&[row(b"age", &[1], 2, &[39])], "step of age is 0");
    refused(&[row(b"age", &[1], 2, &[41])], "age needs 41 bytes, 40 are left");
    refused(&vec![plain(b"age"); 60], "number of attributes is 65, at most 64");

    // An unknown coder, and an optional attribute.
    refused(&[row(b"age", &[1], 9, &[40])], "coder of age is 9 (unknown), expected one that this program knows");
    assert_eq!(forged(&[row(b"age", &[1], 0x80 | 9, &[40])], &numbers).unwrap().further, []);
}

#[test]
fn the_built_in_attributes_are_all_there() {
    let encoded = attributes::encode(&cloud(10), &AttributeSteps::default()).unwrap();
    let change = |at: usize, new: u8| {
        let mut bytes = encoded.bytes.clone();
        bytes[at] = new;
        attributes::decode(&bytes, &Limits::default()).unwrap_err().to_string()
    };
    // Number of attributes; then name, width and coder of the first.
    assert_eq!(encoded.bytes[4..13], *b"\x05\x05means\x03\x01");
    assert!(change(4, 4).contains("attribute sh_dc is missing"));
    assert!(change(6, b'n').contains("attribute means is \"neans\""));
    assert!(change(11, 4).contains("width of means is 4, expected 3"));
    assert!(change(12, 0x81).contains("mark of means is may be left out"));
    assert!(change(12, 2).contains("coder of means is 2 (channels)"));
    assert!(change(12, 0).contains("coder of means is 0 (float32)"));
}

/// The memory of a wide attribute counts, though its stream has nearly no bytes.
#[test]
fn width_is_within_the_budget() {
    let count = 40_000;
    let mut given = from_rows(&vec![[0.25; 14]; count]);
    given.further =
        vec![FurtherAttribute { name: "features".into(), width: 256, values: vec![0.0; 256 * count], optional: true }];
    let bytes = attributes::encode(&given, &AttributeSteps::default().with("features", 0.1)).unwrap().bytes;
    assert!(bytes.len() < 10_000, "{}", bytes.len());
    let error = attributes::decode(&bytes, &Limits::default()).unwrap_err().to_string();
    assert!(error.contains("decoding takes"), "{error}");
    assert_eq!(attributes::decode(&bytes, &Limits::large()).unwrap().further[0].values.len(), 256 * count);
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
    let added = |name: &str, width: u32, values: usize| {
        let attribute = FurtherAttribute { name: name.into(), width, values: vec![0.0; values], optional: false };
        message(&|g| g.further.push(attribute.clone()))
    };
    assert!(added("age", 1, 2).contains("length of age is 2, expected 3"));
    assert!(added("age", 2, 7).contains("length of age is 7, expected 6"));
    assert!(added("age", 0, 0).contains("width of age is 0"));
    assert!(added("Age", 1, 3).contains("name of an attribute is \"Age\""));
    assert!(added("means", 3, 9).contains("\"means\" twice"));
    assert!(message(&|g| g.further = vec![further("age", 1, 3); 2]).contains("\"age\" twice"));
    assert!(
        message(&|g| {
            g.further = vec![further("age", 1, 3)];
            g.further[0].values[1] = f32::NAN;
        })
        .contains("value 1 of age is NaN")
    );
    let zero = AttributeSteps::default().with("sh_dc", 0.0);
    assert!(attributes::encode(&cloud(3), &zero).unwrap_err().to_string().contains("step of sh_dc is 0"));
}

#[test]
fn damage_never_panics() {
    let bytes = attributes::encode(&cloud(220), &AttributeSteps::default()).unwrap().bytes;
    for end in 0..bytes.len() {
        assert!(attributes::decode(&bytes[..end], &Limits::default()).is_err(), "cut at {end}");
    }
    // The step is odd, so that every bit of a byte occurs.
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
        let encoded = attributes::encode(&given, &steps).unwrap();
        let a_gaussian = |bytes: usize| bytes as f64 / given.len() as f64;
        let parts =
            encoded.attributes.iter().map(|part| format!("{} {:.2}", part.name, a_gaussian(part.bytes as usize)));
        println!(
            "{path}: {} Gaussians, {:.2} bytes each: {}; overhead {} bytes; encode {encode:.1?}, decode {decode:.1?}",
            given.len(),
            a_gaussian(bytes.len()),
            parts.collect::<Vec<_>>().join(", "),
            encoded.overhead(),
        );
    }
}
