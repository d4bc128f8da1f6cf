//! The two networks for which LPIPS is published, up to the last layer that it uses.

use std::fmt;

/// A network whose features are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LpipsNetwork {
    /// AlexNet (Krizhevsky 2014), the one with which papers report results.
    Alex,
    /// VGG-16 (Simonyan and Zisserman 2014).
    Vgg,
}

/// A convolution with the ReLU after it.
#[derive(Clone, Copy, Debug)]
pub(super) struct LayerShape {
    /// Its number among the layers of torchvision's `features`.
    pub(super) index: usize,
    /// Side of the maximum pooling (stride 2) before it.
    pub(super) pooling: Option<usize>,
    pub(super) inputs: usize,
    pub(super) outputs: usize,
    /// Side of the kernel.
    pub(super) kernel: usize,
    pub(super) stride: usize,
    pub(super) padding: usize,
    /// Whether LPIPS compares its output.
    pub(super) is_tap: bool,
}

const fn layer(index: usize, pooling: Option<usize>, inputs: usize, outputs: usize, is_tap: bool) -> LayerShape {
    LayerShape { index, pooling, inputs, outputs, kernel: 3, stride: 1, padding: 1, is_tap }
}

const ALEX: [LayerShape; 5] = [
    LayerShape { kernel: 11, stride: 4, padding: 2, ..layer(0, None, 3, 64, true) },
    LayerShape { kernel: 5, padding: 2, ..layer(3, Some(3), 64, 192, true) },
    layer(6, Some(3), 192, 384, true),
    layer(8, None, 384, 256, true),
    layer(10, None, 256, 256, true),
];

const VGG: [LayerShape; 13] = [
    layer(0, None, 3, 64, false),
    layer(2, None, 64, 64, true),
    layer(5, Some(2), 64, 128, false),
    layer(7, None, 128, 128, true),
    layer(10, Some(2), 128, 256, false),
    layer(12, None, 256, 256, false),
    layer(14, None, 256, 256, true),
    layer(17, Some(2), 256, 512, false),
    layer(19, None, 512, 512, false),
    layer(21, None, 512, 512, true),
    layer(24, Some(2), 512, 512, false),
    layer(26, None, 512, 512, false),
    layer(28, None, 512, 512, true),
];

impl LpipsNetwork {
    /// Both networks.
    pub const ALL: [Self; 2] = [Self::Alex, Self::Vgg];

    /// The name that the `lpips` package gives it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Alex => "alex",
            Self::Vgg => "vgg",
        }
    }

    pub(super) fn layers(self) -> &'static [LayerShape] {
        match self {
            Self::Alex => &ALEX,
            Self::Vgg => &VGG,
        }
    }

    /// Channels at each tap.
    pub(super) fn tap_channels(self) -> impl Iterator<Item = usize> {
        self.layers().iter().filter(|layer| layer.is_tap).map(|layer| layer.outputs)
    }

    /// The smallest side of an image that still has a pixel at the last tap.
    pub(super) fn least_side(self) -> usize {
        match self {
            Self::Alex => 31,
            Self::Vgg => 16,
        }
    }
}

impl fmt::Display for LpipsNetwork {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())
    }
}
