//! The pinhole camera and its conversions.

use glam::{DMat3, DVec3, Mat3, Mat4, Vec3, Vec4};

/// How far `R^T R` may be from the identity before a pose is refused.
const ROTATION_TOLERANCE: f64 = 1e-3;

/// How far from the origin a camera may be, world units. Coordinates of maps stay below 1e7; in much larger scenes
/// float32 numbers overflow in training.
const MOST_DISTANCE: f64 = 1e8;

/// Focal lengths in image sides: within these, float32 can tell the field of view from 0 and from π.
const FOCAL_SIDES: std::ops::RangeInclusive<f64> = 1e-5..=1e6;

/// How far from the image's middle the principal point may be, in image sides. In cropped images it may lie outside.
const MOST_OFF_CENTER: f64 = 1e3;

/// An OpenCV pinhole camera: +x right, +y down, +z forward; `x_cam = rotation * x_world + translation`.
///
/// Pixel `(i, j)` sees `u = fx * x / z + cx - 0.5`, compared with the integer `i` (and `v` likewise
/// with `j`): the center of the image is at `cx = width / 2`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// World to camera rotation `[3, 3]` (orthonormal, determinant 1).
    pub rotation: Mat3,
    /// World to camera translation, world units.
    pub translation: Vec3,
    /// Horizontal focal length, pixels.
    pub fx: f32,
    /// Vertical focal length, pixels.
    pub fy: f32,
    /// Horizontal principal point, pixels from the image's left edge.
    pub cx: f32,
    /// Vertical principal point, pixels from the image's upper edge.
    pub cy: f32,
    /// Image width, pixels.
    pub width: u32,
    /// Image height, pixels.
    pub height: u32,
}

/// Focal lengths and principal point of a camera, in the pixels of an image of `width` × `height`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intrinsics {
    /// Image width, pixels.
    pub width: u32,
    /// Image height, pixels.
    pub height: u32,
    /// Horizontal focal length, pixels.
    pub fx: f64,
    /// Vertical focal length, pixels.
    pub fy: f64,
    /// Horizontal principal point, pixels from the image's left edge.
    pub cx: f64,
    /// Vertical principal point, pixels from the image's upper edge.
    pub cy: f64,
}

impl Intrinsics {
    /// The same camera for an image of another size.
    pub fn resized(&self, width: u32, height: u32) -> Self {
        let x = f64::from(width) / f64::from(self.width.max(1));
        let y = f64::from(height) / f64::from(self.height.max(1));
        Self { width, height, fx: self.fx * x, fy: self.fy * y, cx: self.cx * x, cy: self.cy * y }
    }
}

/// What is wrong with a camera pose or its intrinsics.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PoseError {
    /// A matrix entry is NaN or infinite.
    #[error("entry [{row}][{column}] is {value}, expected a finite number")]
    NotFinite {
        /// Row of the entry.
        row: usize,
        /// Column of the entry.
        column: usize,
        /// The entry.
        value: f32,
    },
    /// The camera is too far from the origin.
    #[error("the camera is {distance:e} world units from the origin, expected at most {MOST_DISTANCE:e}")]
    TooFar {
        /// From the origin, world units.
        distance: f64,
    },
    /// The upper left 3×3 part is not a rotation.
    #[error(
        "the upper left 3x3 part is not a rotation (determinant {determinant:.4}, largest error of R^T R {error:.4}); expected orthonormal columns and determinant 1"
    )]
    NotRotation {
        /// Its determinant.
        determinant: f64,
        /// Largest absolute entry of `R^T R - 1`.
        error: f64,
    },
    /// The last row is not `0 0 0 1`.
    #[error("the last row is {row:?}, expected [0, 0, 0, 1]")]
    LastRow {
        /// The row that was found.
        row: [f32; 4],
    },
    /// The field of view is not between 0 and pi.
    #[error("the horizontal field of view is {fov_x} rad, expected a value between 0 and pi")]
    FieldOfView {
        /// The angle that was given, radians.
        fov_x: f32,
    },
    /// A focal length is not positive, or the principal point is not finite, or either is unusable for the image.
    #[error(
        "focal lengths are {fx} x {fy} and the principal point is ({cx}, {cy}), expected focal lengths of {} to {:e} image sides and a principal point within {MOST_OFF_CENTER} of them", FOCAL_SIDES.start(), FOCAL_SIDES.end()
    )]
    Intrinsics {
        /// Horizontal focal length, pixels.
        fx: f32,
        /// Vertical focal length, pixels.
        fy: f32,
        /// Horizontal principal point, pixels.
        cx: f32,
        /// Vertical principal point, pixels.
        cy: f32,
    },
    /// The image has no pixels.
    #[error("the image is {width} x {height} pixels, expected at least 1 x 1")]
    EmptyImage {
        /// Width, pixels.
        width: u32,
        /// Height, pixels.
        height: u32,
    },
}

