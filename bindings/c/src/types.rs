//! The structures that the functions take and fill.

use light4gs_codec::Limits;

/// The most that a reader accepts. Begin with `l4gs_limits_default` or `l4gs_limits_large`, and change what you need. For a
/// field that the library keeps in fewer bits, a larger number means the largest.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct L4gsLimits {
    /// Bytes of a whole stream; a take may be longer, each stream in it may not.
    pub file_bytes: u64,
    /// Bytes of the scene meta in the header.
    pub meta_bytes: u64,
    /// Entries of the section table.
    pub sections: u64,
    /// Bytes of one string.
    pub string_bytes: u64,
    /// Bytes of a name.
    pub name_bytes: u64,
    /// Extra entries in the scene meta.
    pub extras: u64,
    /// Frames of the source.
    pub frames: u64,
    /// Width and height of an image, in pixels: the source's, and one that is rendered.
    pub image_side: u64,
    /// Width times height of such an image.
    pub image_pixels: u64,
    /// Segments of a take, together with the slots for further ones.
    pub segments: u64,
    /// Gaussians.
    pub gaussians: u64,
    /// Attributes of a Gaussian.
    pub attributes: u64,
    /// Numbers that an attribute has for a Gaussian.
    pub attribute_width: u64,
    /// Channels of a plane.
    pub channels: u64,
    /// Samples of a plane along one axis.
    pub resolution: u64,
    /// Scales of the planes.
    pub scales: u64,
    /// Networks of a section, and priors that use them.
    pub networks: u64,
    /// Nodes, inputs or outputs of one network.
    pub nodes: u64,
    /// Inputs or outputs of one layer.
    pub layer_width: u64,
    /// Weights of all networks of a section.
    pub layer_weights: u64,
    /// Memory that decoding takes, in bytes, without the stream itself. Showing and rendering may take eight times as much.
    pub memory_bytes: u64,
    /// Time that decoding takes on one thread of a server core of 2023, as estimated from counts and sizes.
    pub nanoseconds: u64,
}

impl From<Limits> for L4gsLimits {
    fn from(limits: Limits) -> Self {
        // Without `..`, so that a limit that comes new is not forgotten here.
        let Limits {
            file_bytes,
            meta_bytes,
            sections,
            string_bytes,
            name_bytes,
            extras,
            frames,
            image_side,
            image_pixels,
            segments,
            gaussians,
            attributes,
            attribute_width,
            channels,
            resolution,
            scales,
            networks,
            nodes,
            layer_width,
            layer_weights,
            memory_bytes,
            nanoseconds,
        } = limits;
        Self {
            file_bytes,
            meta_bytes: meta_bytes.into(),
            sections: sections.into(),
            string_bytes: string_bytes.into(),
            name_bytes: name_bytes.into(),
            extras: extras.into(),
            frames: frames.into(),
            image_side: image_side.into(),
            image_pixels,
            segments: segments.into(),
            gaussians: gaussians.into(),
            attributes: attributes.into(),
            attribute_width: attribute_width.into(),
            channels: channels.into(),
            resolution: resolution.into(),
            scales: scales.into(),
            networks: networks.into(),
            nodes: nodes.into(),
            layer_width: layer_width.into(),
            layer_weights,
            memory_bytes,
            nanoseconds,
        }
    }
}

impl From<L4gsLimits> for Limits {
    fn from(limits: L4gsLimits) -> Self {
        let narrow = |value: u64| u32::try_from(value).unwrap_or(u32::MAX);
        Self {
            file_bytes: limits.file_bytes,
            meta_bytes: narrow(limits.meta_bytes),
            sections: narrow(limits.sections),
            string_bytes: narrow(limits.string_bytes),
            name_bytes: narrow(limits.name_bytes),
            extras: narrow(limits.extras),
            frames: narrow(limits.frames),
            image_side: narrow(limits.image_side),
            image_pixels: limits.image_pixels,
            segments: narrow(limits.segments),
            gaussians: narrow(limits.gaussians),
            attributes: narrow(limits.attributes),
            attribute_width: narrow(limits.attribute_width),
            channels: narrow(limits.channels),
            resolution: narrow(limits.resolution),
            scales: narrow(limits.scales),
            networks: narrow(limits.networks),
            nodes: narrow(limits.nodes),
            layer_width: narrow(limits.layer_width),
            layer_weights: limits.layer_weights,
            memory_bytes: limits.memory_bytes,
            nanoseconds: limits.nanoseconds,
        }
    }
}

