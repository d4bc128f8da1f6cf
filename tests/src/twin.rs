//! A slow, plain rasterizer in float64, written from `docs/design.md` (conventions) and sharing no code with the operation:
//! a loop over pixels, and in each one over all Gaussians by depth.
//!
//! It also says where float32 may decide differently from float64 (a threshold within rounding), so that a test can
//! leave such pixels and Gaussians out.

use glam::{DMat3, DQuat, DVec3};
use light4gs_data::Camera;

use crate::splat_scene::{MEANS, OPACITIES, QUATS, SCALES, SCREEN_OFFSETS, SH_DC, SH_REST, SplatScene};

const TILE: usize = 16;

/// The results of the twin.
#[derive(Clone, Debug)]
pub struct TwinImage {
    /// `[H, W, 5]`: red, green, blue, alpha, depth.
    pub values: Vec<f64>,
    /// `[H, W]`: whether a threshold was met within rounding.
    pub doubtful: Vec<bool>,
    /// `[N]`: 3 sigma in pixels, rounded up; 0 for a Gaussian outside the image or behind the camera.
    pub radii: Vec<i64>,
    /// `[N]`: whether rounding decides which tiles the Gaussian touches, or its place in the order of depths.
    pub doubtful_gaussians: Vec<bool>,
    /// Smallest alpha before the 1/255 threshold, over all pixels and drawn Gaussians; infinite if there is none.
    pub smallest_alpha: f64,
    /// Largest alpha before the clamp at 0.99.
    pub largest_alpha: f64,
    /// Smallest transmittance of a pixel at the end.
    pub smallest_transmittance: f64,
    /// Hash of which Gaussian was blended at which pixel. Between two images with the same hash there is no jump.
    pub decisions: u64,
}

struct Splat {
    index: usize,
    center: [f64; 2],
    /// Inverse covariance: xx, xy, yy.
    inverse: [f64; 3],
    opacity: f64,
    color: [f64; 3],
    depth: f64,
    radius: f64,
    /// Half-open ranges of tiles.
    columns: [i64; 2],
    rows: [i64; 2],
    doubtful: bool,
}

/// Real spherical harmonics with the signs of the original 3DGS code, `[16]`.
fn harmonics(d: DVec3) -> [f64; 16] {
    let pi = std::f64::consts::PI;
    let (x, y, z) = (d.x, d.y, d.z);
    let (xx, yy, zz) = (x * x, y * y, z * z);
    let c1 = (3.0 / (4.0 * pi)).sqrt();
    let c2 = (15.0 / (4.0 * pi)).sqrt();
    let (c3, c31) = ((35.0 / (32.0 * pi)).sqrt(), (21.0 / (32.0 * pi)).sqrt());
    [
        (0.25 / pi).sqrt(),
        -c1 * y,
        c1 * z,
        -c1 * x,
        c2 * x * y,
        -c2 * y * z,
        (5.0 / (16.0 * pi)).sqrt() * (2.0 * zz - xx - yy),
        -c2 * x * z,
        0.5 * c2 * (xx - yy),
        -c3 * y * (3.0 * xx - yy),
        (105.0 / (4.0 * pi)).sqrt() * x * y * z,
        -c31 * y * (4.0 * zz - xx - yy),
        (7.0 / (16.0 * pi)).sqrt() * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        -c31 * x * (4.0 * zz - xx - yy),
        (105.0 / (16.0 * pi)).sqrt() * z * (xx - yy),
        -c3 * x * (xx - 3.0 * yy),
    ]
}

fn near_integer(value: f64, slack: f64) -> bool {
    (value - value.round()).abs() < slack
}

fn project(scene: &SplatScene, index: usize, camera: &Camera, degree: usize) -> Option<Splat> {
    let triple = |attribute: usize| DVec3::from_slice(&scene.attributes[attribute][3 * index..]);
    let world_to_camera = camera.rotation.as_dmat3();
    let mean = triple(MEANS);
    let view = world_to_camera * mean + camera.translation.as_dvec3();
    if view.z <= 0.2 {
        return None;
    }
    let q = &scene.attributes[QUATS][4 * index..];
    let rotation = DMat3::from_quat(DQuat::from_xyzw(q[1], q[2], q[3], q[0]).normalize());
    let scaled = rotation * DMat3::from_diagonal(triple(SCALES));
    let covariance = scaled * scaled.transpose();

    let (fx, fy) = (f64::from(camera.fx), f64::from(camera.fy));
    let (width, height) = (f64::from(camera.width), f64::from(camera.height));
    // The image's edges as slopes, 15 % of its size further out.
    let slope = |slope: f64, size: f64, focal: f64, principal: f32| {
        let principal = f64::from(principal);
        slope.clamp((-0.15 * size - principal) / focal, (1.15 * size - principal) / focal)
    };
    let slope_x = slope(view.x / view.z, width, fx, camera.cx);
    let slope_y = slope(view.y / view.z, height, fy, camera.cy);
    let jacobian_x = DVec3::new(fx, 0.0, -fx * slope_x) / view.z;
    let jacobian_y = DVec3::new(0.0, fy, -fy * slope_y) / view.z;
    let in_view = world_to_camera * covariance * world_to_camera.transpose();
    let xx = jacobian_x.dot(in_view * jacobian_x) + 0.3;
    let xy = jacobian_x.dot(in_view * jacobian_y);
    let yy = jacobian_y.dot(in_view * jacobian_y) + 0.3;
    let determinant = xx * yy - xy * xy;

    let middle = 0.5 * (xx + yy);
    let sigma = (middle + (middle * middle - determinant).max(0.1).sqrt()).sqrt();
    let radius = (3.0 * sigma).ceil();
    let offset = &scene.attributes[SCREEN_OFFSETS][2 * index..];
    let x = fx * view.x / view.z + f64::from(camera.cx) - 0.5 + offset[0] * 0.5 * width;
    let y = fy * view.y / view.z + f64::from(camera.cy) - 0.5 + offset[1] * 0.5 * height;

    let eye = -(world_to_camera.transpose() * camera.translation.as_dvec3());
    let basis = harmonics((mean - eye).normalize());
    let mut color = 0.5 + basis[0] * triple(SH_DC);
    for k in 1..(degree + 1) * (degree + 1) {
        color += basis[k] * DVec3::from_slice(&scene.attributes[SH_REST][45 * index + 3 * (k - 1)..]);
    }

    let tile = TILE as f64;
    let tiles = |center: f64, size: f64| {
        let (low, high) = ((center - radius) / tile, (center + radius + tile - 1.0) / tile);
        let last = (size / tile).ceil();
        let doubtful = near_integer(low, 1e-4) || near_integer(high, 1e-4);
        ([low.trunc().clamp(0.0, last) as i64, high.trunc().clamp(0.0, last) as i64], doubtful)
    };
    let ((columns, doubt_x), (rows, doubt_y)) = (tiles(x, width), tiles(y, height));
    Some(Splat {
        index,
        center: [x, y],
        inverse: [yy / determinant, -xy / determinant, xx / determinant],
        opacity: scene.attributes[OPACITIES][index],
        color: color.max(DVec3::ZERO).to_array(),
        depth: view.z,
        radius,
        columns,
        rows,
        doubtful: doubt_x || doubt_y || near_integer(3.0 * sigma, 1e-3) || view.z < 0.2001,
    })
}

