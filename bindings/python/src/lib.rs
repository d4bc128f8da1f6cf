//! The part of the Python package `light4gs` that is written in Rust: it decodes, evaluates and draws with the
//! interpreter's lock released. The package around it, in `python/`, turns the results into NumPy arrays and classes.
//!
//! Arrays leave as `bytearray`s of float32, so that the module needs only Python's stable interface.

use std::path::PathBuf;

use glam::{DMat3, DVec3};
use light4gs_codec::take::SegmentPlace;
use light4gs_codec::{CodecError, GaussianArrays, Limits, SectionInfo, StreamInfo};
use light4gs_data::{Camera, Intrinsics};
use light4gs_render::conventions::{Gsplat, Inria};
use light4gs_render::{PlayableScene, PlayableTake};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyByteArray, PyDict};

/// Names of limits, and functions that read and write each by its name.
macro_rules! limits {
    ($($name:ident)*) => {
        /// All limits, by name.
        fn limits_to_dict<'py>(py: Python<'py>, limits: Limits) -> PyResult<Bound<'py, PyDict>> {
            // Without `..`, so that a limit that comes new is not forgotten here.
            let Limits { $($name),* } = limits;
            let dict = PyDict::new(py);
            $(dict.set_item(stringify!($name), $name)?;)*
            Ok(dict)
        }

        /// The default limits, changed by a dict.
        fn limits_from_dict(dict: Option<&Bound<'_, PyDict>>) -> PyResult<Limits> {
            let mut limits = Limits::default();
            for (name, value) in dict.into_iter().flatten() {
                let name: String = name.extract()?;
                match name.as_str() {
                    $(stringify!($name) => limits.$name = value.extract()?,)*
                    _ => {
                        let known = [$(stringify!($name)),*].join(", ");
                        return Err(PyValueError::new_err(format!("there is no limit {name:?}, only {known}")));
                    }
                }
            }
            Ok(limits)
        }
    };
}

limits! {
    file_bytes meta_bytes sections string_bytes name_bytes extras frames image_side image_pixels segments gaussians
    attributes attribute_width channels resolution scales networks nodes layer_width layer_weights memory_bytes nanoseconds
}

/// An error of the decoder as an exception: `OSError` if the system refused, otherwise `light4gs.Error`.
fn exception(py: Python<'_>, error: CodecError) -> PyErr {
    if let CodecError::Io { action, path, error } = error {
        let message = format!("cannot {action} {}: {error}", path.display());
        return std::io::Error::new(error.kind(), message).into();
    }
    let (kind, message) = (error.kind(), error.to_string());
    let class = py.import("light4gs._errors").and_then(|module| module.getattr("Error"));
    match class.and_then(|class| class.call1((kind, message))) {
        Ok(value) => PyErr::from_value(value),
        Err(error) => error,
    }
}

/// An error of the codec about an argument, such as the time.
fn call_exception(py: Python<'_>, error: CodecError) -> PyErr {
    match error {
        CodecError::Invalid { .. } => PyValueError::new_err(error.to_string()),
        other => exception(py, other),
    }
}

/// Numbers as bytes that NumPy can use without another copy.
fn bytes_of<'py>(py: Python<'py>, values: &[f32]) -> PyResult<Bound<'py, PyByteArray>> {
    PyByteArray::new_with(py, size_of_val(values), |bytes| {
        for (bytes, value) in bytes.chunks_exact_mut(4).zip(values) {
            bytes.copy_from_slice(&value.to_ne_bytes());
        }
        Ok(())
    })
}

/// A decoded scene.
#[pyclass(frozen, module = "light4gs._native")]
struct Scene(PlayableScene);

#[pymethods]
impl Scene {
    #[staticmethod]
    fn open(py: Python<'_>, path: PathBuf, limits: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let limits = limits_from_dict(limits)?;
        py.detach(|| PlayableScene::open(&path, &limits)).map(Self).map_err(|error| exception(py, error))
    }

    #[staticmethod]
    fn from_bytes(py: Python<'_>, bytes: &[u8], limits: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let limits = limits_from_dict(limits)?;
        py.detach(|| PlayableScene::decode(bytes, &limits)).map(Self).map_err(|error| exception(py, error))
    }

