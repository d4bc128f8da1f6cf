//! For each Gaussian, the nearest ones of those that a decoder already has.

/// How many neighbors a Gaussian has.
pub(super) const NEIGHBORS: usize = 4;
/// How far back in Morton order they are searched. Most Gaussians that are near in space are near in this order.
const WINDOW: usize = 64;

/// For each cell the indices of the nearest cells before it, nearest first; of two equally near ones, the later first.
///
/// The first cell has no neighbors: it gets its own index, which the caller must expect. The next few cells repeat
/// their nearest neighbor. Only integers are compared, so all machines agree.
pub(super) fn nearest_before(cells: &[[i32; 3]]) -> Vec<[u32; NEIGHBORS]> {
    let mut found = Vec::with_capacity(cells.len());
    for (index, cell) in cells.iter().enumerate() {
        let mut nearest = [(i64::MAX, index); NEIGHBORS];
        for other in (index.saturating_sub(WINDOW)..index).rev() {
            let [x, y, z] = [0, 1, 2].map(|axis| i64::from(cell[axis] - cells[other][axis]));
            let candidate = (x * x + y * y + z * z, other);
            if candidate.0 < nearest[NEIGHBORS - 1].0 {
                let place = nearest.partition_point(|kept| kept.0 <= candidate.0);
                nearest[place..].rotate_right(1);
                nearest[place] = candidate;
            }
        }
        let first = nearest[0].1;
        found.push(nearest.map(|(distance, other)| if distance == i64::MAX { first } else { other } as u32));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbors_come_before() {
        let cells = [[0, 0, 0], [9, 0, 0], [1, 0, 0], [1, 0, 0], [8, 0, 0], [0, 0, 1]];
        assert_eq!(nearest_before(&cells), [[0; 4], [0; 4], [0, 1, 0, 0], [2, 0, 1, 2], [1, 3, 2, 0], [0, 3, 2, 4]]);
        assert_eq!(nearest_before(&[]), [[0; 4]; 0]);
    }
}
