//! The result, and advice if it is poor.

use crate::posing::{LEAST_PARALLAX, LEAST_REGISTERED};
use std::fmt;

/// If the mean reprojection error, in pixels, is larger, the poses blur the trained scene.
const MOST_ERROR: f64 = 1.5;
/// If there are fewer points, the images had too little texture.
const LEAST_POINTS: usize = 500;

/// The result of [`crate::prepare`].
#[derive(Clone, Debug, PartialEq)]
pub struct PrepareSummary {
    /// Images for which poses were searched.
    pub images: usize,
    /// Images with a pose.
    pub registered: usize,
    /// Mean reprojection error: the distance between the places where points were seen and where they project, pixels.
    pub reprojection_error: f64,
    /// Points of the sparse model.
    pub points: usize,
    /// Frames of the dataset.
    pub frames: usize,
    /// Cameras of the dataset.
    pub cameras: usize,
    /// The angle, in degrees, at which a point at the usual depth sees the two cameras that are farthest apart.
    pub parallax: f64,
    /// What was changed or tried on the way, and what is wrong with the videos: sentences.
    pub notes: Vec<String>,
}

impl PrepareSummary {
    /// What to do better, in sentences; empty if all is well.
    pub fn advice(&self) -> Vec<&'static str> {
        let mut advice = Vec::new();
        if (self.registered as f64) < LEAST_REGISTERED * self.images as f64 {
            advice.push(if self.cameras > 1 {
                "Cameras without a pose see too little of what the others see: put them closer together, or turn them \
                 to a common background with texture."
            } else {
                "Many frames have no pose: move more slowly and sideways, avoid blank walls and fast turns, or take more \
                 frames with --frames."
            });
        }
        if self.parallax < LEAST_PARALLAX {
            advice.push(
                "The camera hardly moved, so that depths are guesses: walk sideways, in an arc around the scene; turning on \
                 the spot does not help.",
            );
        }
        if self.reprojection_error > MOST_ERROR {
            advice.push(
                "The reprojection error is high: fix focus and exposure, switch off zoom and stabilization, and film in \
                 good light so that frames are sharp.",
            );
        }
        if self.points < LEAST_POINTS {
            advice.push(
                "There are few points: bring objects with texture into the background, and keep most of the image still \
                 while something moves.",
            );
        }
        advice
    }
}

impl fmt::Display for PrepareSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let share = 100.0 * self.registered as f64 / self.images.max(1) as f64;
        writeln!(f, "images with a pose      {} of {} ({share:.0} %)", self.registered, self.images)?;
        writeln!(f, "reprojection error      {:.2} pixels", self.reprojection_error)?;
        writeln!(f, "points                  {}", self.points)?;
        writeln!(f, "parallax                {:.1} degrees", self.parallax)?;
        write!(f, "frames of the dataset   {} of {} camera", self.frames, self.cameras)?;
        f.write_str(if self.cameras == 1 { "" } else { "s" })?;
        for advice in self.advice() {
            write!(f, "\n{advice}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poor_results_come_with_advice() {
        let good = PrepareSummary {
            images: 100,
            registered: 98,
            reprojection_error: 0.7,
            points: 9000,
            frames: 98,
            cameras: 1,
            parallax: 40.0,
            notes: Vec::new(),
        };
        assert!(good.advice().is_empty());
        assert!(good.to_string().contains("98 of 100 (98 %)"));
        let poor = PrepareSummary { registered: 40, reprojection_error: 2.5, points: 80, parallax: 0.4, ..good };
        assert_eq!(poor.advice().len(), 4);
        assert!(poor.to_string().contains("sideways"));
    }
}