    /// Metadata of the file, by name.
    fn metadata<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        metadata_of(py, self.0.info())
    }

    /// Means, quaternions, scales, opacities, harmonics of all degrees.
    fn gsplat<'py>(&self, py: Python<'py>, time: f32) -> PyResult<[Bound<'py, PyByteArray>; 5]> {
        gsplat_of(py, || self.0.at(time))
    }

    /// Means, harmonics of degree 0, the others, opacities, scales, quaternions; and the further attributes by name.
    fn inria<'py>(&self, py: Python<'py>, time: f32) -> PyResult<([Bound<'py, PyByteArray>; 6], Bound<'py, PyDict>)> {
        let further = PyDict::new(py);
        for attribute in self.0.further() {
            further.set_item(&attribute.name, (attribute.width, bytes_of(py, &attribute.values)?))?;
        }
        Ok((inria_of(py, || self.0.at(time))?, further))
    }

    /// An image `[height, width, 3]`.
    fn render<'py>(
        &self,
        py: Python<'py>,
        size: [u32; 2],
        intrinsics: [f64; 4],
        rotation: [f64; 9],
        translation: [f64; 3],
        time: f32,
        background: [f32; 3],
    ) -> PyResult<Bound<'py, PyByteArray>> {
        let camera = camera(size, intrinsics, rotation, translation)?;
        image_of(py, background, || self.0.render(&camera, time, background))
    }
}

/// Metadata of a stream, by name.
fn metadata_of<'py>(py: Python<'py>, info: &StreamInfo) -> PyResult<Bound<'py, PyDict>> {
    let meta = &info.meta;
    let dict = PyDict::new(py);
    dict.set_item("name", &meta.name)?;
    dict.set_item("frame_count", meta.frame_count)?;
    dict.set_item("fps", meta.fps)?;
    dict.set_item("bounds", meta.bounds)?;
    dict.set_item("background", meta.background)?;
    dict.set_item("width", meta.width)?;
    dict.set_item("height", meta.height)?;
    dict.set_item("fov_x", meta.fov_x)?;
    dict.set_item("extra", &meta.extra)?;
    dict.set_item("gaussian_count", info.gaussian_count)?;
    dict.set_item("sh_degree", info.sh_degree)?;
    dict.set_item("bytes", info.bytes)?;
    dict.set_item("sections", SectionInfo::bytes_by_name(&info.sections))?;
    Ok(dict)
}

/// Means, quaternions, scales, opacities, harmonics of all degrees.
fn gsplat_of<'py>(
    py: Python<'py>,
    at: impl FnOnce() -> Result<GaussianArrays, CodecError> + Send,
) -> PyResult<[Bound<'py, PyByteArray>; 5]> {
    let found = py.detach(|| at().map(|gaussians| Gsplat::of(&gaussians)));
    let Gsplat { means, quats, scales, opacities, sh } = found.map_err(|error| call_exception(py, error))?;
    Ok([
        bytes_of(py, &means)?,
        bytes_of(py, &quats)?,
        bytes_of(py, &scales)?,
        bytes_of(py, &opacities)?,
        bytes_of(py, &sh)?,
    ])
}

/// Means, harmonics of degree 0, the others, opacities, scales, quaternions.
fn inria_of<'py>(
    py: Python<'py>,
    at: impl FnOnce() -> Result<GaussianArrays, CodecError> + Send,
) -> PyResult<[Bound<'py, PyByteArray>; 6]> {
    let found = py.detach(|| at().map(|gaussians| Inria::of(&gaussians)));
    let Inria { means, f_dc, f_rest, opacity, scale, rot } = found.map_err(|error| call_exception(py, error))?;
    Ok([
        bytes_of(py, &means)?,
        bytes_of(py, &f_dc)?,
        bytes_of(py, &f_rest)?,
        bytes_of(py, &opacity)?,
        bytes_of(py, &scale)?,
        bytes_of(py, &rot)?,
    ])
}

/// An image `[height, width, 3]` over a background.
fn image_of<'py>(
    py: Python<'py>,
    background: [f32; 3],
    render: impl FnOnce() -> Result<Vec<f32>, CodecError> + Send,
) -> PyResult<Bound<'py, PyByteArray>> {
    if !background.iter().all(|value| value.is_finite()) {
        return Err(PyValueError::new_err(format!("background is {background:?}, expected finite numbers")));
    }
    let image = py.detach(render);
    bytes_of(py, &image.map_err(|error| call_exception(py, error))?)
}

/// A take whose base is decoded.
#[pyclass(frozen, module = "light4gs._native")]
struct Take(PlayableTake);

