//! Rounded Gaussians of a fixed set of scales (paper III-C).

use std::sync::OnceLock;

use super::{Distribution, TOTAL_BITS, normal::normal_distribution};

/// Scales of the table, in geometric progression from 0.11 to 256.
pub(super) const LEVELS: usize = 128;
const LEAST_SCALE: f64 = 0.11;
/// `(256 / 0.11)^(1 / 127)`.
const RATIO: f64 = 1.062_944_547_489_952;
/// Its square root.
const HALF_RATIO: f64 = 1.030_992_021_060_275_7;
/// Standard deviations that a row covers on either side. The rest, 2e-9, is left to the escape.
const REACH: f64 = 6.0;

/// Buckets from one power of two to the next. They are so narrow that each has one threshold at most.
const BUCKETS_OF_OCTAVE: u32 = 32;
/// Powers of two below the first threshold and above the last.
const BOUNDS: [f32; 2] = [1.0 / 16.0, 256.0];

/// One distribution for each scale.
#[derive(Debug)]
pub(crate) struct GaussianTable {
    /// By ascending scale. Symmetric around 0, except for the rounding of frequencies.
    pub(crate) levels: Vec<Distribution>,
    /// `thresholds[i]` is the geometric mean of scales `i` and `i + 1`, the last one infinite.
    thresholds: [f32; LEVELS],
    /// The level of the least scale of each bucket.
    buckets: Vec<u8>,
}

/// The bucket of a scale within [`BOUNDS`].
#[inline]
fn bucket(scale: f32) -> usize {
    let of = |scale: f32| scale.to_bits() >> (f32::MANTISSA_DIGITS - 1 - BUCKETS_OF_OCTAVE.ilog2());
    (of(scale) - of(BOUNDS[0])) as usize
}

impl GaussianTable {
    /// The level whose scale is nearest to `scale` in logarithm. NaN, negative and small scales have the first level.
    #[inline]
    pub(crate) fn level(&self, scale: f32) -> u16 {
        // NaN and scales that are too small become the least one.
        let bounded = if scale > BOUNDS[0] { scale.min(BOUNDS[1]) } else { BOUNDS[0] };
        let level = u16::from(self.buckets[bucket(bounded)]);
        level + u16::from(self.thresholds[usize::from(level)] < bounded)
    }

    fn new() -> Self {
        let mut scale = LEAST_SCALE;
        let mut levels = Vec::with_capacity(LEVELS);
        let mut thresholds = [f32::INFINITY; LEVELS];
        for level in 0..LEVELS {
            levels.push(rounded_gaussian(scale));
            if level + 1 < LEVELS {
                thresholds[level] = (scale * HALF_RATIO) as f32;
            }
            scale *= RATIO;
        }
        let mut buckets = vec![0; bucket(BOUNDS[1]) + 1];
        for &threshold in &thresholds[..LEVELS - 1] {
            buckets[bucket(threshold) + 1..].iter_mut().for_each(|level| *level += 1);
        }
        Self { levels, thresholds, buckets }
    }
}

/// The table, made when it is first used (some milliseconds).
pub(crate) fn gaussian_table() -> &'static GaussianTable {
    static TABLE: OnceLock<GaussianTable> = OnceLock::new();
    TABLE.get_or_init(GaussianTable::new)
}

