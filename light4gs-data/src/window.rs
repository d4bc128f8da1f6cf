//! Parts of a scene: a window of its time, and fewer of its times.

use crate::duration::{different, usual_step};
use crate::error::DataError;
use crate::frame::Frame;
use crate::scene::{Scene, Split};
use std::collections::HashSet;

impl Scene {
    /// The part of the scene from time `from` to time `to`, shares of the whole: the frames of all splits at these times, with
    /// half an interval of frames to either side, so that rounding leaves none out. `from` becomes time 0 and `to` time 1;
    /// frames outside of them, by half an interval at most, get the nearer one. [`Scene::seconds`] becomes that of the window.
    ///
    /// Points, extent and mean of the cameras stay those of the whole, so that learning rates do not depend on the window.
    /// Where no test frame lies in it, the test split is empty, and a note says so.
    ///
    /// # Errors
    /// [`DataError::Options`] where `from` and `to` do not rise from 0 to 1, or no training frame lies between them.
    pub fn between(&self, from: f64, to: f64) -> Result<Self, DataError> {
        let bad = |problem: String| Err(DataError::Options { option: "window", problem });
        if !(from >= 0.0 && from < to && to <= 1.0) {
            return bad(format!("{from} to {to}, expected two shares of the time from 0 to 1, the second one larger"));
        }
        let half = 0.5 * f64::from(usual_step(&self.times()).unwrap_or(0.0));
        let part = |frames: &[Frame]| -> Vec<Frame> {
            let inside = frames.iter().filter(|frame| {
                let time = f64::from(frame.time);
                from - half <= time && time <= to + half
            });
            let moved = |frame: &Frame| {
                let time = (f64::from(frame.time) - from) / (to - from);
                Frame { time: time.clamp(0.0, 1.0) as f32, ..frame.clone() }
            };
            inside.map(moved).collect()
        };
        let train = part(&self.train);
        if train.is_empty() {
            let count = self.train.len();
            return bad(format!("{from} to {to}, expected at least one of the {count} training frames in it"));
        }
        let mut scene = Self {
            train,
            test: part(&self.test),
            val: part(&self.val),
            video: part(&self.video),
            seconds: self.seconds.map(|seconds| (to - from) * seconds),
            ..self.without_frames()
        };
        if scene.test.is_empty() {
            scene.notes.push(format!("no test frame lies between the times {from} and {to} of the capture"));
        }
        Ok(scene)
    }

    /// The scene with training frames at no more than `times` different times (at least 1), spread evenly over those that
    /// they have: the first, the last, and those between. Of one time it is the middle. All cameras of a time stay, and
    /// so do the frames of the other splits, extent and points.
    pub fn thinned(&self, times: usize) -> Self {
        let all = different(self.train.iter().map(|frame| frame.time));
        let (wanted, last) = (times.clamp(1, all.len().max(1)), all.len().saturating_sub(1));
        let rank = |k: usize| if wanted == 1 { last / 2 } else { (2 * k * last + wanted - 1) / (2 * (wanted - 1)) };
        let kept: HashSet<u32> = (0..wanted).filter_map(|k| all.get(rank(k))).map(|time| time.to_bits()).collect();
        let train = self.train.iter().filter(|frame| kept.contains(&frame.time.to_bits()));
        Self {
            train: train.cloned().collect(),
            test: self.test.clone(),
            val: self.val.clone(),
            video: self.video.clone(),
            ..self.without_frames()
        }
    }

    /// The different times of the images, rising.
    pub(crate) fn times(&self) -> Vec<f32> {
        let splits = [Split::Train, Split::Test, Split::Val];
        different(splits.iter().flat_map(|split| self.frames(*split)).map(|frame| frame.time))
    }

