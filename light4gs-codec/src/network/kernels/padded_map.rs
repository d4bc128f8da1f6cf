//! Maps with a border of zeros, and windows of them.

use super::{LANES, Lanes, kept};

/// Columns of a row that are computed together: `first`, `first + step`, ..., [`LANES`] of them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Columns {
    pub(crate) first: usize,
    /// At most 4.
    pub(crate) step: usize,
}

/// The largest [`Columns::step`].
const MOST_STEPS: usize = 4;

/// A map `[channels, height, width]` in a border of zeros, so that a window needs no check of bounds.
#[derive(Clone, Debug)]
pub(crate) struct PaddedMap {
    pub(crate) channels: usize,
    pub(crate) height: usize,
    pub(crate) width: usize,
    pub(crate) border: usize,
    stride: usize,
    values: Vec<f32>,
}

impl PaddedMap {
    /// A map of zeros with `border` added on each side.
    pub(crate) fn zeros(channels: usize, height: usize, width: usize, border: usize) -> Self {
        // Lanes may extend beyond the end of a row, into the next one; their values there are not used.
        let stride = width + 2 * border;
        let values = vec![0.0; channels * (height + 2 * border) * stride + MOST_STEPS * LANES];
        Self { channels, height, width, border, stride, values }
    }

    /// A map of given values `[channels, height, width]`, with `center` subtracted.
    pub(crate) fn centered(values: &[f32], [height, width]: [usize; 2], center: f32, border: usize) -> Self {
        let mut map = Self::zeros(values.len() / (height * width), height, width, border);
        for (index, row) in values.chunks_exact(width).enumerate() {
            for (target, &value) in map.row_mut(index / height, index % height).iter_mut().zip(row) {
                *target = kept(value - center);
            }
        }
        map
    }

    /// Numbers that a map of this size takes.
    pub(crate) fn footprint(channels: u64, [height, width]: [u32; 2], border: usize) -> u64 {
        let side = |length: u32| u64::from(length) + 2 * border as u64;
        let beyond = (MOST_STEPS * LANES) as u64;
        channels.saturating_mul(side(height)).saturating_mul(side(width)).saturating_add(beyond)
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

    /// Where a row begins; `bordered_y` counts from the top of the border.
    #[inline(always)]
    fn start(&self, channel: usize, bordered_y: usize) -> usize {
        (channel * (self.height + 2 * self.border) + bordered_y) * self.stride
    }

    /// The values of one channel at `columns`, displaced by `(dy, dx)`, each at most the border.
    #[inline(always)]
    pub(crate) fn lanes(&self, channel: usize, y: usize, columns: Columns, dy: isize, dx: isize) -> Lanes {
        let row = self.start(channel, (y + self.border).wrapping_add_signed(dy));
        let start = row + (columns.first + self.border).wrapping_add_signed(dx);
        let mut lanes = [0.0; LANES];
        match columns.step {
            1 => lanes.copy_from_slice(&self.values[start..start + LANES]),
            2 => {
                let pairs = self.values[start..start + 2 * LANES].chunks_exact(2);
                lanes.iter_mut().zip(pairs).for_each(|(lane, pair)| *lane = pair[0]);
            }
            step => {
                let places = self.values[start..].iter().step_by(step);
                lanes.iter_mut().zip(places).for_each(|(lane, &value)| *lane = value);
            }
        }
        lanes
    }
}
