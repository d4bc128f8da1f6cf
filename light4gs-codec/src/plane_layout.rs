//! The feature planes of a field: scale, axes and size of each, their names, the order in which they are coded, and the
//! planes that predict a plane.
//!
//! Model, codec and training all use this description of the planes. A hexplane has a plane over each pair of axes at
//! each scale, a tri-plane has those over space alone, and other fields may have any others. Each plane states its
//! scale and its axes; its place in the list is only the order.

use std::error::Error;
use std::fmt;

/// Names of the axes.
pub const AXIS_NAMES: [&str; 4] = ["x", "y", "z", "t"];
/// The axis of time.
pub const TIME_AXIS: usize = 3;
/// Rows and columns of a plane come in multiples of this: the hyperprior halves them twice.
pub const SIZE_MULTIPLE: usize = 4;

/// The two axes of a plane, the first along its width and the second along its height: values are `[C, res b, res a]`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum PlaneAxes {
    /// x and y.
    #[default]
    Xy,
    /// x and z.
    Xz,
    /// x and time.
    Xt,
    /// y and z.
    Yz,
    /// y and time.
    Yt,
    /// z and time.
    Zt,
}

impl PlaneAxes {
    /// All of them, in the order of the planes of a scale.
    pub const ALL: [Self; 6] = [Self::Xy, Self::Xz, Self::Xt, Self::Yz, Self::Yt, Self::Zt];
    /// Those without time.
    pub const SPACE_ONLY: [Self; 3] = [Self::Xy, Self::Xz, Self::Yz];
    /// Those with time, by the axis of space.
    pub const SPACE_TIME: [Self; 3] = [Self::Xt, Self::Yt, Self::Zt];

    /// The axes as places in [`AXIS_NAMES`], rising.
    pub const fn axes(self) -> [usize; 2] {
        match self {
            Self::Xy => [0, 1],
            Self::Xz => [0, 2],
            Self::Xt => [0, 3],
            Self::Yz => [1, 2],
            Self::Yt => [1, 3],
            Self::Zt => [2, 3],
        }
    }

    /// Names of both axes.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Xy => "xy",
            Self::Xz => "xz",
            Self::Xt => "xt",
            Self::Yz => "yz",
            Self::Yt => "yt",
            Self::Zt => "zt",
        }
    }

    /// Whether one of them is time.
    pub const fn is_space_time(self) -> bool {
        self.axes()[1] == TIME_AXIS
    }

    /// For two axes of space: each of them paired with time. `None` where one of the two is time itself.
    ///
    /// ```
    /// use light4gs_codec::plane_layout::PlaneAxes;
    ///
    /// assert_eq!(PlaneAxes::Xz.over_time(), Some([PlaneAxes::Xt, PlaneAxes::Zt]));
    /// assert_eq!(PlaneAxes::Xt.over_time(), None);
    /// ```
    pub const fn over_time(self) -> Option<[Self; 2]> {
        let [a, b] = self.axes();
        if b == TIME_AXIS { None } else { Some([Self::SPACE_TIME[a], Self::SPACE_TIME[b]]) }
    }
}

/// One plane: where it stands and how large it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PlaneShape {
    /// From 0, the lowest.
    pub scale: usize,
    /// The axes that it spans.
    pub axes: PlaneAxes,
    /// Cells along its second and its first axis: height, width.
    pub size: [usize; 2],
}

impl PlaneShape {
    /// The plane's name in records and messages: its scale and its axes.
    ///
    /// ```
    /// use light4gs_codec::plane_layout::{PlaneAxes, PlaneShape};
    ///
    /// assert_eq!(PlaneShape { scale: 1, axes: PlaneAxes::Xz, size: [8, 8] }.name(), "1.xz");
    /// ```
    pub fn name(&self) -> String {
        format!("{}.{}", self.scale, self.axes.name())
    }

    /// Cells along one of [`AXIS_NAMES`], if the plane spans it.
    pub fn cells_along(&self, axis: usize) -> Option<usize> {
        let ([a, b], [height, width]) = (self.axes.axes(), self.size);
        if axis == a { Some(width) } else { (axis == b).then_some(height) }
    }
}

/// The feature planes of a field as a list: scale by scale from 0 on, in each scale in the order of [`PlaneAxes::ALL`], no
/// plane twice.
///
/// ```
/// use light4gs_codec::plane_layout::{PlaneAxes, PlaneLayout};
///
/// let layout = PlaneLayout::multiscale(&PlaneAxes::ALL, [64, 64, 64, 24], &[1, 2]);
/// assert_eq!((layout.len(), layout.scales()), (12, 2));
/// // A plane over space is predicted from the planes over its axes and time, one above from the one below.
/// assert_eq!(layout.in_same_scale(6, PlaneAxes::Xt), Some(8));
/// assert_eq!(layout.one_scale_below(8), Some(2));
/// // Planes with time are coded first.
/// assert_eq!(layout.coding_order()[..6], [2, 4, 5, 0, 1, 3]);
///
/// let planes = PlaneLayout::multiscale(&PlaneAxes::SPACE_ONLY, [64, 64, 64, 24], &[1]);
/// assert_eq!(planes.in_same_scale(0, PlaneAxes::Xt), None);
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PlaneLayout {
    planes: Vec<PlaneShape>,
}

