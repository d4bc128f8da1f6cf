//! A decoded scene, computed at one time after the other.

use light4gs_codec::{CodecError, SceneData};

use crate::description::{Facts, describe};
use crate::draw_list::{DrawList, Viewpoint, WHOLE};
use crate::gaussians::activated;
use crate::levels::levels;
use crate::part::Part;

/// A decoded scene.
#[derive(Debug)]
pub struct OpenScene {
    part: Part,
    description: String,
    list: DrawList,
}

impl OpenScene {
    /// Of a decoded scene, whose scales are multiplied by `growth`.
    pub(crate) fn new(scene: &SceneData, facts: &Facts<'_>, growth: f32) -> Result<Self, CodecError> {
        let mut scene = scene.clone();
        if growth != 1.0 {
            let scales = scene.gaussians.log_scales.as_flattened_mut();
            scales.iter_mut().for_each(|scale| *scale += growth.ln());
        }
        let description = describe(&scene, facts, levels(scene.gaussians.len()));
        Ok(Self { part: Part::new(scene)?, description, list: DrawList::default() })
    }

    /// Number of Gaussians of the level that is shown.
    pub fn count(&self) -> usize {
        self.part.count()
    }

    /// The scene as JSON: name, sizes, sections.
    pub fn description(&self) -> &str {
        &self.description
    }

    /// Chooses the level for [`OpenScene::evaluate`] and [`OpenScene::draw_list`]: 0 is the scene itself, and each
    /// further level has half of the Gaussians of the one before. Their number is in the description; a larger number
    /// means the last one. Returns whether the level was made anew: then nothing of it is evaluated yet.
    pub fn show_level(&mut self, level: u32) -> bool {
        self.part.show_level(level)
    }

    /// Computes the Gaussians `first` to `last` of the level that is shown at a time.
    pub fn evaluate(&mut self, time: f32, first: usize, last: usize) {
        self.part.evaluate(time, first, last);
    }

    /// The Gaussians as computed last, back to front, [`ENTRY`](crate::ENTRY) numbers each.
    pub fn draw_list(&mut self, viewpoint: &Viewpoint) -> &[f32] {
        self.list.make(&[self.part.drawn(WHOLE)], viewpoint)
    }

    /// All attributes at a time, activated: centers `[N, 3]`, standard deviations `[N, 3]`, unit quaternions `(w, x, y, z)
    /// [N, 4]` (zeros where there is no direction), opacities `[N]`, harmonics `[N, (degree + 1)², 3]`, one behind the other.
    pub fn attributes_at(&self, time: f32) -> Vec<f32> {
        activated(&self.part.moved_at(time))
    }

    /// Degree of the spherical harmonics.
    pub fn sh_degree(&self) -> u8 {
        self.part.canonical().sh_degree
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene() -> OpenScene {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/quickstart.l4gs");
        OpenScene::decode(&std::fs::read(path).expect("a scene")).expect("a scene")
    }

    fn list(scene: &mut OpenScene, level: u32, time: f32) -> Vec<f32> {
        scene.show_level(level);
        scene.evaluate(time, 0, scene.count());
        scene.draw_list(&Viewpoint { row: [0.0, 0.0, 1.0, 5.0], eye: [0.0, 0.0, -5.0], spread: f32::INFINITY }).to_vec()
    }

    /// A level that was drawn in between changes nothing of the scene itself, to the last bit.
    #[test]
    fn the_scene_itself_stays_as_it_is() {
        let expected = list(&mut scene(), 0, 0.5);
        let mut scene = scene();
        let count = scene.count();
        let attributes = scene.attributes_at(0.25);
        assert_eq!(list(&mut scene, 0, 0.5), expected);
        let fewer = list(&mut scene, 1, 0.5);
        assert!(scene.count().abs_diff(count / 2) <= 1 && fewer.len() < expected.len());
        assert_eq!(list(&mut scene, 0, 0.5), expected);
        assert_eq!((scene.count(), scene.attributes_at(0.25)), (count, attributes));
    }

    /// The Gaussians of a level are where they are in the scene, at every time, with the same opacity.
    #[test]
    fn a_level_moves_as_the_scene_does() {
        let mut scene = scene();
        let centers = |list: &[f32]| {
            let drawn = list.chunks_exact(crate::ENTRY).filter(|entry| entry[3] > 0.0);
            drawn.map(|entry| [0, 1, 2, 3].map(|i| entry[i].to_bits())).collect::<std::collections::HashSet<_>>()
        };
        for time in [0.0, 0.7] {
            let all = centers(&list(&mut scene, 0, time));
            let fewer = centers(&list(&mut scene, 1, time));
            assert!(fewer.len() > 1000 && fewer.is_subset(&all), "{} of {}", fewer.len(), all.len());
        }
    }

    #[test]
    fn a_level_is_made_once_and_there_is_no_further_one() {
        let mut scene = scene();
        assert!(!scene.show_level(0));
        assert!(scene.show_level(9));
        let count = scene.count();
        assert!(!scene.show_level(0) && !scene.show_level(1));
        assert_eq!(scene.count(), count);
    }
}
