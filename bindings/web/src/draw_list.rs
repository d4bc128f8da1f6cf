//! The list for drawing: Gaussians in front of a camera, back to front, with their colors as seen from there.

use light4gs_codec::GaussianArrays;
use light4gs_codec::rendering::{MIN_ALPHA, NEAR};

use crate::gaussians::FLOATS;

/// Numbers of one entry, four texels: those of `FLOATS`, then red, green, blue, and three zeros for padding.
pub const ENTRY: usize = 16;
/// Entries in a row of the texture. Lists are padded to whole rows with transparent entries.
pub const ROW: usize = 256;

const DIGIT_BITS: u32 = 11;
const DIGITS: usize = 1 << DIGIT_BITS;

/// The view from which a list is made.
#[derive(Clone, Copy, Debug)]
pub struct Viewpoint {
    /// The depth of a point is `row · (x, y, z, 1)`.
    pub row: [f32; 4],
    /// The camera's center, world units.
    pub eye: [f32; 3],
    /// Tangent of the angle between the view axis and the cone around it; infinity for everything in front of the
    /// camera. Gaussians that do not reach into the cone are left out.
    pub spread: f32,
}

/// Standard deviations at which the alpha of an opaque Gaussian falls below [`MIN_ALPHA`]: `√(2 ln 255)`, rounded up.
const REACH: f32 = 3.33;

impl Viewpoint {
    fn depth(&self, [x, y, z]: [f32; 3]) -> f32 {
        x * self.row[0] + y * self.row[1] + z * self.row[2] + self.row[3]
    }

    /// Whether a Gaussian at a depth may reach into the cone.
    fn sees(&self, gaussian: &[f32], depth: f32) -> bool {
        let offset: [f32; 3] = std::array::from_fn(|axis| gaussian[axis] - self.eye[axis]);
        let from_axis = (offset.iter().map(|x| x * x).sum::<f32>() - depth * depth).max(0.0).sqrt();
        // The trace of the covariance is no less than the largest variance.
        let radius = REACH * (gaussian[4] + gaussian[7] + gaussian[9]).sqrt();
        // At the border of the cone a sphere touches it where it is a little farther from the axis.
        from_axis <= self.spread * depth + radius * (1.0 + self.spread * self.spread).sqrt()
    }
}

/// Gaussians that are drawn, as computed last.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Drawn<'a> {
    /// [`FLOATS`] numbers for each Gaussian.
    pub(crate) packed: &'a [f32],
    pub(crate) gaussians: &'a GaussianArrays,
    /// Who draws them: a list of the Gaussians of the stream that are hidden, and a weight. The weight of a Gaussian is the sum of
    /// those that do not hide it; what a list does not have is not hidden.
    pub(crate) shares: &'a [Share<'a>],
    /// Which Gaussians of the stream they are; empty where they are all.
    pub(crate) indices: &'a [u32],
}

/// Hidden Gaussians, and a weight.
pub(crate) type Share<'a> = (&'a [bool], f32);

/// All are drawn as they are.
pub(crate) const WHOLE: &[Share<'_>] = &[(&[], 1.0)];

/// The weights of a moment have the sum 1, but for rounding.
const NEARLY_ONE: f32 = 1.0 - 1e-5;

impl Drawn<'_> {
    /// The opacity with which a Gaussian is drawn: `1 - (1 - o)^weight`.
    fn opacity(&self, index: usize) -> f32 {
        let of_stream = self.indices.get(index).map_or(index, |&index| index as usize);
        let is_shown = |hidden: &[bool]| !hidden.get(of_stream).copied().unwrap_or(false);
        let weight: f32 = self.shares.iter().filter(|(hidden, _)| is_shown(hidden)).map(|(_, weight)| weight).sum();
        let opacity = self.packed[FLOATS * index + 3];
        if weight >= NEARLY_ONE { opacity } else { 1.0 - (1.0 - opacity).powf(weight) }
    }
}

/// A list, and memory that is used again for the next one.
#[derive(Debug, Default)]
pub(crate) struct DrawList {
    keys: Vec<(u32, u32)>,
    other: Vec<(u32, u32)>,
    entries: Vec<f32>,
}

