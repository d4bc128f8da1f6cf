//! The weights of the skinning as numbers, for programs that do the skinning themselves.

use std::ops::Range;

use burn::tensor::{Tensor, s};

use super::{NodesField, tensor};
use crate::ops::node_poses::pose;
use crate::ops::skinning::{PLACE, POSED};
use crate::scene::GaussianTensors;

/// Nodes whose weights one call of the kernel gives.
const GROUP: usize = 3;
/// Where the quaternion of a posed node is.
const QUATERNION: Range<usize> = PLACE + 12..POSED;

impl NodesField {
    /// `[N, B + 1]`: the weight of each node for each Gaussian, and in the last column that of standing still. Rows sum to 1.
    /// They do not depend on the time.
    ///
    /// ```
    /// use burn::tensor::Device;
    /// use light4gs_data::PointCloud;
    /// use light4gs_model::{DynamicSceneConfig, GaussiansConfig, NodesField, NodesFieldConfig};
    ///
    /// let cloud = PointCloud { positions: vec![[0.0; 3], [1.0, 0.0, 0.0]], colors: vec![[0.5; 3]; 2] };
    /// let config = DynamicSceneConfig::<NodesField>::new(GaussiansConfig::new(), NodesFieldConfig::default());
    /// let scene = config.init(&cloud, &Device::flex());
    /// let weights = scene.field.weights(&scene.gaussians.tensors());
    /// assert_eq!(weights.dims(), [2, scene.field.nodes() + 1]);
    /// ```
    pub fn weights(&self, canonical: &GaussianTensors) -> Tensor<2> {
        let (count, nodes, device) = (canonical.means.dims()[0], self.nodes(), self.device());
        let unturned = Tensor::from_floats([[1.0, 0.0, 0.0, 0.0]], &device).repeat_dim(0, count);
        let unturned = GaussianTensors { quats: unturned, ..canonical.clone() };
        // The skinning kernel computes them, so that there is one softmax. If three nodes have the imaginary units as
        // quaternions and all others 0, the blended quaternion consists of the weight of standing still and of theirs.
        let at_rest = pose(self.parameters(), 0.0);
        let blended = |first: usize| {
            let mut quats = vec![0.0; nodes * QUATERNION.len()];
            for (part, node) in (first..nodes).take(GROUP).enumerate() {
                quats[node * QUATERNION.len() + 1 + part] = 1.0;
            }
            let quats = tensor(quats, [nodes, QUATERNION.len()], &device);
            let posed = at_rest.clone().slice_assign(s![.., QUATERNION], quats);
            self.skinned(&unturned, posed).quats
        };
        let mut columns = Vec::new();
        let mut still = None;
        for first in (0..nodes).step_by(GROUP) {
            let weights = blended(first);
            columns.push(weights.clone().slice(s![.., 1..1 + GROUP.min(nodes - first)]));
            still = Some(weights.slice(s![.., 0..1]));
        }
        columns.extend(still);
        Tensor::cat(columns, 1)
    }
}
