//! Every trained tensor of a scene with its name and its learning-rate group.

use burn::module::Param;
use burn::nn::Linear;
use burn::tensor::Tensor;
use light4gs_model::{DeformationHead, DynamicScene, PLANE_NAMES};

/// Parameters that share a learning rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterGroup {
    /// Positions.
    Means,
    /// Logarithms of scales.
    LogScales,
    /// Quaternions.
    Quats,
    /// Opacity logits.
    Opacity,
    /// Degree-0 spherical harmonics.
    ShDc,
    /// Higher spherical harmonics.
    ShRest,
    /// Hexplanes.
    Grid,
    /// The deformation network.
    Deformation,
}

/// Names of the parameters that have a row for each Gaussian.
pub const GAUSSIAN_PARAMETERS: [&str; 6] = [
    "gaussians.means",
    "gaussians.log_scales",
    "gaussians.quats",
    "gaussians.opacity_logits",
    "gaussians.sh_dc",
    "gaussians.sh_rest",
];

/// Something to do with every parameter, whatever its rank.
pub trait ParameterVisitor {
    /// Called once a parameter, in a fixed order.
    fn visit<const D: usize>(&mut self, group: ParameterGroup, name: &str, parameter: &mut Param<Tensor<D>>);
}

/// Visits every trained parameter of a scene.
pub fn visit_parameters(scene: &mut DynamicScene, visitor: &mut impl ParameterVisitor) {
    use ParameterGroup::*;
    let gaussians = &mut scene.gaussians;
    visitor.visit(Means, GAUSSIAN_PARAMETERS[0], &mut gaussians.means);
    visitor.visit(LogScales, GAUSSIAN_PARAMETERS[1], &mut gaussians.log_scales);
    visitor.visit(Quats, GAUSSIAN_PARAMETERS[2], &mut gaussians.quats);
    visitor.visit(Opacity, GAUSSIAN_PARAMETERS[3], &mut gaussians.opacity_logits);
    visitor.visit(ShDc, GAUSSIAN_PARAMETERS[4], &mut gaussians.sh_dc);
    visitor.visit(ShRest, GAUSSIAN_PARAMETERS[5], &mut gaussians.sh_rest);
    for (i, plane) in scene.hexplane.planes.iter_mut().enumerate() {
        visitor.visit(Grid, &format!("hexplane.{}.{}", i / 6, PLANE_NAMES[i % 6]), plane);
    }
    for (i, layer) in scene.deformation.trunk.iter_mut().enumerate() {
        visit_linear(visitor, &format!("deformation.trunk.{i}"), layer);
    }
    let deformation = &mut scene.deformation;
    let heads: [(&str, &mut Option<DeformationHead>); 5] = [
        ("position", &mut deformation.position),
        ("scale", &mut deformation.scale),
        ("rotation", &mut deformation.rotation),
        ("opacity", &mut deformation.opacity),
        ("sh", &mut deformation.sh),
    ];
    for (name, head) in heads {
        if let Some(head) = head {
            visit_linear(visitor, &format!("deformation.{name}.hidden"), &mut head.hidden);
            visit_linear(visitor, &format!("deformation.{name}.output"), &mut head.output);
        }
    }
}

fn visit_linear(visitor: &mut impl ParameterVisitor, name: &str, layer: &mut Linear) {
    visitor.visit(ParameterGroup::Deformation, &format!("{name}.weight"), &mut layer.weight);
    if let Some(bias) = &mut layer.bias {
        visitor.visit(ParameterGroup::Deformation, &format!("{name}.bias"), bias);
    }
}
