//! The context model of the hexplanes as plain arrays (paper III-C, DESIGN section 6).

use crate::{CodecError, FrequencyTable, Limits, limits::at_most};

const SECTION: &str = "context_model";

/// A number for the planes over space and one for the planes over an axis and time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PerGroup {
    /// For xy, xz and yz.
    pub space_only: f32,
    /// For xt, yt and zt.
    pub space_time: f32,
}

impl PerGroup {
    pub(crate) fn of(self, space_time: bool) -> f32 {
        if space_time { self.space_time } else { self.space_only }
    }
}

/// Everything that is needed to read planes: the networks that give each value's distribution, but for `h_a`, which
/// only the encoder needs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ContextModelArrays {
    /// Sizes and parts.
    pub shape: ContextModelShape,
    /// The layers of [`ContextModelShape::layers`], in that order.
    pub layers: Vec<ConvolutionLayer>,
    /// One distribution of hyperprior symbols for each hyper channel; none without the hyperprior.
    pub hyper_tables: Vec<FrequencyTable>,
    /// The median of each hyper channel: a hyperprior value is symbol plus median.
    pub hyper_medians: Vec<f32>,
}

/// Sizes and parts of a context model.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContextModelShape {
    /// `M`: channels of a plane.
    pub channels: u32,
    /// `N`: channels of the hyperprior.
    pub hyper_channels: u32,
    /// `A` and `B`: channels between the layers of `h_s`. The reference has `M` and `3M/2`.
    pub synthesis_channels: [u32; 2],
    /// `C` and `D`: channels between the layers of `entropy_parameters`. The reference has `10M/3` and `8M/3`.
    pub parameter_channels: [u32; 2],
    /// Groups of the checkerboard-masked convolution.
    pub context_groups: u32,
    /// The convolution of the time means.
    pub inter_plane: SpatialKernel,
    /// The convolution of the plane one scale below.
    pub inter_scale: SpatialKernel,
    /// The parts that are there.
    pub parts: ContextParts,
    /// What is subtracted from a plane before any network sees it.
    pub centres: PerGroup,
}

/// Size and groups of a convolution.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SpatialKernel {
    /// Side of the kernel, odd.
    pub kernel: u32,
    /// Groups, a divisor of inputs and outputs.
    pub groups: u32,
}

/// The parts of a context model that can be switched off (DESIGN section 6).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ContextParts {
    /// A hyperprior for planes that nothing else is known about.
    pub hyperprior: bool,
    /// Half of the positions of a plane tell about the other half.
    pub checkerboard: bool,
    /// Planes over time tell about planes over space of the same scale.
    pub inter_plane: bool,
    /// A plane tells about the one a scale above.
    pub inter_scale: bool,
    /// Higher scales have a hyperprior besides, as in the public code; needs `hyperprior` and `inter_scale`.
    pub high_scale_hyperprior: bool,
}

impl ContextParts {
    pub(crate) fn bits(self) -> u8 {
        let Self { hyperprior, checkerboard, inter_plane, inter_scale, high_scale_hyperprior } = self;
        let parts = [hyperprior, checkerboard, inter_plane, inter_scale, high_scale_hyperprior];
        parts.iter().enumerate().map(|(bit, &on)| u8::from(on) << bit).sum()
    }

    pub(crate) fn from_bits(bits: u8) -> Option<Self> {
        let [hyperprior, checkerboard, inter_plane, inter_scale, high_scale_hyperprior] =
            [0, 1, 2, 3, 4].map(|bit| bits >> bit & 1 == 1);
        let parts = Self { hyperprior, checkerboard, inter_plane, inter_scale, high_scale_hyperprior };
        (bits >> 5 == 0).then_some(parts)
    }
}

