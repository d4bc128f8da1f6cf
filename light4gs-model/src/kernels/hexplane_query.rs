//! The hexplane query of one scale: points and planes, features, gradients.

use std::fmt::Debug;

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, ExtensionType};

/// Points and the planes of one scale.
#[derive(ExtensionType)]
pub struct QueryInputs<B: Backend> {
    /// `[N, 4]`: x, y, z, t in [-1, 1]; what lies outside is clamped to the border.
    pub points: FloatTensor<B>,
    /// `[C, res y, res x]`.
    pub xy: FloatTensor<B>,
    /// `[C, res z, res x]`.
    pub xz: FloatTensor<B>,
    /// `[C, res t, res x]`.
    pub xt: FloatTensor<B>,
    /// `[C, res z, res y]`.
    pub yz: FloatTensor<B>,
    /// `[C, res t, res y]`.
    pub yt: FloatTensor<B>,
    /// `[C, res t, res z]`.
    pub zt: FloatTensor<B>,
}

/// Tensors of [`QueryInputs`].
pub(crate) const INPUTS: usize = 7;

impl<B: Backend> QueryInputs<B> {
    pub(crate) fn into_array(self) -> [FloatTensor<B>; INPUTS] {
        [self.points, self.xy, self.xz, self.xt, self.yz, self.yt, self.zt]
    }

    pub(crate) fn from_array([points, xy, xz, xt, yz, yt, zt]: [FloatTensor<B>; INPUTS]) -> Self {
        Self { points, xy, xz, xt, yz, yt, zt }
    }
}

/// Gradients of a query.
pub struct QueryGradients<B: Backend> {
    /// `[N, 4]`, absent if it was not asked for.
    pub points: Option<FloatTensor<B>>,
    /// In the shapes of the planes.
    pub planes: [FloatTensor<B>; 6],
}

/// A back end's kernels. [`HexPlaneOps`](crate::ops::hexplane_query::HexPlaneOps) adds the dispatch and the tape.
pub trait HexPlaneKernels: Backend {
    /// What the backward pass wants to see again.
    type Saved: Clone + Debug + Send + 'static;

    /// Features `[N, C]`.
    fn query_forward(inputs: QueryInputs<Self>) -> (FloatTensor<Self>, Self::Saved);

    /// Gradients of planes and, if `with_points`, of the points.
    fn query_backward(saved: Self::Saved, gradient: FloatTensor<Self>, with_points: bool) -> QueryGradients<Self>;
}
