//! From numbers to integers and back.

/// The largest index on either side of zero. Indices up to here are exact in float32.
pub(crate) const LARGEST_INDEX: i32 = 1 << 23;
/// The largest step, so that no index reconstructs to infinity.
pub(crate) const LARGEST_STEP: f32 = 1e30;

/// The index of the level nearest to `value` among `offset + step * integer`; `None` beyond [`LARGEST_INDEX`].
///
/// Mid-tread: where `offset` is 0, zero is a level.
pub(crate) fn index(value: f32, step: f32, offset: f32) -> Option<i32> {
    let index = ((f64::from(value) - f64::from(offset)) / f64::from(step)).round();
    (index.abs() <= f64::from(LARGEST_INDEX)).then_some(index as i32)
}

/// The level at `index`. Encoder and decoder compute every number by this function: one product and one sum in float32,
/// each rounded, which is the same on every machine.
#[inline]
pub(crate) fn reconstruct(index: i32, step: f32, offset: f32) -> f32 {
    index as f32 * step + offset
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_nearest() {
        for value in [0.0, 0.1, -0.1, 3.3, -7.77, 100.0] {
            let index = index(value, 0.25, 0.0).unwrap();
            assert!((reconstruct(index, 0.25, 0.0) - value).abs() <= 0.125);
        }
        assert_eq!(index(-0.0, 0.1, 0.0), Some(0));
        assert_eq!(reconstruct(0, 0.1, 0.0).to_bits(), 0);
    }

    #[test]
    fn what_has_no_level_gets_none() {
        assert_eq!(index(1e30, 0.1, 0.0), None);
        assert_eq!(index(f32::NAN, 0.1, 0.0), None);
        assert!(reconstruct(LARGEST_INDEX, LARGEST_STEP, LARGEST_STEP).is_finite());
    }
}
