//! The deformation network as one Burn operation (paper III-A): a tree of linear layers with a ReLU between any two, such as a
//! trunk and its heads, on many rows.
//!
//! One operation a layer writes every layer's output of all Gaussians to memory, with and without its ReLU, and reads it again. Here a
//! block of rows goes through all layers while its numbers are in the cache, or in a workgroup's memory. Only what the backward
//! pass needs is written: the hidden layers after their ReLU.

mod cpu;
#[cfg(feature = "wgpu")]
pub(super) mod gpu;
mod slots;

use std::fmt::Debug;

use burn::backend::autodiff::checkpoint::base::Checkpointer;
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, AutodiffBackend, Backend, Dispatch, ExtensionType, backend_extension};
use burn::tensor::Tensor;

use super::for_all_back_ends;
use super::tensor_list::TensorList;

/// Most layers of a network.
pub const MOST_LAYERS: usize = 16;
/// Most numbers of a row that are needed at once: what a workgroup's memory on a GPU holds for a few rows.
const MOST_CHANNELS: usize = 512;
/// Features, weights and biases; a tape's node has a fixed number of parents.
const PARENTS: usize = 1 + 2 * MOST_LAYERS;

/// A layer's place in a [`NetworkLayout`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct LayerLayout {
    /// The earlier layer whose output, after a ReLU, is this one's input; `None`: the features.
    pub input: Option<usize>,
    /// Numbers in.
    pub inputs: usize,
    /// Numbers out.
    pub outputs: usize,
}

/// The layers of a network. Each comes after the one that it reads. Layers that no other reads are the network's output.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct NetworkLayout(Vec<LayerLayout>);

impl NetworkLayout {
    /// Adds a layer, and returns its number.
    pub fn add(&mut self, input: Option<usize>, [inputs, outputs]: [usize; 2]) -> usize {
        debug_assert!(
            input.is_none_or(|input| self.0[input].outputs == inputs),
            "a layer reads all of another's output"
        );
        self.0.push(LayerLayout { input, inputs, outputs });
        self.0.len() - 1
    }

    /// The layers.
    pub fn layers(&self) -> &[LayerLayout] {
        &self.0
    }

    /// Whether the operation takes such a network: it has at most [`MOST_LAYERS`], and a GPU can keep some rows of what its layers
    /// give each other in the memory of a workgroup.
    pub fn fits(&self) -> bool {
        (1..=MOST_LAYERS).contains(&self.0.len()) && self.channels_at_once() <= MOST_CHANNELS
    }

    /// Numbers of a row of features.
    fn features(&self) -> usize {
        self.0.iter().find(|layer| layer.input.is_none()).map_or(0, |layer| layer.inputs)
    }

    /// Whether another layer reads this one's output.
    fn is_hidden(&self, layer: usize) -> bool {
        self.0.iter().any(|other| other.input == Some(layer))
    }

    /// For each layer, where its output begins in a row of the network's; `None` for hidden ones. Then the length of a row.
    fn places(&self) -> (Vec<Option<usize>>, usize) {
        let mut width = 0;
        let places = self.0.iter().enumerate().map(|(number, layer)| {
            (!self.is_hidden(number)).then(|| {
                width += layer.outputs;
                width - layer.outputs
            })
        });
        (places.collect(), width)
    }
}

/// Features, and the parameters of all layers.
#[derive(ExtensionType)]
pub struct NetworkTensors<B: Backend> {
    /// `[N, F]`.
    pub features: FloatTensor<B>,
    /// For each layer its weights `[inputs, outputs]`, then its biases `[outputs]`.
    #[extension_type]
    pub parameters: TensorList<B>,
}

/// Gradients of a network.
pub struct NetworkGradients<B: Backend> {
    /// `[N, F]`; `None` if not requested.
    pub features: Option<FloatTensor<B>>,
    /// In the order of [`NetworkTensors::parameters`].
    pub parameters: Vec<FloatTensor<B>>,
}

/// A back end's kernels. [`NetworkOps`] adds the dispatch and the tape.
pub trait NetworkKernels: Backend {
    /// What the backward pass needs from the forward pass.
    type Saved: Clone + Debug + Send + 'static;

    /// The outputs `[N, O]`; N > 0. A backward pass follows only if `keep`.
    fn network_forward(
        tensors: NetworkTensors<Self>,
        layout: NetworkLayout,
        keep: bool,
    ) -> (FloatTensor<Self>, Self::Saved);

    /// Gradients of all parameters and, if `with_features`, of the features.
    fn network_backward(saved: Self::Saved, gradient: FloatTensor<Self>, with_features: bool)
    -> NetworkGradients<Self>;
}

