//! From an image taken through a lens to the one that a pinhole would have recorded.

use crate::camera::Camera;
use crate::lens::Lens;
use glam::DVec2;

/// Undistorts `[H, W, 4]` bytes of `size` = (width, height) pixels (straight alpha): same size, focal lengths and
/// principal point, without distortion and skew. `camera` may have another size; its intrinsics are scaled.
///
/// Between pixels it is bilinear. Places outside of the recorded image get the color of its edge.
pub(super) fn undistort(rgba: &[u8], size: (u32, u32), camera: &Camera, lens: &Lens) -> Vec<u8> {
    let map = Map::new(size, camera, lens);
    let (width, height) = (size.0 as usize, size.1 as usize);
    let opaque = rgba.chunks_exact(4).all(|pixel| pixel[3] == 255);
    let mut out = Vec::with_capacity(rgba.len());
    for j in 0..height {
        for i in 0..width {
            let at = map.recorded(i as f64, j as f64);
            // Neighbors and weights; NaN and infinity saturate to a pixel at the edge.
            let x = (at.x as f32).clamp(0.0, (width - 1) as f32);
            let y = (at.y as f32).clamp(0.0, (height - 1) as f32);
            let (left, top) = (x as usize, y as usize);
            let (right, bottom) = ((left + 1).min(width - 1), (top + 1).min(height - 1));
            let (dx, dy) = (x - left as f32, y - top as f32);
            let corners = [
                (top * width + left, (1.0 - dx) * (1.0 - dy)),
                (top * width + right, dx * (1.0 - dy)),
                (bottom * width + left, (1.0 - dx) * dy),
                (bottom * width + right, dx * dy),
            ];
            out.extend(if opaque { blend(rgba, corners) } else { blend_with_alpha(rgba, corners) });
        }
    }
    out
}

/// `[H, W]` bytes of a mask, undistorted by taking the nearest pixel; outside of the recorded image it is `outside`.
pub(super) fn undistort_mask(mask: &[u8], size: (u32, u32), camera: &Camera, lens: &Lens, outside: u8) -> Vec<u8> {
    let map = Map::new(size, camera, lens);
    let (width, height) = (size.0 as usize, size.1 as usize);
    let value = |i: usize, j: usize| {
        let at = map.recorded(i as f64, j as f64);
        let inside = at.x > -0.5 && at.y > -0.5 && at.x < width as f64 - 0.5 && at.y < height as f64 - 0.5;
        if !inside {
            return outside;
        }
        let (x, y) = (at.x.round() as usize, at.y.round() as usize);
        mask[y.min(height - 1) * width + x.min(width - 1)]
    };
    (0..height).flat_map(|j| (0..width).map(move |i| (i, j))).map(|(i, j)| value(i, j)).collect()
}

/// Whether every pixel of the pinhole image was recorded. Only the pixels at its edge are checked: if they were
/// recorded, so were those inside.
pub(super) fn is_recorded_everywhere(size: (u32, u32), camera: &Camera, lens: &Lens) -> bool {
    let map = Map::new(size, camera, lens);
    let (right, bottom) = (f64::from(size.0) - 1.0, f64::from(size.1) - 1.0);
    let inside = |(i, j): (f64, f64)| {
        let at = map.recorded(i, j);
        at.x > -0.5 && at.y > -0.5 && at.x < right + 0.5 && at.y < bottom + 0.5
    };
    let columns = (0..size.0).map(f64::from).flat_map(|i| [(i, 0.0), (i, bottom)]);
    let rows = (0..size.1).map(f64::from).flat_map(|j| [(0.0, j), (right, j)]);
    columns.chain(rows).all(inside)
}

/// From pixels of the pinhole image to pixels of the recorded one; integers are pixel centers.
struct Map<'a> {
    lens: &'a Lens,
    focal: DVec2,
    center: DVec2,
}

impl<'a> Map<'a> {
    fn new(size: (u32, u32), camera: &Camera, lens: &'a Lens) -> Self {
        let camera = camera.resized(size.0, size.1);
        let focal = DVec2::new(camera.fx.into(), camera.fy.into());
        let center = DVec2::new(f64::from(camera.cx) - 0.5, f64::from(camera.cy) - 0.5);
        Self { lens, focal, center }
    }

    fn recorded(&self, i: f64, j: f64) -> DVec2 {
        let point = (DVec2::new(i, j) - self.center) / self.focal;
        self.lens.apply(point) * self.focal + self.center
    }
}

fn blend(rgba: &[u8], corners: [(usize, f32); 4]) -> [u8; 4] {
    let mut sum = [0.5f32; 3];
    for (pixel, weight) in corners {
        for c in 0..3 {
            sum[c] += weight * f32::from(rgba[4 * pixel + c]);
        }
    }
    [sum[0] as u8, sum[1] as u8, sum[2] as u8, 255]
}

