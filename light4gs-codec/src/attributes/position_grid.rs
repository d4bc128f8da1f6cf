//! Rounding positions to a grid, and the order of its cells.

use std::array::from_fn;

use super::{SECTION, steps::check_step};
use crate::{
    CodecError,
    adaptive::{LARGEST_STEP, index, reconstruct},
    bytes::{Reader, Writer},
    parallel,
};

/// Most bits of a coordinate, so that three fit into a Morton code.
const MOST_BITS: u32 = 20;
/// The largest coordinate in world units, so that no position reconstructs to infinity.
const LARGEST_POSITION: f32 = LARGEST_STEP;

/// A cubic grid over the bounding box of all positions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PositionGrid {
    /// The smallest corner of the box, in world units.
    origin: [f32; 3],
    /// The distance between two cells, in world units.
    step: f32,
    /// Bits of a coordinate.
    bits: u32,
}

impl PositionGrid {
    /// The grid of `means` with about `step` between cells.
    pub(super) fn new(means: &[[f32; 3]], step: f32) -> Result<Self, CodecError> {
        let Some(&first) = means.first() else {
            return Ok(Self { origin: [0.0; 3], step: 1.0, bits: 0 });
        };
        check_positions(means)?;
        let (mut least, mut most) = (first, first);
        for (index, &value) in means.as_flattened().iter().enumerate() {
            let axis = index % 3;
            least[axis] = least[axis].min(value);
            most[axis] = most[axis].max(value);
        }
        let extent = (0..3).map(|axis| f64::from(most[axis]) - f64::from(least[axis])).fold(0.0, f64::max);
        let finest = (extent / f64::from((1_u32 << MOST_BITS) - 1)) as f32;
        // Even after rounding to float32 the last cell must be within the index range.
        let step = step.clamp(f32::MIN_POSITIVE, LARGEST_STEP).max(finest.next_up());
        let last = (extent / f64::from(step)).round() as u32;
        Ok(Self { origin: least, step, bits: u32::BITS - last.leading_zeros() })
    }

    /// Bits of a Morton code.
    pub(super) fn code_bits(&self) -> u32 {
        3 * self.bits
    }

    /// The cell of a position of this grid's box.
    pub(super) fn cell(&self, mean: [f32; 3]) -> [i32; 3] {
        let last = (1 << self.bits) - 1;
        from_fn(|axis| index(mean[axis], self.step, self.origin[axis]).map_or(last, |index| index.clamp(0, last)))
    }

    /// The rows of positions in the order of their Morton codes, and these codes, ascending.
    pub(super) fn sorted(&self, means: &[[f32; 3]]) -> (Vec<u32>, Vec<u64>) {
        // Rows in one cell stay in their order.
        let mut sorted = parallel::map(means.len(), |row| (morton_code(self.cell(means[row])), row as u32));
        parallel::sort(&mut sorted);
        sorted.into_iter().map(|(code, row)| (row, code)).unzip()
    }

    /// The position of a cell.
    pub(super) fn mean(&self, cell: [i32; 3]) -> [f32; 3] {
        from_fn(|axis| reconstruct(cell[axis], self.step, self.origin[axis]))
    }

    pub(super) fn write(&self, writer: &mut Writer) {
        writer.f32s(&self.origin);
        writer.f32(self.step);
        writer.u8(self.bits as u8);
    }

    pub(super) fn read(reader: &mut Reader<'_>) -> Result<Self, CodecError> {
        let origin: [f32; 3] = reader.group("origin of the grid")?;
        // NaN is in no range.
        if let Some(bad) = origin.iter().find(|value| !(-LARGEST_POSITION..=LARGEST_POSITION).contains(value)) {
            let expected = format!("at most {LARGEST_POSITION:e} on either side of 0");
            return Err(CodecError::invalid(SECTION, "origin of the grid", bad, expected));
        }
        let step = reader.f32("step of position")?;
        check_step("position", step)?;
        let bits = reader.u8("bits of a position")?.into();
        if bits > MOST_BITS {
            return Err(CodecError::invalid(SECTION, "bits of a position", bits, format!("at most {MOST_BITS}")));
        }
        Ok(Self { origin, step, bits })
    }
}

