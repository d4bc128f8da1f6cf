//! The context model and the quantisation steps as the codec's plain arrays.

use burn::module::Param;
use burn::tensor::Tensor;
use light4gs_codec::plane_layout::{PLANES_PER_SCALE, SPACE_ONLY_PLANES, SPACE_TIME_PLANES};
use light4gs_codec::{
    CodecError, ContextModelArrays, ContextModelShape, ContextParts as Parts, ConvolutionLayer, ConvolutionShape,
    FrequencyTable, PerGroup, SpatialKernel,
};

use super::model::ContextModel;
use crate::entropy::convolution::PlaneConv;
use crate::entropy::quantization_steps::PlaneSteps;
use crate::named_parameters::Layer;

fn values<const D: usize>(parameter: &Param<Tensor<D>>) -> Vec<f32> {
    parameter.val().into_data().iter::<f32>().collect()
}

impl PlaneSteps {
    /// A pair of steps for each scale, or one for all where they are the same.
    pub fn to_groups(&self) -> Vec<PerGroup> {
        let steps = self.values();
        let mut groups: Vec<PerGroup> = steps
            .chunks_exact(PLANES_PER_SCALE)
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
