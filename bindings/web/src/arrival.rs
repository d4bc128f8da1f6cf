//! A file that is shown while it comes.

use light4gs_codec::{CodecError, SceneData, SectionInfo, StreamDecoder};

use crate::description::Facts;
use crate::limits::limits;
use crate::scene::OpenScene;

/// A file whose bytes are coming.
#[derive(Debug)]
pub struct Arrival {
    decoder: StreamDecoder,
    /// Layers of Gaussians that were shown.
    shown: usize,
}

impl Default for Arrival {
    fn default() -> Self {
        Self { decoder: StreamDecoder::with_limits(&limits()), shown: 0 }
    }
}

impl Arrival {
    /// Takes the next bytes, or none. Decodes one more layer, if there is one, and returns the scene with the Gaussians
    /// so far, enlarged to stand for the missing ones. Only one layer at a time, so that the scene can be shown before
    /// the next one is decoded.
    ///
    /// # Errors
    /// As [`StreamDecoder::push`] and [`StreamDecoder::decode`].
    pub fn push(&mut self, bytes: &[u8]) -> Result<Option<OpenScene>, CodecError> {
        self.advance(bytes, self.shown + 1)
    }

    /// As [`Arrival::push`], with all layers that have come.
    fn push_all(&mut self, bytes: &[u8]) -> Result<Option<OpenScene>, CodecError> {
        self.advance(bytes, usize::MAX)
    }

    fn advance(&mut self, bytes: &[u8], layers: usize) -> Result<Option<OpenScene>, CodecError> {
        self.decoder.push(bytes)?;
        let shown = self.decoder.decode_until(layers)?;
        let Some(scene) = self.decoder.scene().filter(|_| shown > self.shown) else { return Ok(None) };
        self.shown = shown;
        let sections = self.decoder.sections().unwrap_or_default();
        let layers = self.decoder.layers().unwrap_or(shown);
        let facts = Facts { bytes: self.decoder.stated().unwrap_or(0), layers, shown, sections: &sections };
        let growth = if shown < layers { growth(&sections, shown) } else { 1.0 };
        OpenScene::new(scene, &facts, growth).map(Some)
    }

    /// The whole scene.
    ///
    /// # Errors
    /// As [`StreamDecoder::finish`]: bytes are missing.
    pub fn finish(self) -> Result<SceneData, CodecError> {
        self.decoder.finish()
    }
}

impl OpenScene {
    /// Decodes a whole file.
    ///
    /// # Errors
    /// As [`light4gs_codec::decode`].
    pub fn decode(bytes: &[u8]) -> Result<Self, CodecError> {
        let mut arrival = Arrival::default();
        let scene = arrival.push_all(bytes)?;
        // Here a file that is cut short is refused.
        arrival.finish()?;
        scene.ok_or(CodecError::MissingSection { section: "gaussians" })
    }
}

/// The factor of the scales if only some layers have come. Gaussians are put into layers by opacity times area, and few
/// Gaussians have most of it. So `share of the area ≈ sqrt(share of the Gaussians) ≈ sqrt(share of their bytes)`, and
/// scales grow by the square root of the area's inverse share.
fn growth(sections: &[SectionInfo], shown: usize) -> f32 {
    let layers: Vec<u64> = sections.iter().filter(|s| s.name == "gaussians").map(|section| section.bytes).collect();
    let sum = |layers: &[u64]| layers.iter().sum::<u64>().max(1) as f32;
    let area = (sum(&layers) / sum(&layers[..shown.min(layers.len())])).sqrt();
    area.sqrt()
}

#[cfg(test)]
mod tests {
    use light4gs_codec::{
        CompressionInput, GaussianLayers, Profile, ShCoding, WeightPrecisions, attributes::AttributeSteps, decode,
        encode_compressed,
    };

    use super::*;

    fn quickstart() -> Vec<u8> {
        std::fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/quickstart.l4gs")).expect("a scene")
    }

    fn layered() -> Vec<u8> {
        let input = CompressionInput {
            profile: Profile::Compact,
            planes: None,
            sh: ShCoding::Channels { step: 0.02 },
            attributes: AttributeSteps::default(),
            weights: WeightPrecisions::default(),
            layers: GaussianLayers::new(4),
        };
        encode_compressed(&decode(&quickstart()).expect("a scene"), &input).expect("a file").bytes
    }

    #[test]
    fn layers_are_shown_as_they_come() {
        let (bytes, mut arrival) = (layered(), Arrival::default());
        let mut counts = Vec::new();
        for piece in bytes.chunks(1000) {
            counts.extend(arrival.push(piece).expect("sound").map(|scene| scene.count()));
        }
        assert_eq!(counts, [428, 1283, 2994, 6415]);
        assert_eq!(arrival.finish().expect("whole"), decode(&bytes).expect("whole"));
    }

    #[test]
    fn the_last_scene_is_that_of_the_whole() {
        let (bytes, mut arrival) = (layered(), Arrival::default());
        // More layers come at once than are shown at once.
        let pieces = bytes.chunks(70_000).chain([&[][..]; 4]);
        let last = pieces.filter_map(|piece| arrival.push(piece).expect("sound")).last().expect("a scene");
        let whole = OpenScene::decode(&bytes).expect("a scene");
        assert_eq!(last.description(), whole.description());
        assert_eq!(last.attributes_at(0.4), whole.attributes_at(0.4));
    }

    #[test]
    fn a_file_without_layers_comes_at_once() {
        let (bytes, mut arrival) = (quickstart(), Arrival::default());
        let (last, all) = bytes.split_last().expect("bytes");
        assert!(arrival.push(all).expect("sound").is_none());
        assert_eq!(arrival.push(&[*last]).expect("sound").map(|scene| scene.count()), Some(6415));
        let mut cut = Arrival::default();
        cut.push(all).expect("sound");
        assert!(cut.finish().unwrap_err().to_string().contains("cut short"));
    }

    #[test]
    fn fewer_gaussians_are_larger() {
        let bytes = layered();
        let sections = light4gs_codec::info(&bytes).expect("a file").sections;
        let growths: Vec<f32> = (1..=4).map(|shown| growth(&sections, shown)).collect();
        // 15, 5 and 2 times as many Gaussians.
        for (found, expected) in growths.iter().zip([1.97, 1.50, 1.19, 1.0]) {
            assert!((found - expected).abs() < 0.15, "{growths:?}");
        }
    }
}
