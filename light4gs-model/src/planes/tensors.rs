//! Feature planes as tensors, and the query.

use std::ops::{Deref, Range};

use burn::backend::Dispatch;
use burn::tensor::Tensor;
use light4gs_codec::plane_layout::{AXIS_NAMES, PlaneAxes, PlaneLayout, PlaneShape};

use crate::ops::plane_query::{PlaneQueryInputs, PlaneQueryOps, PlaneSet};

/// Feature planes as tensors `[C, H, W]`, in the order of their layout: values of parameters, planes with noise,
/// decoded planes, or slices of them.
#[derive(Clone, Debug, Default)]
pub struct PlaneTensors {
    layout: PlaneLayout,
    planes: Vec<Tensor<3>>,
}

impl Deref for PlaneTensors {
    type Target = [Tensor<3>];

    fn deref(&self) -> &[Tensor<3>] {
        &self.planes
    }
}

impl PlaneTensors {
    /// Planes of a layout.
    ///
    /// # Panics
    /// If a plane is missing, differs from the layout in size, or differs from the first plane in channels.
    pub fn new(layout: PlaneLayout, planes: Vec<Tensor<3>>) -> Self {
        assert_eq!(planes.len(), layout.len(), "one tensor for each plane of the layout");
        let channels = planes.first().map_or(0, |plane| plane.dims()[0]);
        for (plane, shape) in planes.iter().zip(layout.planes()) {
            let [height, width] = shape.size;
            assert_eq!(plane.dims(), [channels, height, width], "shape of plane {}", shape.name());
        }
        Self { layout, planes }
    }

    /// Planes over the same axes at every scale, given scale by scale, in each scale in the order of
    /// [`PlaneAxes::ALL`]. Sizes are those of the tensors.
    ///
    /// # Panics
    /// If the number of tensors is no multiple of the number of axes, the axes are out of order, or channels differ.
    pub fn at_scales(axes: &[PlaneAxes], planes: Vec<Tensor<3>>) -> Self {
        assert!(planes.len().is_multiple_of(axes.len()), "{} planes for {} pairs of axes", planes.len(), axes.len());
        let shapes = planes.iter().enumerate().map(|(place, plane)| {
            let [_, height, width] = plane.dims();
            PlaneShape { scale: place / axes.len(), axes: axes[place % axes.len()], size: [height, width] }
        });
        let layout = PlaneLayout::new(shapes.collect()).unwrap_or_else(|problem| panic!("{problem}"));
        Self::new(layout, planes)
    }

    /// The layout of the planes.
    pub fn layout(&self) -> &PlaneLayout {
        &self.layout
    }

    /// The tensors `[C, H, W]`, in the order of the layout.
    pub fn into_tensors(self) -> Vec<Tensor<3>> {
        self.planes
    }

    /// Each plane replaced by another of the same shape, which `replace` makes from its index and value.
    pub fn map(&self, replace: impl Fn(usize, Tensor<3>) -> Tensor<3>) -> Self {
        let planes = self.planes.iter().enumerate().map(|(place, plane)| replace(place, plane.clone()));
        Self { layout: self.layout.clone(), planes: planes.collect() }
    }

    /// Replaces one plane by another of the same shape.
    pub fn set(&mut self, plane: usize, values: Tensor<3>) {
        self.planes[plane] = values;
    }

    /// Features `[N, C · scales]` at points `[N, 4]`, x, y, z, t in [-1, 1] (clamped to the border outside): for each scale the
    /// product of the planes' bilinear samples. Differentiable in points and planes.
    ///
    /// # Panics
    /// If the points are not `[N, 4]`, or there are no planes.
    pub fn query(&self, points: Tensor<2>) -> Tensor<2> {
        self.query_planes(points, |_| true)
    }

    /// [`Self::query`] of the space-only planes at positions `[N, 3]`. A scale without such planes gives ones.
    ///
    /// # Panics
    /// As [`Self::query`].
    pub fn query_space(&self, positions: Tensor<2>) -> Tensor<2> {
        let [count, _] = positions.dims();
        let points = Tensor::cat(vec![positions.clone(), Tensor::zeros([count, 1], &positions.device())], 1);
        self.query_planes(points, |axes| !axes.is_space_time())
    }

    fn query_planes(&self, points: Tensor<2>, counts: impl Fn(PlaneAxes) -> bool) -> Tensor<2> {
        let [count, coordinates] = points.dims();
        assert_eq!(coordinates, AXIS_NAMES.len(), "points must be [N, 4]: x, y, z, t");
        assert!(!self.is_empty(), "there are no planes to query");
        let [channels, ..] = self.planes[0].dims();
        let scale = |scale: usize| {
            let queries = self.together(self.layout.scale(scale), &counts).into_iter();
            let product = queries.map(|planes| self.query_set(points.clone(), &planes)).reduce(|a, b| a * b);
            product.unwrap_or_else(|| Tensor::ones([count, channels], &points.device()))
        };
        let mut features: Vec<Tensor<2>> = (0..self.layout.scales()).map(scale).collect();
        if features.len() == 1 { features.remove(0) } else { Tensor::cat(features, 1) }
    }

    /// The planes of a scale for which `counts` holds, in groups with equal sizes along each axis, as the operation
    /// requires.
    fn together(&self, planes: Range<usize>, counts: impl Fn(PlaneAxes) -> bool) -> Vec<Vec<usize>> {
        let shapes = self.layout.planes();
        let agree = |a: usize, b: usize| {
            (0..AXIS_NAMES.len()).all(|axis| match (shapes[a].cells_along(axis), shapes[b].cells_along(axis)) {
                (Some(a), Some(b)) => a == b,
                _ => true,
            })
        };
        let mut groups: Vec<Vec<usize>> = Vec::new();
        for plane in planes.filter(|plane| counts(shapes[*plane].axes)) {
            match groups.iter_mut().find(|group| group.iter().all(|other| agree(*other, plane))) {
                Some(group) => group.push(plane),
                None => groups.push(vec![plane]),
            }
        }
        groups
    }

    /// The product `[N, C]` of the samples of some planes of a scale.
    fn query_set(&self, points: Tensor<2>, planes: &[usize]) -> Tensor<2> {
        let device = points.device();
        let place = |axes: PlaneAxes| planes.iter().copied().find(|plane| self.layout.planes()[*plane].axes == axes);
        let set = PlaneSet(PlaneAxes::ALL.map(|axes| place(axes).is_some()));
        let [xy, xz, xt, yz, yt, zt] = PlaneAxes::ALL.map(|axes| {
            // Where there is no plane, the placeholder is not read.
            let plane =
                place(axes).map_or_else(|| Tensor::zeros([1, 1, 1], &device), |plane| self.planes[plane].clone());
            plane.into_dispatch()
        });
        let inputs = PlaneQueryInputs { points: points.into_dispatch(), xy, xz, xt, yz, yt, zt };
        Tensor::from_dispatch(Dispatch::plane_query(inputs, set))
    }
}
