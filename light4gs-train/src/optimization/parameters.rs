//! Every trained tensor of a run with its name and its learning-rate group.

use burn::module::Param;
use burn::nn::Linear;
use burn::tensor::Tensor;
use light4gs_codec::plane_layout::plane_name;
use light4gs_model::{DeformationHead, DynamicScene, NamedParameterVisitor, NamedParameters};

use crate::compression::Compression;

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
    /// The entropy model of the hexplanes.
    Context,
    /// The entropy model of the spherical harmonics.
    ShModel,
    /// Logarithms of the hexplanes' quantisation steps.
    Steps,
}

impl ParameterGroup {
    /// Whether parameters of this group have a row for each Gaussian.
    pub fn is_per_gaussian(self) -> bool {
        use ParameterGroup::*;
        matches!(self, Means | LogScales | Quats | Opacity | ShDc | ShRest)
    }
}

/// What every Gaussian has: the parameters with a row for each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GaussianAttribute {
    /// Positions.
    Means,
    /// Logarithms of standard deviations.
    LogScales,
    /// Quaternions.
    Quats,
    /// Opacities before the sigmoid.
    OpacityLogits,
    /// Degree-0 spherical harmonics.
    ShDc,
    /// Higher spherical harmonics.
    ShRest,
}

impl GaussianAttribute {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::Means, Self::LogScales, Self::Quats, Self::OpacityLogits, Self::ShDc, Self::ShRest];

    /// The parameter's path in the scene.
    pub fn path(self) -> &'static str {
        match self {
            Self::Means => "gaussians.means",
            Self::LogScales => "gaussians.log_scales",
            Self::Quats => "gaussians.quats",
            Self::OpacityLogits => "gaussians.opacity_logits",
            Self::ShDc => "gaussians.sh_dc",
            Self::ShRest => "gaussians.sh_rest",
        }
    }
}

/// Name of a plane's parameter; planes are counted scale-major.
pub fn plane_parameter(plane: usize) -> String {
    format!("hexplane.{}", plane_name(plane))
}

/// Something to do with every parameter, whatever its rank.
pub trait ParameterVisitor {
    /// Called once a parameter, in a fixed order.
    fn visit<const D: usize>(&mut self, group: ParameterGroup, name: &str, parameter: &mut Param<Tensor<D>>);
}

/// Visits every trained parameter of a scene.
pub fn visit_parameters(scene: &mut DynamicScene, visitor: &mut impl ParameterVisitor) {
    use ParameterGroup::*;
    let gaussians = &mut scene.gaussians;
    visitor.visit(Means, GaussianAttribute::Means.path(), &mut gaussians.means);
    visitor.visit(LogScales, GaussianAttribute::LogScales.path(), &mut gaussians.log_scales);
    visitor.visit(Quats, GaussianAttribute::Quats.path(), &mut gaussians.quats);
    visitor.visit(Opacity, GaussianAttribute::OpacityLogits.path(), &mut gaussians.opacity_logits);
    visitor.visit(ShDc, GaussianAttribute::ShDc.path(), &mut gaussians.sh_dc);
    visitor.visit(ShRest, GaussianAttribute::ShRest.path(), &mut gaussians.sh_rest);
    for (i, plane) in scene.field.hexplane.planes.iter_mut().enumerate() {
        visitor.visit(Grid, &plane_parameter(i), plane);
    }
    for (i, layer) in scene.field.deformation.trunk.iter_mut().enumerate() {
        visit_linear(visitor, &format!("deformation.trunk.{i}"), layer);
    }
    let deformation = &mut scene.field.deformation;
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

/// Visits every trained parameter of the entropy models and the quantisation steps.
pub fn visit_compression(compression: &mut Compression, visitor: &mut impl ParameterVisitor) {
    use ParameterGroup::*;
    let Compression { context, quantization, sh } = compression;
    context.visit_parameters(&mut InGroup { group: Context, prefix: "context", visitor });
    quantization.visit_parameters(&mut InGroup { group: Steps, prefix: "quantization", visitor });
    if let Some(sh) = sh {
        sh.visit_parameters(&mut InGroup { group: ShModel, prefix: "sh_model", visitor });
    }
}

/// Shows a module's parameters as members of a group.
struct InGroup<'a, V> {
    group: ParameterGroup,
    prefix: &'static str,
    visitor: &'a mut V,
}

impl<V: ParameterVisitor> NamedParameterVisitor for InGroup<'_, V> {
    fn visit<const D: usize>(&mut self, name: &str, parameter: &mut Param<Tensor<D>>) {
        self.visitor.visit(self.group, &format!("{}.{name}", self.prefix), parameter);
    }
}

fn visit_linear(visitor: &mut impl ParameterVisitor, name: &str, layer: &mut Linear) {
    visitor.visit(ParameterGroup::Deformation, &format!("{name}.weight"), &mut layer.weight);
    if let Some(bias) = &mut layer.bias {
        visitor.visit(ParameterGroup::Deformation, &format!("{name}.bias"), bias);
    }
}
