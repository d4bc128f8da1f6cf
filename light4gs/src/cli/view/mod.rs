//! `view`.

mod body;
mod connections;
mod request;
mod server;
mod take;

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex, PoisonError, TryLockError};

use clap::Args;
use light4gs_data::{DataError, Scene, read_regular_file};
use light4gs_report::cameras_json;
use light4gs_train::config::{Config, DeviceName};
use light4gs_train::dataset::load_options;
use light4gs_train::error::TrainError;
use light4gs_train::run::RunFolder;
use light4gs_train::take::TakeFolder;
use light4gs_train::view_source::{Shown, ViewSource};
use light4gs_web::page::{Content, PLAYER, TRAINER, TRAINER_PAGE, page};
use serde_json::json;

use self::body::Body;
use self::server::{Answer, Server};
use self::take::TakeSource;
use super::output::{say, tell};
use super::take::is_take_file;

/// The player's script.
const PLAYER_ADDRESS: &str = "light4gs-player.js";

/// More bytes than the program that trains in a browser has.
const LARGEST_PROGRAM: u64 = 256 << 20;

// Types of content.
const HTML: &str = "text/html; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";
const JSON: &str = "application/json";

/// What the page of a scene may load and run: what this server gives it, the decoder in its worker, and nothing else. Styles stand
/// in the page and in the player.
const SCENE_POLICY: &str = "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; worker-src blob:; connect-src 'self'; \
     style-src 'unsafe-inline'; img-src data: blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
/// The same for the page that trains. The report that it makes is a page with its scripts inside, and inherits this policy.
const TRAINER_POLICY: &str = "default-src 'none'; script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval'; worker-src blob:; \
     connect-src 'self' blob:; style-src 'unsafe-inline'; img-src data: blob:; base-uri 'none'; form-action 'none'; \
     frame-ancestors 'none'";

/// What the page of a scene asks for.
const SERVED: Content<'static> = Content::Served { scene: "scene.l4gs", cameras: "cameras.json", watch: "state.json" };

/// Most cameras of each split that the player lists.
const MOST_CAMERAS: usize = 500;

