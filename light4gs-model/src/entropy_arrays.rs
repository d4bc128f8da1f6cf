//! Entropy models and quantisation steps as the codec's plain arrays.

use burn::module::Param;
use burn::tensor::Tensor;
use light4gs_codec::{
    CodecError, ContextModelArrays, ContextModelShape, ContextParts as Parts, ConvolutionLayer, ConvolutionShape,
    FrequencyTable, LinearLayer, PerGroup, ShCoding, ShCondition, SpatialKernel,
};

use crate::context_model::ContextModel;
use crate::hexplane::{PLANE_NAMES, SPACE_ONLY_PLANES, SPACE_TIME_PLANES};
use crate::named_parameters::Layer;
use crate::plane_conv::PlaneConv;
use crate::quantization_steps::PlaneSteps;
use crate::sh_entropy::{ShEntropy, ShEntropyModel};

/// A table goes no further than this many symbols on either side of 0; what lies beyond is escaped.
const TABLE_REACH: i32 = 8000;

/// The symbol of a value, as far as a table reaches.
fn table_symbol(value: f32, step: f32) -> i32 {
    ((value / step).round() as i32).clamp(-TABLE_REACH, TABLE_REACH)
}

fn values<const D: usize>(parameter: &Param<Tensor<D>>) -> Vec<f32> {
    parameter.val().into_data().iter::<f32>().collect()
}

impl PlaneSteps {
    /// A pair of steps for each scale, or one for all where they are the same.
    pub fn to_groups(&self) -> Vec<PerGroup> {
        let steps = self.values();
        let mut groups: Vec<PerGroup> = steps
            .chunks_exact(PLANE_NAMES.len())
            .map(|scale| PerGroup { space_only: scale[SPACE_ONLY_PLANES[0]], space_time: scale[SPACE_TIME_PLANES[0]] })
            .collect();
        if groups.iter().all(|group| *group == groups[0]) {
            groups.truncate(1);
        }
        groups
    }
}

impl ContextModel {
    /// What a decoder needs of the model. Call [`Self::update_quantiles`] first: the hyperprior's tables go as far as
    /// its quantiles.
    ///
    /// # Errors
    /// A density that gives no frequency table; the message names what is wrong with it.
    pub fn to_arrays(&self) -> Result<ContextModelArrays, CodecError> {
        let shape = self.stream_shape();
        let found = self.layers();
        let layers = shape.layers().into_iter().map(|shape| convolution_layer(shape, &found)).collect();
        let (mut hyper_tables, mut hyper_medians) = (Vec::new(), Vec::new());
        if let Some(hyperprior) = &self.hyperprior {
            let bottleneck = &hyperprior.bottleneck;
            for (channel, range) in bottleneck.symbol_ranges().into_iter().enumerate() {
                let first = *range.start();
                hyper_tables.push(FrequencyTable::from_pmf(first, &bottleneck.pmf(range)[channel])?);
            }
            hyper_medians = bottleneck.medians().into_data().iter::<f32>().collect();
        }
        Ok(ContextModelArrays { shape, layers, hyper_tables, hyper_medians })
    }

