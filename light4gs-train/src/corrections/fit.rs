//! The fit of exposure, pose and time to a view that was not trained on.
//!
//! A test view has an exposure and a pose of its own, as the training views have, and nothing has learned them. Without a fit
//! its figure would say how far the dataset is off, and not how good the scene is. The scene is not changed. The fit is that
//! of Levenberg and Marquardt, with derivatives by finite differences: it needs no tape, and few images.

use burn::tensor::Tensor;
use glam::{Quat, Vec3};
use light4gs_data::{Camera, Frame};
use light4gs_model::Rendering;
use serde::Serialize;

use super::exposure::{Exposure, bounded, exposed};
use super::poses::Pose;

/// Most steps.
const STEPS: usize = 8;
/// A fit ends where a step takes away less than this share of the squared error.
const LEAST_GAIN: f64 = 1e-3;
/// Share of the diagonal by which a step is damped at first; ten times as much after one that made the error larger.
const DAMPING: f64 = 1e-3;
/// Tries of a step.
const TRIES: usize = 3;
/// Finite differences: motion on the screen in pixels, and share of an interval of time.
const PIXELS: f32 = 0.5;
const INTERVALS: f32 = 0.25;

/// What is fitted to a view.
#[derive(Clone, Copy, Debug)]
pub struct ViewFit {
    /// A gain and an offset of each color channel.
    pub exposure: bool,
    /// A turn and a translation of the camera.
    pub pose: bool,
    /// An offset of the time.
    pub time: bool,
    pub(super) interval: f32,
    pub(super) background: [f32; 3],
}

/// The numbers that fit a view best.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Fitted {
    /// As the view shows the scene's radiance.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exposure: Option<Exposure>,
    /// The correction of its camera.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pose: Option<Pose>,
    /// How much later it was taken than the dataset says, in intervals between two frames.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frames: Option<f32>,
}

/// A state of the fit.
#[derive(Clone, Copy)]
struct Guess {
    exposure: [f32; 6],
    camera: Camera,
    time: f32,
}

/// An image for a guess.
struct Drawn {
    guess: Guess,
    rendering: Rendering,
    /// `[H, W, 3]`, with its exposure.
    image: Tensor<3>,
    /// Mean squared difference from the truth.
    error: f64,
}

impl ViewFit {
    /// Fits a frame whose image is `truth [H, W, 3]`. `render` draws the scene through a camera at a time, on a device
    /// without autodiff. Returns the numbers, and the image that they give, `[H, W, 3]`.
    pub fn fit(
        &self,
        frame: &Frame,
        truth: &Tensor<3>,
        render: impl Fn(&Camera, f32) -> Rendering,
    ) -> (Fitted, Tensor<3>) {
        let draw = |guess: Guess| {
            let rendering = render(&guess.camera, guess.time);
            let image = self.exposed(&rendering, guess.exposure);
            let error = (image.clone() - truth.clone()).powi_scalar(2).mean().into_scalar::<f64>();
            Drawn { guess, rendering, image, error }
        };
        let mut best = draw(Guess { exposure: [0.0; 6], camera: frame.camera, time: frame.time });
        for _ in 0..STEPS {
            let directions = self.directions(&best);
            let columns: Vec<Tensor<2>> = directions.iter().map(|d| self.column(&best, d, &render)).collect();
            let columns = Tensor::cat(columns, 0);
            let rest = (truth.clone() - best.image.clone()).flatten::<1>(0, 2).unsqueeze_dim::<2>(1);
            let system = columns.clone().matmul(Tensor::cat(vec![columns.transpose(), rest], 1));
            let system: Vec<f64> = system.into_data().iter::<f64>().collect();
            let Some(next) = damped(DAMPING).find_map(|damping| {
                let step = solved(&system, directions.len(), damping)?;
                let next = draw(self.moved(best.guess, &directions, &step));
                (next.error < best.error).then_some(next)
            }) else {
                break;
            };
            let over = next.error > (1.0 - LEAST_GAIN) * best.error;
            best = next;
            if over {
                break;
            }
        }
        (self.fitted(frame, &best.guess), best.image)
    }

    fn exposed(&self, rendering: &Rendering, values: [f32; 6]) -> Tensor<3> {
        let values = Tensor::from_floats(values, &rendering.image.device());
        exposed(rendering.image.clone(), rendering.alpha.clone(), values, self.background)
    }

    /// The numbers that are fitted, each with a step that changes the image a little.
    fn directions(&self, drawn: &Drawn) -> Vec<Direction> {
        let mut all = Vec::new();
        if self.exposure {
            all.extend((0..6).map(|number| Direction { what: What::Exposure(number), step: 0.01 }));
        }
        if self.pose {
            let sum = |tensor: &Tensor<2>| tensor.clone().sum().into_scalar::<f32>();
            let depth = sum(&drawn.rendering.depth) / sum(&drawn.rendering.alpha).max(1.0);
            let pixel = PIXELS / drawn.guess.camera.fx;
            let step = |number: usize| if number < 3 { pixel } else { pixel * depth.max(1e-6) };
            all.extend((0..6).map(|number| Direction { what: What::Pose(number), step: step(number) }));
        }
        if self.time {
            // Forward at the beginning, so that the scene still lasts.
            let sign = if drawn.guess.time < 0.5 { 1.0 } else { -1.0 };
            all.push(Direction { what: What::Time, step: sign * INTERVALS * self.interval });
        }
        all
    }

