//! Numbers of a storage, and the tensors that are views of it.

use std::collections::BTreeMap;

use super::{PlainTensor, Problem, problem};

/// Type of a storage's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    F64,
    F32,
    F16,
    Bf16,
    I64,
    I32,
    I16,
    I8,
    U8,
    Bool,
}

impl Scalar {
    /// By the name of PyTorch's class, such as `FloatStorage`.
    pub(super) fn of_class(name: &str) -> Option<Self> {
        Some(match name {
            "DoubleStorage" => Self::F64,
            "FloatStorage" => Self::F32,
            "HalfStorage" => Self::F16,
            "BFloat16Storage" => Self::Bf16,
            "LongStorage" => Self::I64,
            "IntStorage" => Self::I32,
            "ShortStorage" => Self::I16,
            "CharStorage" => Self::I8,
            "ByteStorage" => Self::U8,
            "BoolStorage" => Self::Bool,
            _ => return None,
        })
    }

    pub(super) fn size(self) -> usize {
        match self {
            Self::F64 | Self::I64 => 8,
            Self::F32 | Self::I32 => 4,
            Self::F16 | Self::Bf16 | Self::I16 => 2,
            Self::I8 | Self::U8 | Self::Bool => 1,
        }
    }

    /// The number at the beginning of at least [`Self::size`] little-endian bytes.
    fn decode(self, bytes: &[u8]) -> f32 {
        fn first<const N: usize>(bytes: &[u8]) -> [u8; N] {
            *bytes.first_chunk().expect("as many bytes as the type has")
        }
        match self {
            Self::F64 => f64::from_le_bytes(first(bytes)) as f32,
            Self::F32 => f32::from_le_bytes(first(bytes)),
            Self::F16 => half_to_f32(u16::from_le_bytes(first(bytes))),
            Self::Bf16 => f32::from_bits(u32::from(u16::from_le_bytes(first(bytes))) << 16),
            Self::I64 => i64::from_le_bytes(first(bytes)) as f32,
            Self::I32 => i32::from_le_bytes(first(bytes)) as f32,
            Self::I16 => f32::from(i16::from_le_bytes(first(bytes))),
            Self::I8 => f32::from(bytes[0] as i8),
            Self::U8 => f32::from(bytes[0]),
            Self::Bool => f32::from(u8::from(bytes[0] != 0)),
        }
    }
}

/// IEEE 754 binary16.
fn half_to_f32(bits: u16) -> f32 {
    let sign = if bits >> 15 == 1 { -1.0 } else { 1.0 };
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f32::from(bits & 1023));
    sign * match exponent {
        0 => fraction * 2f32.powi(-24),
        31 if fraction == 0.0 => f32::INFINITY,
        31 => f32::NAN,
        _ => (1.0 + fraction / 1024.0) * 2f32.powi(exponent - 15),
    }
}

/// How a tensor views its storage.
#[derive(Clone, Debug)]
pub(super) struct View {
    pub(super) storage: String,
    pub(super) scalar: Scalar,
    pub(super) offset: i64,
    pub(super) shape: Vec<i64>,
    pub(super) strides: Vec<i64>,
}

/// The bytes of every storage by its key.
pub(super) struct Storages<'a>(BTreeMap<String, &'a [u8]>);

impl<'a> Storages<'a> {
    pub(super) fn new(storages: BTreeMap<String, &'a [u8]>) -> Self {
        Self(storages)
    }

    /// The numbers that a tensor views. They are charged to `budget`, which they must not exceed.
    pub(super) fn tensor(&self, view: &View, name: &str, budget: &mut usize) -> Result<PlainTensor, Problem> {
        let wrong = |what: String| problem(format!("tensor `{name}`"), what);
        let View { storage, scalar, offset, shape, strides } = view;
        let bytes = self.0.get(storage).ok_or_else(|| wrong(format!("its storage `{storage}` is missing")))?;
        let negative = |numbers: &[i64]| numbers.iter().any(|number| *number < 0);
        if shape.len() != strides.len() || shape.len() > 16 || negative(shape) || negative(strides) || *offset < 0 {
            let found = format!("shape {shape:?}, strides {strides:?}, offset {offset}");
            return Err(wrong(format!(
                "{found}: expected at most 16 axes, each with a stride, and no negative numbers"
            )));
        }
        let product = |total: usize, side: &i64| total.checked_mul(usize::try_from(*side).ok()?);
        let count = shape.iter().try_fold(1, product).filter(|count| count <= budget);
        let count = count.ok_or_else(|| wrong(format!("shape {shape:?} has more numbers than the file can hold")))?;
        *budget -= count;
        let held = bytes.len() / scalar.size();
        let last = shape
            .iter()
            .zip(strides)
            .try_fold(*offset, |at, (side, stride)| at.checked_add((side - 1).max(0).checked_mul(*stride)?));
        if count > 0 && last.is_none_or(|last| last as u128 >= held as u128) {
            return Err(wrong(format!(
                "shape {shape:?} needs more numbers than the {held} of its storage: it is truncated"
            )));
        }
        let mut values = Vec::with_capacity(count);
        let mut index = vec![0i64; shape.len()];
        let mut at = *offset;
        for _ in 0..count {
            values.push(scalar.decode(&bytes[at as usize * scalar.size()..]));
            for axis in (0..shape.len()).rev() {
                index[axis] += 1;
                at += strides[axis];
                if index[axis] < shape[axis] {
                    break;
                }
                at -= strides[axis] * shape[axis];
                index[axis] = 0;
            }
        }
        Ok(PlainTensor { shape: shape.iter().map(|side| *side as usize).collect(), values })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_are_the_numbers_they_stand_for() {
        for (bits, expected) in
            [(0, 0.0), (0x3c00, 1.0), (0xc000, -2.0), (0x3555, 0.333_251_95), (1, 5.960_464_5e-8), (0x7bff, 65504.0)]
        {
            assert_eq!(half_to_f32(bits), expected);
        }
        assert_eq!(half_to_f32(0xfc00), f32::NEG_INFINITY);
        assert!(half_to_f32(0x7e00).is_nan());
    }
}
