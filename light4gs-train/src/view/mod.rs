//! Viewing a scene in the browser: the page, its data, and the server of `light4gs view`.

mod cameras;
mod server;
mod source;

pub use cameras::{cameras_json, run_around};
pub use server::{Answer, Server};
pub use source::ViewSource;
