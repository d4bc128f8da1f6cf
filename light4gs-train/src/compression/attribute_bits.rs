//! Bits of each attribute of the Gaussians: those that the models of the training expect, and those that the coder writes.

use burn::module::Module;
use light4gs_codec::{CompressionReport, Limits, SceneMeta};
use light4gs_model::attributes::SH_REST;
use light4gs_model::{DeformationField, DynamicScene, PlaneEntropy};

use super::{Compression, ShModel, encoded_so_far};
use crate::config::CompressionConfig;
use crate::error::TrainError;

/// A correction changes expected bits by at most this factor, up or down.
const MOST: f64 = 2.0;

/// Written bits of each attribute of a file, by its name; 0 for what is not among its attributes. Spherical harmonics
/// have a section of their own.
pub(super) fn written_attribute_bits(
    file: &[u8],
    report: &CompressionReport,
) -> Result<impl Fn(&str) -> f64 + use<>, TrainError> {
    let in_file = light4gs_codec::info_with_limits(file, &Limits::large())?.attributes;
    let sh_bytes: u64 = report.sh.degrees.iter().sum();
    Ok(move |name: &str| match in_file.iter().find(|attribute| attribute.name == name) {
        Some(attribute) => 8.0 * attribute.bytes as f64,
        None if name == SH_REST.name => 8.0 * sh_bytes as f64,
        None => 0.0,
    })
}

impl<C: PlaneEntropy, S: ShModel> Compression<C, S> {
    /// The bits that the model expects for each attribute with a learned step, by its name.
    pub(super) fn expected_attribute_bits<F: DeformationField>(&self, decoded: &DynamicScene<F>) -> Vec<(String, f64)> {
        let gaussians = decoded.gaussians.tensors();
        let Some(models) = self.learned_attributes().filter(|_| gaussians.means.dims()[0] > 0) else {
            return Vec::new();
        };
        let bits = models.bits_of_each(gaussians).into_data();
        models.attributes().iter().map(|attribute| attribute.name.clone()).zip(bits.iter()).collect()
    }

    /// Has the model expect for each attribute of this scene what the coder writes for it now. A density knows neither what
    /// the coder spends on learning its statistics nor all that these learn.
    ///
    /// # Errors
    /// What the codec refuses.
    pub fn correct_expected_bits<F: DeformationField>(
        &mut self,
        scene: &DynamicScene<F>,
        meta: SceneMeta,
        config: &CompressionConfig,
    ) -> Result<(), TrainError> {
        let encoded = encoded_so_far(scene, self, meta, config)?;
        let device = scene.gaussians.means.val().inner().device();
        let decoded = DynamicScene::<F>::from_arrays(&encoded.decoded, &device)?;
        let written = written_attribute_bits(&encoded.bytes, &encoded.report)?;
        let factor = |(name, expected): &(String, f64)| match written(name) / expected {
            ratio if ratio.is_finite() && ratio > 0.0 => ratio.clamp(1.0 / MOST, MOST) as f32,
            _ => 1.0,
        };
        let factors: Vec<f32> = self.valid().expected_attribute_bits(&decoded).iter().map(factor).collect();
        if let Some(attributes) = self.attributes.as_mut().filter(|_| !factors.is_empty()) {
            attributes.correct(&factors);
        }
        Ok(())
    }
}
