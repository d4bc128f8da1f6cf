//! The order in which Gaussians are coded.

use super::{
    neighbors::{NEIGHBORS, nearest_before},
    position_grid::{PositionGrid, cell_point, morton_cell},
    positions,
};
use crate::{CodecError, adaptive::BitEncoder, parallel};

/// Which Gaussians each one is predicted from, for a training whose rate shall know it.
///
/// ```
/// use light4gs_codec::attributes::CodingOrder;
///
/// let order = CodingOrder::new(&[[1.0, 0.0, 0.0], [0.0; 3], [0.9, 0.0, 0.0]], 0.1)?;
/// // Coded are the second, the third, the first.
/// assert_eq!(order.neighbors(&[0, 1]), [[2, 1, 2, 2], [1; 4]]);
/// # Ok::<(), light4gs_codec::CodecError>(())
/// ```
#[derive(Clone, Debug)]
pub struct CodingOrder {
    /// The rows, in order.
    rows: Vec<u32>,
    /// The place of each row in the order.
    places: Vec<u32>,
    /// Morton codes of the cells, in order, and their bits.
    codes: Vec<u64>,
    code_bits: u32,
    /// Cells, in order.
    points: Vec<[f64; 3]>,
}

impl CodingOrder {
    /// For positions that are rounded to a grid with this step, in world units.
    ///
    /// # Errors
    /// Positions that are not finite, or beyond ±1e30.
    pub fn new(means: &[[f32; 3]], step: f32) -> Result<Self, CodecError> {
        let grid = PositionGrid::new(means, step)?;
        let (rows, codes) = grid.sorted(means);
        let mut places = vec![0; rows.len()];
        for (place, &row) in rows.iter().enumerate() {
            places[row as usize] = place as u32;
        }
        let points = parallel::map(codes.len(), |place| cell_point(morton_cell(codes[place])));
        Ok(Self { rows, places, codes, code_bits: grid.code_bits(), points })
    }

    /// The bits that the positions take, without the grid.
    pub fn position_bits(&self) -> u64 {
        let mut encoder = BitEncoder::default();
        positions::code(&mut encoder, &mut self.codes.clone(), self.code_bits).expect("an encoder is never damaged");
        8 * encoder.finish().len() as u64
    }

    /// The rows of the Gaussians, `[N]`, along the Morton curve.
    pub fn rows(&self) -> &[u32] {
        &self.rows
    }

    /// For each of some rows, those of the nearest Gaussians that are coded before it, nearest first. The first Gaussian has
    /// its own row.
    ///
    /// # Panics
    /// If there is no such row.
    pub fn neighbors(&self, rows: &[u32]) -> Vec<[u32; NEIGHBORS]> {
        parallel::map(rows.len(), |index| {
            let place = self.places[rows[index] as usize];
            nearest_before(&self.points, place as usize).map(|place| self.rows[place as usize])
        })
    }
}
