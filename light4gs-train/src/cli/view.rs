//! `view`.

use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Mutex, PoisonError};

use clap::Args;
use light4gs_data::Scene;
use light4gs_web::page::{Content, PLAYER, page};
use serde_json::json;

use super::output::{say, tell};
use crate::config::{Config, DeviceName};
use crate::dataset::load_options;
use crate::error::TrainError;
use crate::view::{Answer, Server, ViewSource, cameras_json, run_around};

/// Most cameras of each split that the player lists.
const MOST_CAMERAS: usize = 500;

#[derive(Debug, Args)]
pub(super) struct View {
    /// A .l4gs file, or the folder of a run: while it trains, the page follows its newest checkpoint.
    #[arg(value_name = "FILE|RUN")]
    what: PathBuf,
    /// Dataset whose cameras the player offers; by default the run's own.
    #[arg(long)]
    scene: Option<PathBuf>,
    /// Port on this machine; 0 is any free one.
    #[arg(long, default_value_t = 0)]
    port: u16,
    /// Open the page in the browser.
    #[arg(long)]
    open: bool,
    /// Back end for reading checkpoints: ndarray, flex, wgpu, or wgpu with an adapter such as wgpu:0.
    #[arg(long)]
    device: Option<DeviceName>,
}

impl View {
    pub(super) fn run(self) -> Result<(), TrainError> {
        let source =
            if self.what.is_dir() { ViewSource::run(&self.what, self.device)? } else { ViewSource::file(&self.what)? };
        let cameras = match (&self.scene, source.dataset()) {
            (None, Some(dataset)) => cameras_json(dataset, MOST_CAMERAS),
            _ => dataset_cameras(&self.what, self.scene.as_deref(), MOST_CAMERAS)?,
        };
        let content = Content::Served { scene: "scene.l4gs", cameras: "cameras.json", watch: "state.json" };
        let html = page(&source.title(), content, Some("light4gs-player.js"));
        let port = self.port;
        let server = Server::bind(port).map_err(|error| {
            TrainError::Input(format!(
                "cannot listen on port {port}: {error}; choose another with --port, or 0 for any"
            ))
        })?;
        let address = server.address().map_err(|error| TrainError::Input(format!("cannot listen: {error}")))?;
        let address = format!("http://{address}/");
        say(format_args!("{address}\nPress Ctrl-C to end."))?;
        if self.open {
            open_browser(&address);
        }
        let source = Mutex::new(source);
        server.run(move |path| {
            let answer = |content_type, body: Cow<'static, [u8]>| Some(Answer { content_type, body });
            match path {
                "/" => answer("text/html; charset=utf-8", Cow::Owned(html.clone().into_bytes())),
                "/light4gs-player.js" => answer("text/javascript; charset=utf-8", Cow::Borrowed(PLAYER.as_bytes())),
                "/cameras.json" => answer("application/json", Cow::Owned(cameras.clone().into_bytes())),
                "/scene.l4gs" => {
                    let source = source.lock().unwrap_or_else(PoisonError::into_inner);
                    let found = source.version() > 0;
                    found.then(|| Answer {
                        content_type: "application/octet-stream",
                        body: Cow::Owned(source.bytes().to_vec()),
                    })
                }
                "/state.json" => {
                    let mut source = source.lock().unwrap_or_else(PoisonError::into_inner);
                    let problem = source.refresh().err().map(|error| error.to_string());
                    let status = problem.as_deref().unwrap_or(source.status());
                    let state = json!({ "scene": source.version(), "status": status });
                    answer("application/json", Cow::Owned(state.to_string().into_bytes()))
                }
                _ => None,
            }
        });
        Ok(())
    }
}

/// The cameras for a file as JSON: those of a named dataset, else those of the run whose folder holds the file, else
/// none.
///
/// # Errors
/// A named dataset that cannot be read.
pub(super) fn dataset_cameras(file: &Path, named: Option<&Path>, most: usize) -> Result<String, TrainError> {
    if let Some(folder) = named {
        return Ok(cameras_json(&Scene::open(folder, &load_options(&Config::default()))?, most));
    }
    // If the dataset of a run no longer exists, its file can be played all the same.
    let dataset = run_around(file)
        .and_then(|(_, record, config)| Scene::open(record.dataset().ok()?, &load_options(&config)).ok());
    Ok(dataset.map_or_else(|| "[]".to_owned(), |scene| cameras_json(&scene, most)))
}

/// Asks the system to show a page. The address has been printed already, so a system without a browser is no error.
fn open_browser(address: &str) {
    let (program, arguments): (&str, &[&str]) = if cfg!(target_os = "macos") {
        ("open", &[])
    } else if cfg!(windows) {
        ("cmd", &["/c", "start", ""])
    } else {
        ("xdg-open", &[])
    };
    let quiet = Command::new(program).args(arguments).arg(address).stdout(Stdio::null()).stderr(Stdio::null()).spawn();
    if let Err(error) = quiet {
        tell(format_args!("cannot open a browser ({program}: {error}); open the address yourself"));
    }
}