    fn stream_shape(&self) -> ContextModelShape {
        let [first, second, last] = &self.entropy_parameters.layers;
        let outputs = |layer: &PlaneConv| layer.weight.dims()[0] as u32;
        let kernel = |layer: Option<&PlaneConv>| {
            layer.map_or_else(SpatialKernel::default, |layer| SpatialKernel {
                kernel: layer.weight.dims()[2] as u32,
                groups: layer.groups() as u32,
            })
        };
        let (hyper_channels, synthesis_channels) = self.hyperprior.as_ref().map_or((0, [0; 2]), |hyperprior| {
            let up = hyperprior.synthesis_up.each_ref().map(|layer| layer.weight.dims()[1] as u32);
            (outputs(&hyperprior.analysis[2]), up)
        });
        ContextModelShape {
            channels: outputs(last) / 2,
            hyper_channels,
            synthesis_channels,
            parameter_channels: [outputs(first), outputs(second)],
            context_groups: kernel(self.checkerboard.as_ref().map(|part| &part.conv)).groups,
            inter_plane: kernel(self.inter_plane.as_ref().map(|part| &part.conv)),
            inter_scale: kernel(self.inter_scale.as_ref().map(|part| &part.conv)),
            parts: Parts {
                hyperprior: self.hyperprior.is_some(),
                checkerboard: self.checkerboard.is_some(),
                inter_plane: self.inter_plane.is_some(),
                inter_scale: self.inter_scale.is_some(),
                high_scale_hyperprior: self.has_high_scale_hyperprior(),
            },
            centres: PerGroup {
                space_only: self.center_of(SPACE_ONLY_PLANES[0]) as f32,
                space_time: self.center_of(SPACE_TIME_PLANES[0]) as f32,
            },
        }
    }
}

fn convolution_layer(shape: ConvolutionShape, layers: &[Layer]) -> ConvolutionLayer {
    let layer = layers.iter().find(|layer| layer.name == shape.name).expect("the stream names our own layers");
    ConvolutionLayer { shape, weight: values(layer.weight), bias: values(layer.bias) }
}

impl ShEntropyModel {
    /// What a decoder needs to read `sh_rest`, `[N, 15, 3]` row-major. Tables go as far as these values do.
    ///
    /// # Errors
    /// Values that are not finite, or too many steps apart for a table.
    pub fn to_coding(&self, sh_rest: &[f32]) -> Result<ShCoding, CodecError> {
        let step = self.step();
        if let Some(tables) = self.tables() {
            let symbols = sh_rest.iter().map(|value| table_symbol(*value, step));
            let (low, high) = symbols.fold((0, 0), |(low, high), k| (low.min(k), high.max(k)));
            let pmf = tables.pmf(low..=high);
            let tables = pmf.iter().map(|pmf| FrequencyTable::from_pmf(low, pmf)).collect::<Result<_, _>>()?;
            return Ok(ShCoding::Tables { step, tables });
        }
        let kind = match self {
            Self::HexPlaneCoupled(_) => ShCondition::HexplaneCoupled,
            _ => ShCondition::Autoregressive,
        };
        let layers = self.layers().iter().map(linear_layer).collect();
        Ok(ShCoding::Conditional { step, kind, layers })
    }
}

/// A 1×1 convolution as a linear layer.
fn linear_layer(layer: &Layer) -> LinearLayer {
    let [outputs, inputs, ..] = layer.weight.dims();
    LinearLayer {
        name: layer.name.to_owned(),
        inputs: inputs as u32,
        outputs: outputs as u32,
        weight: values(layer.weight),
        bias: values(layer.bias),
    }
}

/// Coding of `sh_rest`, `[N, channels]` row-major, without a trained model: a table a channel, from how often each
/// symbol occurs.
///
/// # Errors
/// Values too many steps apart for a table.
pub fn counted_sh_coding(sh_rest: &[f32], channels: usize, step: f32) -> Result<ShCoding, CodecError> {
    let table = |channel: usize| {
        let symbols: Vec<i32> =
            sh_rest.iter().skip(channel).step_by(channels).map(|value| table_symbol(*value, step)).collect();
        let (low, high) = symbols.iter().fold((0, 0), |(low, high), k| (low.min(*k), high.max(*k)));
        let mut pmf = vec![0.0; (high - low + 1) as usize];
        for symbol in &symbols {
            pmf[(symbol - low) as usize] += 1.0 / symbols.len() as f64;
        }
        if symbols.is_empty() {
            pmf[0] = 1.0;
        }
        FrequencyTable::from_pmf(low, &pmf)
    };
    Ok(ShCoding::Tables { step, tables: (0..channels).map(table).collect::<Result<_, _>>()? })
}
