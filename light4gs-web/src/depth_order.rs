//! Back to front.

use crate::gaussians::FLOATS;

/// What lies nearer along the view axis is not drawn, as in the renderer of the program.
const NEAR: f32 = 0.2;
const DIGIT_BITS: u32 = 11;
const DIGITS: usize = 1 << DIGIT_BITS;

/// Memory of the sort.
#[derive(Debug, Default)]
pub(crate) struct DepthOrder {
    keys: Vec<(u32, u32)>,
    other: Vec<(u32, u32)>,
    order: Vec<u32>,
}

impl DepthOrder {
    /// The Gaussians in front of the camera, farthest first, of equal ones the later first. `row` gives the depth:
    /// `row · (x, y, z, 1)`. What is transparent is left out.
    pub(crate) fn sort(&mut self, packed: &[f32], row: [f32; 4]) -> &[u32] {
        self.keys.clear();
        for (index, gaussian) in packed.chunks_exact(FLOATS).enumerate() {
            let depth = gaussian[0] * row[0] + gaussian[1] * row[1] + gaussian[2] * row[2] + row[3];
            if depth > NEAR && gaussian[3] >= 1.0 / 255.0 {
                // Depths are positive, so their bits sort as they do.
                self.keys.push((depth.to_bits(), index as u32));
            }
        }
        self.other.resize(self.keys.len(), (0, 0));
        // The sign is 0: 31 bits are left, three digits.
        for digit in 0..3 {
            let place = |key: u32| (key >> (digit * DIGIT_BITS)) as usize % DIGITS;
            let mut starts = [0u32; DIGITS];
            self.keys.iter().for_each(|&(key, _)| starts[place(key)] += 1);
            let mut sum = 0;
            for start in &mut starts {
                sum += std::mem::replace(start, sum);
            }
            for &(key, index) in &self.keys {
                let start = &mut starts[place(key)];
                self.other[*start as usize] = (key, index);
                *start += 1;
            }
            std::mem::swap(&mut self.keys, &mut self.other);
        }
        self.order.clear();
        self.order.extend(self.keys.iter().rev().map(|&(_, index)| index));
        &self.order
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn farthest_first_ties_by_index_and_nothing_behind_the_camera() {
        let depths = [5.0, 0.2, 1.0, -3.0, 5.0, 1e20, 0.25, f32::NAN, f32::INFINITY];
        let mut packed: Vec<f32> =
            depths.iter().flat_map(|&z| [[0.0, 0.0, z, 1.0], [0.0; 4], [0.0; 4]]).flatten().collect();
        packed.extend([0.0, 0.0, 2.0, 0.001].into_iter().chain([0.0; 8]));
        let mut order = DepthOrder::default();
        assert_eq!(order.sort(&packed, [0.0, 0.0, 1.0, 0.0]), [8, 5, 4, 0, 2, 6]);
        // The same memory again, seen from the other side.
        assert_eq!(order.sort(&packed, [0.0, 0.0, -1.0, 0.0]), [3]);
    }

    #[test]
    fn many_are_sorted_as_the_library_sorts() {
        let mut state = 1u32;
        let mut random = || {
            state = state.wrapping_mul(1664525).wrapping_add(1013904223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        let depths: Vec<f32> =
            (0..5000).map(|_| 0.3 + 10.0 * (random() * 64.0).floor() / 64.0 + 0.001 * random()).collect();
        let packed: Vec<f32> =
            depths.iter().flat_map(|&z| [[0.0, 0.0, z, 1.0], [0.0; 4], [0.0; 4]]).flatten().collect();
        let mut expected: Vec<u32> = (0..5000).collect();
        expected.sort_by(|&a, &b| depths[b as usize].total_cmp(&depths[a as usize]).then(b.cmp(&a)));
        assert_eq!(DepthOrder::default().sort(&packed, [0.0, 0.0, 1.0, 0.0]), expected);
    }
}