impl PlaneLayout {
    /// A layout of planes.
    ///
    /// # Errors
    /// Planes that are not in the order of a layout, a plane that occurs twice, a scale without planes below another
    /// one.
    pub fn new(planes: Vec<PlaneShape>) -> Result<Self, IllegalOrder> {
        for (place, plane) in planes.iter().enumerate() {
            let follows = match place.checked_sub(1).map(|before| planes[before]) {
                None => plane.scale == 0,
                Some(before) if before.scale == plane.scale => before.axes < plane.axes,
                Some(before) => before.scale.checked_add(1) == Some(plane.scale),
            };
            if !follows {
                return Err(IllegalOrder { plane: place, name: plane.name() });
            }
        }
        Ok(Self { planes })
    }

    /// The same planes at each scale: one over each of `axes`, with the given resolution along x, y, z and t. The
    /// resolution in space is multiplied, by one multiplier for each scale; time keeps its resolution.
    pub fn multiscale(axes: &[PlaneAxes], resolution: [usize; 4], multipliers: &[usize]) -> Self {
        let mut axes = axes.to_vec();
        axes.sort_unstable();
        axes.dedup();
        let plane = |scale: usize, multiplier: usize, axes: PlaneAxes| {
            let side = |axis: usize| resolution[axis].saturating_mul(if axis == TIME_AXIS { 1 } else { multiplier });
            let [a, b] = axes.axes();
            PlaneShape { scale, axes, size: [side(b), side(a)] }
        };
        let scales = multipliers.iter().enumerate();
        let planes =
            scales.flat_map(|(scale, &multiplier)| axes.iter().map(move |&axes| plane(scale, multiplier, axes)));
        Self { planes: planes.collect() }
    }

    /// The planes.
    pub fn planes(&self) -> &[PlaneShape] {
        &self.planes
    }

    /// Number of planes.
    pub fn len(&self) -> usize {
        self.planes.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.planes.is_empty()
    }

    /// Number of scales.
    pub fn scales(&self) -> usize {
        self.planes.last().map_or(0, |plane| plane.scale + 1)
    }

    /// The planes of a scale, as places in the list.
    pub fn scale(&self, scale: usize) -> std::ops::Range<usize> {
        let start = self.planes.partition_point(|plane| plane.scale < scale);
        start..self.planes.partition_point(|plane| plane.scale <= scale)
    }

    /// The place of a plane.
    pub fn find(&self, scale: usize, axes: PlaneAxes) -> Option<usize> {
        self.planes.binary_search_by_key(&(scale, axes), |plane| (plane.scale, plane.axes)).ok()
    }

    /// The plane over other axes in the same scale.
    pub fn in_same_scale(&self, plane: usize, axes: PlaneAxes) -> Option<usize> {
        self.find(self.planes[plane].scale, axes)
    }

    /// The plane over the same axes one scale below.
    pub fn one_scale_below(&self, plane: usize) -> Option<usize> {
        let PlaneShape { scale, axes, .. } = self.planes[plane];
        self.find(scale.checked_sub(1)?, axes)
    }

    /// The planes over the first axis and time, and over the second axis and time, in the scale of a plane over space.
    /// `None` if one of them is missing, or if its size along the shared axis differs.
    pub fn over_time(&self, plane: usize) -> Option<[usize; 2]> {
        let own = &self.planes[plane];
        let [over_a, over_b] = own.axes.over_time()?.map(|axes| self.in_same_scale(plane, axes));
        let [height, width] = own.size;
        let fits = |place: &usize, cells: usize| self.planes[*place].size[1] == cells;
        Some([over_a.filter(|place| fits(place, width))?, over_b.filter(|place| fits(place, height))?])
    }

    /// The order in which a model in training treats planes as decoded: scale by scale, in each those with time first.
    pub fn coding_order(&self) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.len()).collect();
        order.sort_by_key(|&plane| (self.planes[plane].scale, !self.planes[plane].axes.is_space_time()));
        order
    }
}

/// The planes are not in the order of a [`PlaneLayout`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct IllegalOrder {
    /// The first plane that is out of place.
    pub plane: usize,
    /// Its name.
    pub name: String,
}

impl fmt::Display for IllegalOrder {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { plane, name } = self;
        write!(
            formatter,
            "plane {plane} is {name}, but planes stand scale by scale from 0 on, in each in the order xy, xz, xt, yz, yt, zt, \
             none of them twice"
        )
    }
}

impl Error for IllegalOrder {}

/// A size that no plane can have along an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IllegalSize {
    /// The size that was asked for.
    pub size: usize,
    /// The axis, as a place in [`AXIS_NAMES`].
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

/// Whether planes can have these sizes along x, y, z and t. A multiple of a legal size is legal as well, so it is
/// enough to check the lowest scale.
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
    resolution.into_iter().enumerate().try_for_each(|(axis, size)| check_size(size, axis))
}

/// Whether planes can have this many cells along one of [`AXIS_NAMES`].
///
/// # Errors
/// A size that is no multiple of [`SIZE_MULTIPLE`], or 0.
pub fn check_size(size: usize, axis: usize) -> Result<(), IllegalSize> {
    if size > 0 && size.is_multiple_of(SIZE_MULTIPLE) { Ok(()) } else { Err(IllegalSize { size, axis }) }
}
