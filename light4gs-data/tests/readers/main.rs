//! The readers of datasets: golden vectors, scenes written in every layout and read back, damaged files.

mod dnerf_errors;
mod golden;
mod large;
mod real;
