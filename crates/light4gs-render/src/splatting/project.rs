//! Projection of 3D Gaussians to screen-space splats (EWA splatting, Zwicker et al. 2001, with the conventions of the
//! original 3DGS rasterizer), forward and backward, one Gaussian at a time.

use glam::{Mat3, Vec2, Vec3};
use light4gs_codec::rendering::{DILATION, MIN_ALPHA, NEAR, TILE};

use crate::rotation::{normalization_backward, rotation_backward, rotation_matrix};
use crate::spherical_harmonics::{basis, basis_gradient, coefficient_count};
use crate::view::View;

/// Radius of a Gaussian that cannot be drawn because it is not finite or has no orientation.
pub const INVALID_RADIUS: i32 = -1;

/// Borrowed attributes of N Gaussians, each array contiguous.
#[derive(Clone, Copy, Debug)]
pub struct GaussianSlices<'a> {
    /// `[N, 3]`, world units.
    pub means: &'a [f32],
    /// `[N, 4]` as (w, x, y, z), any length but zero.
    pub quats: &'a [f32],
    /// `[N, 3]`, standard deviations in world units.
    pub scales: &'a [f32],
    /// `[N]` in [0, 1].
    pub opacities: &'a [f32],
    /// `[N, 1, 3]`.
    pub sh_dc: &'a [f32],
    /// `[N, K, 3]`.
    pub sh_rest: &'a [f32],
    /// `[N, 2]`: added to the position on screen, in units of half the image.
    pub screen_offsets: &'a [f32],
}

impl GaussianSlices<'_> {
    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.opacities.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.opacities.is_empty()
    }

    fn rest_count(&self) -> usize {
        self.sh_rest.len() / (3 * self.len().max(1))
    }

    fn mean(&self, i: usize) -> Vec3 {
        Vec3::from_slice(&self.means[3 * i..])
    }
}

/// One Gaussian on the screen.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Splat {
    pub(crate) x: f32,
    pub(crate) y: f32,
    /// Inverse of the 2D covariance: (xx, xy, yy).
    pub(crate) conic: [f32; 3],
    pub(crate) opacity: f32,
    pub(crate) color: [f32; 3],
    pub(crate) depth: f32,
    /// Diagonal of the 2D covariance.
    pub(crate) variance: [f32; 2],
    /// Twice the exponent at which alpha falls below [`MIN_ALPHA`]; negative if it never reaches it.
    pub(crate) reach: f32,
    /// Pixels; 0 = not on the screen, [`INVALID_RADIUS`] = cannot be drawn.
    pub(crate) radius: i32,
    /// Bit c is set where color channel c was clamped at 0.
    clamped: u8,
}

/// Values of the projection that the backward pass needs again.
struct Geometry {
    view_position: Vec3,
    quat: [f32; 4],
    quat_norm: f32,
    rotation: Mat3,
    scale: Vec3,
    /// Rows of J · W.
    jacobian_world: [Vec3; 2],
    /// Rows of J · W · R · S, so that the covariance is their Gram matrix.
    factor: [Vec3; 2],
    /// Clamped x/z and y/z, and whether each was clamped.
    slope: Vec2,
    slope_clamped: [bool; 2],
}

fn geometry(gaussians: &GaussianSlices, i: usize, view: &View) -> Geometry {
    let camera = &view.camera;
    let view_position = camera.rotation * gaussians.mean(i) + camera.translation;
    let raw: [f32; 4] = gaussians.quats[4 * i..4 * i + 4].try_into().expect("four components");
    let quat_norm = raw.iter().map(|q| q * q).sum::<f32>().sqrt();
    let quat = raw.map(|q| q / quat_norm);
    let rotation = rotation_matrix(quat);
    let scale = Vec3::from_slice(&gaussians.scales[3 * i..]);

    let z = view_position.z;
    let [least, most] = view.slope_limits();
    let free = view_position.truncate() / z;
    let slope = free.clamp(least, most);
    let slope_clamped = [slope.x != free.x, slope.y != free.y];
    let world = camera.rotation.transpose();
    let (row_x, row_y, row_z) = (world.x_axis, world.y_axis, world.z_axis);
    let jacobian_world = [(camera.fx / z) * (row_x - slope.x * row_z), (camera.fy / z) * (row_y - slope.y * row_z)];
    let factor = jacobian_world.map(|row| (rotation.transpose() * row) * scale);
    Geometry { view_position, quat, quat_norm, rotation, scale, jacobian_world, factor, slope, slope_clamped }
}

/// Color before the clamp at zero, from `SH(direction) + 0.5`.
fn raw_color(gaussians: &GaussianSlices, i: usize, degree: usize, direction: Vec3) -> Vec3 {
    let rest = gaussians.rest_count();
    let b = basis(degree, direction.to_array());
    let mut color = b[0] * Vec3::from_slice(&gaussians.sh_dc[3 * i..]) + 0.5;
    let coefficients = gaussians.sh_rest[3 * rest * i..].chunks_exact(3);
    for (k, coefficient) in coefficients.take(coefficient_count(degree) - 1).enumerate() {
        color += b[k + 1] * Vec3::from_slice(coefficient);
    }
    color
}