/// A Gaussian of mean 0, integrated over the unit intervals around `-reach..=reach`.
///
/// Slot `i` begins at `i + floor(F · (2^24 - slots))`, where `F` is the share of the covered probability below it. So
/// every slot gets one unit, the rest is divided by probability, and the escape, the last slot, keeps its one unit.
fn rounded_gaussian(scale: f64) -> Distribution {
    let reach = (REACH * scale) as i32 + 1;
    // The probability below the upper edge of 0, 1, ..., reach; the lower half follows by symmetry.
    let edges: Vec<f64> = (0..=reach).map(|k| normal_distribution((f64::from(k) + 0.5) / scale)).collect();
    let below = |k: i32| if k > 0 { edges[k as usize - 1] } else { 1.0 - edges[-k as usize] };
    let (least, most) = (below(-reach), edges[reach as usize]);
    let slots = 2 * reach as u32 + 2;
    let spare = f64::from((1u32 << TOTAL_BITS) - slots);
    let mut starts: Vec<u32> = (-reach..=reach)
        .zip(0u32..)
        .map(|(k, slot)| slot + ((below(k) - least) / (most - least) * spare) as u32)
        .collect();
    starts.push((1 << TOTAL_BITS) - 1);
    Distribution::new(-reach, starts)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::entropy::{SymbolCoder, SymbolWriter};

    #[test]
    fn scales_find_the_nearest_level() {
        let table = gaussian_table();
        assert_eq!(table.levels.len(), LEVELS);
        for odd in [f32::NAN, -1.0, f32::NEG_INFINITY, 0.0, 0.11, -0.0] {
            assert_eq!(table.level(odd), 0);
        }
        assert_eq!(table.level(f32::INFINITY), LEVELS as u16 - 1);
        assert_eq!(table.level(256.0), LEVELS as u16 - 1);
        for i in 0..1000 {
            let scale = 0.11 * (f64::from(i) / 1000.0 * (256.0f64 / 0.11).ln()).exp();
            let nearest = ((scale / 0.11).ln() / RATIO.ln()).round() as u16;
            assert_eq!(table.level(scale as f32), nearest, "{scale}");
        }
        for (level, &threshold) in table.thresholds[..LEVELS - 1].iter().enumerate() {
            assert_eq!(table.level(threshold), level as u16);
            assert_eq!(table.level(threshold.next_up()), level as u16 + 1);
        }
    }

    #[test]
    fn frequencies_follow_the_density() {
        for (level, scale) in [(0, 0.11), (40, 0.11 * RATIO.powi(40)), (127, 256.0)] {
            let row = &gaussian_table().levels[level];
            for k in [-7i32, -1, 0, 1, 2, 30] {
                let upper = normal_distribution((f64::from(k) + 0.5) / scale);
                let mass = upper - normal_distribution((f64::from(k) - 0.5) / scale);
                if mass > 1e-5 {
                    assert!((row.bits(k) + mass.log2()).abs() < 0.02, "level {level}, {k}: {}", row.bits(k));
                }
            }
            assert!(row.bits(SYMBOL_FAR) == TOTAL_BITS as f64);
        }
    }

    const SYMBOL_FAR: i32 = 1 << 20;

    /// Scales that fall between the levels, and symbols that follow them, take their ideal number of bits within a
    /// percent.
    #[test]
    fn coded_bits_are_the_ideal_bits() {
        let table = gaussian_table();
        let mut state = 1u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 33) as f64 + 0.5) / f64::from(1u32 << 31)
        };
        for (least, most) in [(0.05, 0.3), (0.3, 3.0), (3.0, 200.0)] {
            let mut ideal = 0.0;
            let mut writer = SymbolWriter::default();
            for _ in 0..200_000 {
                let scale: f64 = least * (uniform() * f64::ln(most / least)).exp();
                let bounded = f64::from(scale as f32).max(LEAST_SCALE);
                let normal = (-2.0 * uniform().ln()).sqrt() * (std::f64::consts::TAU * uniform()).cos();
                let symbol = (bounded * normal).round();
                let distribution = |edge: f64| normal_distribution(edge / bounded);
                // By the nearer tail, where the difference is sharp.
                let edge = symbol.abs();
                ideal -= (distribution(0.5 - edge) - distribution(-0.5 - edge)).log2();
                writer.code(&table.levels, table.level(scale as f32), || symbol as i32).unwrap();
            }
            let coded = 8.0 * writer.finish(&table.levels).len() as f64;
            assert!((coded / ideal - 1.0).abs() < 0.01, "scales {least} to {most}: {coded} bits, ideal {ideal}");
        }
    }
}
