//! A number for each pixel of an image, of which a metric is the mean over a region.

use burn::tensor::Tensor;
use light4gs_data::PixelMask;

/// The worst pixels are one in 20: 5 %.
const WORST_PART: usize = 20;

/// `[H, W]` numbers, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct PixelMap(Vec<f32>);

impl PixelMap {
    /// The mean over the channels of a map `[H, W, C]`.
    pub fn of(map: Tensor<3>) -> Self {
        let channels = map.dims()[2];
        let values: Vec<f32> = map.into_data().iter::<f32>().collect();
        Self(values.chunks_exact(channels.max(1)).map(|pixel| pixel.iter().sum::<f32>() / channels as f32).collect())
    }

    /// The mean over the pixels of a mask of the same size, and their number; none where the mask is empty.
    pub fn mean_over(&self, mask: &PixelMask) -> Option<(f64, u64)> {
        let inside = self.0.iter().zip(&mask.pixels).filter(|(_, inside)| **inside != 0).map(|(value, _)| *value);
        mean(inside)
    }

    /// The mean over the 5 % of the pixels that have the largest numbers, and the number of those pixels (rounded up);
    /// none without pixels.
    pub fn mean_of_worst(&self) -> Option<(f64, u64)> {
        let mut values = self.0.clone();
        let count = values.len().div_ceil(WORST_PART);
        if count < values.len() {
            values.select_nth_unstable_by(count, |a, b| b.total_cmp(a));
        }
        mean(values[..count].iter().copied())
    }
}

fn mean(values: impl Iterator<Item = f32>) -> Option<(f64, u64)> {
    let (sum, count) = values.fold((0.0, 0u64), |(sum, count), value| (sum + f64::from(value), count + 1));
    (count > 0).then(|| (sum / count as f64, count))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_over_regions() {
        let map = PixelMap(vec![1.0, 2.0, 4.0, 8.0]);
        let mask = |pixels: [u8; 4]| PixelMask { width: 2, height: 2, pixels: pixels.into() };
        assert_eq!(map.mean_over(&mask([1, 0, 0, 1])), Some((4.5, 2)));
        assert_eq!(map.mean_over(&mask([0; 4])), None);
        assert_eq!(map.mean_of_worst(), Some((8.0, 1)));
        let counted = |count: usize| PixelMap((0..count).map(|i| (i * 7 % count) as f32).collect()).mean_of_worst();
        assert_eq!([counted(20), counted(40), counted(41)], [Some((19.0, 1)), Some((38.5, 2)), Some((39.0, 3))]);
        assert_eq!(PixelMap(Vec::new()).mean_of_worst(), None);
    }
}