    /// `[1, 3 H W]`: the change of the image by one step in a direction.
    fn column(&self, drawn: &Drawn, direction: &Direction, render: impl Fn(&Camera, f32) -> Rendering) -> Tensor<2> {
        let guess = self.moved(drawn.guess, std::slice::from_ref(direction), &[1.0]);
        let image = match direction.what {
            What::Exposure(_) => self.exposed(&drawn.rendering, guess.exposure),
            _ => self.exposed(&render(&guess.camera, guess.time), guess.exposure),
        };
        (image - drawn.image.clone()).flatten::<1>(0, 2).unsqueeze_dim(0)
    }

    /// A guess after steps along directions.
    fn moved(&self, guess: Guess, directions: &[Direction], steps: &[f64]) -> Guess {
        let mut further = [0.0; 6];
        let mut moved = guess;
        for (direction, step) in directions.iter().zip(steps) {
            let change = direction.step * *step as f32;
            match direction.what {
                What::Exposure(number) => moved.exposure[number] += change,
                What::Pose(number) => further[number] += change,
                What::Time => moved.time = (moved.time + change).clamp(0.0, 1.0),
            }
        }
        moved.exposure = bounded(moved.exposure);
        if self.pose {
            moved.camera = Pose::of(further).corrected(&guess.camera);
        }
        moved
    }

    fn fitted(&self, frame: &Frame, guess: &Guess) -> Fitted {
        let turn = guess.camera.rotation * frame.camera.rotation.transpose();
        let translation = guess.camera.translation - turn * frame.camera.translation;
        let rotation: Vec3 = Quat::from_mat3(&turn).to_scaled_axis();
        Fitted {
            exposure: self.exposure.then(|| Exposure::of(guess.exposure)),
            pose: self.pose.then(|| Pose { rotation: rotation.to_array(), translation: translation.to_array() }),
            frames: self.time.then(|| (guess.time - frame.time) / self.interval),
        }
    }
}

/// A number that is fitted.
#[derive(Clone, Copy)]
enum What {
    /// One of the six of an exposure.
    Exposure(usize),
    /// One of the six of a pose.
    Pose(usize),
    Time,
}

/// A number, and its step.
struct Direction {
    what: What,
    step: f32,
}

/// Shares of the diagonal to try, one after the other.
fn damped(first: f64) -> impl Iterator<Item = f64> {
    (0..TRIES).map(move |attempt| first * 30f64.powi(attempt as i32))
}

/// The solution of the normal equations `[count, count + 1]`, the right side last, with the diagonal times `1 + damping`, by
/// Cholesky's method. `None` where there is none. A number that has no effect stays 0.
fn solved(system: &[f64], count: usize, damping: f64) -> Option<Vec<f64>> {
    let at = |row: usize, column: usize| system[row * (count + 1) + column];
    let mut lower = vec![0.0; count * count];
    for row in 0..count {
        for column in 0..=row {
            let mut value = at(row, column);
            if row == column {
                value = if value > 0.0 { value * (1.0 + damping) } else { 1.0 };
            }
            let sum: f64 = (0..column).map(|k| lower[row * count + k] * lower[column * count + k]).sum();
            value -= sum;
            lower[row * count + column] = match row == column {
                true if value > 0.0 => value.sqrt(),
                true => return None,
                false => value / lower[column * count + column],
            };
        }
    }
    let mut solution: Vec<f64> = (0..count).map(|row| at(row, count)).collect();
    for row in 0..count {
        let sum: f64 = (0..row).map(|k| lower[row * count + k] * solution[k]).sum();
        solution[row] = (solution[row] - sum) / lower[row * count + row];
    }
    for row in (0..count).rev() {
        let sum: f64 = (row + 1..count).map(|k| lower[k * count + row] * solution[k]).sum();
        solution[row] = (solution[row] - sum) / lower[row * count + row];
    }
    solution.iter().all(|value| value.is_finite()).then_some(solution)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_equations_are_solved() {
        // x + y = 3, x - 2 y = -3, and a number without effect.
        let rows = [[1.0, 1.0, 0.0, 3.0], [1.0, -2.0, 0.0, -3.0]];
        let system: Vec<f64> =
            (0..3).flat_map(|a| (0..4).map(move |b| rows.iter().map(|row: &[f64; 4]| row[a] * row[b]).sum())).collect();
        let solution = solved(&system, 3, 0.0).unwrap();
        for (value, expected) in solution.into_iter().zip([1.0, 2.0, 0.0]) {
            assert!((value - expected).abs() < 1e-12, "{value}");
        }
    }
}
