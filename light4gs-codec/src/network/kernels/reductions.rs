//! Means over rows and columns, and transposition.

use super::{PaddedMap, kept};

/// Means over the rows: `[C, 1, W]`. The sum runs down the rows; it is divided by their number at the end.
pub(crate) fn mean_over_height(map: &PaddedMap, border: usize) -> PaddedMap {
    let mut means = PaddedMap::zeros(map.channels, 1, map.width, border);
    for channel in 0..map.channels {
        let sums = means.row_mut(channel, 0);
        for y in 0..map.height {
            sums.iter_mut().zip(map.row(channel, y)).for_each(|(sum, &value)| *sum += value);
        }
        sums.iter_mut().for_each(|sum| *sum = kept(*sum / map.height as f32));
    }
    means
}

/// Means over the columns: `[C, H, 1]`. The sum runs from left to right; it is divided by their number at the end.
pub(crate) fn mean_over_width(map: &PaddedMap, border: usize) -> PaddedMap {
    let mut means = PaddedMap::zeros(map.channels, map.height, 1, border);
    for channel in 0..map.channels {
        for y in 0..map.height {
            let sum = map.row(channel, y).iter().fold(0.0, |sum, &value| sum + value);
            means.row_mut(channel, y)[0] = kept(sum / map.width as f32);
        }
    }
    means
}

/// `[C, W, H]` of `[C, H, W]`.
pub(crate) fn transposed(map: &PaddedMap, border: usize) -> PaddedMap {
    let mut other = PaddedMap::zeros(map.channels, map.width, map.height, border);
    for channel in 0..map.channels {
        for y in 0..map.height {
            for x in 0..map.width {
                other.row_mut(channel, x)[y] = map.row(channel, y)[x];
            }
        }
    }
    other
}