/// Refuses a matrix that is not orthonormal with determinant 1.
fn check_rotation(rotation: DMat3) -> Result<(), PoseError> {
    let excess = rotation.transpose() * rotation - DMat3::IDENTITY;
    let error = excess.to_cols_array().iter().fold(0.0f64, |worst, v| worst.max(v.abs()));
    let determinant = rotation.determinant();
    // Written so that NaN is refused.
    if error <= ROTATION_TOLERANCE && determinant > 0.0 {
        return Ok(());
    }
    Err(PoseError::NotRotation { determinant, error })
}

/// Refuses a camera center so far away that float32 numbers would overflow.
fn check_distance(center: DVec3) -> Result<(), PoseError> {
    let distance = center.length();
    // Written so that NaN is refused.
    if distance <= MOST_DISTANCE { Ok(()) } else { Err(PoseError::TooFar { distance }) }
}

impl Camera {
    /// Center of projection in world units.
    pub fn center(&self) -> Vec3 {
        -(self.rotation.transpose() * self.translation)
    }

    /// A camera from a Blender/NeRF pose: rows of a camera-to-world matrix in OpenGL axes
    /// (+x right, +y up, looking along -z), with square pixels and a centered principal point.
    ///
    /// `fov_x` is the full horizontal field of view in radians.
    ///
    /// # Errors
    /// [`PoseError`] when an entry is not finite or too large, the matrix is not a rigid motion, the field of view is
    /// not in (0, pi) or too near to either, or the image is empty.
    pub fn from_camera_to_world_opengl(
        c2w: &[[f32; 4]; 4],
        fov_x: f32,
        width: u32,
        height: u32,
    ) -> Result<Self, PoseError> {
        for (row, values) in c2w.iter().enumerate() {
            for (column, &value) in values.iter().enumerate() {
                if !value.is_finite() {
                    return Err(PoseError::NotFinite { row, column, value });
                }
            }
        }
        let expected = [0.0, 0.0, 0.0, 1.0];
        if c2w[3].iter().zip(expected).any(|(a, b)| (a - b).abs() > 1e-5) {
            return Err(PoseError::LastRow { row: c2w[3] });
        }
        if !(fov_x > 0.0 && fov_x < std::f32::consts::PI) {
            return Err(PoseError::FieldOfView { fov_x });
        }
        if width == 0 || height == 0 {
            return Err(PoseError::EmptyImage { width, height });
        }
        let column = |j: usize| DVec3::new(f64::from(c2w[0][j]), f64::from(c2w[1][j]), f64::from(c2w[2][j]));
        // OpenGL -> OpenCV: y and z change sign. The inverse of a rotation is its transpose.
        let rotation = DMat3::from_cols(column(0), -column(1), -column(2)).transpose();
        check_rotation(rotation)?;
        check_distance(column(3))?;
        let translation = -(rotation * column(3));
        let camera = Self::centered(rotation.as_mat3(), translation.as_vec3(), fov_x, width, height);
        if !FOCAL_SIDES.contains(&(f64::from(camera.fx) / f64::from(width))) {
            return Err(PoseError::FieldOfView { fov_x });
        }
        Ok(camera)
    }

    /// A camera from a rotation from world to camera (OpenCV axes), its center in world units, and intrinsics in pixels.
    ///
    /// # Errors
    /// [`PoseError`] when a number is not finite as an `f32` or too large, the matrix is not a rotation, a focal length
    /// is not positive or unusable for the image, or the image is empty.
    pub fn from_pose(rotation: DMat3, center: DVec3, intrinsics: &Intrinsics) -> Result<Self, PoseError> {
        let Intrinsics { width, height, fx, fy, cx, cy } = *intrinsics;
        let translation = -(rotation * center);
        for row in 0..3 {
            let values = [0, 1, 2].map(|j| rotation.col(j)[row]).into_iter().chain([translation[row]]);
            for (column, value) in values.enumerate() {
                if !(value as f32).is_finite() {
                    return Err(PoseError::NotFinite { row, column, value: value as f32 });
                }
            }
        }
        check_rotation(rotation)?;
        check_distance(center)?;
        if width == 0 || height == 0 {
            return Err(PoseError::EmptyImage { width, height });
        }
        let legal = |focal: f64, middle: f64, side: u32| {
            let side = f64::from(side);
            FOCAL_SIDES.contains(&(focal / side)) && (middle / side - 0.5).abs() <= MOST_OFF_CENTER
        };
        let both_legal = legal(fx, cx, width) && legal(fy, cy, height);
        let [fx, fy, cx, cy] = [fx, fy, cx, cy].map(|value| value as f32);
        if !both_legal {
            return Err(PoseError::Intrinsics { fx, fy, cx, cy });
        }
        let (rotation, translation) = (rotation.as_mat3(), translation.as_vec3());
        Ok(Self { rotation, translation, fx, fy, cx, cy, width, height })
    }

