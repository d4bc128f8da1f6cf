//! Uniform noise on a CPU.

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use rayon::prelude::*;

use super::{NoiseDraw, UniformNoiseOps};
use crate::ops::for_cpu_back_ends;
use crate::ops::host::HostBackend;
use crate::ops::tensor_list::TensorList;

const CHUNK: usize = 1 << 14;

/// A hash of 32 bits with little bias ("lowbias32" of C. Wellons's Hash Prospector, 2018).
fn mixed(mut x: u32) -> u32 {
    x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
    x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// The two words of a seed.
pub(super) fn words(seed: u64) -> [u32; 2] {
    [seed as u32, (seed >> 32) as u32]
}

/// In [-1/2, 1/2): a multiple of 2^-24. `shaders/uniform_noise/uniform_noise.wgsl` computes the same.
fn noise(place: u32, seed: [u32; 2]) -> f32 {
    let bits = mixed(mixed(place.wrapping_add(seed[0])) ^ seed[1]);
    (bits >> 8) as f32 * (1.0 / 16_777_216.0) - 0.5
}

fn noise_on_cpu<B: HostBackend>(values: FloatTensor<B>, width: f32, seed: u64) -> FloatTensor<B> {
    let seed = words(seed);
    let shape = values.shape();
    let values = B::to_host(values);
    let values = values.as_slice();
    let mut noisy = vec![0.0; values.len()];
    noisy.par_chunks_mut(CHUNK).zip(values.par_chunks(CHUNK)).enumerate().for_each(|(chunk, (noisy, values))| {
        for (i, (noisy, value)) in noisy.iter_mut().zip(values).enumerate() {
            *noisy = value + width * noise((chunk * CHUNK + i) as u32, seed);
        }
    });
    B::from_values(noisy, shape)
}

for_cpu_back_ends! {
    UniformNoiseOps {
        fn uniform_noise(
            values: TensorList<Self>,
            widths: FloatTensor<Self>,
            unit: FloatTensor<Self>,
            draws: Vec<NoiseDraw>,
        ) -> TensorList<Self> {
            let (widths, unit) = (Self::to_host(widths), Self::to_host(unit));
            let width = |draw: NoiseDraw| {
                let width = widths.as_slice()[draw.width];
                if draw.in_units { width * unit.as_slice()[0] } else { width }
            };
            let noisy = values.0.into_iter().zip(draws);
            TensorList(noisy.map(|(values, draw)| noise_on_cpu::<Self>(values, width(draw), draw.seed)).collect())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean, variance and correlation of neighbors, of other seeds and of twice the place, within five standard deviations.
    #[test]
    fn noise_is_uniform_and_independent() {
        const COUNT: u32 = 200_000;
        let seed = [12_345, 678];
        let mean = |of: &dyn Fn(u32) -> f64| (0..COUNT).map(of).sum::<f64>() / f64::from(COUNT);
        let own = |place: u32| f64::from(noise(place, seed));
        let error = |deviation: f64| 5.0 * deviation / f64::from(COUNT).sqrt();
        assert!(mean(&own).abs() < error(0.289));
        assert!((mean(&|i| own(i).powi(2)) - 1.0 / 12.0).abs() < error(0.075));
        let others: [&dyn Fn(u32) -> f64; 4] =
            [&|i| own(i + 1), &|i| own(2 * i + 1), &|i| f64::from(noise(i, [seed[0] + 1, seed[1] + 1])), &|i| {
                f64::from(noise(i, [seed[0], seed[1] + 1]))
            }];
        for other in others {
            assert!(mean(&|i| own(i) * other(i)).abs() < error(1.0 / 12.0));
        }
        assert!((0..COUNT).all(|i| (-0.5..0.5).contains(&own(i))));
    }
}
