//! How to open a scene: layout, image size, background, and random points for a dataset without a point cloud.

use crate::error::DataError;

/// The size at which images are used; cameras follow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Resolution {
    /// As in the files.
    #[default]
    Native,
    /// The longer side becomes this many pixels, the other follows; smaller images stay as they are.
    MaxSide(u32),
    /// Exactly `width` × `height` pixels, whatever the aspect.
    Exact {
        /// Pixels.
        width: u32,
        /// Pixels.
        height: u32,
    },
}

impl Resolution {
    /// The size (width, height) at which an image of `source` = (width, height) pixels is used.
    pub fn apply(self, source: (u32, u32)) -> (u32, u32) {
        match self {
            Self::Native => source,
            Self::Exact { width, height } => (width, height),
            Self::MaxSide(limit) => {
                let longest = source.0.max(source.1);
                if longest <= limit {
                    return source;
                }
                let scaled = |side: u32| {
                    let exact = f64::from(side) * f64::from(limit) / f64::from(longest);
                    (exact.round() as u32).max(1)
                };
                (scaled(source.0), scaled(source.1))
            }
        }
    }
}

/// How the times of images follow from their names, where the capture's files do not give times.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TimesFrom {
    /// From a date and time of day in the names, otherwise from their last number, otherwise from their order.
    #[default]
    Auto,
    /// From the last number.
    Number,
    /// From the natural order of the names of each camera: one step per name.
    Order,
}

/// How the cameras of images follow from their names, in layouts that do not name cameras.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CamerasFrom {
    /// From the folder and the name without what counts the time.
    #[default]
    Auto,
    /// There is one camera, which moves.
    One,
    /// Each folder is a camera.
    Folder,
}

/// How to open a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadOptions {
    /// The layout's name, such as `dnerf`; `None` finds it by content.
    pub layout: Option<String>,
    /// The size at which images are used.
    pub resolution: Resolution,
    /// Length of the sequence in frames: later ones are left out. Where the dataset counts frames instead of giving
    /// times (layout `neu3d`, whose captures have 300), the time of frame `i` is `i / frames`. `None`: all frames.
    pub frames: Option<usize>,
    /// Frames per second at which the capture was taken, 0.001 to 100000: its different times are counted as frames, whatever its files
    /// say. `None`: as the files say, see [`crate::Scene::seconds`].
    pub frames_a_second: Option<f64>,
    /// First and last time that is kept, shares of the whole: see [`crate::Scene::between`]. `None`: all.
    pub between: Option<[f64; 2]>,
    /// Training frames have at most this number of times: see [`crate::Scene::thinned`]. `None`: all.
    pub most_times: Option<usize>,
    /// The color behind transparent pixels: red, green, blue in `[0, 1]`.
    pub background: [f32; 3],
    /// Seed of the random point cloud.
    pub seed: u64,
    /// Number of random points, where the dataset has no point cloud.
    pub random_points: usize,
    /// Half the side of the cube of the random points, world units.
    pub random_half_size: f32,
    /// The most points that a cloud keeps; of a larger one every n-th point is left.
    pub most_points: usize,
    /// How times follow from the images' names.
    pub times: TimesFrom,
    /// How cameras follow from the images' names.
    pub cameras: CamerasFrom,
    /// Whether cameras of a rig that are out of step are moved in time, see [`crate::out_of_step`]. Up to 240 images are
    /// decoded for it.
    pub synchronize: bool,
}

impl Default for LoadOptions {
    /// Layout by content, native size, white background, 2000 random points in ±1.3, at most a million points, seed 0.
    fn default() -> Self {
        Self {
            layout: None,
            resolution: Resolution::Native,
            frames: None,
            frames_a_second: None,
            between: None,
            most_times: None,
            background: [1.0; 3],
            seed: 0,
            random_points: 2000,
            random_half_size: 1.3,
            most_points: 1_000_000,
            times: TimesFrom::default(),
            cameras: CamerasFrom::default(),
            synchronize: false,
        }
    }
}

impl LoadOptions {
    /// Refuses options that are out of range.
    pub(crate) fn check(&self) -> Result<(), DataError> {
        let bad = |option: &'static str, problem: String| Err(DataError::Options { option, problem });
        if self.background.iter().any(|v| !(0.0..=1.0).contains(v)) {
            let found = self.background;
            return bad("background", format!("{found:?}, expected three values from 0 to 1"));
        }
        match self.resolution {
            Resolution::MaxSide(0) | Resolution::Exact { width: 0, .. } | Resolution::Exact { height: 0, .. } => {
                return bad("resolution", "0 pixels, expected at least 1".into());
            }
            Resolution::Exact { width, height } if width.max(height) > 16384 => {
                return bad("resolution", format!("{width} x {height}, expected at most 16384"));
            }
            _ => {}
        }
        if self.frames == Some(0) {
            return bad("frames", "0, expected at least 1".into());
        }
        if let Some(found) = self.frames_a_second.filter(|rate| !(1e-3..=1e5).contains(rate)) {
            return bad("frames_a_second", format!("{found}, expected 0.001 to 100000"));
        }
        if self.most_points == 0 {
            return bad("most_points", "0, expected at least 1".into());
        }
        if self.random_points == 0 || self.random_points > 100_000_000 {
            let found = self.random_points;
            return bad("random_points", format!("{found}, expected 1 to 100000000"));
        }
        if !(self.random_half_size > 0.0 && self.random_half_size.is_finite()) {
            let found = self.random_half_size;
            return bad("random_half_size", format!("{found}, expected a positive number"));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn resolutions() {
        assert_eq!(Resolution::Native.apply((800, 600)), (800, 600));
        assert_eq!(Resolution::MaxSide(200).apply((800, 600)), (200, 150));
        assert_eq!(Resolution::MaxSide(200).apply((600, 800)), (150, 200));
        assert_eq!(Resolution::MaxSide(900).apply((800, 600)), (800, 600));
        assert_eq!(Resolution::MaxSide(1).apply((800, 6)), (1, 1));
        let exact = Resolution::Exact { width: 200, height: 200 };
        assert_eq!(exact.apply((800, 600)), (200, 200));
    }

    #[test]
    fn bad_options_are_refused_by_name() {
        let bad = [
            ("background", LoadOptions { background: [0.0, f32::NAN, 0.0], ..Default::default() }),
            ("resolution", LoadOptions { resolution: Resolution::MaxSide(0), ..Default::default() }),
            ("frames", LoadOptions { frames: Some(0), ..Default::default() }),
            ("frames_a_second", LoadOptions { frames_a_second: Some(0.0), ..Default::default() }),
            ("frames_a_second", LoadOptions { frames_a_second: Some(f64::NAN), ..Default::default() }),
            ("random_points", LoadOptions { random_points: 0, ..Default::default() }),
            ("random_half_size", LoadOptions { random_half_size: -1.0, ..Default::default() }),
        ];
        for (name, options) in bad {
            let refused = options.check().unwrap_err();
            assert!(matches!(&refused, DataError::Options { option, .. } if *option == name), "{refused}");
        }
    }
}
