//! Brightness that changes as a Gaussian turns: light comes from one side, and what turns away from it gets darker.
//!
//! The light that a matte surface reflects is nearly linear in its normal (Ramamoorthi and Hanrahan 2001). So each Gaussian has a
//! vector, its *shading*, which turns along with it like a normal, and the scene has a direction of the light. Color is what was
//! learned at rest, times `1 + (R v - v) · light`.

use burn::module::Param;
use burn::tensor::{Device, Tensor};
use light4gs_codec::network::{Layer, Network, Operation, Value};
use light4gs_data::SH_C0;

use super::stream::affine;
use super::{numbers, tensor};
use crate::scene::Attribute;

/// The attribute by which a Gaussian says how its brightness answers to being turned, `[N, 3]`: a vector along its normal, as long as
/// brightness changes from facing the light to being at right angles to it, as a share of the brightness at rest.
pub const SHADING: &str = "shading";

/// How fast it is learned, and its step in a file.
const RATE: f64 = 0.01;
const STEP: f64 = 0.1;
/// Where the light comes from at the beginning. The direction is learned; it need not be of length 1.
const FIRST_LIGHT: [f32; 3] = [0.5, 0.5, 0.7];
/// Of the harmonic of degree 0, the coefficient of black.
const BLACK: f32 = 0.5 / SH_C0;

pub(super) fn attribute() -> Attribute {
    Attribute::new(SHADING, 3).constant().with_learning_rate(RATE).with_step(STEP)
}

/// The direction of the light at the beginning, `[1, 3]`.
pub(super) fn first_light(device: &Device) -> Param<Tensor<2>> {
    Param::from_tensor(tensor(FIRST_LIGHT.to_vec(), [1, 3], device))
}

/// Harmonics of degree 0 `[N, 1, 3]` of Gaussians whose shading `[N, 3]` has turned, under a light `[1, 3]`.
pub(super) fn shaded(sh_dc: &Tensor<3>, shading: Tensor<2>, turned: Tensor<2>, light: Tensor<2>) -> Tensor<3> {
    let change = (turned - shading).matmul(light.transpose());
    sh_dc.clone() + (sh_dc.clone() + BLACK) * change.unsqueeze_dim(2)
}

/// The same as operations of the codec: a matrix of 9 channels turns the shading.
pub(super) fn describe(network: &mut Network, [sh_dc, shading, matrix]: [Value; 3], light: Tensor<2>) -> Value {
    let turned = network.node(Operation::Multiply, &[matrix, shading]);
    let turned = network.node(Operation::GroupSum(3), &[turned]);
    let difference = network.node(Operation::Subtract, &[turned, shading]);
    let change = network.layer(difference, Layer::linear(numbers(light), vec![0.0]));
    let above_black = network.node(affine(1.0, BLACK), &[sh_dc]);
    let added = network.node(Operation::Multiply, &[above_black, change]);
    network.node(Operation::Add, &[sh_dc, added])
}
