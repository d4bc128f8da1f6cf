//! A decoded scene, of which one time after the other is computed.

use light4gs_codec::{CodecError, GaussianArrays, MotionEvaluator, SceneData};

use crate::Arrival;
use crate::description::{Facts, describe};
use crate::draw_list::{DrawList, Viewpoint};
use crate::gaussians::{FLOATS, Unchanged, opacity, pack, rotation, scales};

/// A decoded scene.
#[derive(Debug)]
pub struct OpenScene {
    canonical: GaussianArrays,
    moved: GaussianArrays,
    unchanged: Unchanged,
    evaluator: MotionEvaluator,
    description: String,
    /// The values for drawing: [`FLOATS`] numbers per Gaussian.
    packed: Vec<f32>,
    list: DrawList,
}

impl OpenScene {
    /// Decodes a stream.
    ///
    /// # Errors
    /// As [`light4gs_codec::decode`].
    pub fn decode(bytes: &[u8]) -> Result<Self, CodecError> {
        let mut arrival = Arrival::default();
        let scene = arrival.push(bytes)?;
        // Here a file that is cut short is refused.
        arrival.finish()?;
        scene.ok_or(CodecError::MissingSection { section: "gaussians" })
    }

    /// Of a decoded scene, whose scales are multiplied by `growth`.
    pub(crate) fn new(scene: &SceneData, facts: &Facts<'_>, growth: f32) -> Result<Self, CodecError> {
        let evaluator = MotionEvaluator::new(scene)?;
        let mut canonical = scene.gaussians.clone();
        if growth != 1.0 {
            canonical.log_scales.as_flattened_mut().iter_mut().for_each(|scale| *scale += growth.ln());
        }
        let floats = FLOATS * canonical.len();
        Ok(Self {
            moved: canonical.clone(),
            unchanged: Unchanged::of(&canonical, |output| evaluator.changes(output)),
            canonical,
            evaluator,
            description: describe(scene, facts),
            packed: vec![0.0; floats],
            list: DrawList::default(),
        })
    }

    /// Number of Gaussians.
    pub fn count(&self) -> usize {
        self.canonical.len()
    }

    /// The scene as JSON: name, sizes, sections.
    pub fn description(&self) -> &str {
        &self.description
    }

    /// Computes the Gaussians `first` to `last` at a time.
    pub fn evaluate(&mut self, time: f32, first: usize, last: usize) {
        let last = last.min(self.count());
        let range = first.min(last)..last;
        self.evaluator.apply(&self.canonical, time, range.clone(), &mut self.moved);
        pack(&self.moved, &self.unchanged, range, &mut self.packed);
    }

    /// The Gaussians as computed last, back to front, [`ENTRY`](crate::ENTRY) numbers each.
    pub fn draw_list(&mut self, viewpoint: &Viewpoint) -> &[f32] {
        self.list.make(&self.packed, &self.moved, viewpoint)
    }

    /// All attributes at a time, activated: centers `[N, 3]`, standard deviations `[N, 3]`, unit quaternions `(w, x, y, z)
    /// [N, 4]` (zeros where there is no direction), opacities `[N]`, harmonics `[N, (degree + 1)², 3]`, one behind the other.
    pub fn attributes_at(&self, time: f32) -> Vec<f32> {
        let mut moved = self.canonical.clone();
        self.evaluator.apply(&self.canonical, time, 0..self.count(), &mut moved);
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
