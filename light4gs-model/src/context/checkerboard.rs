//! The checkerboard context (He et al. 2021; paper III-C).
//!
//! ```text
//!     . # . #      # anchors: row + column odd. Coded first, all at once, without this context.
//!     # . # .      . the others: coded second, all at once, with the decoded anchors around them as context.
//!     . # . #
//! ```

use burn::config::Config;
use burn::module::Module;
use burn::tensor::{Device, Tensor};
use light4gs_codec::{Network, PlaneSource};

use super::prior::DescribedCondition;
use crate::entropy::convolution::{PlaneConv, PlaneConvConfig};

const KERNEL: usize = 5;

/// Configuration of a [`Checkerboard`].
#[derive(Config, Debug)]
pub struct CheckerboardConfig {
    /// Channels of a plane, M.
    pub channels: usize,
    /// Groups of the convolution.
    #[config(default = 1)]
    pub groups: usize,
}

impl CheckerboardConfig {
    /// PyTorch's default initialization; masked taps are zero.
    pub fn init(&self, device: &Device) -> Checkerboard {
        let conv = PlaneConvConfig::new(self.channels, 2 * self.channels, KERNEL)
            .with_groups(self.groups)
            .with_checkerboard(true);
        Checkerboard { conv: conv.init(device) }
    }
}

/// The context of non-anchors from the anchors around them.
#[derive(Module, Debug)]
pub struct Checkerboard {
    /// 5×5 `[M, H, W]` to `[2 M, H, W]`; only taps with row + column odd, which lead from a non-anchor to anchors.
    pub conv: PlaneConv,
}

impl Checkerboard {
    /// The same computation as [`Self::context`], for the codec's exact executor.
    pub fn describe(&self) -> DescribedCondition {
        let layer = self.conv.to_layer();
        let (mut network, [anchors]) = Network::new([layer.inputs]);
        let context = network.layer(anchors, layer);
        network.output(context);
        DescribedCondition { network, sources: vec![PlaneSource::Anchors] }
    }

    /// The context `[2 M, H, W]` of a plane `[M, H, W]` in original units, of which only the anchors are used. It is
    /// zero at the anchors themselves, so that one evaluation of the following network serves both passes.
    ///
    /// ```
    /// use burn::tensor::{Device, Tensor};
    /// use light4gs_model::CheckerboardConfig;
    ///
    /// let device = Device::flex();
    /// let context = CheckerboardConfig::new(4).init(&device).context(Tensor::ones([4, 8, 8], &device));
    /// assert_eq!(context.dims(), [8, 8, 8]);
    /// ```
    pub fn context(&self, plane: Tensor<3>) -> Tensor<3> {
        // From one of the others the taps lead to anchors only, so the plane needs no mask.
        self.conv.without_anchors(plane)
    }
}

/// `[1, H, W]`: 1 at the anchors, where row + column is odd, else 0.
pub fn anchor_mask([height, width]: [usize; 2], device: &Device) -> Tensor<3> {
    let mask: Vec<f32> = (0..height * width).map(|i| ((i / width + i % width) % 2) as f32).collect();
    Tensor::<1>::from_floats(mask.as_slice(), device).reshape([1, height, width])
}
