//! A few numbers for each of several units, such as frames or cameras, with moments of their own.
//!
//! They are on the host: a view needs one row of them, and the optimizer steps only the rows of the views that an iteration
//! has seen. With one optimizer over all rows, the momentum of one frame would still move it while others are looked at.

use std::collections::BTreeMap;

/// Adam's usual constants, those of [`Adam`](crate::optimization::adam::Adam).
const BETAS: [f32; 2] = [0.9, 0.999];
const EPSILON: f32 = 1e-15;

/// `N` numbers for each unit, all 0 at the beginning.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Rows<const N: usize> {
    pub(super) values: Vec<[f32; N]>,
    moments: [Vec<[f32; N]>; 2],
    steps: Vec<u32>,
    /// The row of each training frame.
    of_frame: Vec<usize>,
    /// The first training frame of each row.
    first_frames: Vec<usize>,
}

impl<const N: usize> Rows<N> {
    /// A row for each different key of the training frames, in the order in which they occur. `None` for a single one, which
    /// could differ from nothing.
    pub(super) fn by<K: Ord>(keys: impl Iterator<Item = K>) -> Option<Self> {
        let mut rows = BTreeMap::new();
        let (mut of_frame, mut first_frames) = (Vec::new(), Vec::new());
        for (frame, key) in keys.enumerate() {
            let row = *rows.entry(key).or_insert_with(|| {
                first_frames.push(frame);
                first_frames.len() - 1
            });
            of_frame.push(row);
        }
        let count = first_frames.len();
        let zeros = || vec![[0.0; N]; count];
        let made = Self { values: zeros(), moments: [zeros(), zeros()], steps: vec![0; count], of_frame, first_frames };
        (count > 1).then_some(made)
    }

    pub(super) fn len(&self) -> usize {
        self.values.len()
    }

    /// The row of a training frame.
    pub(super) fn row(&self, frame: usize) -> usize {
        self.of_frame[frame]
    }

    /// The numbers of a training frame.
    pub(super) fn of(&self, frame: usize) -> [f32; N] {
        self.values[self.row(frame)]
    }

    /// A training frame of each row: the first.
    pub(super) fn first_frames(&self) -> impl Iterator<Item = usize> {
        self.first_frames.iter().copied()
    }

    /// One step of Adam for the row of a training frame. `rates` gives the rates for the number of rows and the steps that this
    /// one has taken.
    pub(super) fn step(&mut self, frame: usize, gradient: [f32; N], rates: impl Fn(usize, u32) -> [f32; N]) {
        let row = self.row(frame);
        let rates = rates(self.len(), self.steps[row]);
        let [first, second] = &mut self.moments;
        self.steps[row] = self.steps[row].saturating_add(1);
        let debiased = BETAS.map(|beta| 1.0 - beta.powi(self.steps[row].try_into().unwrap_or(i32::MAX)));
        for column in 0..N {
            let value = gradient[column];
            let mix = |old: &mut f32, new: f32, beta: f32| {
                *old = beta * *old + (1.0 - beta) * new;
                *old
            };
            let mean = mix(&mut first[row][column], value, BETAS[0]) / debiased[0];
            let square = mix(&mut second[row][column], value * value, BETAS[1]) / debiased[1];
            self.values[row][column] -= rates[column] * mean / (square.sqrt() + EPSILON);
        }
    }

    /// The numbers for a checkpoint, by name.
    pub(super) fn state(&self, name: &str, into: &mut BTreeMap<String, Vec<f32>>) {
        let [first, second] = &self.moments;
        let steps = self.steps.iter().map(|step| *step as f32).collect();
        let tables = [("values", &self.values), ("first", first), ("second", second)];
        into.extend(tables.map(|(what, table)| (format!("{name}.{what}"), table.as_flattened().to_vec())));
        into.insert(format!("{name}.steps"), steps);
    }

    /// Takes the numbers of a checkpoint.
    ///
    /// # Errors
    /// As text: a table that is missing, or has another length, or numbers that training cannot have produced.
    pub(super) fn restore(&mut self, name: &str, state: &mut BTreeMap<String, Vec<f32>>) -> Result<(), String> {
        let count = self.len();
        let mut take = |what: &str, width: usize| {
            let name = format!("corrections.{name}.{what}");
            let values = state.remove(name.trim_start_matches("corrections."));
            let values = values.ok_or_else(|| format!("tensor `{name}` is missing"))?;
            match values.len() == width * count {
                true => Ok(values),
                false => Err(format!("tensor `{name}` has {} numbers, expected {}", values.len(), width * count)),
            }
        };
        let mut table = |what: &str| -> Result<Vec<[f32; N]>, String> { Ok(take(what, N)?.as_chunks().0.to_vec()) };
        let (values, first, second) = (table("values")?, table("first")?, table("second")?);
        let steps = take("steps", 1)?;
        if second.as_flattened().iter().any(|square| *square < 0.0) {
            return Err(format!("tensor `corrections.{name}.second` has a number below 0, expected means of squares"));
        }
        if steps.iter().any(|step| *step < 0.0 || step.fract() != 0.0) {
            return Err(format!("tensor `corrections.{name}.steps` has something else than numbers of steps"));
        }
        self.steps = steps.into_iter().map(|step| step as u32).collect();
        (self.values, self.moments) = (values, [first, second]);
        Ok(())
    }
}

/// The middle value of each column; the mean of the two in the middle where the number of rows is even.
pub(super) fn medians<const N: usize>(rows: &[[f32; N]]) -> [f32; N] {
    std::array::from_fn(|column| {
        let mut values: Vec<f32> = rows.iter().map(|row| row[column]).collect();
        values.sort_by(f32::total_cmp);
        let middle = values.len() / 2;
        if values.len().is_multiple_of(2) { f32::midpoint(values[middle - 1], values[middle]) } else { values[middle] }
    })
}

/// The mean of each column.
pub(super) fn means<const N: usize>(rows: &[[f32; N]]) -> [f32; N] {
    std::array::from_fn(|column| {
        (rows.iter().map(|row| f64::from(row[column])).sum::<f64>() / rows.len() as f64) as f32
    })
}