/// The shape of a convolution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ConvolutionShape {
    /// Its name, as in the Burn module.
    pub name: &'static str,
    /// Output channels.
    pub outputs: u32,
    /// Input channels.
    pub inputs: u32,
    /// Side of the kernel.
    pub kernel: u32,
    /// Groups, as in PyTorch.
    pub groups: u32,
    /// Whether it is a transposed convolution of stride 2 (padding 2, output padding 1); others have stride 1 and keep
    /// the size.
    pub transposed: bool,
}

impl ConvolutionShape {
    /// Numbers of the weight.
    pub fn weights(&self) -> u64 {
        let taps = u64::from(self.kernel) * u64::from(self.kernel);
        u64::from(self.outputs) * u64::from(self.inputs / self.groups.max(1)) * taps
    }
}

/// A convolution.
#[derive(Clone, Debug, PartialEq)]
pub struct ConvolutionLayer {
    /// Its shape.
    pub shape: ConvolutionShape,
    /// `[outputs, inputs / groups, kernel, kernel]` row-major; `[inputs, outputs, kernel, kernel]` where transposed.
    pub weight: Vec<f32>,
    /// `[outputs]`.
    pub bias: Vec<f32>,
}

/// The name of the layer whose kernel is masked.
pub(crate) const CONTEXT_PREDICTION: &str = "context_prediction";

/// Positions in a 5 x 5 kernel, row-major, that the checkerboard mask leaves: row plus column is odd.
pub(crate) fn masked_taps() -> impl Iterator<Item = usize> {
    (0..25).filter(|tap| (tap / 5 + tap % 5) % 2 == 1)
}

impl ContextModelShape {
    /// The layers that a decoder needs, in the order of the stream. Layers of parts that are switched off are missing.
    ///
    /// ```
    /// use light4gs_codec::{ContextModelShape, ContextParts};
    /// let shape = ContextModelShape {
    ///     channels: 4,
    ///     parameter_channels: [8, 8],
    ///     context_groups: 4,
    ///     parts: ContextParts { checkerboard: true, ..Default::default() },
    ///     ..Default::default()
    /// };
    /// let names: Vec<_> = shape.layers().iter().map(|layer| layer.name).collect();
    /// assert_eq!(names, ["context_prediction", "entropy_parameters.0", "entropy_parameters.2", "entropy_parameters.4"]);
    /// ```
    pub fn layers(&self) -> Vec<ConvolutionShape> {
        let (m, n) = (self.channels, self.hyper_channels);
        let ([a, b], [c, d]) = (self.synthesis_channels, self.parameter_channels);
        let two = m.saturating_mul(2);
        let layer = |name, inputs, outputs, kernel, groups, transposed| ConvolutionShape {
            name,
            outputs,
            inputs,
            kernel,
            groups,
            transposed,
        };
        let mut layers = Vec::new();
        if self.parts.hyperprior {
            layers.push(layer("h_s.0", n, a, 5, 1, true));
            layers.push(layer("h_s.2", a, b, 5, 1, true));
            layers.push(layer("h_s.4", b, two, 3, 1, false));
        }
        if self.parts.checkerboard {
            layers.push(layer(CONTEXT_PREDICTION, m, two, 5, self.context_groups, false));
        }
        if self.parts.inter_plane {
            let SpatialKernel { kernel, groups } = self.inter_plane;
            layers.push(layer("inter_plane", two, two, kernel, groups, false));
        }
        if self.parts.inter_scale {
            let SpatialKernel { kernel, groups } = self.inter_scale;
            layers.push(layer("inter_scale", m, two, kernel, groups, false));
        }
        layers.push(layer("entropy_parameters.0", m.saturating_mul(4), c, 1, 1, false));
        layers.push(layer("entropy_parameters.2", c, d, 1, 1, false));
        layers.push(layer("entropy_parameters.4", d, two, 1, 1, false));
        layers
    }

    /// Numbers of all weights.
    pub(crate) fn weights(&self) -> u64 {
        self.layers().iter().fold(0, |sum: u64, layer| sum.saturating_add(layer.weights()))
    }

