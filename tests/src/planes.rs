//! Sets of feature planes that a field may have: the hexplane, and others.

use light4gs_codec::plane_layout::PlaneAxes::{self, Xt, Xy, Xz, Yt, Yz, Zt};
use light4gs_codec::plane_layout::{PlaneLayout, PlaneShape};

/// Small layouts with names. A context model treats each of them differently. Sizes differ between the axes; the first
/// is a hexplane of two scales.
pub fn plane_sets() -> Vec<(&'static str, PlaneLayout)> {
    let of = |axes: &[PlaneAxes], multipliers: &[usize]| PlaneLayout::multiscale(axes, [8, 12, 4, 8], multipliers);
    let list = |planes: &[(usize, PlaneAxes, [usize; 2])]| {
        let shape = |&(scale, axes, [width, height]): &(usize, PlaneAxes, [usize; 2])| PlaneShape {
            scale,
            axes,
            size: [height, width],
        };
        PlaneLayout::new(planes.iter().map(shape).collect()).expect("they stand in order")
    };
    vec![
        ("hexplane", of(&PlaneAxes::ALL, &[1, 2])),
        ("tri-plane", of(&PlaneAxes::SPACE_ONLY, &[1, 2])),
        ("space-time planes", of(&PlaneAxes::SPACE_TIME, &[1, 2])),
        ("one space-time plane", of(&[Yt], &[1])),
        ("half a hexplane", of(&[Xy, Xt, Yt], &[1, 2])),
        (
            "other planes at each scale",
            list(&[
                (0, Xy, [8, 12]),
                (0, Xt, [8, 4]),
                (0, Yt, [12, 4]),
                (1, Xz, [16, 8]),
                (1, Zt, [8, 8]),
                (2, Xy, [32, 16]),
            ]),
        ),
        (
            "sizes of their own",
            list(&[(0, Xy, [8, 12]), (0, Xt, [4, 8]), (0, Yz, [8, 8]), (0, Yt, [12, 4]), (1, Xy, [24, 4])]),
        ),
    ]
}
