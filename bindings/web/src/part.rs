//! Gaussians that move together, and the level of detail of them that is shown.

use light4gs_codec::{CodecError, GaussianArrays, MotionEvaluator, SceneData};

use crate::draw_list::{Drawn, Share};
use crate::gaussians::{FLOATS, Unchanged, pack};
use crate::levels::{Selection, levels, most_significance, select};

/// The Gaussians of a decoded stream.
#[derive(Debug)]
pub(crate) struct Part {
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
}

/// Gaussians that are moved and drawn together: those of the stream, or fewer that stand for them.
#[derive(Debug)]
struct Level {
    canonical: GaussianArrays,
    moved: GaussianArrays,
    unchanged: Unchanged,
    evaluator: MotionEvaluator,
    /// Which Gaussians of the stream they are, and factors of their areas; empty where they are all, and the factors 1.
    selection: Selection,
    /// The values for drawing: [`FLOATS`] numbers per Gaussian.
    packed: Vec<f32>,
}

impl Level {
    /// The Gaussians of a scene, which are taken out of it.
    fn take(scene: &mut SceneData, selection: Selection) -> Result<Self, CodecError> {
        let evaluator = MotionEvaluator::new(scene)?;
        let canonical = std::mem::take(&mut scene.gaussians);
        Ok(Self {
            moved: canonical.clone(),
            unchanged: Unchanged::of(&canonical, |output| evaluator.changes(output)),
            packed: vec![0.0; FLOATS * canonical.len()],
            canonical,
            evaluator,
            selection,
        })
    }
}

impl Part {
    pub(crate) fn new(mut scene: SceneData) -> Result<Self, CodecError> {
        let full = Level::take(&mut scene, Selection::default())?;
        Ok(Self { scene, full, reduced: None, significance: None, shows_reduced: false })
    }

    /// The level that is shown.
    fn shown(&self) -> &Level {
        self.reduced.as_ref().filter(|_| self.shows_reduced).map_or(&self.full, |(_, level)| level)
    }

    /// Number of Gaussians of the level that is shown.
    pub(crate) fn count(&self) -> usize {
        self.shown().canonical.len()
    }

    /// All Gaussians, before they are moved.
    pub(crate) fn canonical(&self) -> &GaussianArrays {
        &self.full.canonical
    }

    /// Chooses the level: 0 has all Gaussians, and each further one half of those of the one before. A larger number than
    /// that of the last level means the last one. Returns whether the level was made anew: then nothing of it is
    /// evaluated yet.
    pub(crate) fn show_level(&mut self, level: u32) -> bool {
        let Level { canonical, moved, evaluator, .. } = &self.full;
        let level = level.min(levels(canonical.len()));
        self.shows_reduced = level > 0;
        if level == 0 || self.reduced.as_ref().is_some_and(|(made, _)| *made == level) {
            return false;
        }
        // The memory of the one before comes back first.
        self.reduced = None;
        let significance = self.significance.get_or_insert_with(|| most_significance(canonical, moved, evaluator));
        let selection = select(&canonical.means, significance, canonical.len() >> level);
        self.scene.gaussians = canonical.gathered(&selection.indices);
        // All Gaussians were accepted, so some of them are.
        self.reduced = Level::take(&mut self.scene, selection).ok().map(|reduced| (level, reduced));
        self.shows_reduced = self.reduced.is_some();
        true
    }

    /// Computes the Gaussians `first` to `last` of the level that is shown at a time.
    pub(crate) fn evaluate(&mut self, time: f32, first: usize, last: usize) {
        let shown = match &mut self.reduced {
            Some((_, reduced)) if self.shows_reduced => reduced,
            _ => &mut self.full,
        };
        let Level { canonical, moved, unchanged, evaluator, selection, packed } = shown;
        let last = last.min(canonical.len());
        let range = first.min(last)..last;
        evaluator.apply(canonical, time, range.clone(), moved);
        pack(moved, unchanged, &selection.growth, range, packed);
    }

    /// The Gaussians as computed last, and who draws them: [`Drawn::shares`].
    pub(crate) fn drawn<'a>(&'a self, shares: &'a [Share<'a>]) -> Drawn<'a> {
        let Level { moved, selection, packed, .. } = self.shown();
        Drawn { packed, gaussians: moved, shares, indices: &selection.indices }
    }

    /// All Gaussians at a time.
    pub(crate) fn moved_at(&self, time: f32) -> GaussianArrays {
        let Level { canonical, evaluator, .. } = &self.full;
        let mut moved = canonical.clone();
        evaluator.apply(canonical, time, 0..canonical.len(), &mut moved);
        moved
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The canonical opacity of some is too low to be seen, but not that of another time.
    #[test]
    fn what_is_seen_at_any_time_may_be_kept() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/quickstart.l4gs");
        let scene = light4gs_codec::decode(&std::fs::read(path).expect("a scene")).expect("a scene");
        let Part { full: Level { canonical, evaluator, .. }, .. } = Part::new(scene).expect("a scene");
        let still = MotionEvaluator::new(&SceneData::default()).expect("a scene without motion");
        let seen = |significance: &[f32]| significance.iter().filter(|&&value| value > 0.0).count();
        let [once, most] =
            [&still, &evaluator].map(|evaluator| seen(&most_significance(&canonical, &canonical, evaluator)));
        assert!(most > once && once > 1000, "{once} of {most}");
    }
}