/// Projects Gaussian `i`. The radius is [`INVALID_RADIUS`] if the Gaussian is not finite or has no orientation, and 0
/// if it is behind the camera or outside the image.
pub(crate) fn project(gaussians: &GaussianSlices, i: usize, view: &View) -> Splat {
    let invalid = Splat { radius: INVALID_RADIUS, ..Splat::default() };
    let mean = gaussians.mean(i);
    let opacity = gaussians.opacities[i];
    let attributes_finite = mean.is_finite()
        && opacity.is_finite()
        && gaussians.screen_offsets[2 * i..2 * i + 2].iter().all(|offset| offset.is_finite())
        && gaussians.scales[3 * i..3 * i + 3].iter().all(|s| s.is_finite())
        && gaussians.quats[4 * i..4 * i + 4].iter().all(|q| q.is_finite());
    if !attributes_finite {
        return invalid;
    }
    let camera = &view.camera;
    let g = geometry(gaussians, i, view);
    let position = g.view_position;
    if !(g.quat_norm.is_finite() && g.quat_norm > 1e-12 && position.is_finite()) {
        return invalid;
    }
    let direction = (mean - camera.center()).normalize_or_zero();
    let color = raw_color(gaussians, i, view.sh_degree, direction);
    if !color.is_finite() {
        return invalid;
    }
    if position.z <= NEAR {
        return Splat::default();
    }

    let [u, v] = g.factor;
    let (xx, xy, yy) = (u.dot(u) + DILATION, u.dot(v), v.dot(v) + DILATION);
    let determinant = xx * yy - xy * xy;
    if !determinant.is_finite() {
        return invalid;
    }
    if determinant <= 0.0 {
        return Splat::default();
    }
    let middle = 0.5 * (xx + yy);
    let largest = middle + (middle * middle - determinant).max(0.1).sqrt();
    let radius = (3.0 * largest.sqrt()).ceil();
    let half = Vec2::new(camera.width as f32, camera.height as f32) * 0.5;
    let offset = Vec2::from_slice(&gaussians.screen_offsets[2 * i..]) * half;
    let x = camera.fx * position.x / position.z + camera.cx - 0.5 + offset.x;
    let y = camera.fy * position.y / position.z + camera.cy - 0.5 + offset.y;
    if !(x.is_finite() && y.is_finite() && radius.is_finite()) {
        return invalid;
    }

    let clamped = (0..3).fold(0, |bits, c| bits | (u8::from(color[c] < 0.0) << c));
    let mut splat = Splat {
        x,
        y,
        conic: [yy / determinant, -xy / determinant, xx / determinant],
        opacity,
        color: color.max(Vec3::ZERO).to_array(),
        depth: position.z,
        variance: [xx, yy],
        reach: if opacity >= MIN_ALPHA { 2.0 * (opacity / MIN_ALPHA).ln() } else { -1.0 },
        radius: radius as i32,
        clamped,
    };
    if splat.tile_rectangle(view).is_empty() {
        splat.radius = 0;
    }
    splat
}

/// Half-open ranges of tile columns and rows.
#[derive(Clone, Copy)]
pub(crate) struct TileRectangle {
    pub(crate) columns: [usize; 2],
    pub(crate) rows: [usize; 2],
}

impl TileRectangle {
    pub(crate) fn is_empty(&self) -> bool {
        self.columns[0] >= self.columns[1] || self.rows[0] >= self.rows[1]
    }
}

impl Splat {
    /// Tiles of the 3-sigma box, truncated as in the original rasterizer.
    pub(crate) fn tile_rectangle(&self, view: &View) -> TileRectangle {
        let tile = TILE as f32;
        let radius = self.radius as f32;
        let range = |center: f32, count: usize| {
            let low = ((center - radius) / tile) as i64;
            let high = ((center + radius + tile - 1.0) / tile) as i64;
            [low.clamp(0, count as i64) as usize, high.clamp(0, count as i64) as usize]
        };
        TileRectangle { columns: range(self.x, view.tiles_across()), rows: range(self.y, view.tiles_down()) }
    }
}

/// Derivative of the loss with respect to the outputs of [`project`] for one Gaussian.
#[derive(Clone, Copy, Default)]
pub(crate) struct SplatGradient {
    pub(crate) position: [f32; 2],
    pub(crate) conic: [f32; 3],
    pub(crate) opacity: f32,
    pub(crate) color: [f32; 3],
    pub(crate) depth: f32,
}

/// Gradients of one Gaussian's attributes; SH gradients are written directly to their arrays.
pub(crate) struct AttributeGradient {
    pub(crate) mean: Vec3,
    pub(crate) quat: [f32; 4],
    pub(crate) scale: Vec3,
    pub(crate) screen_offset: Vec2,
}

