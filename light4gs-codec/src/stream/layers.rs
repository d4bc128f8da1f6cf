//! Layers of Gaussians: a player shows the first one before the others have come.

use crate::{
    CodecError, GaussianArrays,
    attributes::{self, AttributeInfo},
    bytes::Section,
    limits::at_most,
    sh,
};

/// The layers into which the encoder divides the Gaussians, the most significant ones first.
///
/// Each layer holds twice the number of Gaussians of the one before, and is decoded without those after it. In the file, what
/// all Gaussians share comes first, then layer after layer: [`StreamDecoder`](crate::StreamDecoder) shows the scene while the
/// file comes. One layer is a file whose Gaussians come all at once. Decoded, a file of several layers has the same
/// Gaussians to the bit, layer after layer in place of one order; it takes a few percent more bytes.
///
/// ```
/// use light4gs_codec::GaussianLayers;
///
/// assert_eq!(GaussianLayers::default().sizes(100), [100]);
/// assert_eq!(GaussianLayers::new(3).sizes(700), [100, 200, 400]);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct GaussianLayers {
    /// Number of layers, 1 to [`GaussianLayers::MOST`].
    pub count: u32,
    /// The significance of each Gaussian for the images, `[N]`; the largest come first. `None` takes opacity times the product
    /// of the two larger scales.
    pub significance: Option<Vec<f32>>,
}

impl Default for GaussianLayers {
    fn default() -> Self {
        Self::new(1)
    }
}

impl GaussianLayers {
    /// The most layers that the encoder makes. The first of eight layers has 1/255 of the Gaussians.
    pub const MOST: u32 = 8;

    /// A number of layers, divided by the built-in significance.
    pub fn new(count: u32) -> Self {
        Self { count, significance: None }
    }

    /// The number of Gaussians of each layer, for a number of `gaussians` in all.
    pub fn sizes(&self, gaussians: usize) -> Vec<usize> {
        let count = self.count.clamp(1, Self::MOST);
        let all = (1_u64 << count) - 1;
        // Rounded up, so that the first layer of few Gaussians is not empty.
        let end = |layer: u32| (gaussians as u64 * ((1 << layer) - 1)).div_ceil(all) as usize;
        (0..count).map(|layer| end(layer + 1) - end(layer)).collect()
    }

    /// Refuses numbers of layers that the encoder does not make, and significances that do not fit the Gaussians.
    pub(crate) fn check(&self, gaussians: usize) -> Result<(), CodecError> {
        if !(1..=Self::MOST).contains(&self.count) {
            return Err(CodecError::invalid("layers", "count", self.count, format!("1 to {}", Self::MOST)));
        }
        let Some(significance) = &self.significance else { return Ok(()) };
        if significance.len() != gaussians {
            let expected = format!("{gaussians}, one for each Gaussian");
            return Err(CodecError::invalid("layers", "number of significances", significance.len(), expected));
        }
        match significance.iter().position(|value| value.is_nan()) {
            None => Ok(()),
            Some(index) => Err(CodecError::invalid("layers", format!("significance {index}"), "NaN", "a number")),
        }
    }

    /// The indices of the Gaussians of each layer, rising.
    pub(crate) fn split(&self, gaussians: &GaussianArrays) -> Vec<Vec<u32>> {
        let mut order: Vec<u32> = (0..gaussians.len() as u32).collect();
        if self.count > 1 {
            let built_in: Vec<f32>;
            let significance = match &self.significance {
                Some(given) => given,
                None => {
                    built_in = logarithms_of_significance(gaussians);
                    &built_in
                }
            };
            order.sort_by(|&a, &b| significance[b as usize].total_cmp(&significance[a as usize]));
        }
        let mut rest = order.as_slice();
        let take = |size| {
            let (layer, others) = rest.split_at(size);
            rest = others;
            let mut layer = layer.to_vec();
            layer.sort_unstable();
            layer
        };
        self.sizes(gaussians.len()).into_iter().map(take).collect()
    }
}

/// The logarithm of opacity times the product of the two larger scales: what an image loses at most without the Gaussian.
fn logarithms_of_significance(gaussians: &GaussianArrays) -> Vec<f32> {
    let one = |(logit, scales): (&f32, &[f32; 3])| {
        let smallest = scales.iter().fold(f32::INFINITY, |least, &scale| least.min(scale));
        // The logarithm of the sigmoid.
        scales.iter().sum::<f32>() - smallest - (-logit).exp().ln_1p()
    };
    gaussians.opacity_logits.iter().zip(&gaussians.log_scales).map(one).collect()
}

