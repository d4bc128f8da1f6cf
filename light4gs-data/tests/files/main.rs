//! Files from others: datasets in every layout (golden vectors, written and read back, damaged), scenes of other
//! programs, and PyTorch's files.

mod dnerf_errors;
mod exchange;
mod golden;
mod large;
mod pytorch;
mod real;
