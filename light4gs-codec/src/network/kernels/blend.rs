//! Weighted sums of numbers that are the same at all places: poses of control nodes, blended by each Gaussian's weights.

use super::lanes::{LANES, Lanes, kept};

/// Outputs that are computed together.
const PANEL: usize = 4;
/// One number for each output of a panel.
type Panel = [f32; PANEL];

/// Numbers `[outputs, channels]` that are the same at all places, for sums over the channels.
#[derive(Debug, Default)]
pub(crate) struct Blend {
    channels: usize,
    /// For four outputs at a time, their numbers channel by channel. Zeros fill up the last four.
    panels: Vec<Panel>,
    finite: bool,
}

impl Blend {
    /// Takes `[outputs, channels]` numbers, each the same in all lanes.
    pub(crate) fn set(&mut self, numbers: &[Lanes], channels: usize) {
        self.channels = channels;
        self.finite = numbers.iter().all(|lanes| lanes[0].is_finite());
        self.panels.clear();
        for outputs in numbers.chunks(PANEL * channels) {
            let number = |output: usize, channel: usize| outputs.get(output * channels + channel).map_or(0.0, |n| n[0]);
            self.panels.extend((0..channels).map(|channel| std::array::from_fn(|output| number(output, channel))));
        }
    }

    /// `output = sum(kept(number · weight))` over the channels in their order, see [`super::kept`]. `used` is scratch
    /// memory.
    ///
    /// If all numbers are finite, channels whose weight is 0 at all eight places are left out. Their products are +0,
    /// and adding +0 changes no bit, because no sum is ever -0: neither 0 nor any product is.
    #[inline(always)]
    pub(crate) fn apply(&self, weights: &[Lanes], used: &mut Vec<(usize, Lanes)>, outputs: &mut [Lanes]) {
        used.clear();
        let all = weights.iter().enumerate().map(|(channel, lanes)| (channel, *lanes));
        used.extend(all.filter(|(_, lanes)| !self.finite || lanes.iter().any(|&weight| weight != 0.0)));
        for (panel, outputs) in self.panels.chunks_exact(self.channels).zip(outputs.chunks_mut(PANEL)) {
            let sums = panel_sums(panel, used);
            for (output, sum) in outputs.iter_mut().zip(&sums) {
                *output = sum.map(kept);
            }
        }
    }
}

/// On x86-64 inlined, to be compiled for the vectors of the processor (see [`crate::vectors`]). Elsewhere a separate
/// and simple function, so that the compiler keeps the sums in vector registers.
#[cfg_attr(target_arch = "x86_64", inline(always))]
#[cfg_attr(not(target_arch = "x86_64"), inline(never))]
fn panel_sums(panel: &[Panel], weights: &[(usize, Lanes)]) -> [Lanes; PANEL] {
    let mut sums = [[0.0; LANES]; PANEL];
    for (channel, weights) in weights {
        for (sum, number) in sums.iter_mut().zip(panel[*channel]) {
            for (sum, weight) in sum.iter_mut().zip(weights) {
                *sum += kept(number * weight);
            }
        }
    }
    sums
}