/// Chain rule through [`project`] for a Gaussian that was drawn.
pub(crate) fn project_backward(
    gaussians: &GaussianSlices,
    i: usize,
    view: &View,
    splat: &Splat,
    gradient: &SplatGradient,
    grad_dc: &mut [f32],
    grad_rest: &mut [f32],
) -> AttributeGradient {
    let camera = &view.camera;
    let g = geometry(gaussians, i, view);

    // From the conic to the covariance: d(inverse) = -Q dC Q.
    let [qa, qb, qc] = splat.conic;
    let [ga, gb, gc] = gradient.conic;
    let half_gb = 0.5 * gb;
    let (m00, m01) = (ga * qa + half_gb * qb, ga * qb + half_gb * qc);
    let (m10, m11) = (half_gb * qa + gc * qb, half_gb * qb + gc * qc);
    let g_xx = -(qa * m00 + qb * m10);
    let g_xy = -(qa * m01 + qb * m11) - (qb * m00 + qc * m10);
    let g_yy = -(qb * m01 + qc * m11);

    // From the covariance to its factor V = (J W) (R S), two rows.
    let [u, v] = g.factor;
    let d_factor = [2.0 * g_xx * u + g_xy * v, g_xy * u + 2.0 * g_yy * v];
    let rows = g.jacobian_world;
    // d(RS) = (J W)^T dV, column by column: column j is sum over rows of row * dV_j.
    let d_rs: [Vec3; 3] = std::array::from_fn(|j| rows[0] * d_factor[0][j] + rows[1] * d_factor[1][j]);
    let axes = [g.rotation.x_axis, g.rotation.y_axis, g.rotation.z_axis];
    let scale = Vec3::from_array(std::array::from_fn(|j| d_rs[j].dot(axes[j])));
    let [x_axis, y_axis, z_axis] = std::array::from_fn(|j| d_rs[j] * g.scale[j]);
    let of_unit = rotation_backward(g.quat, Mat3::from_cols(x_axis, y_axis, z_axis));
    let quat = normalization_backward(g.quat, g.quat_norm, of_unit);
    // d(J W) = dV (R S)^T
    let d_rows = d_factor.map(|d| g.rotation * (d * g.scale));

    // From J W to the view position, with J the projection's Jacobian at the clamped slope.
    let inverse_z = 1.0 / g.view_position.z;
    let focal = [camera.fx, camera.fy];
    let world = camera.rotation.transpose();
    let mut d_view = Vec3::ZERO;
    for axis in 0..2 {
        let row = if axis == 0 { world.x_axis } else { world.y_axis };
        // The row is (focal / z) (row_axis - slope row_z).
        d_view.z -= d_rows[axis].dot(row - g.slope[axis] * world.z_axis) * focal[axis] * inverse_z * inverse_z;
        if !g.slope_clamped[axis] {
            let d_slope = -d_rows[axis].dot(world.z_axis) * focal[axis] * inverse_z;
            d_view[axis] += d_slope * inverse_z;
            d_view.z -= d_slope * g.view_position[axis] * inverse_z * inverse_z;
        }
        // From the center on the screen.
        let d_pixel = gradient.position[axis] * focal[axis] * inverse_z;
        d_view[axis] += d_pixel;
        d_view.z -= d_pixel * g.view_position[axis] * inverse_z;
    }
    d_view.z += gradient.depth;
    let mut mean = world * d_view;

    mean += color_backward(gaussians, i, view, splat, gradient.color, grad_dc, grad_rest);
    let half = Vec2::new(camera.width as f32, camera.height as f32) * 0.5;
    AttributeGradient { mean, quat, scale, screen_offset: Vec2::from_array(gradient.position) * half }
}

/// SH gradients, and the gradient of the mean through the view direction.
fn color_backward(
    gaussians: &GaussianSlices,
    i: usize,
    view: &View,
    splat: &Splat,
    gradient: [f32; 3],
    grad_dc: &mut [f32],
    grad_rest: &mut [f32],
) -> Vec3 {
    let degree = view.sh_degree;
    let offset = gaussians.mean(i) - view.camera.center();
    let distance = offset.length();
    let direction = offset.normalize_or_zero();
    let b = basis(degree, direction.to_array());
    let d_color =
        Vec3::from_array(std::array::from_fn(|c| if splat.clamped >> c & 1 == 1 { 0.0 } else { gradient[c] }));
    (b[0] * d_color).write_to_slice(grad_dc);
    if degree == 0 {
        return Vec3::ZERO;
    }
    let rest = gaussians.rest_count();
    let coefficients = &gaussians.sh_rest[3 * rest * i..3 * rest * (i + 1)];
    let d_basis = basis_gradient(degree, direction.to_array());
    let mut d_direction = Vec3::ZERO;
    for k in 0..coefficient_count(degree) - 1 {
        (b[k + 1] * d_color).write_to_slice(&mut grad_rest[3 * k..]);
        d_direction += Vec3::from_array(d_basis[k + 1]) * d_color.dot(Vec3::from_slice(&coefficients[3 * k..]));
    }
    if distance > 0.0 { (d_direction - direction * direction.dot(d_direction)) / distance } else { Vec3::ZERO }
}