    /// All but the frames: a long take has many of them, and most are left out.
    fn without_frames(&self) -> Self {
        Self {
            name: self.name.clone(),
            root: self.root.clone(),
            layout: self.layout,
            train: Vec::new(),
            test: Vec::new(),
            val: Vec::new(),
            video: Vec::new(),
            background: self.background,
            points: self.points.clone(),
            camera_mean: self.camera_mean,
            extent: self.extent,
            seconds: self.seconds,
            notes: self.notes.clone(),
            reading: self.reading.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::points::PointCloud;
    use crate::scene::SplitFrames;
    use glam::Vec3;
    use proptest::prelude::*;
    use std::path::Path;

    /// `count` times of one camera, every eighth for testing.
    fn take(count: usize) -> Scene {
        let frame = |i: usize| {
            let eye = Vec3::new(i as f32, 1.0, 2.0);
            let time = i as f32 / (count - 1) as f32;
            Frame::without_image(format!("{i}"), Camera::look_at(eye, Vec3::ZERO, Vec3::Z, 0.7, 8, 8), time)
        };
        let (test, train) = (0..count).map(frame).partition(|frame| frame.name.parse::<usize>().unwrap() % 8 == 4);
        let frames = SplitFrames { train, test, video: (0..count).map(frame).collect(), ..Default::default() };
        let scene = Scene::new("mine", Path::new("a/take"), frames, PointCloud::random(9, 1.0, 0), [1.0; 3]).unwrap();
        scene.with_seconds(Some((count - 1) as f64 / 30.0))
    }

    proptest! {
        #[test]
        fn windows_share_out_the_frames_and_keep_the_rest(count in 20usize..400, parts in 1usize..6) {
            let scene = take(count);
            let mut seen = HashSet::new();
            for k in 0..parts {
                let (from, to) = (k as f64 / parts as f64, (k + 1) as f64 / parts as f64);
                let part = scene.between(from, to).unwrap();
                prop_assert_eq!((part.extent, part.camera_mean, &part.points), (scene.extent, scene.camera_mean, &scene.points));
                prop_assert!((part.seconds.unwrap() * parts as f64 - scene.seconds.unwrap()).abs() < 1e-9);
                for frame in part.train.iter().chain(&part.test).chain(&part.video) {
                    prop_assert!((0.0..=1.0).contains(&frame.time));
                    let number: f64 = frame.name.parse().unwrap();
                    let back = from + f64::from(frame.time) * (to - from);
                    // Half an interval, where the window's end is between two frames.
                    prop_assert!((back * (count - 1) as f64 - number).abs() < 0.51, "{} at {back}", number);
                }
                seen.extend(part.train.iter().chain(&part.test).map(|frame| frame.name.clone()));
            }
            prop_assert_eq!(seen.len(), count);
        }

        #[test]
        fn the_whole_window_changes_nothing(count in 20usize..100) {
            prop_assert_eq!(take(count).between(0.0, 1.0).unwrap(), take(count));
        }

        #[test]
        fn thinned_times_are_few_and_even(count in 20usize..400, times in 0usize..500) {
            let scene = take(count);
            let thinned = scene.thinned(times);
            let kept: Vec<f64> = thinned.train.iter().map(|frame| frame.time.into()).collect();
            prop_assert_eq!(kept.len(), times.clamp(1, scene.train.len()));
            prop_assert_eq!((&thinned.test, thinned.extent, thinned.seconds), (&scene.test, scene.extent, scene.seconds));
            if kept.len() > 1 {
                prop_assert_eq!((kept[0], kept[kept.len() - 1]), (0.0, f64::from(scene.train[scene.train.len() - 1].time)));
                let even = (scene.train.len() - 1) as f64 / (kept.len() - 1) as f64;
                let ranks: Vec<f64> = thinned.train.iter().map(|frame| {
                    scene.train.iter().position(|other| other.name == frame.name).unwrap() as f64
                }).collect();
                for (k, rank) in ranks.iter().enumerate() {
                    prop_assert!((rank - even * k as f64).abs() <= 0.5 + 1e-9);
                }
            }
        }
    }

    #[test]
    fn windows_without_frames_are_refused_or_noted() {
        let mut scene = take(20);
        for (from, to) in [(0.5, 0.5), (0.7, 0.2), (-0.1, 0.5), (0.5, 1.1), (f64::NAN, 1.0), (0.0, f64::INFINITY)] {
            let message = scene.between(from, to).unwrap_err().to_string();
            assert!(message.contains("option window") && message.contains("the second one larger"), "{message}");
        }
        // Frame 19 and frame 13; frames 4 and 12 are for testing.
        let end = scene.between(0.99, 1.0).unwrap();
        assert_eq!((end.train.len(), end.test.len(), end.train[0].time), (1, 0, 1.0));
        assert!(end.notes[0].contains("no test frame") && end.notes[0].contains("0.99"), "{:?}", end.notes);
        assert_eq!(scene.between(0.65, 0.66).unwrap().train[0].name, "13");
        scene.train.retain(|frame| frame.time < 0.3);
        let message = scene.between(0.4, 0.8).unwrap_err().to_string();
        assert!(message.contains("0.4 to 0.8") && message.contains("training frames"), "{message}");
    }
}