impl DrawList {
    /// The Gaussians that a viewpoint sees, farthest first, of equal ones the later first.
    pub(crate) fn make(&mut self, parts: &[Drawn<'_>], viewpoint: &Viewpoint) -> &[f32] {
        let eye = viewpoint.eye;
        let all = viewpoint.spread == f32::INFINITY;
        self.keys.clear();
        let mut begin = 0;
        for part in parts {
            for (index, gaussian) in part.packed.chunks_exact(FLOATS).enumerate() {
                let depth = viewpoint.depth([gaussian[0], gaussian[1], gaussian[2]]);
                let near = depth > NEAR && gaussian[3] >= MIN_ALPHA && (all || viewpoint.sees(gaussian, depth));
                if near && part.opacity(index) >= MIN_ALPHA {
                    // Depths are positive, so their bits sort as they do.
                    self.keys.push((depth.to_bits(), begin + index as u32));
                }
            }
            begin += part.gaussians.len() as u32;
        }
        self.sort();
        self.entries.clear();
        self.entries.reserve(ENTRY * self.keys.len().next_multiple_of(ROW));
        for &(_, index) in self.keys.iter().rev() {
            let Some((part, index)) = find(parts, index as usize) else { continue };
            let gaussian = &part.packed[FLOATS * index..][..FLOATS];
            let color = seen_color(part.gaussians, index, std::array::from_fn(|axis| gaussian[axis] - eye[axis]));
            if color.iter().all(|value| value.is_finite()) {
                self.entries.extend_from_slice(&gaussian[..3]);
                self.entries.push(part.opacity(index));
                self.entries.extend_from_slice(&gaussian[4..]);
                self.entries.extend_from_slice(&color);
                self.entries.extend_from_slice(&[0.0; ENTRY - FLOATS - 3]);
            }
        }
        self.entries.resize(self.entries.len().next_multiple_of(ENTRY * ROW), 0.0);
        &self.entries
    }

    /// Sorts by rising key; entries with equal keys keep their order.
    fn sort(&mut self) {
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
    }
}

/// The part that has a Gaussian, and its number there.
fn find<'a>(parts: &'a [Drawn<'a>], mut index: usize) -> Option<(&'a Drawn<'a>, usize)> {
    for part in parts {
        if index < part.gaussians.len() {
            return Some((part, index));
        }
        index -= part.gaussians.len();
    }
    None
}

/// The color of a Gaussian at an offset from the camera: `max(0, 0.5 + Σ basis · coefficient)`.
fn seen_color(gaussians: &GaussianArrays, index: usize, offset: [f32; 3]) -> [f32; 3] {
    let length = offset.iter().map(|x| x * x).sum::<f32>().sqrt();
    let direction = if length > 0.0 { offset.map(|x| x / length) } else { [0.0; 3] };
    let mut color = gaussians.sh_dc[index].map(|value| 0.5 + 0.282_094_8 * value);
    let rest = gaussians.sh_rest.len() / gaussians.len();
    let coefficients = &gaussians.sh_rest[rest * index..][..rest];
    for (basis, coefficient) in basis(direction).iter().zip(coefficients.chunks_exact(3)) {
        color.iter_mut().zip(coefficient).for_each(|(sum, value)| *sum += basis * value);
    }
    color.map(|value| if value < 0.0 { 0.0 } else { value })
}

/// Real spherical harmonics of degrees 1 to 3, with the signs of the original 3DGS.
fn basis([x, y, z]: [f32; 3]) -> [f32; 15] {
    let (xx, yy, zz) = (x * x, y * y, z * z);
    [
        -0.488_602_5 * y,
        0.488_602_5 * z,
        -0.488_602_5 * x,
        1.092_548_4 * x * y,
        -1.092_548_4 * y * z,
        0.315_391_57 * (2.0 * zz - xx - yy),
        -1.092_548_4 * x * z,
        0.546_274_2 * (xx - yy),
        -0.590_043_6 * y * (3.0 * xx - yy),
        2.890_611_4 * x * y * z,
        -0.457_045_8 * y * (4.0 * zz - xx - yy),
        0.373_176_34 * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        -0.457_045_8 * x * (4.0 * zz - xx - yy),
        1.445_305_7 * z * (xx - yy),
        -0.590_043_6 * x * (xx - 3.0 * yy),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gaussians along z whose index is their red: `2 · index` before the harmonics' scale.
    fn along_z(depths: &[f32]) -> (Vec<f32>, GaussianArrays) {
        let count = depths.len();
        let mut packed = vec![0.0; FLOATS * count];
        for (gaussian, &z) in packed.chunks_exact_mut(FLOATS).zip(depths) {
            (gaussian[2], gaussian[3]) = (z, 1.0);
        }
        let sh_dc = (0..count).map(|index| [index as f32 / 0.282_094_8, 0.0, -9.0]).collect();
        (packed, GaussianArrays { means: vec![[0.0; 3]; count], sh_dc, ..GaussianArrays::default() })
    }

    fn drawn((packed, gaussians): &(Vec<f32>, GaussianArrays)) -> Drawn<'_> {
        Drawn { packed, gaussians, shares: WHOLE, indices: &[] }
    }

    fn order(list: &mut DrawList, scene: &(Vec<f32>, GaussianArrays), z: f32) -> Vec<usize> {
        let viewpoint = Viewpoint { row: [0.0, 0.0, z, 0.0], eye: [0.0; 3], spread: f32::INFINITY };
        let entries = list.make(&[drawn(scene)], &viewpoint);
        assert!(entries.len().is_multiple_of(ENTRY * ROW));
        let drawn = entries.chunks_exact(ENTRY).filter(|entry| entry[3] > 0.0);
        drawn.map(|entry| (entry[FLOATS] - 0.5).round() as usize).collect()
    }

    #[test]
    fn farthest_first_ties_by_index_and_nothing_behind_the_camera() {
        let mut scene = along_z(&[5.0, 0.2, 1.0, -3.0, 5.0, 1e20, 0.25, f32::NAN, 2.0]);
        scene.0[FLOATS * 8 + 3] = 0.001;
        let mut list = DrawList::default();
        assert_eq!(order(&mut list, &scene, 1.0), [5, 4, 0, 2, 6]);
        // The same memory is used again, for the view from the other side.
        assert_eq!(order(&mut list, &scene, -1.0), [3]);
    }

    #[test]
    fn parts_are_sorted_together_and_hidden_ones_left_out() {
        let (first, second) = (along_z(&[5.0, 3.0, 1.0]), along_z(&[4.0, 2.0]));
        let viewpoint = Viewpoint { row: [0.0, 0.0, 1.0, 0.0], eye: [0.0; 3], spread: f32::INFINITY };
        let depths = |parts: &[Drawn<'_>]| {
            let mut list = DrawList::default();
            let drawn = list.make(parts, &viewpoint).chunks_exact(ENTRY).filter(|entry| entry[3] > 0.0);
            drawn.map(|entry| entry[2]).collect::<Vec<_>>()
        };
        let [base, segment] = [&first, &second].map(drawn);
        assert_eq!(depths(&[base, segment]), [5.0, 4.0, 3.0, 2.0, 1.0]);
        let hidden: [Share<'_>; 1] = [(&[false, true], 1.0)];
        assert_eq!(depths(&[Drawn { shares: &hidden, ..base }, segment]), [5.0, 4.0, 2.0, 1.0]);
        // A level of detail has some of the Gaussians: here the stream's numbers 1, 4 and 0.
        assert_eq!(depths(&[Drawn { shares: &hidden, indices: &[1, 4, 0], ..base }, segment]), [4.0, 3.0, 2.0, 1.0]);
    }

    #[test]
    fn around_a_join_opacities_are_shared() {
        let mut scene = along_z(&[1.0, 2.0, 3.0, 4.0]);
        scene.0.chunks_exact_mut(FLOATS).for_each(|gaussian| gaussian[3] = 0.75);
        // Nobody hides the first, one of them the second or the third, both the last.
        let shares: [Share<'_>; 2] = [(&[false, true, false, true], 0.5), (&[false, false, true, true], 0.5)];
        let viewpoint = Viewpoint { row: [0.0, 0.0, 1.0, 0.0], eye: [0.0; 3], spread: f32::INFINITY };
        let mut list = DrawList::default();
        let entries = list.make(&[Drawn { shares: &shares, ..drawn(&scene) }], &viewpoint);
        let opacities: Vec<f32> = entries.chunks_exact(ENTRY).map(|entry| entry[3]).filter(|&one| one > 0.0).collect();
        assert_eq!(opacities, [0.5, 0.5, 0.75]);
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
        let mut expected: Vec<usize> = (0..5000).collect();
        expected.sort_by(|&a, &b| depths[b].total_cmp(&depths[a]).then(b.cmp(&a)));
        assert_eq!(order(&mut DrawList::default(), &along_z(&depths), 1.0), expected);
    }

    #[test]
    fn what_does_not_reach_into_the_cone_is_left_out() {
        let viewpoint = Viewpoint { row: [0.0, 0.0, 1.0, -1.0], eye: [0.0, 0.0, 1.0], spread: 0.5 };
        // At a depth of 4 the cone ends 2 from the axis.
        let sees = |x: f32, variance: f32| {
            let gaussian = [x, 0.0, 5.0, 1.0, variance, 0.0, 0.0, 0.0, 0.0, 0.0];
            viewpoint.sees(&gaussian, viewpoint.depth([x, 0.0, 5.0]))
        };
        assert!(sees(0.0, 0.0) && sees(1.99, 0.0) && !sees(-2.01, 0.0));
        // Three standard deviations across, where the way to the border is 0.5 · cos of the cone's angle.
        assert!(sees(2.5, 0.04) && !sees(2.8, 0.04) && sees(-2.8, 1.0));
    }

    #[test]
    fn colors_follow_the_direction_and_are_cut_at_black() {
        let (_, mut gaussians) = along_z(&[1.0]);
        (gaussians.sh_degree, gaussians.sh_rest) = (1, vec![0.0; 9]);
        gaussians.sh_rest[3..6].copy_from_slice(&[1.0, 0.0, 0.0]); // along z
        let seen = |z: f32| seen_color(&gaussians, 0, [0.0, 0.0, z]);
        assert!(
            (seen(3.0)[0] - (0.5 + 0.488_602_5)).abs() < 1e-6 && (seen(-2.0)[0] - (0.5 - 0.488_602_5)).abs() < 1e-6
        );
        assert_eq!(seen(1.0)[2], 0.0);
        assert_eq!(seen(0.0)[0], 0.5);
    }
}
