//! Compact coding of network weights (docs/design.md).
//!
//! Each tensor is quantized uniformly, by a step of its own, and the integers are coded adaptively, as differences from
//! a prediction: zero, the integer before, or a straight line through the two before (for splines, whose knots are rows
//! of a layer). The context of a weight is the magnitude of the differences before it. Names and lengths are not in the
//! bytes: the reader of a network knows its shape before it reads the weights.
//!
//! ```
//! use light4gs_codec::{Limits, network_weights::{self, TensorLength, WeightPrecision, WeightTensor}};
//!
//! let encoded = network_weights::encode("deformation", &[
//!     WeightTensor { name: "trunk.0.weight", values: &[0.5, -0.25, 0.1], row: 3, precision: WeightPrecision::Bits(10) },
//!     WeightTensor { name: "trunk.0.bias", values: &[0.0], row: 1, precision: WeightPrecision::Step(1e-4) },
//! ])?;
//! let lengths = [
//!     TensorLength { name: "trunk.0.weight", length: 3 },
//!     TensorLength { name: "trunk.0.bias", length: 1 },
//! ];
//! let decoded = network_weights::decode("deformation", &encoded.bytes, &lengths, &Limits::default())?;
//! assert_eq!(decoded, encoded.tensors);
//! # Ok::<(), light4gs_codec::CodecError>(())
//! ```
//!
//! The bytes are one range-coded stream: for each tensor that is not empty its step as the 32 raw bits of a float32, 0
//! for a tensor of zeros, then the kind of the prediction, then the integers. Zeros at the end fill it up to one byte
//! for 256 weights, so that a reader can check a length against the bytes.

use crate::{
    CodecError, Limits,
    adaptive::{
        AdaptiveInteger, BitCoder, BitDecoder, BitEncoder, Damaged, LARGEST_INDEX, LARGEST_STEP, index,
        magnitude_level, reconstruct,
    },
    budget::Budget,
    limits::at_most,
    steps,
};

/// The most weights that one byte can stand for.
const WEIGHTS_A_BYTE: u64 = 256;
/// Nanoseconds to read a weight, however few bits it takes.
const WEIGHT_NANOSECONDS: u64 = 300;
/// The last level of the expected magnitude.
const LAST_LEVEL: usize = 24;
/// Fractional bits of the expected magnitude.
const FRACTION: u32 = 4;
/// The highest order of a prediction.
const MOST_ORDER: u32 = 2;
/// Bits of the length of a row.
const ROW_BITS: u32 = 16;
/// The largest weight, so that rounding up to the last level cannot reach infinity.
const LARGEST_WEIGHT: f32 = 1e30;

/// How finely a tensor is quantized.
///
/// Measured on the deformation networks of five trained scenes: 10 bits cost 0.02 dB at most, 8 bits 0.04 to 0.19 dB.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WeightPrecision {
    /// 2 to 16 bits a weight before entropy coding: the step is the largest magnitude over `2^(bits - 1) - 1`.
    Bits(u8),
    /// A step in the units of the weights.
    Step(f32),
}

impl WeightPrecision {
    /// Refuses bits beyond 2 to 16, and a step that is not positive or above 1e30.
    pub(crate) fn check(self) -> Result<(), CodecError> {
        match self {
            Self::Bits(2..=16) => Ok(()),
            Self::Bits(bits) => Err(CodecError::invalid("weights", "precision", bits, "2 to 16 bits")),
            Self::Step(step) => steps::check_step("weights", "step", step, f32::MIN_POSITIVE),
        }
    }
}

/// A tensor of a network.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WeightTensor<'a> {
    /// Its name in messages.
    pub name: &'a str,
    /// Its numbers, in an order that the reader knows too.
    pub values: &'a [f32],
    /// Length of a row: prediction begins anew with each. A tensor that is one row has its own length, or more.
    pub row: usize,
    /// How finely it is quantized.
    pub precision: WeightPrecision,
}

/// What a reader knows about a tensor beforehand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TensorLength<'a> {
    /// Its name in messages.
    pub name: &'a str,
    /// The number of its weights.
    pub length: u64,
}

/// Tensors as bytes.
#[derive(Clone, Debug, PartialEq)]
pub struct EncodedWeights {
    /// What [`decode`] reads.
    pub bytes: Vec<u8>,
    /// What [`decode`] gives: the tensors as a decoder sees them.
    pub tensors: Vec<Vec<f32>>,
}