/// Refuses positions that no grid can hold.
pub(crate) fn check_positions(means: &[[f32; 3]]) -> Result<(), CodecError> {
    // NaN is in no range.
    let legal = |value: &f32| (-LARGEST_POSITION..=LARGEST_POSITION).contains(value);
    match means.as_flattened().iter().enumerate().find(|(_, value)| !legal(value)) {
        None => Ok(()),
        Some((index, value)) => {
            let expected = format!("at most {LARGEST_POSITION:e} on either side of 0");
            Err(CodecError::invalid(SECTION, "means", format!("{value:e} in value {index}"), expected))
        }
    }
}

/// A cell as a point, in units of the grid's step: exact, as its squared distances are.
pub(super) fn cell_point(cell: [i32; 3]) -> [f64; 3] {
    cell.map(f64::from)
}

/// The Morton code of a cell: the bits of its coordinates taken in turn, x highest.
pub(super) fn morton_code(cell: [i32; 3]) -> u64 {
    let [x, y, z] = cell.map(|coordinate| spread(coordinate as u64));
    x << 2 | y << 1 | z
}

/// The cell of a Morton code.
pub(super) fn morton_cell(code: u64) -> [i32; 3] {
    [2, 1, 0].map(|shift| gather(code >> shift) as i32)
}

/// Masks of groups of bits. The groups halve in length from mask to mask, and the gaps are twice as long as the groups.
const GROUPS: [u64; 6] = [
    0x0000_0000_001f_ffff,
    0x001f_0000_0000_ffff,
    0x001f_0000_ff00_00ff,
    0x100f_00f0_0f00_f00f,
    0x10c3_0c30_c30c_30c3,
    0x1249_2492_4924_9249,
];

/// Moves bit `i` to bit `3 i`, for 21 bits.
fn spread(mut bits: u64) -> u64 {
    bits &= GROUPS[0];
    for level in 1..6 {
        bits = (bits | bits << (64 >> level)) & GROUPS[level];
    }
    bits
}

/// Moves bit `3 i` to bit `i`, for 21 bits.
fn gather(mut bits: u64) -> u64 {
    bits &= GROUPS[5];
    for level in (1..6).rev() {
        bits = (bits | bits >> (64 >> level)) & GROUPS[level - 1];
    }
    bits
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn a_morton_code_is_its_cell(cell in prop::array::uniform3(0..1 << MOST_BITS)) {
            let code = morton_code(cell);
            prop_assert_eq!(morton_cell(code), cell);
            for bit in 0..60 {
                prop_assert_eq!(code >> bit & 1, cell[2 - bit % 3] as u64 >> (bit / 3) & 1);
            }
        }

        #[test]
        fn positions_are_within_half_a_step(
            means in prop::collection::vec(prop::array::uniform3(-1e3_f32..1e3), 1..20), step in 1e-9_f32..1e3)
        {
            let grid = PositionGrid::new(&means, step).unwrap();
            for mean in means {
                let found = grid.mean(grid.cell(mean));
                for axis in 0..3 {
                    prop_assert!((found[axis] - mean[axis]).abs() <= 0.501 * grid.step + 2e-4, "{} {}", found[axis], mean[axis]);
                }
            }
        }
    }

    #[test]
    fn boxes_of_any_size_have_a_grid() {
        for extent in [0.0, f32::MIN_POSITIVE, 1.0, 1e30] {
            for step in [f32::MIN_POSITIVE, 1e-3, 1e30, f32::INFINITY] {
                let means = [[-extent, 0.0, 0.0], [extent, 0.0, 0.0]];
                let grid = PositionGrid::new(&means, step).unwrap();
                assert!(grid.bits <= MOST_BITS, "{extent} {step}: {grid:?}");
                assert!(
                    means.map(|mean| grid.mean(grid.cell(mean))).as_flattened().iter().all(|value| value.is_finite())
                );
            }
        }
        assert!(
            PositionGrid::new(&[[0.0, 2e30, 0.0]], 1.0).unwrap_err().to_string().contains("means is 2e30 in value 1")
        );
    }
}
