//! The contents of a file, as plain arrays.

mod gaussians;
mod motion;

pub use gaussians::{
    AttributeValues, Coder, FurtherAttribute, GaussianArrays, LONGEST_ATTRIBUTE_NAME, legal_attribute_name,
    sh_rest_coefficients,
};
pub(crate) use gaussians::{BUILT_IN, SH_REST, is_built_in};
pub use motion::{MotionArrays, MotionNetwork, MotionOutput, MotionSource, NamedTensor};

use std::collections::BTreeMap;

use crate::{
    CodecError,
    bytes::Section,
    plane_layout::{PlaneAxes, PlaneLayout, PlaneShape},
};

/// A whole dynamic scene: everything that a `.l4gs` stream holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneData {
    /// Name, frames, box, background and camera.
    pub meta: SceneMeta,
    /// The canonical Gaussians.
    pub gaussians: GaussianArrays,
    /// The scene coordinates that normalize positions before the planes are queried.
    pub coordinates: SceneCoordinateArrays,
    /// The feature planes; empty where nothing reads them.
    pub feature_planes: FeaturePlaneArrays,
    /// How the Gaussians move.
    pub motion: MotionArrays,
}

/// Facts about a scene that a player needs before it decodes anything.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneMeta {
    /// A name for display.
    pub name: String,
    /// Number of frames of the source; time 0 is the first and time 1 the last.
    pub frame_count: u32,
    /// Frames a second of the source, 0 where it is not known.
    pub fps: f32,
    /// Axis-aligned box of the scene in world units: smallest corner, largest corner.
    pub bounds: [[f32; 3]; 2],
    /// Color behind the Gaussians, red, green, blue.
    pub background: [f32; 3],
    /// Digest of the configuration that the scene was trained with, zeros where there is none.
    pub config_digest: [u8; 32],
    /// Width in pixels of the source's default camera.
    pub width: u32,
    /// Height in pixels of the source's default camera.
    pub height: u32,
    /// Horizontal field of view in radians of the source's default camera.
    pub fov_x: f32,
    /// Extra entries, such as the program that wrote the file.
    pub extra: BTreeMap<String, String>,
}

/// Mean, principal axes and per-axis standard deviation of the initial cloud.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneCoordinateArrays {
    /// Mean of the cloud, in world units.
    pub mean: [f32; 3],
    /// `axes[j]` is principal axis `j`, of unit length.
    pub axes: [[f32; 3]; 3],
    /// Standard deviation along each principal axis.
    pub std: [f32; 3],
    /// From standardized coordinates to those of the planes.
    pub mapping: CoordinateMapping,
}

impl Default for SceneCoordinateArrays {
    /// World coordinates: mean 0, the world's axes, deviations 1.
    fn default() -> Self {
        Self {
            mean: [0.0; 3],
            axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            std: [1.0; 3],
            mapping: CoordinateMapping::default(),
        }
    }
}

/// How standardized coordinates become those of the planes, in [-1, 1], and how the time of the scene becomes that of
/// the field, in [0, 1]. The default is the paper's; others belong to scenes that other programs have trained.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoordinateMapping {
    /// Whether space is contracted into the ball of radius 2 first.
    pub contracts: bool,
    /// Each coordinate is then multiplied by this...
    pub scale: [f32; 3],
    /// ...and this is added.
    pub offset: [f32; 3],
    /// The time is multiplied by this...
    pub time_scale: f32,
    /// ...and this is added.
    pub time_offset: f32,
}

impl Default for CoordinateMapping {
    /// Contracted and halved; the time unchanged.
    fn default() -> Self {
        Self { contracts: true, scale: [0.5; 3], offset: [0.0; 3], time_scale: 1.0, time_offset: 0.0 }
    }
}

impl CoordinateMapping {
    /// The field's time for a time of the scene, both in [0, 1].
    pub fn time(&self, time: f32) -> f32 {
        time * self.time_scale + self.time_offset
    }
}

/// Feature planes over pairs of the axes x, y, z, t, at several scales. A feature is the product of the samples of a
/// scale's planes, channel by channel; the features of all scales are concatenated.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FeaturePlaneArrays {
    /// Channels of every plane.
    pub channels: u32,
    /// In the order of a [`PlaneLayout`].
    pub planes: Vec<Plane>,
}

impl FeaturePlaneArrays {
    /// Planes of a layout, without their values.
    pub fn without_values(channels: u32, layout: &PlaneLayout) -> Self {
        let plane = |&PlaneShape { scale, axes, size: [height, width] }: &PlaneShape| Plane {
            scale: scale as u32,
            axes,
            height: height as u32,
            width: width as u32,
            values: Vec::new(),
        };
        Self { channels, planes: layout.planes().iter().map(plane).collect() }
    }

    /// The layout of the planes.
    ///
    /// # Errors
    /// Planes that are not in the order of a layout.
    pub fn layout(&self) -> Result<PlaneLayout, CodecError> {
        let planes = self.planes.iter().map(Plane::shape).collect();
        PlaneLayout::new(planes).map_err(|illegal| {
            CodecError::invalid(Section::FeaturePlanes.name(), "order of the planes", illegal, "the order of a layout")
        })
    }

    /// Number of scales.
    pub fn scales(&self) -> usize {
        self.planes.last().map_or(0, |plane| plane.scale as usize + 1)
    }

    /// Length of a feature: `channels · scales`.
    pub fn features(&self) -> u64 {
        u64::from(self.channels) * self.scales() as u64
    }
}

/// One feature plane. Over axes `(a, b)`, `a` before `b`, its width runs along `a` and its height along `b`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plane {
    /// From 0, the lowest.
    pub scale: u32,
    /// The axes that it spans.
    pub axes: PlaneAxes,
    /// Samples along the second axis.
    pub height: u32,
    /// Samples along the first axis.
    pub width: u32,
    /// Features, `[channels, height, width]` row-major.
    pub values: Vec<f32>,
}

impl Plane {
    /// The plane without its values.
    pub fn shape(&self) -> PlaneShape {
        PlaneShape { scale: self.scale as usize, axes: self.axes, size: [self.height as usize, self.width as usize] }
    }
}
