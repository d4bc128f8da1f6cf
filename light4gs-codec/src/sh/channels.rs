//! Spherical harmonics, coded as other attributes are: predicted from the nearest Gaussians before and from the channels
//! before, residuals under adaptive statistics.

use super::group;
use crate::{
    GaussianArrays,
    adaptive::{Damaged, index, reconstruct},
    attributes::{NEIGHBORS, all_nearest_before, channels},
    parallel,
};

/// The largest index on either side of zero, as for the symbols of other codings.
const LARGEST_INDEX: u32 = 1 << 22;

/// The streams of `values`, `[count, channels]`, one for each degree. Values are replaced by the decoded ones.
pub(super) fn write(
    gaussians: &GaussianArrays,
    step: f32,
    degree: u8,
    values: &mut [f32],
) -> Result<Vec<Vec<u8>>, Damaged> {
    let width = width(degree.into());
    let neighbors = neighbors(gaussians);
    let mut streams = Vec::new();
    for degree in 1..=usize::from(degree) {
        let (offset, count) = group(degree);
        let mut indices: Vec<Vec<i32>> = vec![Vec::with_capacity(neighbors.len()); count];
        for row in values.chunks_exact_mut(width) {
            for (value, channel) in row[offset..][..count].iter_mut().zip(&mut indices) {
                let found = legal(index(*value, step, 0.0).ok_or(Damaged)?)?;
                *value = reconstruct(found, step, 0.0);
                channel.push(found);
            }
        }
        streams.push(channels::encode(&indices, &neighbors));
    }
    Ok(streams)
}

/// What [`write`] leaves in its values.
pub(super) fn read(gaussians: &GaussianArrays, step: f32, streams: &[&[u8]]) -> Result<Vec<f32>, Damaged> {
    let width = width(streams.len());
    let neighbors = neighbors(gaussians);
    let mut values = vec![0.0; width * neighbors.len()];
    let decoded = parallel::map(streams.len(), |at| channels::decode(streams[at], group(at + 1).1, &neighbors));
    for (degree, indices) in (1..).zip(decoded) {
        let (offset, _) = group(degree);
        for (number, channel) in (offset..).zip(indices?) {
            for (row, found) in values.chunks_exact_mut(width).zip(channel) {
                row[number] = reconstruct(legal(found)?, step, 0.0);
            }
        }
    }
    Ok(values)
}

/// Channels of all degrees up to one.
fn width(degree: usize) -> usize {
    group(degree + 1).0
}

fn legal(index: i32) -> Result<i32, Damaged> {
    if index.unsigned_abs() <= LARGEST_INDEX { Ok(index) } else { Err(Damaged) }
}

/// Decoded positions stand on a grid, but which one is not known here: their distances are compared in world units.
fn neighbors(gaussians: &GaussianArrays) -> Vec<[u32; NEIGHBORS]> {
    let points: Vec<_> = gaussians.means.iter().map(|mean| mean.map(f64::from)).collect();
    all_nearest_before(&points)
}
