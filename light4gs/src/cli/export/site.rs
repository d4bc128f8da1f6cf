//! `export --site`: a folder that plays a scene from any static server.

use std::fs;
use std::io::Write;
use std::path::Path;

use light4gs_codec::{GaussianArrays, Limits};
use light4gs_data::{Camera, DataError, Frame, RgbImage8, RgbImage32, write_atomically};
use light4gs_render::{PlayableScene, PlayableTake};
use light4gs_train::error::TrainError;
use light4gs_web::page::{Content, PLAYER, Preview, page, with_preview};

use super::super::output::say;
use super::super::take::is_take_file;
use super::super::view::{dataset_cameras, dataset_of};
use super::{MOST_CAMERAS, title_of};

const PAGE: &str = "index.html";
const SCRIPT: &str = "light4gs-player.js";
const SCENE: &str = "scene.l4gs";
const CAMERAS: &str = "cameras.json";
const PICTURE: &str = "preview.jpg";
/// All files of such a folder, the page last: it names the others.
const FILES: [&str; 5] = [SCRIPT, SCENE, CAMERAS, PICTURE, PAGE];
/// Longest side of the picture, pixels: large enough for programs that show links.
const PICTURE_SIDE: u32 = 800;
/// Of its JPEG, of 100.
const PICTURE_QUALITY: u8 = 85;
/// Field of view of a camera where no dataset has one, radians.
const FIELD_OF_VIEW: f32 = 0.8;

/// Writes the folder. One of an earlier time is written anew; a folder with other files is refused.
pub(super) fn write(
    folder: &Path,
    file: &Path,
    scene: Option<&Path>,
    title: Option<&str>,
    url: Option<&str>,
) -> Result<(), TrainError> {
    refuse_other_files(folder)?;
    let shown = Shown::open(file)?;
    // Of the moment that is shown: what one moving camera has filmed looks right from there.
    let from_middle = |frame: &&Frame| (frame.time - 0.5).abs();
    let camera = dataset_of(file, scene)?.and_then(|data| {
        let frames = data.train.iter();
        frames.min_by(|a, b| from_middle(a).total_cmp(&from_middle(b))).map(|frame| frame.camera)
    });
    let picture = shown.picture(camera)?;
    let cameras = dataset_cameras(file, scene, MOST_CAMERAS)?;
    let title = title_of(title, &shown.name);
    let base = url.map_or_else(String::new, |url| format!("{}/", url.trim_end_matches('/')));
    let content = Content::Beside { scene: SCENE, cameras: CAMERAS };
    let preview = Preview {
        title,
        description: "A scene that moves, made of Gaussians: drag to turn it.",
        image: &format!("{base}{PICTURE}"),
        image_size: [picture.width, picture.height],
    };
    let page = with_preview(&page(title, content, Some(SCRIPT)), &preview);

    fs::create_dir_all(folder).map_err(DataError::io("create", folder))?;
    let put = |name: &str, bytes: &[u8]| write_atomically(&folder.join(name), |file| file.write_all(bytes));
    put(SCRIPT, PLAYER.as_bytes())?;
    let mut source = fs::File::open(file).map_err(DataError::io("read", file))?;
    write_atomically(&folder.join(SCENE), |file| std::io::copy(&mut source, file).map(|_| ()))?;
    put(CAMERAS, cameras.as_bytes())?;
    picture.save_jpeg(&folder.join(PICTURE), PICTURE_QUALITY)?;
    put(PAGE, page.as_bytes())?;
    let sizes = FILES.iter().filter_map(|name| fs::metadata(folder.join(name)).ok()).map(|metadata| metadata.len());
    say(format_args!(
        "wrote {} ({:.2} MB); look at it with: python3 -m http.server --directory {}",
        folder.display(),
        sizes.sum::<u64>() as f64 / 1e6,
        folder.display()
    ))
}

/// Refuses a folder that holds what is not of such a folder, so that nothing is replaced.
fn refuse_other_files(folder: &Path) -> Result<(), TrainError> {
    if folder.exists() && !folder.is_dir() {
        return Err(TrainError::Input(format!("{} is a file; --site takes a folder", folder.display())));
    }
    let names = folder.read_dir().into_iter().flatten().flatten();
    let mut names = names.map(|entry| entry.file_name().to_string_lossy().into_owned());
    match names.find(|name| !FILES.contains(&name.as_str())) {
        Some(name) => Err(TrainError::Input(format!(
            "{} holds other files, among them `{name}`; name a new folder for --site",
            folder.display()
        ))),
        None => Ok(()),
    }
}

/// What a file shows.
struct Shown {
    name: String,
    scene: Playable,
}

enum Playable {
    Clip(Box<PlayableScene>),
    Take(Box<PlayableTake>),
}

impl Shown {
    fn open(file: &Path) -> Result<Self, TrainError> {
        let limits = Limits::large();
        if is_take_file(file) {
            let take = PlayableTake::open(file, &limits)?;
            return Ok(Self { name: take.take().meta().name.clone(), scene: Playable::Take(Box::new(take)) });
        }
        let scene = PlayableScene::open(file, &limits)?;
        Ok(Self { name: scene.info().meta.name.clone(), scene: Playable::Clip(Box::new(scene)) })
    }

    /// The scene in the middle of its time, from a camera of its dataset, or from one that sees most of it.
    fn picture(&self, camera: Option<Camera>) -> Result<RgbImage8, TrainError> {
        let (middle, gaussians, background) = match &self.scene {
            Playable::Clip(scene) => (0.5, scene.at(0.5)?, scene.info().meta.background),
            Playable::Take(take) => {
                let middle = 0.5 * take.take().index().seconds();
                (middle, take.at(middle)?, take.base().info().meta.background)
            }
        };
        let camera = camera.map_or_else(
            || camera_before(&gaussians),
            |camera| {
                let scale = f64::from(PICTURE_SIDE) / f64::from(camera.width.max(camera.height).max(1));
                let side = |side: u32| ((f64::from(side) * scale).round() as u32).max(1);
                camera.resized(side(camera.width), side(camera.height))
            },
        );
        let pixels = match &self.scene {
            Playable::Clip(scene) => scene.render(&camera, middle as f32, background)?,
            Playable::Take(take) => take.render(&camera, middle, background)?,
        };
        Ok(RgbImage32 { width: camera.width, height: camera.height, pixels }.to_u8())
    }
}

/// A camera in front of the middle of some Gaussians, which sees those within two standard deviations. The z axis points up, as
/// in our datasets.
fn camera_before(gaussians: &GaussianArrays) -> Camera {
    let means: Vec<[f32; 3]> =
        gaussians.means.iter().copied().filter(|mean| mean.iter().all(|place| place.is_finite())).collect();
    let count = means.len().max(1) as f32;
    let center: [f32; 3] = std::array::from_fn(|axis| means.iter().map(|mean| mean[axis]).sum::<f32>() / count);
    let square = |mean: &[f32; 3]| (0..3).map(|axis| (mean[axis] - center[axis]).powi(2)).sum::<f32>();
    let spread = (means.iter().map(square).sum::<f32>() / count).sqrt().clamp(1e-3, 1e6);
    let distance = 2.0 * spread / (0.5 * FIELD_OF_VIEW).tan();
    let eye = [center[0], center[1] - 0.94 * distance, center[2] + 0.34 * distance];
    Camera::look_at(
        eye.into(),
        center.into(),
        [0.0, 0.0, 1.0].into(),
        FIELD_OF_VIEW,
        PICTURE_SIDE,
        PICTURE_SIDE * 3 / 4,
    )
}