/// Colors are weighted by their alpha: the color of a transparent pixel is meaningless.
fn blend_with_alpha(rgba: &[u8], corners: [(usize, f32); 4]) -> [u8; 4] {
    let mut sum = [0.0f32; 3];
    let mut alpha = 0.0;
    for (pixel, weight) in corners {
        let share = weight * f32::from(rgba[4 * pixel + 3]);
        alpha += share;
        for c in 0..3 {
            sum[c] += share * f32::from(rgba[4 * pixel + c]);
        }
    }
    let color = sum.map(|v| if alpha > 0.0 { (v / alpha + 0.5) as u8 } else { 0 });
    [color[0], color[1], color[2], (alpha + 0.5) as u8]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::Distortion;
    use glam::Vec3;

    /// A smooth pattern over the directions in front of a camera.
    fn color(p: DVec2) -> [u8; 4] {
        let wave = |v: f64| (127.5 + 100.0 * v.sin()) as u8;
        [wave(9.0 * p.x), wave(11.0 * p.y), wave(7.0 * (p.x - p.y)), 255]
    }

    /// The image of the pattern through a lens: for every recorded pixel, the pattern in the direction that the pixel
    /// sees.
    fn recorded(camera: &Camera, lens: &Lens) -> Vec<u8> {
        let mut out = Vec::new();
        for j in 0..camera.height {
            for i in 0..camera.width {
                let seen = DVec2::new(
                    f64::from(i as f32 + 0.5 - camera.cx) / f64::from(camera.fx),
                    f64::from(j as f32 + 0.5 - camera.cy) / f64::from(camera.fy),
                );
                // Inverse by fixed-point iteration.
                let mut p = seen;
                for _ in 0..200 {
                    p += (seen - lens.apply(p)) * 0.7;
                }
                out.extend(color(p));
            }
        }
        out
    }

    #[test]
    fn straightened_images_match_the_pinhole() {
        let mut camera = Camera::look_at(Vec3::X, Vec3::ZERO, Vec3::Z, 1.0, 160, 120);
        (camera.cx, camera.cy, camera.fy) = (84.3, 55.1, camera.fy * 1.05);
        let radial = [-0.2, 0.05, 0.0, 0.0, 0.0, 0.0];
        let models = [
            Distortion::RadialTangential { radial, tangential: [0.002, -0.003] },
            Distortion::Fisheye { radial: [-0.03, 0.01, 0.0, 0.0] },
            Distortion::ThinPrismFisheye {
                radial: [0.02, 0.0, 0.0, 0.0],
                tangential: [0.001, 0.0],
                prism: [0.002, 0.0],
            },
            Distortion::FieldOfView { omega: 0.7 },
        ];
        for (distortion, skew) in models.into_iter().zip([0.01, 0.0, 0.0, 0.0]) {
            let lens = Lens::new(distortion, skew).unwrap();
            let straight = undistort(&recorded(&camera, &lens), (160, 120), &camera, &lens);
            let mut worst = 0;
            for j in 2..118usize {
                for i in 2..158usize {
                    let x = (i as f64 + 0.5 - f64::from(camera.cx)) / f64::from(camera.fx);
                    let y = (j as f64 + 0.5 - f64::from(camera.cy)) / f64::from(camera.fy);
                    let expected = color(DVec2::new(x, y));
                    for c in 0..3 {
                        worst = worst.max(straight[4 * (j * 160 + i) + c].abs_diff(expected[c]));
                    }
                }
            }
            assert!(worst <= 3, "{distortion:?}: {worst}");
        }
    }

    #[test]
    fn masks_take_the_nearest_value_and_say_what_was_not_recorded() {
        let camera = Camera::look_at(Vec3::X, Vec3::ZERO, Vec3::Z, 1.2, 40, 30);
        let pincushion = Distortion::RadialTangential { radial: [0.5, 0.0, 0.0, 0.0, 0.0, 0.0], tangential: [0.0; 2] };
        let lens = Lens::new(pincushion, 0.0).unwrap();
        let mask = undistort_mask(&[255; 1200], (40, 30), &camera, &lens, 0);
        assert_eq!((mask[0], mask[15 * 40 + 20]), (0, 255));
        assert!(mask.iter().all(|v| *v == 0 || *v == 255));
    }

    #[test]
    fn transparent_neighbors_do_not_bleed() {
        let rgba = [200, 0, 0, 255, 0, 99, 0, 0];
        let half = [(0usize, 0.5f32), (1, 0.5), (0, 0.0), (1, 0.0)];
        assert_eq!(blend_with_alpha(&rgba, half), [200, 0, 0, 128]);
    }
}
