//! How a configuration is put together: what a file extends, overrides from the command line, and the check of each layer.

pub(super) mod layers;
mod overrides;
pub(super) mod presets;
pub(super) mod schema;

pub use overrides::Overrides;
