//! Code that the layouts share: files and names, arrays and JSON, times and splits, and the conversion from posed
//! images to frames.

pub(crate) mod files;
pub(super) mod json;
mod moment;
pub(super) mod names;
pub(super) mod npy;
pub(super) mod posed;
pub(super) mod seconds;
pub(super) mod sequence;
pub(super) mod times;
pub(super) mod transforms;
