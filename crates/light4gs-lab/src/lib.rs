//! The laboratory of Light4GS: [`study`] trains a scene many times with variants and makes tables and plots of the runs;
//! [`benchmark`] times every part of a training step.
//!
//! It stands above the libraries, which do without it. The program's commands `study`, `gather` and `bench` use it.

pub mod benchmark;
pub mod study;