/// Draws activated Gaussians. All must be finite, and their quaternions not 0.
pub fn render(scene: &SplatScene, camera: &Camera, background: [f32; 3], degree: usize) -> TwinImage {
    let (width, height) = (camera.width as usize, camera.height as usize);
    let mut radii = vec![0; scene.len()];
    let mut doubtful_gaussians = vec![false; scene.len()];
    let mut splats: Vec<Splat> = (0..scene.len()).filter_map(|i| project(scene, i, camera, degree)).collect();
    for splat in &splats {
        let empty = splat.columns[0] >= splat.columns[1] || splat.rows[0] >= splat.rows[1];
        radii[splat.index] = if empty { 0 } else { splat.radius as i64 };
        doubtful_gaussians[splat.index] = splat.doubtful;
    }
    splats.retain(|splat| radii[splat.index] > 0);
    splats.sort_by(|a, b| a.depth.total_cmp(&b.depth));
    for pair in splats.windows(2) {
        if pair[1].depth - pair[0].depth < 2e-6 * pair[0].depth {
            doubtful_gaussians[pair[1].index] = true;
        }
    }

    let mut image = TwinImage {
        values: Vec::with_capacity(width * height * 5),
        doubtful: Vec::with_capacity(width * height),
        radii,
        doubtful_gaussians,
        smallest_alpha: f64::INFINITY,
        largest_alpha: 0.0,
        smallest_transmittance: 1.0,
        decisions: 0xcbf2_9ce4_8422_2325,
    };
    for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
        let (column, row) = ((x / TILE) as i64, (y / TILE) as i64);
        let (mut sums, mut transmittance, mut doubtful) = ([0.0; 4], 1.0, false);
        for splat in &splats {
            let Splat { columns, rows, center, inverse, .. } = splat;
            if !(columns[0]..columns[1]).contains(&column) || !(rows[0]..rows[1]).contains(&row) {
                // Outside of its box a Gaussian is cut off, so the image is not smooth there.
                image.smallest_alpha = 0.0;
                continue;
            }
            let (dx, dy) = (center[0] - x as f64, center[1] - y as f64);
            let exponent = 0.5 * (inverse[0] * dx * dx + inverse[2] * dy * dy) + inverse[1] * dx * dy;
            let free = splat.opacity * (-exponent).exp();
            image.smallest_alpha = image.smallest_alpha.min(free);
            image.largest_alpha = image.largest_alpha.max(free);
            let alpha = free.min(0.99);
            doubtful |= (alpha * 255.0 - 1.0).abs() < 1e-3;
            if alpha < 1.0 / 255.0 {
                continue;
            }
            let after = transmittance * (1.0 - alpha);
            doubtful |= (after / 1e-4 - 1.0).abs() < 1e-2;
            if after < 1e-4 {
                break;
            }
            // FNV-1a over (pixel, Gaussian).
            for word in [image.doubtful.len(), splat.index] {
                image.decisions = (image.decisions ^ word as u64).wrapping_mul(0x0000_0100_0000_01b3);
            }
            let weight = transmittance * alpha;
            for c in 0..3 {
                sums[c] += weight * splat.color[c];
            }
            sums[3] += weight * splat.depth;
            transmittance = after;
        }
        image.smallest_transmittance = image.smallest_transmittance.min(transmittance);
        image.values.extend((0..3).map(|c| sums[c] + transmittance * f64::from(background[c])));
        image.values.extend([1.0 - transmittance, sums[3]]);
        image.doubtful.push(doubtful);
    }
    image
}

/// A scene without the Gaussians whose tiles or order depend on rounding, and its image.
pub fn render_without_doubt(
    scene: &SplatScene,
    camera: &Camera,
    background: [f32; 3],
    degree: usize,
) -> (SplatScene, TwinImage) {
    let mut scene = scene.clone();
    loop {
        let image = render(&scene, camera, background, degree);
        if !image.doubtful_gaussians.contains(&true) {
            return (scene, image);
        }
        let keep: Vec<bool> = image.doubtful_gaussians.iter().map(|doubtful| !doubtful).collect();
        scene = scene.filtered(&keep);
    }
}