    /// Refuses sizes that make no network, or one beyond the limits.
    pub(crate) fn check(&self, limits: &Limits) -> Result<(), CodecError> {
        let ContextParts { hyperprior, inter_scale, high_scale_hyperprior, .. } = self.parts;
        if high_scale_hyperprior && !(hyperprior && inter_scale) {
            return invalid("parts", "high_scale_hyperprior alone", "hyperprior and inter_scale with it");
        }
        for (name, centre) in [("space-only", self.centres.space_only), ("space-time", self.centres.space_time)] {
            if !centre.is_finite() {
                return invalid(&format!("centre of {name} planes"), &centre.to_string(), "a finite number");
            }
        }
        let mut weights = 0u64;
        for ConvolutionShape { name, outputs, inputs, kernel, groups, .. } in self.layers() {
            for (what, channels) in [("inputs", inputs), ("outputs", outputs)] {
                at_most(SECTION, format!("{name}.{what}"), channels.into(), limits.layer_width)?;
                if channels == 0 {
                    return invalid(&format!("{name}.{what}"), "0", "1 or more");
                }
            }
            if groups == 0 || !inputs.is_multiple_of(groups) || !outputs.is_multiple_of(groups) {
                let expected = format!("a divisor of {inputs} inputs and {outputs} outputs");
                return invalid(&format!("{name}.groups"), &groups.to_string(), &expected);
            }
            if kernel.is_multiple_of(2) || kernel > 7 {
                return invalid(&format!("{name}.kernel"), &kernel.to_string(), "odd, at most 7");
            }
            let taps = u64::from(kernel) * u64::from(kernel);
            weights = weights.saturating_add(u64::from(outputs) * u64::from(inputs / groups) * taps);
        }
        at_most(SECTION, "number of weights", weights, limits.layer_weights)
    }
}

impl ContextModelArrays {
    /// A layer that the shape has.
    pub(crate) fn layer(&self, name: &str) -> &ConvolutionLayer {
        self.layers
            .iter()
            .find(|layer| layer.shape.name == name)
            .expect("`check` has compared the layers with the shape")
    }

    /// Refuses arrays that contradict the shape.
    pub(crate) fn check(&self, limits: &Limits) -> Result<(), CodecError> {
        self.shape.check(limits)?;
        let expected = self.shape.layers();
        let found: Vec<_> = self.layers.iter().map(|layer| layer.shape).collect();
        if found != expected {
            return invalid("layers", &format!("{found:?}"), &format!("{expected:?}"));
        }
        for ConvolutionLayer { shape, weight, bias } in &self.layers {
            for (what, values, count) in [("weight", weight, shape.weights()), ("bias", bias, u64::from(shape.outputs))]
            {
                if values.len() as u64 != count {
                    let field = format!("length of {}.{what}", shape.name);
                    return invalid(&field, &values.len().to_string(), &count.to_string());
                }
                if let Some(index) = values.iter().position(|value| !value.is_finite()) {
                    let field = format!("{}.{what}", shape.name);
                    return Err(CodecError::NonFinite { section: SECTION, field, index, value: values[index] });
                }
            }
        }
        let channels = if self.shape.parts.hyperprior { self.shape.hyper_channels as usize } else { 0 };
        for (what, count) in [("hyper_tables", self.hyper_tables.len()), ("hyper_medians", self.hyper_medians.len())] {
            if count != channels {
                return invalid(
                    &format!("length of {what}"),
                    &count.to_string(),
                    &format!("{channels}, the hyper channels"),
                );
            }
        }
        if let Some(index) = self.hyper_medians.iter().position(|median| !median.is_finite()) {
            let value = self.hyper_medians[index];
            return Err(CodecError::NonFinite { section: SECTION, field: "hyper_medians".into(), index, value });
        }
        Ok(())
    }
}

fn invalid(field: &str, found: &str, expected: &str) -> Result<(), CodecError> {
    Err(CodecError::invalid(SECTION, field, found, expected))
}