/// Codes tensors; `section` is for messages.
///
/// # Errors
/// NaN and infinities, weights beyond ±1e30, precisions out of range, and weights beyond 2^23 steps. The message
/// names the tensor.
pub fn encode(section: &'static str, tensors: &[WeightTensor<'_>]) -> Result<EncodedWeights, CodecError> {
    let mut quantized = tensors.iter().map(|tensor| Quantized::of(section, tensor)).collect::<Result<Vec<_>, _>>()?;
    let mut encoder = BitEncoder::default();
    code(&mut encoder, &mut quantized).expect("an encoder is never damaged");
    let mut bytes = encoder.finish();
    let weights: usize = tensors.iter().map(|tensor| tensor.values.len()).sum();
    bytes.resize(bytes.len().max(weights.div_ceil(WEIGHTS_A_BYTE as usize)), 0);
    Ok(EncodedWeights { bytes, tensors: quantized.iter().map(Quantized::values).collect() })
}

/// Reads tensors of known lengths; `section` is for messages.
///
/// # Errors
/// Bytes that [`encode`] does not write for tensors of these lengths. Memory is taken for at most 256 weights a byte.
pub fn decode(
    section: &'static str,
    bytes: &[u8],
    lengths: &[TensorLength<'_>],
    limits: &Limits,
) -> Result<Vec<Vec<f32>>, CodecError> {
    decode_within(section, bytes, lengths, &Budget::new(limits))
}

/// As [`decode`], within a budget.
pub(crate) fn decode_within(
    section: &'static str,
    bytes: &[u8],
    lengths: &[TensorLength<'_>],
    budget: &Budget,
) -> Result<Vec<Vec<f32>>, CodecError> {
    let limits = &budget.limits;
    let most = 2 * u64::from(limits.networks) * u64::from(limits.nodes);
    at_most(section, "number of tensors", lengths.len() as u64, most)?;
    let weights = lengths.iter().fold(0_u64, |sum, tensor| sum.saturating_add(tensor.length));
    if weights.div_ceil(WEIGHTS_A_BYTE) > bytes.len() as u64 {
        let expected = format!("at most {WEIGHTS_A_BYTE} a byte, and there are {} bytes", bytes.len());
        return Err(CodecError::invalid(section, "number of weights", weights, expected));
    }
    budget.stream(section, bytes.len())?;
    budget.things(section, weights, 8, WEIGHT_NANOSECONDS)?;
    let mut quantized: Vec<_> = lengths
        .iter()
        // At most 256 times the number of bytes, so it fits.
        .map(|tensor| Quantized {
            step: 0.0,
            prediction: Prediction::default(),
            indices: vec![0; tensor.length as usize],
        })
        .collect();
    code(&mut BitDecoder::new(bytes), &mut quantized)
        .map_err(|_| CodecError::invalid(section, "weights", "damaged or cut short", "a range-coded stream"))?;
    for (tensor, TensorLength { name, .. }) in quantized.iter().zip(lengths) {
        if tensor.prediction.order > MOST_ORDER {
            let field = format!("prediction of {name}");
            return Err(CodecError::invalid(section, field, tensor.prediction.order, format!("at most {MOST_ORDER}")));
        }
        if tensor.step != 0.0 {
            check_step(section, name, tensor.step)?;
        }
        if let Some(index) = tensor.indices.iter().find(|index| index.unsigned_abs() > LARGEST_INDEX.unsigned_abs()) {
            let expected = format!("at most {LARGEST_INDEX} steps from 0");
            return Err(CodecError::invalid(section, *name, format!("{index} steps"), expected));
        }
    }
    Ok(quantized.iter().map(Quantized::values).collect())
}

/// A tensor as integers.
#[derive(Clone, Debug)]
struct Quantized {
    /// 0 where all integers are 0.
    step: f32,
    prediction: Prediction,
    indices: Vec<i32>,
}

/// How the integers of a tensor are predicted.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Prediction {
    /// 0: zero; 1: the integer before; 2: on a line with the two before.
    order: u32,
    /// Length of a row: the prediction begins anew after each. In the stream only where the order is not 0.
    row: u32,
}

impl Prediction {
    /// The prediction of an integer from those before it.
    fn of(self, before: &[i32]) -> i32 {
        let known = before.len().checked_rem(self.row as usize).unwrap_or(before.len());
        match (self.order.min(known as u32), before) {
            (2, [.., older, last]) => last.wrapping_add(last.wrapping_sub(*older)),
            (1, [.., last]) => *last,
            _ => 0,
        }
    }

    /// The prediction that costs the fewest bits, by a rough count.
    fn best(indices: &[i32], row: usize) -> Self {
        // A row whose length does not fit into the stream is not used.
        let row = u32::try_from(row).ok().filter(|row| *row < 1 << ROW_BITS).unwrap_or(0);
        let bits = |prediction: &Self| -> u32 {
            let difference = |at: usize| indices[at].wrapping_sub(prediction.of(&indices[..at])).unsigned_abs();
            (0..indices.len()).map(|at| 2 * (32 - difference(at).leading_zeros())).sum()
        };
        let all = (0..=MOST_ORDER).map(|order| Self { order, row: if order == 0 { 0 } else { row } });
        all.min_by_key(bits).unwrap_or_default()
    }
}

impl Quantized {
    fn of(section: &'static str, tensor: &WeightTensor<'_>) -> Result<Self, CodecError> {
        let WeightTensor { name, values, precision, .. } = *tensor;
        if let Some(index) = values.iter().position(|value| !value.is_finite()) {
            return Err(CodecError::NonFinite { section, field: name.to_owned(), index, value: values[index] });
        }
        let largest = values.iter().fold(0.0_f32, |largest, value| largest.max(value.abs()));
        if largest > LARGEST_WEIGHT {
            let expected = format!("at most {LARGEST_WEIGHT:e} on either side of 0");
            return Err(CodecError::invalid(section, name, format!("{largest:e}"), expected));
        }
        let step = match precision {
            WeightPrecision::Bits(bits @ 2..=16) => {
                (largest / ((1_u32 << (bits - 1)) - 1) as f32).max(f32::MIN_POSITIVE)
            }
            WeightPrecision::Bits(bits) => {
                return Err(CodecError::invalid(section, format!("precision of {name}"), bits, "2 to 16 bits"));
            }
            WeightPrecision::Step(step) => step,
        };
        check_step(section, name, step)?;
        let indices =
            values.iter().map(|&value| index(value, step, 0.0)).collect::<Option<Vec<_>>>().ok_or_else(|| {
                let expected = format!("at most {LARGEST_INDEX} steps of {step} from 0");
                CodecError::invalid(section, name, format!("{largest:e}"), expected)
            })?;
        let zeros = indices.iter().all(|&index| index == 0);
        Ok(Self { step: if zeros { 0.0 } else { step }, prediction: Prediction::best(&indices, tensor.row), indices })
    }

    fn values(&self) -> Vec<f32> {
        self.indices.iter().map(|&index| reconstruct(index, self.step, 0.0)).collect()
    }
}

fn check_step(section: &'static str, name: &str, step: f32) -> Result<(), CodecError> {
    if (f32::MIN_POSITIVE..=LARGEST_STEP).contains(&step) {
        return Ok(());
    }
    let expected = format!("a positive number, at most {LARGEST_STEP:e}");
    Err(CodecError::invalid(section, format!("step of {name}"), step, expected))
}

/// Codes all tensors, under the same statistics. Symmetric, see [`BitCoder`].
fn code(coder: &mut impl BitCoder, tensors: &mut [Quantized]) -> Result<(), Damaged> {
    let mut integers = AdaptiveInteger::new(LAST_LEVEL + 1);
    for tensor in tensors.iter_mut().filter(|tensor| !tensor.indices.is_empty()) {
        tensor.step = f32::from_bits(coder.raw(32, tensor.step.to_bits()));
        if tensor.step == 0.0 {
            continue;
        }
        let Prediction { order, row } = &mut tensor.prediction;
        *order = coder.raw(2, *order);
        if *order > 0 {
            *row = coder.raw(ROW_BITS, *row);
        }
        let mut expected = ExpectedMagnitude::default();
        for at in 0..tensor.indices.len() {
            coder.check()?;
            let predicted = tensor.prediction.of(&tensor.indices[..at]);
            let difference = integers.code(coder, expected.level(), tensor.indices[at].wrapping_sub(predicted));
            tensor.indices[at] = predicted.wrapping_add(difference);
            expected.learn(difference.unsigned_abs());
        }
    }
    coder.check()
}

/// A running mean of magnitudes.
#[derive(Clone, Copy, Debug)]
struct ExpectedMagnitude {
    /// In units of `2^-FRACTION`.
    mean: u64,
}

impl Default for ExpectedMagnitude {
    /// A guess for the first weight, which the next ones soon replace.
    fn default() -> Self {
        Self { mean: 16 << FRACTION }
    }
}

impl ExpectedMagnitude {
    fn level(self) -> usize {
        magnitude_level(self.mean >> 2, LAST_LEVEL)
    }

    /// A window of about 16 weights.
    fn learn(&mut self, magnitude: u32) {
        self.mean = (15 * self.mean + (u64::from(magnitude) << FRACTION) + 8) / 16;
    }
}