#[pymethods]
impl Take {
    #[staticmethod]
    fn open(py: Python<'_>, path: PathBuf, limits: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let limits = limits_from_dict(limits)?;
        py.detach(|| PlayableTake::open(&path, &limits)).map(Self).map_err(|error| exception(py, error))
    }

    #[staticmethod]
    fn from_bytes(py: Python<'_>, bytes: &[u8], limits: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let limits = limits_from_dict(limits)?;
        py.detach(|| PlayableTake::decode(bytes.to_vec(), &limits)).map(Self).map_err(|error| exception(py, error))
    }

    /// Metadata of the base, by name, with those of the take in place of the same ones.
    fn metadata<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = metadata_of(py, self.0.base().info())?;
        let (meta, index) = (self.0.take().meta(), self.0.take().index());
        dict.set_item("name", &meta.name)?;
        dict.set_item("fps", meta.fps)?;
        dict.set_item("extra", &meta.extra)?;
        dict.set_item("seconds", index.seconds())?;
        let times = |place: &SegmentPlace| (place.times.begin, place.times.end);
        dict.set_item("segments", index.segments().iter().map(times).collect::<Vec<_>>())?;
        Ok(dict)
    }

    /// As for a scene, at a time in seconds.
    fn gsplat<'py>(&self, py: Python<'py>, seconds: f64) -> PyResult<[Bound<'py, PyByteArray>; 5]> {
        gsplat_of(py, || self.0.at(seconds))
    }

    /// As for a scene, at a time in seconds; there are no further attributes.
    fn inria<'py>(
        &self,
        py: Python<'py>,
        seconds: f64,
    ) -> PyResult<([Bound<'py, PyByteArray>; 6], Bound<'py, PyDict>)> {
        Ok((inria_of(py, || self.0.at(seconds))?, PyDict::new(py)))
    }

    /// An image `[height, width, 3]` at a time in seconds.
    fn render<'py>(
        &self,
        py: Python<'py>,
        size: [u32; 2],
        intrinsics: [f64; 4],
        rotation: [f64; 9],
        translation: [f64; 3],
        seconds: f64,
        background: [f32; 3],
    ) -> PyResult<Bound<'py, PyByteArray>> {
        let camera = camera(size, intrinsics, rotation, translation)?;
        image_of(py, background, || self.0.render(&camera, seconds, background))
    }
}

fn camera(
    [width, height]: [u32; 2],
    [fx, fy, cx, cy]: [f64; 4],
    rotation: [f64; 9],
    translation: [f64; 3],
) -> PyResult<Camera> {
    let rotation = DMat3::from_cols_array(&rotation).transpose();
    let intrinsics = Intrinsics { width, height, fx, fy, cx, cy };
    Camera::from_world_to_camera(rotation, DVec3::from_array(translation), &intrinsics)
        .map_err(|error| PyValueError::new_err(format!("camera: {error}")))
}

/// Refuses numbers that are no camera.
#[pyfunction]
fn check_camera(size: [u32; 2], intrinsics: [f64; 4], rotation: [f64; 9], translation: [f64; 3]) -> PyResult<()> {
    camera(size, intrinsics, rotation, translation).map(|_| ())
}

/// Focal length, rotation and translation of a camera at `eye` that looks at `target`.
#[pyfunction]
fn look_at(eye: [f32; 3], target: [f32; 3], up: [f32; 3], fov_x: f32, size: [u32; 2]) -> (f32, [f32; 9], [f32; 3]) {
    let camera = Camera::look_at(eye.into(), target.into(), up.into(), fov_x, size[0], size[1]);
    (camera.fx, camera.rotation.transpose().to_cols_array(), camera.translation.to_array())
}

/// The limits of a name.
#[pyfunction]
fn limits<'py>(py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyDict>> {
    match name {
        "default" => limits_to_dict(py, Limits::default()),
        "large" => limits_to_dict(py, Limits::large()),
        other => Err(PyValueError::new_err(format!("there are no limits {other:?}, only \"default\" and \"large\""))),
    }
}

#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<Scene>()?;
    module.add_class::<Take>()?;
    module.add_function(wrap_pyfunction!(check_camera, module)?)?;
    module.add_function(wrap_pyfunction!(look_at, module)?)?;
    module.add_function(wrap_pyfunction!(limits, module)?)?;
    Ok(())
}