    /// A camera from `x_cam = rotation * x_world + translation` (OpenCV axes) and intrinsics in pixels.
    ///
    /// # Errors
    /// As [`Camera::from_pose`].
    pub fn from_world_to_camera(
        rotation: DMat3,
        translation: DVec3,
        intrinsics: &Intrinsics,
    ) -> Result<Self, PoseError> {
        let camera = Self::from_pose(rotation, -(rotation.transpose() * translation), intrinsics)?;
        // Not by way of the center: if the rotation was rounded, the translation would get other digits.
        Ok(Self { translation: translation.as_vec3(), ..camera })
    }

    /// A camera at `eye` that looks at `target` with `up` (any length) upwards in the image.
    ///
    /// `fov_x` is the full horizontal field of view in radians; pixels are square. If `eye` equals `target`, the camera
    /// looks along +y. If `up` is parallel to the view, another axis is taken.
    pub fn look_at(eye: Vec3, target: Vec3, up: Vec3, fov_x: f32, width: u32, height: u32) -> Self {
        let (eye64, up64) = (eye.as_dvec3(), up.as_dvec3());
        let forward = (target.as_dvec3() - eye64).try_normalize().unwrap_or(DVec3::Y);
        let right = [up64, DVec3::Y, DVec3::X]
            .iter()
            .map(|axis| forward.cross(axis.normalize_or_zero()))
            .find(|side| side.length() > 1e-9)
            .unwrap_or(DVec3::X)
            .normalize_or(DVec3::X);
        let down = forward.cross(right);
        let rotation = DMat3::from_cols(right, down, forward).transpose();
        let translation = -(rotation * eye64);
        Self::centered(rotation.as_mat3(), translation.as_vec3(), fov_x, width, height)
    }

    /// Square pixels, principal point in the middle.
    fn centered(rotation: Mat3, translation: Vec3, fov_x: f32, width: u32, height: u32) -> Self {
        let focal = (f64::from(width) / (2.0 * (f64::from(fov_x) / 2.0).tan())) as f32;
        Self {
            rotation,
            translation,
            fx: focal,
            fy: focal,
            cx: width as f32 / 2.0,
            cy: height as f32 / 2.0,
            width,
            height,
        }
    }

    /// The same view for an image of another size: focal lengths and principal point scale along.
    pub fn resized(&self, width: u32, height: u32) -> Self {
        let sx = f64::from(width) / f64::from(self.width.max(1));
        let sy = f64::from(height) / f64::from(self.height.max(1));
        let scaled = |value: f32, by: f64| (f64::from(value) * by) as f32;
        Self {
            fx: scaled(self.fx, sx),
            cx: scaled(self.cx, sx),
            fy: scaled(self.fy, sy),
            cy: scaled(self.cy, sy),
            width,
            height,
            ..*self
        }
    }

    /// The same view with fewer pixels, each the size of `factor`×`factor` of these. Columns and rows that are left
    /// over at the right and the lower edge are not seen. The image for it is [`crate::RgbImage8::reduced`].
    ///
    /// # Panics
    /// If `factor` is 0.
    pub fn reduced(&self, factor: u32) -> Self {
        let Self { width, height, .. } = *self;
        let whole = Self { width: width - width % factor, height: height - height % factor, ..*self };
        whole.resized(width / factor, height / factor)
    }

    /// `(tan(fov_x / 2), tan(fov_y / 2))`, as if the principal point were in the middle.
    pub fn tan_half_fov(&self) -> (f32, f32) {
        (self.width as f32 / (2.0 * self.fx), self.height as f32 / (2.0 * self.fy))
    }

    /// Full fields of view `(fov_x, fov_y)`, radians.
    pub fn fov(&self) -> (f32, f32) {
        let (x, y) = self.tan_half_fov();
        (2.0 * x.atan(), 2.0 * y.atan())
    }

    /// World to camera as a 4×4 matrix for column vectors.
    pub fn view_matrix(&self) -> Mat4 {
        let column = |v: Vec3| v.extend(0.0);
        Mat4::from_cols(
            column(self.rotation.x_axis),
            column(self.rotation.y_axis),
            column(self.rotation.z_axis),
            self.translation.extend(1.0),
        )
    }

