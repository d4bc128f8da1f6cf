//! Means over time on a CPU.

use burn::backend::tensor::FloatTensor;

use super::{PlanesOverTime, TimeMeansKernels, TimeSizes};
use crate::ops::for_cpu_back_ends;
use crate::ops::host::HostBackend;

/// Sums of the rows of each channel, `[M, length]` from `[M, rows, length]`, times `share`.
fn sums_of_rows(plane: &[f32], [_, rows, length]: [usize; 3], share: f32) -> Vec<f32> {
    let of_channel = |channel: &[f32]| -> Vec<f32> {
        let mut sums = vec![0.0; length];
        for row in channel.chunks_exact(length) {
            sums.iter_mut().zip(row).for_each(|(sum, value)| *sum += value);
        }
        sums.iter().map(|sum| sum * share).collect()
    };
    plane.chunks_exact(rows * length).flat_map(of_channel).collect()
}

/// Each row `T` times: `[M, T, length]` from `[M, length]`.
fn repeated(rows: &[f32], [_, times, length]: [usize; 3]) -> Vec<f32> {
    rows.chunks_exact(length).flat_map(|row| row.repeat(times)).collect()
}

fn forward<B: HostBackend>(planes: PlanesOverTime<B>) -> FloatTensor<B> {
    let sizes = TimeSizes::of(&planes);
    let [along_a, along_b] = [(planes.over_a, 0), (planes.over_b, 1)]
        .map(|(plane, place)| sums_of_rows(B::to_host(plane).as_slice(), sizes.input(place), sizes.share(place)));
    let [a, b] = sizes.lengths;
    let mut spread = Vec::with_capacity(2 * sizes.channels * a * b);
    along_a.chunks_exact(a).for_each(|row| spread.extend(row.repeat(b)));
    along_b.iter().for_each(|mean| spread.extend(std::iter::repeat_n(mean, a)));
    B::from_values(spread, sizes.output())
}

fn backward<B: HostBackend>(sizes: TimeSizes, gradient: FloatTensor<B>) -> PlanesOverTime<B> {
    let gradient = B::to_host(gradient);
    let [a, b] = sizes.lengths;
    let (of_a, of_b) = gradient.as_slice().split_at(sizes.channels * a * b);
    let [a_share, b_share] = [0, 1].map(|place| sizes.share(place));
    let of_a = sums_of_rows(of_a, [sizes.channels, b, a], a_share);
    let of_b: Vec<f32> = of_b.chunks_exact(a).map(|row| row.iter().sum::<f32>() * b_share).collect();
    PlanesOverTime {
        over_a: B::from_values(repeated(&of_a, sizes.input(0)), sizes.input(0)),
        over_b: B::from_values(repeated(&of_b, sizes.input(1)), sizes.input(1)),
    }
}

for_cpu_back_ends! {
    TimeMeansKernels {
        fn time_means_forward(planes: PlanesOverTime<Self>) -> FloatTensor<Self> {
            forward(planes)
        }

        fn time_means_backward(sizes: TimeSizes, gradient: FloatTensor<Self>) -> PlanesOverTime<Self> {
            backward(sizes, gradient)
        }
    }
}
