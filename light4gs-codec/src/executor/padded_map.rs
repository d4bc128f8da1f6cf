//! Maps with a border of zeros, and windows of them.

use super::{LANES, Lanes};

/// Columns of a row that are computed together: `first`, `first + step`, ..., [`LANES`] of them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Columns {
    pub(crate) first: usize,
    /// 1 or 2.
    pub(crate) step: usize,
}

/// A map `[channels, height, width]` in a border of zeros, so that a window needs no bounds.
#[derive(Clone, Debug)]
pub(crate) struct PaddedMap {
    pub(crate) channels: usize,
    pub(crate) height: usize,
    pub(crate) width: usize,
    border: usize,
    stride: usize,
    values: Vec<f32>,
}

impl PaddedMap {
    /// A map of zeros with `border` more on each side.
    pub(crate) fn zeros(channels: usize, height: usize, width: usize, border: usize) -> Self {
        // Lanes may reach beyond the end of a row, into the next one; what they find there is not used.
        let stride = width + 2 * border;
        let values = vec![0.0; channels * (height + 2 * border) * stride + 2 * LANES];
        Self { channels, height, width, border, stride, values }
    }

    /// A map of given values `[channels, height, width]`, each less `centre`.
    pub(crate) fn centred(values: &[f32], [height, width]: [usize; 2], centre: f32, border: usize) -> Self {
        let mut map = Self::zeros(values.len() / (height * width), height, width, border);
        for (index, row) in values.chunks_exact(width).enumerate() {
            for (target, &value) in map.row_mut(index / height, index % height).iter_mut().zip(row) {
                *target = value - centre;
            }
        }
        map
    }

    /// One row without its border.
    pub(crate) fn row(&self, channel: usize, y: usize) -> &[f32] {
        let start = self.start(channel, y + self.border) + self.border;
        &self.values[start..start + self.width]
    }

    /// One row without its border.
    pub(crate) fn row_mut(&mut self, channel: usize, y: usize) -> &mut [f32] {
        let start = self.start(channel, y + self.border) + self.border;
        &mut self.values[start..start + self.width]
    }

    /// Where a row begins, counted from the top of the border.
    fn start(&self, channel: usize, bordered_y: usize) -> usize {
        (channel * (self.height + 2 * self.border) + bordered_y) * self.stride
    }

    /// The value of one channel at `columns`, displaced by `(dy, dx)`, which may be as large as the border.
    #[inline]
    pub(super) fn lanes(&self, channel: usize, y: usize, columns: Columns, dy: isize, dx: isize) -> Lanes {
        let row = self.start(channel, (y + self.border).wrapping_add_signed(dy));
        let start = row + (columns.first + self.border).wrapping_add_signed(dx);
        let mut lanes = [0.0; LANES];
        if columns.step == 1 {
            lanes.copy_from_slice(&self.values[start..start + LANES]);
        } else {
            for (lane, pair) in lanes.iter_mut().zip(self.values[start..start + 2 * LANES].chunks_exact(2)) {
                *lane = pair[0];
            }
        }
        lanes
    }
}