#[derive(Debug, Args)]
pub(super) struct View {
    /// A .l4gs file, or the folder of a run or of a take. During a training, the page shows the newest checkpoint.
    #[arg(value_name = "FILE|RUN", required_unless_present = "trainer")]
    what: Option<PathBuf>,
    /// Dataset whose cameras the player offers; by default the run's own.
    #[arg(long)]
    scene: Option<PathBuf>,
    /// Serve a page that trains a scene in the browser; FILE.wasm is the output of bindings/web/build-trainer.
    #[arg(long, value_name = "FILE.wasm", conflicts_with_all = ["what", "scene", "device"])]
    trainer: Option<PathBuf>,
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
        match (&self.what, &self.trainer) {
            (_, Some(program)) => self.train(program),
            (Some(what), None) => self.play(what),
            (None, None) => Err(TrainError::Input("name a .l4gs file or the folder of a run".into())),
        }
    }

    /// A page that plays a take, and follows it while it is trained. Its file stays on disk, and is sent by ranges.
    fn play_take(&self, take: TakeSource) -> Result<(), TrainError> {
        let cameras = match (&self.scene, take.dataset()) {
            (Some(named), _) => cameras_json(&Scene::open(named, &load_options(&Config::default()))?, MOST_CAMERAS),
            // If the dataset no longer exists, the take can be played all the same.
            (None, Some((folder, dataset))) => Scene::open(dataset, &load_options(folder.config()))
                .map_or_else(|_| "[]".to_owned(), |scene| cameras_json(&scene, MOST_CAMERAS)),
            (None, None) => "[]".to_owned(),
        };
        let html = page(&take.title(), SERVED, Some(PLAYER_ADDRESS));
        let (html, cameras) = (Body::from(html), Body::from(cameras));
        take.newest();
        self.serve(SCENE_POLICY, move |path| match path {
            "/" => Some(answer(HTML, html.clone())),
            "/cameras.json" => Some(answer(JSON, cameras.clone())),
            "/scene.l4gs" => Some(answer("application/octet-stream", Body::File(take.path()))),
            "/state.json" => {
                let state = take.newest();
                Some(answer(JSON, json!({ "scene": state.version, "status": state.status }).to_string()))
            }
            _ => None,
        })
    }

    /// A page that plays a scene.
    fn play(&self, what: &Path) -> Result<(), TrainError> {
        let limits = light4gs_web::limits();
        if TakeFolder::is_one(what) {
            return self.play_take(TakeSource::folder(what)?);
        }
        if is_take_file(what) {
            return self.play_take(TakeSource::file(what, &limits)?);
        }
        let mut source =
            if what.is_dir() { ViewSource::run(what, self.device)? } else { ViewSource::file(what, &limits)? };
        let cameras = match (&self.scene, source.dataset()) {
            (None, Some(dataset)) => cameras_json(dataset, MOST_CAMERAS),
            _ => dataset_cameras(what, self.scene.as_deref(), MOST_CAMERAS)?,
        };
        let html = page(&source.title(), SERVED, Some(PLAYER_ADDRESS));
        let (html, cameras) = (Body::from(html), Body::from(cameras));
        let state = State { shown: Mutex::new(source.refresh().clone()), source: Mutex::new(source) };
        self.serve(SCENE_POLICY, move |path| match path {
            "/" => Some(answer(HTML, html.clone())),
            "/cameras.json" => Some(answer(JSON, cameras.clone())),
            "/scene.l4gs" => {
                let Shown { bytes, version, .. } = state.shown();
                (version > 0).then(|| answer("application/octet-stream", bytes))
            }
            "/state.json" => {
                let Shown { version, status, .. } = state.newest();
                Some(answer(JSON, json!({ "scene": version, "status": status }).to_string()))
            }
            _ => None,
        })
    }

    /// A page that trains a scene.
    fn train(&self, program: &Path) -> Result<(), TrainError> {
        let module = read_regular_file(program, LARGEST_PROGRAM).map_err(DataError::io("read", program))?;
        if !module.starts_with(b"\0asm") {
            let program = program.display();
            return Err(TrainError::Input(format!(
                "{program} is no WebAssembly module; bindings/web/build-trainer makes one"
            )));
        }
        let module = Arc::new(module);
        self.serve(TRAINER_POLICY, move |path| match path {
            "/" => Some(answer(HTML, TRAINER_PAGE)),
            "/light4gs-trainer.js" => Some(answer(SCRIPT, TRAINER)),
            "/light4gs-web-trainer.wasm" => Some(answer("application/wasm", module.clone())),
            _ => None,
        })
    }

    /// Serves a page with the player's script until the program is ended.
    fn serve(
        &self,
        policy: &'static str,
        respond: impl Fn(&str) -> Option<Answer> + Send + Sync + 'static,
    ) -> Result<(), TrainError> {
        let port = self.port;
        let server = Server::bind(port, policy).map_err(|error| {
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
        server.run(move |path| match path.strip_prefix('/') {
            Some(PLAYER_ADDRESS) => Some(answer(SCRIPT, PLAYER)),
            _ => respond(path),
        });
        Ok(())
    }
}

fn answer(content_type: &'static str, body: impl Into<Body>) -> Answer {
    Answer { content_type, body: body.into() }
}

/// What the page asks for again and again.
#[derive(Debug)]
struct State {
    source: Mutex<ViewSource>,
    /// That of the source when it was looked at last: readers need not wait while a scene is read.
    shown: Mutex<Shown>,
}

impl State {
    fn shown(&self) -> Shown {
        self.shown.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Looks for a newer scene, unless somebody else is at it.
    fn newest(&self) -> Shown {
        let mut source = match self.source.try_lock() {
            Ok(source) => source,
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(TryLockError::WouldBlock) => return self.shown(),
        };
        let newest = source.refresh().clone();
        self.shown.lock().unwrap_or_else(PoisonError::into_inner).clone_from(&newest);
        newest
    }
}

/// The cameras for a file as JSON: those of a named dataset, else those of the run whose folder holds the file, else
/// none.
///
/// # Errors
/// A named dataset that cannot be read.
pub(super) fn dataset_cameras(file: &Path, named: Option<&Path>, most: usize) -> Result<String, TrainError> {
    Ok(dataset_of(file, named)?.map_or_else(|| "[]".to_owned(), |scene| cameras_json(&scene, most)))
}

/// A named dataset, else that of the run whose folder holds the file, if it is there.
///
/// # Errors
/// A named dataset that cannot be read.
pub(super) fn dataset_of(file: &Path, named: Option<&Path>) -> Result<Option<Scene>, TrainError> {
    let around = file.parent().map(|folder| if folder.as_os_str().is_empty() { Path::new(".") } else { folder });
    // A run may read its dataset in another way than by default, or a part of it.
    let of_run = |folder: &Path| {
        let (_, record, config) = RunFolder::open(folder).ok()?;
        Some((record.dataset().ok()?.to_owned(), config))
    };
    let of_take = |folder: &Path| {
        let folder = TakeFolder::open(folder).ok()?;
        Some((folder.record().scene.clone(), folder.config().clone()))
    };
    let found = around.and_then(|folder| of_run(folder).or_else(|| of_take(folder)));
    if let Some(folder) = named {
        let config = found.map_or_else(Config::default, |(_, config)| config);
        return Ok(Some(Scene::open(folder, &load_options(&config))?));
    }
    // If the dataset of a run no longer exists, its file can be played all the same.
    Ok(found.and_then(|(dataset, config)| Scene::open(&dataset, &load_options(&config)).ok()))
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