/// The network on every back end that has [`NetworkKernels`], differentiable under [`Autodiff`].
#[backend_extension(
    NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"), Autodiff
)]
pub trait NetworkOps: Backend {
    /// The outputs `[N, O]`; see [`network`].
    fn deformation_network(#[extension_type] tensors: NetworkTensors<Self>, layout: NetworkLayout)
    -> FloatTensor<Self>;
}

for_all_back_ends! {
    NetworkOps with NetworkKernels {
        fn deformation_network(tensors: NetworkTensors<Self>, layout: NetworkLayout) -> FloatTensor<Self> {
            Self::network_forward(tensors, layout, false).0
        }
    }
}

impl<B: NetworkOps + NetworkKernels, C: CheckpointStrategy> NetworkOps for Autodiff<B, C> {
    fn deformation_network(tensors: NetworkTensors<Self>, layout: NetworkLayout) -> FloatTensor<Self> {
        #[derive(Debug)]
        struct Network;

        impl<B: NetworkKernels> Backward<B, PARENTS> for Network {
            type State = B::Saved;

            fn backward(self, ops: Ops<Self::State, PARENTS>, tape: &mut Gradients, _: &mut Checkpointer) {
                let gradient = tape.consume::<B>(&ops.node);
                let [features, parameters @ ..] = ops.parents;
                let gradients = B::network_backward(ops.state, gradient, features.is_some());
                let of_parameters = gradients.parameters.into_iter().map(Some);
                for (parent, gradient) in
                    [features].into_iter().chain(parameters).zip([gradients.features].into_iter().chain(of_parameters))
                {
                    if let (Some(parent), Some(gradient)) = (parent, gradient) {
                        tape.register::<B>(parent.id, gradient);
                    }
                }
            }
        }

        let NetworkTensors { features, parameters } = tensors;
        // Parents beyond the last parameter are a constant.
        let constant = <Self as AutodiffBackend>::from_inner(features.primitive().clone());
        let parents = std::array::from_fn(|parent| match parent.checked_sub(1).map(|place| parameters.0.get(place)) {
            None => features.node(),
            Some(Some(parameter)) => parameter.node(),
            Some(None) => constant.node(),
        });
        let inner = NetworkTensors {
            features: features.into_primitive(),
            parameters: TensorList(parameters.0.into_iter().map(|parameter| parameter.into_primitive()).collect()),
        };
        match Network.prepare::<C>(parents).compute_bound().stateful() {
            OpsKind::Tracked(prep) => {
                let (outputs, saved) = B::network_forward(inner, layout, true);
                prep.finish(saved, outputs)
            }
            OpsKind::UnTracked(prep) => prep.finish(B::deformation_network(inner, layout)),
        }
    }
}

/// The outputs `[N, O]` of a network for rows of `features [N, F]`, N > 0: those of the layers that no other layer reads, one
/// beside the other. `parameters` has the weights `[inputs, outputs]` and the biases `[outputs]` of each layer.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::ops::deformation_network::{NetworkLayout, network};
///
/// let device = Device::flex();
/// let mut layout = NetworkLayout::default();
/// let trunk = layout.add(None, [1, 2]);
/// layout.add(Some(trunk), [2, 1]);
/// layout.add(Some(trunk), [2, 1]);
/// let parameters = [
///     (Tensor::<2>::from_floats([[1.0, -1.0]], &device), Tensor::<1>::from_floats([0.0, 0.0], &device)),
///     (Tensor::from_floats([[1.0], [10.0]], &device), Tensor::from_floats([0.5], &device)),
///     (Tensor::from_floats([[2.0], [0.0]], &device), Tensor::from_floats([0.0], &device)),
/// ];
/// let outputs = network(&layout, Tensor::from_floats([[3.0], [-4.0]], &device), parameters);
/// assert_eq!(outputs.into_data().to_vec::<f32>().unwrap(), [3.5, 6.0, 40.5, 0.0]);
/// ```
///
/// # Panics
/// If the layout does not [fit](NetworkLayout::fits), or the tensors have other shapes than it says.
pub fn network(
    layout: &NetworkLayout,
    features: Tensor<2>,
    parameters: impl IntoIterator<Item = (Tensor<2>, Tensor<1>)>,
) -> Tensor<2> {
    assert!(layout.fits(), "a network of {layout:?}");
    assert_eq!(features.dims()[1], layout.features(), "features must be [N, F], as the layout says");
    let mut tensors = Vec::with_capacity(2 * layout.layers().len());
    for (weight, bias) in parameters {
        let layer = layout.layers().get(tensors.len() / 2).expect("parameters must be those of the layout");
        assert_eq!(weight.dims(), [layer.inputs, layer.outputs], "weights must be [inputs, outputs]");
        assert_eq!(bias.dims(), [layer.outputs], "biases must be [outputs]");
        tensors.extend([weight.into_dispatch(), bias.into_dispatch()]);
    }
    assert_eq!(tensors.len(), 2 * layout.layers().len(), "parameters must be those of the layout");
    let tensors = NetworkTensors { features: features.into_dispatch(), parameters: TensorList(tensors) };
    Tensor::from_dispatch(Dispatch::deformation_network(tensors, layout.clone()))
}
