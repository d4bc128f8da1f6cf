//! The symbols of one plane, in order.

use super::plane_parameters::{Part, PlaneParameters, RowParameters};
use crate::{
    adaptive::Damaged,
    entropy::{Distribution, SymbolCoder, gaussian_table},
    network::kernels::{AnchorMap, Columns},
    parallel,
};

/// Rows whose parameters are computed together.
pub(super) const BATCH: usize = 16;

/// The grid of the values of a plane: a value is `(symbol + mean) * step + center`, each operation rounded to float32.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid {
    pub(super) step: f32,
    pub(super) center: f32,
}

impl Grid {
    fn symbol(self, value: f32, mean: f32) -> i32 {
        nearest((value - self.center) / self.step, mean)
    }

    fn value(self, symbol: i32, mean: f32) -> f32 {
        (symbol as f32 + mean) * self.step + self.center
    }
}

/// The integer whose sum with `mean` is nearest to `value`, both in units of the step. Values out of range saturate,
/// and are refused later.
pub(crate) fn nearest(value: f32, mean: f32) -> i32 {
    // In float32 the difference from a large mean would be rounded, to 1/8 at 2^20, and the value be further than half
    // a step from its symbol's.
    (f64::from(value) - f64::from(mean)).round_ties_even() as i32
}

/// Codes the values `[M, height, width]` of a plane, with one coder for each part. An encoder's values are replaced by
/// the decoded ones.
///
/// Order within a part: row, channel, column.
pub(super) fn walk<C: SymbolCoder>(
    parameters: &PlaneParameters<'_>,
    grid: Grid,
    size: [usize; 2],
    values: &mut [f32],
    coders: &mut [(Part, C)],
) -> Result<(), Damaged> {
    let mut anchors = None;
    for (part, coder) in coders {
        if *part == Part::Others {
            anchors = Some(AnchorMap::new(values, size, grid.center));
        }
        for first in (0..size[0]).step_by(BATCH) {
            let rows = BATCH.min(size[0] - first);
            let batch = parallel::map(rows, |row| Row::of(parameters, first + row, *part, anchors.as_ref()));
            for row in batch {
                row.walk(grid, size, values, coder)?;
            }
        }
    }
    Ok(())
}

/// The positions of one row and their distributions.
struct Row {
    y: usize,
    columns: Columns,
    /// Levels of the Gaussian table, `[M, positions]`.
    levels: Vec<u16>,
    /// `[M, positions]`.
    means: Vec<f32>,
}

impl Row {
    fn of(parameters: &PlaneParameters<'_>, y: usize, part: Part, anchors: Option<&AnchorMap>) -> Self {
        let RowParameters { scales, means } = parameters.row(y, part, anchors);
        let table = gaussian_table();
        let levels = scales.into_iter().map(|scale| table.level(scale)).collect();
        Self { y, columns: part.columns(y), levels, means }
    }

    fn walk<C: SymbolCoder>(
        &self,
        grid: Grid,
        [height, width]: [usize; 2],
        values: &mut [f32],
        coder: &mut C,
    ) -> Result<(), Damaged> {
        let levels: &[Distribution] = &gaussian_table().levels;
        let Columns { first, step } = self.columns;
        let count = (width - first).div_ceil(step);
        let channels = self.levels.chunks_exact(count).zip(self.means.chunks_exact(count));
        for (channel, (row_levels, row_means)) in channels.enumerate() {
            let start = (channel * height + self.y) * width;
            let targets = values[start + first..start + width].iter_mut().step_by(step);
            for ((value, &level), &mean) in targets.zip(row_levels).zip(row_means) {
                let symbol = coder.code(levels, level, || grid.symbol(*value, mean))?;
                *value = grid.value(symbol, mean);
            }
        }
        Ok(())
    }
}
