//! Which planes a scale of a hexplane has, in which order, what they are called, and which sizes they may have.
//!
//! Model, codec and training all speak of the same planes; they take it from here. Planes are counted scale-major, six a
//! scale, from 0.

use std::error::Error;
use std::fmt;

/// Names of the axes.
pub const AXIS_NAMES: [&str; 4] = ["x", "y", "z", "t"];
/// The axis of time.
pub const TIME_AXIS: usize = 3;
/// Planes of a scale: one over each pair of axes.
pub const PLANES_PER_SCALE: usize = 6;
/// The axes (a, b) of the planes of a scale, a < b. A plane's rows go along a, its columns along b: `[C, res b, res a]`.
pub const PLANE_AXES: [[usize; 2]; PLANES_PER_SCALE] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];
/// Names of the planes of a scale: those of their axes.
pub const PLANE_NAMES: [&str; PLANES_PER_SCALE] = ["xy", "xz", "xt", "yz", "yt", "zt"];
/// Positions in a scale of the planes that hold no time.
pub const SPACE_ONLY_PLANES: [usize; 3] = [0, 1, 3];
/// Positions in a scale of the planes over an axis and time, by axis.
pub const SPACE_TIME_PLANES: [usize; 3] = [2, 4, 5];
/// Rows and columns of a plane come in multiples of this: the hyperprior halves them twice.
pub const SIZE_MULTIPLE: usize = 4;

/// The scale of a plane, 0 the lowest.
pub const fn scale_of(plane: usize) -> usize {
    plane / PLANES_PER_SCALE
}

/// The position of a plane in its scale.
pub const fn position_of(plane: usize) -> usize {
    plane % PLANES_PER_SCALE
}

/// Whether a plane holds time.
pub fn is_space_time(plane: usize) -> bool {
    SPACE_TIME_PLANES.contains(&position_of(plane))
}

/// How a plane is called in records and messages: its scale and its axes.
///
/// ```
/// assert_eq!(light4gs_codec::plane_layout::plane_name(7), "1.xz");
/// ```
pub fn plane_name(plane: usize) -> String {
    format!("{}.{}", scale_of(plane), PLANE_NAMES[position_of(plane)])
}

/// The order in which planes are coded: scale by scale, in each the space-time planes first.
pub fn coding_order(planes: usize) -> Vec<usize> {
    let in_scale = SPACE_TIME_PLANES.into_iter().chain(SPACE_ONLY_PLANES);
    let scales = 0..planes / PLANES_PER_SCALE;
    scales.flat_map(|scale| in_scale.clone().map(move |position| scale * PLANES_PER_SCALE + position)).collect()
}

/// A number of cells that no plane can have along an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IllegalSize {
    /// As asked for.
    pub size: usize,
    /// Along which of [`AXIS_NAMES`].
    pub axis: usize,
}

impl fmt::Display for IllegalSize {
    /// Ends with the nearest legal size.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { size, axis } = *self;
        write!(
            formatter,
            "{size} along {}; it must be a multiple of {SIZE_MULTIPLE}, the nearest is ",
            AXIS_NAMES[axis]
        )?;
        let below = size / SIZE_MULTIPLE * SIZE_MULTIPLE;
        let above = below.saturating_add(SIZE_MULTIPLE);
        match size - below {
            _ if below == 0 => write!(formatter, "{above}"),
            1 => write!(formatter, "{below}"),
            2 => write!(formatter, "{below} or {above}"),
            _ => write!(formatter, "{above}"),
        }
    }
}

impl Error for IllegalSize {}

/// Whether planes can have this many cells along x, y, z and t. A whole multiple of a legal size is legal as well, so the
/// lowest scale settles it for all.
///
/// # Errors
/// The first axis whose size is no multiple of [`SIZE_MULTIPLE`], or 0.
///
/// ```
/// use light4gs_codec::plane_layout::check_resolution;
///
/// assert!(check_resolution([64, 64, 64, 24]).is_ok());
/// let problem = check_resolution([64, 64, 64, 25]).unwrap_err().to_string();
/// assert_eq!(problem, "25 along t; it must be a multiple of 4, the nearest is 24");
/// ```
pub fn check_resolution(resolution: [usize; 4]) -> Result<(), IllegalSize> {
    let illegal = |size: usize| size == 0 || !size.is_multiple_of(SIZE_MULTIPLE);
    match resolution.iter().position(|size| illegal(*size)) {
        Some(axis) => Err(IllegalSize { size: resolution[axis], axis }),
        None => Ok(()),
    }
}