/// Counts and metadata of a scene.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct L4gsInfo {
    /// Bytes of the whole stream.
    pub bytes: u64,
    /// Number of Gaussians, N.
    pub gaussians: u32,
    /// Degree of the spherical harmonics, 0 to 3.
    pub sh_degree: u32,
    /// Coefficients of a color channel, K = (degree + 1)².
    pub sh_coefficients: u32,
    /// Number of frames of the source; time 0 is the first, time 1 the last.
    pub frames: u32,
    /// Frames per second of the source, 0 where not known.
    pub fps: f32,
    /// Smallest corner of the scene's box, world units.
    pub bounds_min: [f32; 3],
    /// Largest corner.
    pub bounds_max: [f32; 3],
    /// Color behind the Gaussians: red, green, blue.
    pub background: [f32; 3],
    /// Width of the source's default camera in pixels, 0 where not known.
    pub width: u32,
    /// Its height.
    pub height: u32,
    /// Its horizontal field of view in radians, 0 where not known.
    pub fov_x: f32,
    /// Number of attributes beyond those that every file has; see `l4gs_attribute`.
    pub attributes: u32,
    /// Number of extra entries; see `l4gs_extra`.
    pub extras: u32,
    /// Number of sections; see `l4gs_section`.
    pub sections: u32,
}

/// Counts and metadata of a take. What a scene has besides stands in its base.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct L4gsTakeInfo {
    /// Seconds of the take: what the file says, or the end of the last segment where that is later.
    pub seconds: f64,
    /// Frames per second of the source, 0 where not known.
    pub fps: f32,
    /// Number of segments; see `l4gs_take_segment`.
    pub segments: u32,
    /// Number of extra entries; see `l4gs_take_extra`.
    pub extras: u32,
    /// Number of Gaussians of the base. That of a time is in `l4gs_gaussians_counts`.
    pub gaussians: u32,
    /// Smallest corner of the base's box, world units.
    pub bounds_min: [f32; 3],
    /// Largest corner.
    pub bounds_max: [f32; 3],
    /// Color behind the Gaussians: red, green, blue.
    pub background: [f32; 3],
    /// Width of the source's default camera in pixels, 0 where not known.
    pub width: u32,
    /// Its height.
    pub height: u32,
    /// Its horizontal field of view in radians, 0 where not known.
    pub fov_x: f32,
}

/// Counts of the Gaussians of a take at one time.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct L4gsCounts {
    /// Number of Gaussians, N.
    pub gaussians: u32,
    /// Degree of the spherical harmonics, 0 to 3.
    pub sh_degree: u32,
    /// Coefficients of a color channel, K = (degree + 1)².
    pub sh_coefficients: u32,
}

/// An OpenCV pinhole camera: x right, y down, z forward; `x_camera = rotation · x_world + translation`. The middle of an
/// image is at `cx = width / 2`, `cy = height / 2`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct L4gsCamera {
    /// Width of the image in pixels.
    pub width: u32,
    /// Height of the image in pixels.
    pub height: u32,
    /// Horizontal focal length in pixels.
    pub fx: f64,
    /// Vertical focal length in pixels.
    pub fy: f64,
    /// Horizontal principal point in pixels from the image's left edge.
    pub cx: f64,
    /// Vertical principal point in pixels from the image's upper edge.
    pub cy: f64,
    /// World to camera, `[3, 3]` row-major.
    pub rotation: [f64; 9],
    /// World to camera, world units.
    pub translation: [f64; 3],
}

/// Arrays of the caller for `l4gs_gaussians_gsplat` and `l4gs_gaussians_copy_gsplat`, row-major; null where one is not wanted.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct L4gsGsplatArrays {
    /// `[N, 3]`, centers in world units.
    pub means: *mut f32,
    /// `[N, 4]`, unit quaternions (w, x, y, z).
    pub quats: *mut f32,
    /// `[N, 3]`, standard deviations in world units.
    pub scales: *mut f32,
    /// `[N]`, in [0, 1].
    pub opacities: *mut f32,
    /// `[N, K, 3]`, harmonics of all degrees.
    pub sh: *mut f32,
}

/// Arrays of the caller for `l4gs_gaussians_inria` and `l4gs_gaussians_copy_inria`, row-major; null where one is not wanted.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct L4gsInriaArrays {
    /// `[N, 3]`, centers in world units.
    pub means: *mut f32,
    /// `[N, 3]`, harmonics of degree 0.
    pub f_dc: *mut f32,
    /// `[N, 3 (K - 1)]`, the other harmonics: all coefficients of red, then green, then blue.
    pub f_rest: *mut f32,
    /// `[N]`, logits of the opacities.
    pub opacity: *mut f32,
    /// `[N, 3]`, natural logarithms of the standard deviations.
    pub scale: *mut f32,
    /// `[N, 4]`, quaternions (w, x, y, z) of any length.
    pub rot: *mut f32,
}
