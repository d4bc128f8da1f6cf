//! How much more of the world a take sees than one of its segments.

use glam::Vec3;
use light4gs_data::{Frame, Scene};

use super::plan::{PlannedSegment, TakePlan};

/// A base never gets more than this number of times the Gaussians of a segment, nor of its iterations.
const MOST: f64 = 2.0;
/// Standard deviation of cameras that counts as standing, in extents of the scene and in lengths of the viewing direction.
const STANDING: f64 = 0.05;

/// The root of the spread of a take's cameras over that of a segment's, in the mean: 1 for a rig, whose cameras stand still, and
/// at most 2.
///
/// The base has what all segments see, so it needs more Gaussians and more iterations than a clip. Both are multiplied by this
/// number, so the time of its training by the ratio itself.
pub(super) fn growth(data: &Scene, plan: &TakePlan) -> f64 {
    let spread_of_segment = |segment: &PlannedSegment| {
        let [from, to] = plan.between(segment);
        spread(data, |frame| (from..=to).contains(&f64::from(frame.time)))
    };
    let segments = plan.segments.iter().map(spread_of_segment).sum::<f64>() / plan.segments.len().max(1) as f64;
    let ratio = (spread(data, |_| true) + STANDING) / (segments + STANDING);
    // A number that a person can read in the record.
    (ratio.sqrt().clamp(1.0, MOST) * 100.0).round() / 100.0
}

/// The standard deviation of the cameras of some training frames: of their centers in extents, and of their viewing directions.
fn spread(data: &Scene, is_meant: impl Fn(&Frame) -> bool) -> f64 {
    let cameras = data.train.iter().filter(|frame| is_meant(frame)).map(|frame| frame.camera);
    let places: Vec<[Vec3; 2]> =
        cameras.map(|camera| [camera.center() / data.extent, camera.rotation.transpose() * Vec3::Z]).collect();
    let count = places.len().max(1) as f32;
    let variance = |which: usize| {
        let mean = places.iter().map(|place| place[which]).sum::<Vec3>() / count;
        places.iter().map(|place| place[which].distance_squared(mean)).sum::<f32>() / count
    };
    f64::from(variance(0) + variance(1)).sqrt()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use light4gs_data::{Camera, PointCloud, SplitFrames};

    use super::*;
    use crate::take::SegmentLength;

    fn take(camera: impl Fn(f32) -> Vec3) -> Scene {
        let frames = (0..360).map(|index| {
            let time = index as f32 / 359.0;
            let camera = Camera::look_at(camera(time), Vec3::ZERO, Vec3::Z, 0.8, 32, 24);
            Frame::without_image(format!("{index}"), camera, time)
        });
        let train: Vec<Frame> = frames.collect();
        let frames = SplitFrames { test: train[..1].to_vec(), train, ..SplitFrames::default() };
        let points = PointCloud { positions: vec![[0.0; 3]], colors: vec![[0.0; 3]] };
        Scene { extent: 2.0, ..Scene::new("test", Path::new("take"), frames, points, [0.0; 3]).unwrap() }
    }

    fn growth(camera: impl Fn(f32) -> Vec3, segment: f64) -> f64 {
        TakePlan::of(&take(camera), 12.0, SegmentLength::Seconds(segment), &[]).unwrap().base_growth
    }

    #[test]
    fn a_long_way_is_much_more_than_a_segment_and_a_rig_is_not() {
        let circle = |angle: f32| Vec3::new(4.0 * angle.cos(), 4.0 * angle.sin(), 1.0);
        let around = growth(|time| circle(6.0 * time), 2.0);
        let a_sixth = growth(circle, 2.0);
        let rig = growth(
            |time| Vec3::new(4.0, if ((time * 359.0) as usize).is_multiple_of(2) { 2.0 } else { -2.0 }, 1.0),
            2.0,
        );
        assert!(around > 1.6 && a_sixth > 1.6 && rig < 1.01, "{around}, {a_sixth}, {rig}");
        assert_eq!(growth(circle, 12.0), 1.0);
    }
}
