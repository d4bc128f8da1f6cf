//! The encoder's requirements, as functions that can be called before training.
//!
//! [`crate::encode`] and [`crate::encode_compressed`] call the same functions. A configuration calls
//! [`feature_planes`], [`plane_step`], [`sh_step`] and
//! [`AttributeSteps::check`](crate::attributes::AttributeSteps::check) before there is a scene. A trainer calls
//! [`scene`] and [`coding`] for the scene that it starts from, and [`positions`] for its points. Only numbers that come
//! from training can still be refused at the end: NaN, infinities, and values beyond 2^22 steps.
//!
//! ```
//! use light4gs_codec::checks;
//! use light4gs_codec::plane_layout::{PlaneAxes, PlaneLayout};
//!
//! let hexplane = |multipliers: &[usize]| PlaneLayout::multiscale(&PlaneAxes::ALL, [64, 64, 64, 24], multipliers);
//! assert!(checks::feature_planes(32, &hexplane(&[1, 2])).is_ok());
//! let problem = checks::feature_planes(32, &hexplane(&[1; 17])).unwrap_err().to_string();
//! assert!(problem.contains("number of scales is 17, at most 16"), "{problem}");
//! assert!(checks::plane_step(1e-45).is_err());
//! ```

use crate::{
    CodecError, CompressionInput, Limits, SceneData, attributes,
    bytes::Section,
    limits::at_most,
    plane_layout::{PlaneLayout, check_size},
    planes, stream,
};

pub use crate::steps::{LEAST_STEP, attribute_step, nearest_plane_steps, nearest_sh_step, plane_step, sh_step};

/// Refuses feature planes that no stream can hold, or that cannot be coded: too many channels or scales, illegal sizes.
///
/// # Errors
/// Names the number that is too large, or the plane and the axis.
pub fn feature_planes(channels: u32, layout: &PlaneLayout) -> Result<(), CodecError> {
    planes::head::Head { channels, layout: layout.clone() }.check(&Limits::large())?;
    layout.planes().iter().try_for_each(|plane| {
        let [a, b] = plane.axes.axes();
        let [height, width] = plane.size;
        [(a, width), (b, height)].into_iter().try_for_each(|(axis, size)| check_size(size, axis)).map_err(|illegal| {
            let field = format!("size of plane {}", plane.name());
            CodecError::invalid(
                Section::FeaturePlanes.name(),
                field,
                illegal,
                "a size that the hyperprior can halve twice",
            )
        })
    })
}

/// Refuses a network that is too large for a stream. `weights` includes the biases, `channels` is the sum over all its
/// values, inputs included. `section` is for the message.
///
/// # Errors
/// Names the number that is too large.
pub fn network_size(section: &'static str, weights: u64, channels: u64) -> Result<(), CodecError> {
    let limits = Limits::large();
    at_most(section, "channels of all values", channels, limits.layer_width)?;
    at_most(section, "number of weights", weights, limits.layer_weights)
}

/// Refuses points with a coordinate beyond ±1e30, or NaN: a stream cannot hold Gaussians there.
///
/// # Errors
/// Names the first one.
pub fn positions(positions: &[[f32; 3]]) -> Result<(), CodecError> {
    attributes::check_positions(positions)
}

/// Refuses a scene that [`crate::encode`] refuses.
///
/// # Errors
/// An array whose length disagrees with the others, a NaN or an infinity, a number beyond [`Limits::large`], a name that no
/// stream can have; the message names the section and the field.
pub fn scene(scene: &SceneData) -> Result<(), CodecError> {
    stream::check(scene, &Limits::large())
}

/// Refuses what [`crate::encode_compressed`] refuses before it codes the first number: a scene as [`scene()`] does, steps,
/// precisions, and entropy models that contradict themselves or the scene, or that ask for more than [`Limits::large`].
///
/// # Errors
/// The message names the section and the field.
pub fn coding(scene: &SceneData, input: &CompressionInput) -> Result<(), CodecError> {
    input.check(scene, &Limits::large())
}