/// What the heads of the layers say together.
#[derive(Clone, Debug, Default)]
pub(crate) struct LayerHeads {
    /// Gaussians of each layer.
    pub(crate) counts: Vec<u32>,
    /// The attributes, with the bytes of all layers.
    pub(crate) attributes: Vec<AttributeInfo>,
    pub(crate) degree: u8,
}

impl LayerHeads {
    /// Adds a layer. Refuses one that has other attributes or another degree than the first, and too many Gaussians.
    pub(crate) fn add(
        &mut self,
        gaussians: attributes::Head,
        sh: sh::section::Head,
        most: u32,
    ) -> Result<(), CodecError> {
        let before: u64 = self.counts.iter().map(|&count| u64::from(count)).sum();
        at_most(Section::Gaussians.name(), "count of all layers", before + u64::from(gaussians.count), most)?;
        if self.counts.is_empty() {
            (self.attributes, self.degree) = (gaussians.attributes, sh.degree);
        } else {
            self.check_attributes(&gaussians.attributes)?;
            if sh.degree != self.degree {
                let expected = format!("{}, that of the first layer", self.degree);
                return Err(CodecError::invalid(Section::Sh.name(), "degree", sh.degree, expected));
            }
            for (sum, attribute) in self.attributes.iter_mut().zip(&gaussians.attributes) {
                sum.bytes = sum.bytes.saturating_add(attribute.bytes);
            }
        }
        self.counts.push(gaussians.count);
        Ok(())
    }

    fn check_attributes(&self, found: &[AttributeInfo]) -> Result<(), CodecError> {
        let row = |attribute: &AttributeInfo| {
            let AttributeInfo { name, width, coder, optional, bytes: _ } = attribute;
            (name.clone(), *width, *coder, *optional)
        };
        if self.attributes.iter().map(row).eq(found.iter().map(row)) {
            return Ok(());
        }
        let names = |attributes: &[AttributeInfo]| {
            let names: Vec<_> =
                attributes.iter().map(|a| format!("{} ({}, {})", a.name, a.width, a.coder.name())).collect();
            names.join(", ")
        };
        let expected = format!("those of the first layer: {}", names(&self.attributes));
        Err(CodecError::invalid(Section::Gaussians.name(), "attributes of a further layer", names(found), expected))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_double_and_none_is_empty_where_there_are_enough() {
        let four = GaussianLayers::new(4);
        assert_eq!(four.sizes(15), [1, 2, 4, 8]);
        assert_eq!(four.sizes(6), [1, 1, 1, 3]);
        assert_eq!(four.sizes(0), [0; 4]);
        for gaussians in 0..300 {
            for count in 1..=GaussianLayers::MOST {
                let sizes = GaussianLayers::new(count).sizes(gaussians);
                assert_eq!(sizes.iter().sum::<usize>(), gaussians);
                assert!(gaussians == 0 || sizes[0] > 0);
            }
        }
    }

    #[test]
    fn the_most_significant_gaussians_come_first() {
        let gaussians = GaussianArrays {
            means: vec![[0.0; 3]; 3],
            // Large and transparent, small and opaque, large and opaque.
            log_scales: vec![[0.0, 0.0, -9.0], [-3.0; 3], [-9.0, 0.0, 0.0]],
            opacity_logits: vec![-6.0, 3.0, 3.0],
            ..Default::default()
        };
        assert_eq!(GaussianLayers::new(2).split(&gaussians), [vec![2], vec![0, 1]]);
        let given = GaussianLayers { count: 2, significance: Some(vec![0.1, 7.0, 0.2]) };
        assert_eq!(given.split(&gaussians), [vec![1], vec![0, 2]]);
        assert_eq!(GaussianLayers::default().split(&gaussians), [vec![0, 1, 2]]);
    }

    #[test]
    fn what_makes_no_layers_is_refused() {
        let problem = |layers: GaussianLayers| layers.check(2).unwrap_err().to_string();
        assert_eq!(problem(GaussianLayers::new(0)), "layers: count is 0, expected 1 to 8");
        assert!(GaussianLayers::new(9).check(2).is_err());
        let given = |significance| GaussianLayers { count: 2, significance: Some(significance) };
        assert!(problem(given(vec![1.0])).contains("number of significances is 1, expected 2"));
        assert!(problem(given(vec![1.0, f32::NAN])).contains("significance 1 is NaN"));
        assert!(given(vec![1.0, f32::INFINITY]).check(2).is_ok());
    }
}