    /// Camera to clip space for column vectors: x and y to [-1, 1] over the field of view, z to
    /// [0, 1] between `near` and `far` (world units), w = z.
    pub fn projection_matrix(&self, near: f32, far: f32) -> Mat4 {
        let (tan_x, tan_y) = self.tan_half_fov();
        let depth = far / (far - near);
        Mat4::from_cols(
            Vec4::new(1.0 / tan_x, 0.0, 0.0, 0.0),
            Vec4::new(0.0, 1.0 / tan_y, 0.0, 0.0),
            Vec4::new(0.0, 0.0, depth, 1.0),
            Vec4::new(0.0, 0.0, -depth * near, 0.0),
        )
    }

    /// A world point in pixels `(u, v)` (integers are pixel centers) and its depth along +z.
    ///
    /// Points with a depth of 0 or less are behind the camera: their `u` and `v` are meaningless.
    pub fn project(&self, point: Vec3) -> (f32, f32, f32) {
        let p = self.rotation * point + self.translation;
        (self.fx * p.x / p.z + self.cx - 0.5, self.fy * p.y / p.z + self.cy - 0.5, p.z)
    }

    /// World direction (unit length) through pixel coordinates `(u, v)`; integers are pixel centers.
    pub fn ray_direction(&self, u: f32, v: f32) -> Vec3 {
        let in_camera = Vec3::new((u + 0.5 - self.cx) / self.fx, (v + 0.5 - self.cy) / self.fy, 1.0);
        (self.rotation.transpose() * in_camera).normalize()
    }

