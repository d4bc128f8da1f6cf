//! Least squares, and least squares that a few large errors do not spoil.

/// Rounds of [`robust_least_squares`]. More take time and change a file by 0.1 %.
const ROUNDS: usize = 5;

/// The weights with which `inputs` numbers predict another with the least squared error, over `count` examples. `example`
/// sets the inputs of one of them, and returns what they predict. `ridge` is added to the diagonal of the normal equations
/// for each example, so that inputs without variation do no harm.
pub fn least_squares(
    inputs: usize,
    count: usize,
    ridge: f64,
    mut example: impl FnMut(usize, &mut [f64]) -> f64,
) -> Vec<f64> {
    // The right side is the last column.
    let mut equations = vec![vec![0.0; inputs + 1]; inputs];
    let mut row = vec![0.0; inputs + 1];
    for index in 0..count {
        row[inputs] = example(index, &mut row[..inputs]);
        for (equation, &number) in equations.iter_mut().zip(&row) {
            equation.iter_mut().zip(&row).for_each(|(sum, other)| *sum += number * other);
        }
    }
    for (diagonal, equation) in equations.iter_mut().enumerate() {
        equation[diagonal] += ridge * count as f64;
    }
    solve(equations)
}

/// Solves positive definite equations whose last column is the right side, by elimination.
fn solve(mut equations: Vec<Vec<f64>>) -> Vec<f64> {
    let size = equations.len();
    for pivot in 0..size {
        let (done, below) = equations.split_at_mut(pivot + 1);
        let row = &done[pivot];
        for equation in below {
            let factor = equation[pivot] / row[pivot];
            equation[pivot..].iter_mut().zip(&row[pivot..]).for_each(|(number, above)| *number -= factor * above);
        }
    }
    let mut solution = vec![0.0; size];
    for row in (0..size).rev() {
        let known: f64 = (row + 1..size).map(|column| equations[row][column] * solution[column]).sum();
        solution[row] = (equations[row][size] - known) / equations[row][row];
    }
    solution
}

/// As [`least_squares`], but with the least sum of `ln(1 + error²)`, by reweighting (Holland and Welsch, *Robust regression
/// using iteratively reweighted least-squares*, 1977): the error of a Cauchy distribution whose scale is 1.
pub(super) fn robust_least_squares(
    inputs: usize,
    count: usize,
    ridge: f64,
    mut example: impl FnMut(usize, &mut [f64]) -> f64,
) -> Vec<f64> {
    let mut weights = least_squares(inputs, count, ridge, &mut example);
    for _ in 1..ROUNDS {
        weights = least_squares(inputs, count, ridge, |index, row| {
            let wanted = example(index, row);
            let found: f64 = row.iter().zip(&weights).map(|(number, weight)| number * weight).sum();
            let error = wanted - found;
            // Not `powi`, whose last bit is the compiler's choice.
            let importance = (1.0 + error * error).sqrt().recip();
            row.iter_mut().for_each(|number| *number *= importance);
            wanted * importance
        });
    }
    weights
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equations_are_solved() {
        let solution = solve(vec![vec![4.0, 1.0, 2.0, 12.0], vec![1.0, 3.0, 0.0, 7.0], vec![2.0, 0.0, 5.0, 17.0]]);
        for (found, expected) in solution.iter().zip([1.0, 2.0, 3.0]) {
            assert!((found - expected).abs() < 1e-12, "{solution:?}");
        }
    }

    /// A fifth of the examples is far off, to one side.
    #[test]
    fn outliers_do_not_matter() {
        let example = |index: usize, row: &mut [f64]| {
            row.copy_from_slice(&[(index % 17) as f64, (index % 5) as f64]);
            3.0 * row[0] - 2.0 * row[1] + if index.is_multiple_of(5) { 400.0 } else { 0.0 }
        };
        let squares = least_squares(2, 1000, 1e-3, example);
        let robust = robust_least_squares(2, 1000, 1e-3, example);
        assert!((squares[0] - 3.0).abs() > 1.0, "{squares:?}");
        assert!((robust[0] - 3.0).abs() < 0.05 && (robust[1] + 2.0).abs() < 0.05, "{robust:?}");
    }
}
