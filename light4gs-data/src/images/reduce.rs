//! Images of fewer pixels, each for a square block.

use super::mask::PixelMask;
use super::rgb::RgbImage8;

impl RgbImage8 {
    /// The image that [`crate::Camera::reduced`] sees: a pixel is the rounded mean of `factor`×`factor` pixels.
    ///
    /// # Panics
    /// If `factor` is 0.
    pub fn reduced(&self, factor: u32) -> Self {
        let size = [self.width / factor, self.height / factor];
        let pixels = reduce::<3>(&self.pixels, self.width, size, factor, |sum, count| (sum + count / 2) / count);
        Self { width: size[0], height: size[1], pixels }
    }
}

impl PixelMask {
    /// The mask of a reduced image: marked where all pixels of a block are.
    ///
    /// # Panics
    /// If `factor` is 0.
    pub fn reduced(&self, factor: u32) -> Self {
        let size = [self.width / factor, self.height / factor];
        let pixels = reduce::<1>(&self.pixels, self.width, size, factor, |sum, count| sum / count);
        Self { width: size[0], height: size[1], pixels }
    }
}

/// `size` = `[width, height]` blocks of an image `[H, width, C]`: `value(sum, number)` of the pixels of each block,
/// channel by channel. Columns and rows that are left over at the right and the lower edge belong to no block.
fn reduce<const C: usize>(
    pixels: &[u8],
    width: u32,
    size: [u32; 2],
    factor: u32,
    value: impl Fn(u32, u32) -> u32,
) -> Vec<u8> {
    let [columns, rows] = size.map(|side| side as usize);
    let (width, side) = (width as usize * C, factor as usize);
    let mut reduced = Vec::with_capacity(columns * rows * C);
    let mut sums = vec![[0_u32; C]; columns];
    for row in 0..rows {
        sums.fill([0; C]);
        for line in pixels[row * side * width..][..side * width].chunks_exact(width) {
            for (sum, block) in sums.iter_mut().zip(line.chunks_exact(side * C)) {
                for pixel in block.chunks_exact(C) {
                    (0..C).for_each(|channel| sum[channel] += u32::from(pixel[channel]));
                }
            }
        }
        reduced.extend(sums.iter().flatten().map(|sum| value(*sum, factor * factor) as u8));
    }
    reduced
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_is_the_mean_of_its_block() {
        let pixels = (0..5 * 3).flat_map(|i| [i, 10 * i, 255]).collect();
        let reduced = RgbImage8 { width: 5, height: 3, pixels }.reduced(2);
        // Pixels 0, 1, 5, 6 and 2, 3, 7, 8; a column and a row are left over.
        assert_eq!((reduced.width, reduced.height), (2, 1));
        assert_eq!(reduced.pixels, [3, 30, 255, 5, 50, 255]);
    }

    #[test]
    fn a_block_is_marked_where_all_of_it_is() {
        let mask = PixelMask { width: 4, height: 2, pixels: vec![1, 1, 1, 0, 1, 1, 1, 1] };
        assert_eq!(mask.reduced(2), PixelMask { width: 2, height: 1, pixels: vec![1, 0] });
        assert_eq!(mask.reduced(1), mask);
    }
}
