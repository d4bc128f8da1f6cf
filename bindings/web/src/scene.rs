//! A decoded scene, computed at one time after the other.

use light4gs_codec::{CodecError, GaussianArrays, MotionEvaluator, SceneData};

use crate::description::{Facts, describe};
use crate::draw_list::{DrawList, Viewpoint};
use crate::gaussians::{FLOATS, Unchanged, opacity, pack, rotation, scales};
use crate::levels::{Selection, levels, most_significance, select};

/// A decoded scene.
#[derive(Debug)]
pub struct OpenScene {
    /// Without its Gaussians.
    scene: SceneData,
    full: Level,
    /// The level that was asked for last besides the scene itself, with its number. One at a time: it has at most half of
    /// the Gaussians, and so takes at most half of the memory of the scene.
    reduced: Option<(u32, Level)>,
    /// The significance of each Gaussian, once a reduced level has been asked for.
    significance: Option<Vec<f32>>,
    /// The level that is shown is the reduced one.
    shows_reduced: bool,
    description: String,
    list: DrawList,
}

/// Gaussians that are moved and drawn together: those of the scene, or fewer that stand for them.
#[derive(Debug)]
struct Level {
    canonical: GaussianArrays,
    moved: GaussianArrays,
    unchanged: Unchanged,
    evaluator: MotionEvaluator,
    /// Factors of the areas; empty where they are all 1.
    growth: Vec<f32>,
    /// The values for drawing: [`FLOATS`] numbers per Gaussian.
    packed: Vec<f32>,
}

impl Level {
    /// The Gaussians of a scene, which are taken out of it.
    fn take(scene: &mut SceneData, growth: Vec<f32>) -> Result<Self, CodecError> {
        let evaluator = MotionEvaluator::new(scene)?;
        let canonical = std::mem::take(&mut scene.gaussians);
        Ok(Self {
            moved: canonical.clone(),
            unchanged: Unchanged::of(&canonical, |output| evaluator.changes(output)),
            packed: vec![0.0; FLOATS * canonical.len()],
            canonical,
            evaluator,
            growth,
        })
    }
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
        let full = Level::take(&mut scene, Vec::new())?;
        Ok(Self {
            scene,
            full,
            reduced: None,
            significance: None,
            shows_reduced: false,
            description,
            list: DrawList::default(),
        })
    }

    /// Number of Gaussians of the level that is shown.
    pub fn count(&self) -> usize {
        self.reduced.as_ref().filter(|_| self.shows_reduced).map_or(&self.full, |(_, level)| level).canonical.len()
    }

    /// The scene as JSON: name, sizes, sections.
    pub fn description(&self) -> &str {
        &self.description
    }

    /// Chooses the level for [`OpenScene::evaluate`] and [`OpenScene::draw_list`]: 0 is the scene itself, and each
    /// further level has half of the Gaussians of the one before. Their number is in the description; a larger number
    /// means the last one. Returns whether the level was made anew: then nothing of it is evaluated yet.
    pub fn show_level(&mut self, level: u32) -> bool {
        let Level { canonical, moved, evaluator, .. } = &self.full;
        let level = level.min(levels(canonical.len()));
        self.shows_reduced = level > 0;
        if level == 0 || self.reduced.as_ref().is_some_and(|(made, _)| *made == level) {
            return false;
        }
        // The memory of the one before comes back first.
        self.reduced = None;
        let significance = self.significance.get_or_insert_with(|| most_significance(canonical, moved, evaluator));
        let Selection { indices, growth } = select(&canonical.means, significance, canonical.len() >> level);
        self.scene.gaussians = canonical.gathered(&indices);
        // All Gaussians were accepted, so some of them are.
        self.reduced = Level::take(&mut self.scene, growth).ok().map(|reduced| (level, reduced));
        self.shows_reduced = self.reduced.is_some();
        true
    }

    /// The level that is shown, and memory for its list.
    fn shown(&mut self) -> (&mut Level, &mut DrawList) {
        let level = match &mut self.reduced {
            Some((_, reduced)) if self.shows_reduced => reduced,
            _ => &mut self.full,
        };
        (level, &mut self.list)
    }

    /// Computes the Gaussians `first` to `last` of the level that is shown at a time.
    pub fn evaluate(&mut self, time: f32, first: usize, last: usize) {
        let (Level { canonical, moved, unchanged, evaluator, growth, packed }, _) = self.shown();
        let last = last.min(canonical.len());
        let range = first.min(last)..last;
        evaluator.apply(canonical, time, range.clone(), moved);
        pack(moved, unchanged, growth, range, packed);
    }

    /// The Gaussians as computed last, back to front, [`ENTRY`](crate::ENTRY) numbers each.
    pub fn draw_list(&mut self, viewpoint: &Viewpoint) -> &[f32] {
        let (level, list) = self.shown();
        list.make(&level.packed, &level.moved, viewpoint)
    }

    /// All attributes at a time, activated: centers `[N, 3]`, standard deviations `[N, 3]`, unit quaternions `(w, x, y, z)
    /// [N, 4]` (zeros where there is no direction), opacities `[N]`, harmonics `[N, (degree + 1)², 3]`, one behind the other.
    pub fn attributes_at(&self, time: f32) -> Vec<f32> {
        let Level { canonical, evaluator, .. } = &self.full;
        let mut moved = canonical.clone();
        evaluator.apply(canonical, time, 0..canonical.len(), &mut moved);
        let rest = moved.sh_rest.len() / moved.len().max(1);
        let mut attributes = Vec::with_capacity(moved.len() * (14 + rest));
        attributes.extend(moved.means.iter().flatten());
        attributes.extend(moved.log_scales.iter().flat_map(|&log_scales| scales(log_scales)));
        attributes.extend(moved.quats.iter().flat_map(|&quaternion| rotation(quaternion).unwrap_or_default()));
        attributes.extend(moved.opacity_logits.iter().map(|&logit| opacity(logit)));
        for gaussian in 0..moved.len() {
            attributes.extend_from_slice(&moved.sh_dc[gaussian]);
            attributes.extend_from_slice(&moved.sh_rest[rest * gaussian..][..rest]);
        }
        attributes
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

    /// The canonical opacity of some is too low to be seen, but not that of another time.
    #[test]
    fn what_is_seen_at_any_time_may_be_kept() {
        let OpenScene { full: Level { canonical, evaluator, .. }, .. } = scene();
        let still = MotionEvaluator::new(&SceneData::default()).expect("a scene without motion");
        let seen = |significance: &[f32]| significance.iter().filter(|&&value| value > 0.0).count();
        let [once, most] =
            [&still, &evaluator].map(|evaluator| seen(&most_significance(&canonical, &canonical, evaluator)));
        assert!(most > once && once > 1000, "{once} of {most}");
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
