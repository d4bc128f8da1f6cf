//! Bits of each attribute of the Gaussians: those that the models of the training expect, and those that the coder writes.

use burn::module::Module;
use burn::tensor::Device;
use light4gs_codec::Encoded;
use light4gs_model::{Gaussians, PlaneEntropy};
use serde::{Deserialize, Serialize};

use super::{Compression, ShModel};

/// A correction changes expected bits by at most this factor, up or down.
const MOST: f64 = 2.0;

/// Expected and written bits of an attribute.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AttributeRecord {
    /// Its name in the table of attributes.
    pub name: String,
    /// Bits that the model of the training expects.
    pub estimated_bits: f64,
    /// Bits in the file; 0 if it is not among the file's attributes.
    pub coded_bits: f64,
}

impl<C: PlaneEntropy, S: ShModel> Compression<C, S> {
    /// The bits of each attribute with a learned step: expected for the decoded Gaussians of a file, and written in it.
    pub(super) fn attribute_records(&self, file: &Encoded, decoded: &Gaussians) -> Vec<AttributeRecord> {
        let Some(models) = self.learned_attributes().filter(|_| !decoded.is_empty()) else { return Vec::new() };
        let bits = models.bits_of_each(decoded.tensors()).into_data();
        let record = |(name, estimated_bits): (&String, f64)| AttributeRecord {
            name: name.clone(),
            estimated_bits,
            coded_bits: 8.0 * file.attribute_bytes(name) as f64,
        };
        models.attributes().iter().map(|attribute| &attribute.name).zip(bits.iter()).map(record).collect()
    }

    /// Scales the model's bits of each attribute so that they agree with those of the scene's `file`. A density alone does
    /// not: the adaptive coder spends bits on learning its statistics, and saves others by them. The bits are computed on
    /// `device`, with autodiff or without.
    pub fn correct_expected_bits(&mut self, file: &Encoded, device: &Device) {
        let decoded = Gaussians::from_arrays(&file.decoded.gaussians, &device.clone().inner());
        let factor = |record: &AttributeRecord| match record.coded_bits / record.estimated_bits {
            ratio if ratio.is_finite() && ratio > 0.0 => ratio.clamp(1.0 / MOST, MOST) as f32,
            _ => 1.0,
        };
        let factors: Vec<f32> = self.valid().attribute_records(file, &decoded).iter().map(factor).collect();
        if let Some(attributes) = self.attributes.as_mut().filter(|_| !factors.is_empty()) {
            attributes.correct(&factors);
        }
    }
}
