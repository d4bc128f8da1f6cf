//! Whether the camera of a capture goes along a path, or jumps from frame to frame.

use glam::Vec3;

use crate::frame::Frame;

/// The median angle between the viewing directions of one frame and the next in time, degrees; 0 for fewer than two frames,
/// and for a rig, whose frames share their times.
///
/// It is a few degrees for a video, and some 60 to 100 for the scenes of D-NeRF, each frame of which shows the scene from
/// another side.
pub fn turn_between_frames(frames: &[Frame]) -> f32 {
    let mut frames: Vec<&Frame> = frames.iter().collect();
    frames.sort_by(|a, b| a.time.total_cmp(&b.time));
    // A few equal times, of frames that were taken twice, make no rig.
    let shared = frames.windows(2).filter(|pair| pair[0].time == pair[1].time).count();
    if 4 * shared > frames.len() {
        return 0.0;
    }
    let directions: Vec<Vec3> = frames.iter().map(|frame| direction(frame)).collect();
    let mut angles: Vec<f32> = directions.windows(2).map(|pair| pair[0].angle_between(pair[1]).to_degrees()).collect();
    angles.sort_by(f32::total_cmp);
    angles.get(angles.len() / 2).copied().unwrap_or(0.0)
}

fn direction(frame: &Frame) -> Vec3 {
    // OpenGL's cameras look along -z.
    let [x, y, z, _] = frame.camera.camera_to_world_opengl();
    -Vec3::new(x[2], y[2], z[2])
}

#[cfg(test)]
mod tests {
    use crate::Camera;

    use super::*;

    /// Frames of a camera that turns by so many degrees around the scene from one to the next, in no order.
    fn frames(turn: f32) -> Vec<Frame> {
        let frame = |k: usize| {
            let angle = (turn * k as f32).to_radians();
            let eye = Vec3::new(3.0 * angle.cos(), 3.0 * angle.sin(), 0.0);
            let camera = Camera::look_at(eye, Vec3::ZERO, Vec3::Z, 0.7, 8, 8);
            Frame::without_image(format!("{k}"), camera, k as f32 / 10.0)
        };
        [3, 1, 0, 4, 2].map(frame).into()
    }

    #[test]
    fn a_turn_is_that_of_the_camera() {
        for turn in [2.0, 65.0] {
            let found = turn_between_frames(&frames(turn));
            assert!((found - turn).abs() < 0.1, "{found}");
        }
        assert_eq!(turn_between_frames(&frames(5.0)[..1]), 0.0);
        assert_eq!(turn_between_frames(&[]), 0.0);
        let rig = [frames(65.0), frames(65.0)].concat();
        assert_eq!(turn_between_frames(&rig), 0.0);
    }
}
