//! A dataset's cameras for the player.

use light4gs_data::{Camera, Frame, Scene, Split};
use serde::Serialize;

/// A camera as the player has it: an OpenCV pinhole.
#[derive(Serialize)]
struct PlayerCamera<'a> {
    name: &'a str,
    split: &'static str,
    time: f32,
    /// World to camera, row-major.
    rotation: [f32; 9],
    translation: [f32; 3],
    fx: f32,
    fy: f32,
    cx: f32,
    cy: f32,
    width: u32,
    height: u32,
}

impl<'a> PlayerCamera<'a> {
    fn new(frame: &'a Frame, split: Split) -> Self {
        let Camera { rotation, translation, fx, fy, cx, cy, width, height } = frame.camera;
        Self {
            name: &frame.name,
            split: split.name(),
            time: frame.time,
            rotation: rotation.transpose().to_cols_array(),
            translation: translation.to_array(),
            fx,
            fy,
            cx,
            cy,
            width,
            height,
        }
    }
}

/// The cameras of a dataset as JSON: of each split at most `most`, spread evenly.
pub fn cameras_json(scene: &Scene, most: usize) -> String {
    let splits = [(Split::Train, &scene.train), (Split::Test, &scene.test), (Split::Val, &scene.val)];
    let cameras: Vec<PlayerCamera> = splits
        .into_iter()
        .flat_map(|(split, frames)| {
            let stride = frames.len().div_ceil(most.max(1)).max(1);
            frames.iter().step_by(stride).map(move |frame| PlayerCamera::new(frame, split))
        })
        .collect();
    serde_json::to_string(&cameras).expect("plain data has a JSON form")
}