    /// Rows of the camera-to-world matrix in OpenGL axes, as in a Blender/NeRF transforms file.
    pub fn camera_to_world_opengl(&self) -> [[f32; 4]; 4] {
        let c2w = self.rotation.transpose();
        let center = self.center();
        let row = |i: usize| [c2w.x_axis[i], -c2w.y_axis[i], -c2w.z_axis[i], center[i]];
        [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> Camera {
        Camera::look_at(Vec3::new(3.0, -2.0, 1.5), Vec3::new(0.2, 0.1, 0.3), Vec3::Z, 0.7, 64, 48)
    }

    #[test]
    fn look_at_puts_the_target_in_the_middle_and_up_upwards() {
        let camera = example();
        let (u, v, depth) = camera.project(Vec3::new(0.2, 0.1, 0.3));
        assert!((u - 31.5).abs() < 1e-3 && (v - 23.5).abs() < 1e-3 && depth > 0.0);
        let (_, higher, _) = camera.project(Vec3::new(0.2, 0.1, 0.4));
        assert!(higher < v, "+y points down");
        assert!((camera.center() - Vec3::new(3.0, -2.0, 1.5)).length() < 1e-5);
        assert!((camera.rotation.determinant() - 1.0).abs() < 1e-5);
    }

    #[test]
    fn a_reduced_camera_sees_the_same_in_larger_pixels() {
        let camera = Camera { width: 101, height: 59, ..example() };
        let reduced = camera.reduced(4);
        assert_eq!((reduced.width, reduced.height), (25, 14));
        let point = camera.center() + camera.rotation.transpose() * Vec3::new(0.2, -0.1, 3.0);
        let ((u, v, z), (reduced_u, reduced_v, reduced_z)) = (camera.project(point), reduced.project(point));
        // Centers of pixels are at whole numbers.
        for (coordinate, reduced) in [(u, reduced_u), (v, reduced_v)] {
            assert!((coordinate + 0.5 - 4.0 * (reduced + 0.5)).abs() < 1e-3, "{coordinate} {reduced}");
        }
        assert_eq!(z, reduced_z);
    }

    #[test]
    fn degenerate_look_at_is_still_a_camera() {
        for (eye, up) in [(Vec3::ZERO, Vec3::Z), (Vec3::Z, Vec3::Z), (Vec3::Z, Vec3::ZERO)] {
            let camera = Camera::look_at(eye, Vec3::ZERO, up, 0.7, 8, 8);
            assert!((camera.rotation.determinant() - 1.0).abs() < 1e-5, "{eye} {up}");
        }
    }

    #[test]
    fn opengl_pose_round_trip() {
        let camera = example();
        let back = Camera::from_camera_to_world_opengl(&camera.camera_to_world_opengl(), 0.7, 64, 48).unwrap();
        assert!((back.translation - camera.translation).length() < 1e-5);
        assert!(back.rotation.abs_diff_eq(camera.rotation, 1e-6));
        assert_eq!((back.fx, back.fy), (camera.fx, camera.fy));
    }

    #[test]
    fn bad_poses_are_refused() {
        let good = example().camera_to_world_opengl();
        let pose = |change: &dyn Fn(&mut [[f32; 4]; 4])| {
            let mut bad = good;
            change(&mut bad);
            Camera::from_camera_to_world_opengl(&bad, 0.7, 8, 8).unwrap_err()
        };
        assert!(matches!(pose(&|m| m[1][2] = f32::NAN), PoseError::NotFinite { row: 1, column: 2, .. }));
        assert!(matches!(pose(&|m| m[0].iter_mut().for_each(|v| *v *= 2.0)), PoseError::NotRotation { .. }));
        assert!(matches!(pose(&|m| m[..3].fill([0.0; 4])), PoseError::NotRotation { .. }));
        assert!(matches!(pose(&|m| m[..3].iter_mut().for_each(|row| row[0] = -row[0])), PoseError::NotRotation { .. }));
        assert!(matches!(pose(&|m| m[3][0] = 1.0), PoseError::LastRow { .. }));
        for fov in [0.0, -1.0, 3.2, f32::NAN] {
            assert!(matches!(
                Camera::from_camera_to_world_opengl(&good, fov, 8, 8),
                Err(PoseError::FieldOfView { .. })
            ));
        }
        assert!(Camera::from_camera_to_world_opengl(&good, 0.7, 0, 8).is_err());
    }

    /// Finite numbers that no camera has. With them training overflowed, or the encoder refused the field of view after
    /// the old run had been replaced.
    #[test]
    fn absurd_cameras_are_refused() {
        let far = |x: f32| {
            let mut pose = example().camera_to_world_opengl();
            pose[0][3] = x;
            Camera::from_camera_to_world_opengl(&pose, 0.7, 64, 48)
        };
        assert!(far(6.4e6).is_ok(), "coordinates of the earth");
        for x in [2e8, -1e20, f32::MAX] {
            assert!(matches!(far(x), Err(PoseError::TooFar { .. })), "{x}");
        }
        let good = example().camera_to_world_opengl();
        for fov in [1e-30, 1e-7, std::f32::consts::PI.next_down()] {
            let camera = Camera::from_camera_to_world_opengl(&good, fov, 64, 48);
            assert!(matches!(camera, Err(PoseError::FieldOfView { .. })), "{fov}");
        }
        let usual = Intrinsics { width: 64, height: 48, fx: 70.0, fy: 70.0, cx: 32.0, cy: 24.0 };
        let pose =
            |intrinsics: Intrinsics, center: f64| Camera::from_pose(DMat3::IDENTITY, DVec3::splat(center), &intrinsics);
        assert!(pose(usual, 3e6).is_ok());
        assert!(pose(Intrinsics { cx: -6400.0, fx: 1e5, ..usual }, 0.0).is_ok(), "a crop");
        assert!(matches!(pose(usual, 1e20), Err(PoseError::TooFar { .. })));
        for absurd in [
            Intrinsics { fx: 1e-30, ..usual },
            Intrinsics { fy: 1e30, ..usual },
            Intrinsics { fx: -70.0, ..usual },
            Intrinsics { fx: f64::NAN, ..usual },
            Intrinsics { cx: 3e38, ..usual },
            Intrinsics { cy: -1e30, ..usual },
            Intrinsics { cy: f64::NAN, ..usual },
        ] {
            assert!(matches!(pose(absurd, 0.0), Err(PoseError::Intrinsics { .. })), "{absurd:?}");
        }
        // An accepted camera has a field of view that a stream takes.
        for fx in [1e-5 * 64.0, 1e6 * 64.0] {
            let (x, _) = pose(Intrinsics { fx, ..usual }, 0.0).unwrap().fov();
            assert!(x > 0.0 && x < std::f32::consts::PI, "{x}");
        }
    }

    #[test]
    fn resizing_keeps_the_field_of_view_and_the_ray() {
        let camera = example();
        let small = camera.resized(16, 12);
        assert_eq!(small.fov(), camera.fov());
        assert_eq!((small.cx, small.cy), (8.0, 6.0));
        // The outer edge of the first pixel is the same world ray.
        let a = camera.ray_direction(-0.5, -0.5);
        let b = small.ray_direction(-0.5, -0.5);
        assert!((a - b).length() < 1e-6);
        let (u, v, _) = camera.project(camera.center() + a * 3.0);
        assert!((u + 0.5).abs() < 1e-3 && (v + 0.5).abs() < 1e-3);
    }
}
