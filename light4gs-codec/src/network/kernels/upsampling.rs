//! A map at another size, bilinear with aligned corners.

use super::{PaddedMap, kept};

/// A sample between two others: `low` and `low + 1` (or `low` again at the end), `share` of the second.
fn positions(from: usize, to: usize) -> impl Iterator<Item = (usize, usize, f32)> {
    let (spans, steps) = (from - 1, (to - 1).max(1));
    (0..to).map(move |index| {
        let low = index * spans / steps;
        let share = (index * spans % steps) as f32 / steps as f32;
        (low, (low + 1).min(spans), share)
    })
}

/// A map at the size `[height, width]`.
///
/// `a (1 - x) + b x` along each of the two rows, then likewise between the rows.
#[inline(always)]
pub(crate) fn resized(lower: &PaddedMap, to: [usize; 2], border: usize) -> PaddedMap {
    let mut map = PaddedMap::zeros(lower.channels, to[0], to[1], border);
    let columns: Vec<_> = positions(lower.width, to[1]).collect();
    for channel in 0..lower.channels {
        for (y, (above, below, share)) in positions(lower.height, to[0]).enumerate() {
            let rows = [lower.row(channel, above), lower.row(channel, below)];
            for (target, &(left, right, across)) in map.row_mut(channel, y).iter_mut().zip(&columns) {
                let [top, bottom] = rows.map(|row| row[left] * (1.0 - across) + row[right] * across);
                *target = kept(top * (1.0 - share) + bottom * share);
            }
        }
    }
    map
}
