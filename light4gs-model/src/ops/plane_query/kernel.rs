//! The query of one scale's feature planes: points and planes, features, gradients.

use std::fmt::Debug;

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, ExtensionType};

/// Which of the planes xy, xz, xt, yz, yt, zt exist; at least one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct PlaneSet(pub [bool; PLANES]);

impl PlaneSet {
    /// Whether all of them exist.
    pub fn is_full(self) -> bool {
        self.0 == [true; PLANES]
    }
}

/// Points, and the planes of one scale, which have equal sizes along common axes. A placeholder for a plane that does
/// not exist is not read.
#[derive(ExtensionType)]
pub struct PlaneQueryInputs<B: Backend> {
    /// `[N, 4]`: x, y, z, t in [-1, 1]; coordinates outside are clamped to the border.
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

/// Planes that a scale may have.
pub(crate) const PLANES: usize = 6;
/// Tensors of [`PlaneQueryInputs`].
pub(crate) const INPUTS: usize = 1 + PLANES;

impl<B: Backend> PlaneQueryInputs<B> {
    pub(crate) fn into_array(self) -> [FloatTensor<B>; INPUTS] {
        [self.points, self.xy, self.xz, self.xt, self.yz, self.yt, self.zt]
    }

    pub(crate) fn from_array([points, xy, xz, xt, yz, yt, zt]: [FloatTensor<B>; INPUTS]) -> Self {
        Self { points, xy, xz, xt, yz, yt, zt }
    }
}

/// Gradients of a query.
pub struct PlaneQueryGradients<B: Backend> {
    /// `[N, 4]`; `None` if not requested.
    pub points: Option<FloatTensor<B>>,
    /// In the shapes of the planes; `None` where there is no plane.
    pub planes: [Option<FloatTensor<B>>; PLANES],
}

/// A back end's kernels. [`PlaneQueryOps`](crate::ops::plane_query::PlaneQueryOps) adds the dispatch and the tape.
pub trait PlaneQueryKernels: Backend {
    /// What the backward pass needs from the forward pass.
    type Saved: Clone + Debug + Send + 'static;

    /// Features `[N, C]`.
    fn query_forward(inputs: PlaneQueryInputs<Self>, planes: PlaneSet) -> (FloatTensor<Self>, Self::Saved);

    /// Gradients of planes and, if `with_points`, of the points.
    fn query_backward(saved: Self::Saved, gradient: FloatTensor<Self>, with_points: bool) -> PlaneQueryGradients<Self>;
}
