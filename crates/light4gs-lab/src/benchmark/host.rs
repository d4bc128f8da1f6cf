//! The host's part of a training step: on a scene so small that a device has next to nothing to do, the time of a step is the
//! time that the host takes to prepare and launch it, and to wait for what it reads. A software driver shows it as well as a GPU.

use burn::tensor::Device;
use light4gs_train::config::DeviceName;
use light4gs_train::device::adapter_name;
use light4gs_train::error::TrainError;
use light4gs_train::table::{Align, Table};

use super::launches::Launches;
use super::steps::FIELDS;
use super::{BenchScene, Meter, Timing, timing_rows};
use crate::record::Row;

/// Gaussians of the scene.
const GAUSSIANS: usize = 100;
/// Width and height of its images, pixels.
const SIDE: u32 = 32;

/// The steps on one device.
#[derive(Clone, Debug)]
pub struct HostTimes {
    /// Name of the back end.
    pub device: String,
    /// The name that its graphics adapter reports, if it has one.
    pub adapter: Option<String>,
    /// For every deformation field a plain step, and one with noise and rate.
    pub timings: Vec<Timing>,
}

/// Times the steps of every deformation field, `repeats` times each, on a device without autodiff.
///
/// # Errors
/// [`TrainError`] if a trainer cannot be made, or a step of it fails.
pub fn host_benchmark(name: DeviceName, device: &Device, repeats: usize) -> Result<HostTimes, TrainError> {
    let scene = BenchScene::generate(GAUSSIANS, SIDE);
    let meter = Meter { device, repeats, launches: &Launches::on(name) };
    let mut timings = Vec::new();
    for field in &FIELDS {
        timings.extend(field.steps(&scene, &meter)?);
    }
    Ok(HostTimes { device: name.to_string(), adapter: adapter_name(name, device), timings })
}

/// A row for each device and step.
pub fn host_rows(results: &[HostTimes]) -> Vec<Row> {
    let of_device = |times: &HostTimes| timing_rows(&times.device, times.adapter.as_deref(), None, &times.timings);
    results.iter().flat_map(of_device).collect()
}

/// One table: a row for each device and step.
pub fn host_table(results: &[HostTimes]) -> String {
    let right = |name: &'static str| (name, Align::Right);
    let columns = [("device", Align::Left), ("step", Align::Left), right("ms (median)"), right("launches")];
    let mut table = Table::new(columns.into_iter().chain([right("read-backs"), right("bytes read")]));
    for device in results {
        for Timing { name, cost } in &device.timings {
            let launches: u64 = cost.launches.values().sum();
            table.row([
                device.device.clone(),
                name.clone(),
                format!("{:.2}", cost.milliseconds),
                launches.to_string(),
                cost.read_backs.to_string(),
                cost.read_bytes.to_string(),
            ]);
        }
    }
    let adapters = results.iter().filter_map(|device| Some((&device.device, device.adapter.as_ref()?)));
    adapters.fold(table.to_string(), |text, (device, adapter)| format!("{text}\n{device}: {adapter}"))
}
