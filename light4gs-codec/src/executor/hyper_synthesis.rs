//! `h_s`: from the decoded hyperprior to entropy parameters at every position (paper III-C).

use super::{Convolution, PaddedMap, lanes::leaky_relu, transposed::TransposedConvolution};
use crate::ConvolutionLayer;

/// Two transposed convolutions and a convolution, LeakyReLU between: `[N, H/4, W/4]` to `[2M, H, W]`.
#[derive(Clone, Debug)]
pub(crate) struct HyperSynthesis {
    first: TransposedConvolution,
    second: TransposedConvolution,
    last: Convolution,
}

impl HyperSynthesis {
    /// From the layers `h_s.0`, `h_s.2`, `h_s.4`, whose shapes are sound.
    pub(crate) fn new([first, second, last]: [&ConvolutionLayer; 3]) -> Self {
        Self {
            first: TransposedConvolution::new(first),
            second: TransposedConvolution::new(second),
            last: Convolution::new(last),
        }
    }

    /// The input of [`HyperSynthesis::last`]: `[B, H, W]`. `hyper` has a border of 1.
    pub(crate) fn expand(&self, hyper: &PaddedMap) -> PaddedMap {
        let half = self.first.apply(hyper, 1, leaky_relu);
        self.second.apply(&half, self.last.border(), leaky_relu)
    }

    /// The convolution at the end, which is left to be evaluated where its outputs are wanted.
    pub(crate) fn last(&self) -> &Convolution {
        &self.last
    }
}
