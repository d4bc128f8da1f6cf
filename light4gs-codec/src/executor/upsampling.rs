//! The inter-scale context: a plane of the scale below, bilinear with aligned corners (paper III-C).

use super::PaddedMap;

/// A sample between two others: `low` and `low + 1` (or `low` again at the end), `share` of the second.
fn positions(from: usize, to: usize) -> impl Iterator<Item = (usize, usize, f32)> {
    let (spans, steps) = (from - 1, (to - 1).max(1));
    (0..to).map(move |index| {
        let low = index * spans / steps;
        let share = (index * spans % steps) as f32 / steps as f32;
        (low, (low + 1).min(spans), share)
    })
}

/// A plane `[channels, from]`, each value less `centre`, at the size `to`.
///
/// `a (1 - x) + b x` along each of the two rows, then likewise between the rows.
pub(crate) fn upsample(values: &[f32], from: [usize; 2], to: [usize; 2], centre: f32, border: usize) -> PaddedMap {
    let lower = PaddedMap::centred(values, from, centre, 0);
    let mut map = PaddedMap::zeros(lower.channels, to[0], to[1], border);
    let columns: Vec<_> = positions(from[1], to[1]).collect();
    for channel in 0..lower.channels {
        for (y, (above, below, share)) in positions(from[0], to[0]).enumerate() {
            let rows = [lower.row(channel, above), lower.row(channel, below)];
            for (target, &(left, right, across)) in map.row_mut(channel, y).iter_mut().zip(&columns) {
                let [top, bottom] = rows.map(|row| row[left] * (1.0 - across) + row[right] * across);
                *target = top * (1.0 - share) + bottom * share;
            }
        }
    }
    map
}
