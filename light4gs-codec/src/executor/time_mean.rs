//! The inter-plane context: what the planes over time say about a plane over space (paper III-C).

use super::PaddedMap;

/// Means over the rows of a plane `[channels, time, size]`, each value less `centre`: `[channels, size]`.
///
/// The sum runs by rising time; it is divided by the number of rows at the end.
pub(crate) fn time_means(values: &[f32], [rows, size]: [usize; 2], centre: f32) -> Vec<f32> {
    let mut means = vec![0.0; values.len() / rows];
    for (sums, channel) in means.chunks_exact_mut(size).zip(values.chunks_exact(rows * size)) {
        for row in channel.chunks_exact(size) {
            sums.iter_mut().zip(row).for_each(|(sum, &value)| *sum += value - centre);
        }
        sums.iter_mut().for_each(|sum| *sum /= rows as f32);
    }
    means
}

/// Means along the first axis (columns) and along the second (rows), spread over the plane: `[2 channels, height,
/// width]`.
pub(crate) fn spread_time_means(
    first: &[f32],
    second: &[f32],
    [height, width]: [usize; 2],
    border: usize,
) -> PaddedMap {
    let channels = first.len() / width;
    let mut map = PaddedMap::zeros(2 * channels, height, width, border);
    for channel in 0..channels {
        for y in 0..height {
            map.row_mut(channel, y).copy_from_slice(&first[channel * width..(channel + 1) * width]);
            map.row_mut(channels + channel, y).fill(second[channel * height + y]);
        }
    }
    map
}
