//! Coded network weights: round trips, refusals, damage.

use light4gs_codec::{
    CodecError, Limits,
    network_weights::{self, EncodedWeights, TensorLength, WeightPrecision, WeightTensor},
};
use proptest::prelude::*;

const SECTION: &str = "deformation";

fn encode(tensors: &[Vec<f32>], precision: WeightPrecision) -> Result<EncodedWeights, CodecError> {
    let row = 7;
    let tensors: Vec<_> = tensors.iter().map(|values| WeightTensor { name: "layer", values, row, precision }).collect();
    network_weights::encode(SECTION, &tensors)
}

fn decode(bytes: &[u8], lengths: impl IntoIterator<Item = usize>) -> Result<Vec<Vec<f32>>, CodecError> {
    let lengths: Vec<_> =
        lengths.into_iter().map(|length| TensorLength { name: "layer", length: length as u64 }).collect();
    network_weights::decode(SECTION, bytes, &lengths, &Limits::default())
}

fn round_trip(tensors: &[Vec<f32>], precision: WeightPrecision) -> EncodedWeights {
    let encoded = encode(tensors, precision).unwrap();
    assert_eq!(decode(&encoded.bytes, tensors.iter().map(Vec::len)).unwrap(), encoded.tensors);
    encoded
}

fn tensors() -> impl Strategy<Value = Vec<Vec<f32>>> {
    let values = prop_oneof![Just(0.0), -1.0_f32..1.0, -1e30_f32..1e30, -1e-38_f32..1e-38];
    prop::collection::vec(prop::collection::vec(values, 0..60), 0..6)
}

proptest! {
    #[test]
    fn any_tensors_come_back(tensors in tensors(), bits in 2..=16_u8) {
        let encoded = round_trip(&tensors, WeightPrecision::Bits(bits));
        for (given, seen) in tensors.iter().zip(&encoded.tensors) {
            let largest = given.iter().fold(0.0_f32, |largest, value| largest.max(value.abs()));
            let step = f64::from(largest) / f64::from((1 << (bits - 1)) - 1) + 1e-37;
            for (a, b) in given.iter().zip(seen) {
                prop_assert!((f64::from(*a) - f64::from(*b)).abs() <= 0.501 * step, "{a} {b}");
            }
        }
    }

    #[test]
    fn any_bytes_end(bytes in prop::collection::vec(any::<u8>(), 0..200), lengths in prop::collection::vec(0..3000_usize, 0..5)) {
        let _ = decode(&bytes, lengths);
    }
}

#[test]
fn zeros_and_nothing_take_next_to_nothing() {
    assert_eq!(round_trip(&[], WeightPrecision::Bits(8)).bytes, []);
    assert_eq!(round_trip(&[vec![], vec![]], WeightPrecision::Bits(8)).bytes, []);
    assert_eq!(round_trip(&[vec![0.0; 10_000], vec![-0.0]], WeightPrecision::Bits(8)).bytes.len(), 40);
    assert_eq!(round_trip(&[vec![1e-6; 300]], WeightPrecision::Step(0.1)).tensors, [[0.0; 300]]);
}

/// Knots of splines, a row each: a straight line is next to free, whatever its values are.
#[test]
fn what_is_smooth_along_a_row_takes_few_bytes() {
    let row = 28;
    let knot = |i: usize| ((i / row) as f32 * 0.7).sin() + (i % row) as f32 * 0.1 * ((i / row) as f32).cos();
    let values: Vec<f32> = (0..60 * row).map(knot).collect();
    let bytes = |row: usize| {
        let tensor = WeightTensor { name: "knots", values: &values, row, precision: WeightPrecision::Bits(10) };
        let encoded = network_weights::encode(SECTION, &[tensor]).unwrap();
        assert_eq!(decode(&encoded.bytes, [values.len()]).unwrap(), encoded.tensors);
        encoded.bytes.len()
    };
    assert!(bytes(row) < 520, "{}", bytes(row));
    assert!(bytes(row) < bytes(values.len()), "{} {}", bytes(row), bytes(values.len()));
}

#[test]
fn what_cannot_be_coded_is_named() {
    let message = |value, precision| encode(&[vec![0.5, value]], precision).unwrap_err().to_string();
    let bits = WeightPrecision::Bits(8);
    assert!(message(f32::NAN, bits).contains("deformation: value 1 of layer is NaN"));
    assert!(message(f32::NEG_INFINITY, bits).contains("value 1 of layer is -inf"));
    assert!(message(2e30, bits).contains("layer is 2e30"));
    assert!(message(1e9, WeightPrecision::Step(1.0)).contains("layer is 1e9"));
    assert!(message(1.0, WeightPrecision::Step(-1.0)).contains("step of layer is -1"));
    assert!(message(1.0, WeightPrecision::Bits(1)).contains("precision of layer is 1"));
    assert!(message(1.0, WeightPrecision::Bits(17)).contains("2 to 16 bits"));
}

#[test]
fn a_length_must_be_paid_for() {
    let encoded = round_trip(&[vec![0.5; 100]], WeightPrecision::Bits(8));
    let error = decode(&encoded.bytes, [usize::MAX, usize::MAX]).unwrap_err();
    assert!(error.to_string().contains("at most 256 a byte"), "{error}");
}

#[test]
fn damage_never_panics() {
    let tensors: Vec<Vec<f32>> =
        (1..4).map(|tensor| (0..100 * tensor).map(|i| ((i * 37 % 101) as f32 - 50.0) / 80.0).collect()).collect();
    let lengths = || tensors.iter().map(Vec::len);
    let bytes = round_trip(&tensors, WeightPrecision::Bits(12)).bytes;
    for end in 0..bytes.len() - 8 {
        assert!(decode(&bytes[..end], lengths()).is_err(), "cut at {end}");
    }
    for bit in 0..8 * bytes.len() {
        let mut flipped = bytes.clone();
        flipped[bit / 8] ^= 1 << (bit % 8);
        if let Ok(tensors) = decode(&flipped, lengths()) {
            assert!(tensors.iter().flatten().all(|value| value.is_finite()));
        }
    }
}

/// Bytes of the deformation networks of trained scenes; run it like the test of the same name in `attributes.rs`.
#[test]
#[ignore = "needs trained scenes"]
fn measured_on_trained_scenes() {
    for path in std::env::var("LIGHT4GS_SCENES").expect("paths in LIGHT4GS_SCENES").split_whitespace() {
        let network = light4gs_codec::read_file(path.as_ref()).unwrap().motion.network.unwrap().network;
        let tensors: Vec<_> = network.layers().flat_map(|layer| [layer.weight.clone(), layer.bias.clone()]).collect();
        let weights: usize = tensors.iter().map(Vec::len).sum();
        print!("{path}: {weights} weights;");
        for bits in [8, 10, 12, 16] {
            let bytes = round_trip(&tensors, WeightPrecision::Bits(bits)).bytes.len();
            print!(" {bits} bits: {bytes} bytes ({:.2} bits each);", 8.0 * bytes as f64 / weights as f64);
        }
        println!();
    }
}
