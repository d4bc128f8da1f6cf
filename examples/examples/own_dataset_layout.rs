//! A dataset layout in your own crate: no file of Light4GS is edited.
//!
//! The layout is a folder with a table `cameras.csv`: for each image its split, its file, a time in seconds and where the
//! camera stands. All cameras look at the origin.

use std::fs;
use std::path::Path;

use light4gs::data::{
    Camera, DataError, DatasetLayout, Frame, ImageStore, Layouts, LoadOptions, PointCloud, Resolution, Scene, Split,
    SplitFrames, image_size,
};
use light4gs_examples::{Outcome, tiny_scene};

/// The horizontal field of view of every camera of this layout, radians.
const FOV_X: f32 = 0.691_111_2;

/// This layout has no state. A layout with state (a scale, a list of cameras to leave out) keeps it in fields.
struct CameraTable;

impl DatasetLayout for CameraTable {
    fn name(&self) -> &'static str {
        "camera-table"
    }

    fn signature(&self) -> &'static str {
        "cameras.csv"
    }

    fn detect(&self, root: &Path) -> bool {
        root.join(self.signature()).is_file()
    }

    fn open(&self, root: &Path, options: &LoadOptions) -> Result<Scene, DataError> {
        let path = root.join(self.signature());
        let table = fs::read_to_string(&path).map_err(DataError::io("read", &path))?;
        let mut frames = SplitFrames::default();
        // The first line holds the names of the columns.
        for (number, line) in table.lines().enumerate().skip(1) {
            let (split, frame) = read_line(root, line, options).map_err(|problem| {
                let remedy = "write `split,image,seconds,x,y,z`";
                DataError::field(&path, format!("line {}", number + 1), problem, remedy)
            })?;
            match split {
                Split::Train => frames.train.push(frame),
                Split::Test => frames.test.push(frame),
                Split::Val => frames.val.push(frame),
                Split::Video => frames.video.push(frame),
            }
        }
        // Times are in [0, 1] from here on.
        let last = frames.train.iter().chain(&frames.test).map(|frame| frame.time).fold(f32::MIN_POSITIVE, f32::max);
        for frame in frames.train.iter_mut().chain(&mut frames.test).chain(&mut frames.val).chain(&mut frames.video) {
            frame.time = (frame.time / last).clamp(0.0, 1.0);
        }
        // This layout has no points, so the Gaussians start anywhere in a cube.
        let points = PointCloud::random(options.random_points, options.random_half_size, options.seed);
        Scene::new(self.name(), root, frames, points, options.background)
    }
}

/// One line of the table. The message of an error says what is wrong with it.
fn read_line(root: &Path, line: &str, options: &LoadOptions) -> Result<(Split, Frame), String> {
    let columns: Vec<&str> = line.split(',').collect();
    let &[split, image, seconds, x, y, z] = columns.as_slice() else {
        return Err(format!("{} columns, expected 6", columns.len()));
    };
    let split = split.parse::<Split>().map_err(|error| error.to_string())?;
    let number = |text: &str| match text.parse::<f32>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(format!("`{text}` is not a finite number")),
    };
    let eye = [number(x)?, number(y)?, number(z)?];
    // The camera is made for the image in the file, and then brought to the size that is asked for.
    let path = root.join(image);
    let source = image_size(&path).map_err(|error| error.to_string())?;
    let (width, height) = options.resolution.apply(source);
    let camera = Camera::look_at(eye.into(), [0.0; 3].into(), [0.0, 0.0, 1.0].into(), FOV_X, source.0, source.1);
    let frame = Frame::new(image, camera.resized(width, height), number(seconds)?, path, source);
    Ok((split, frame))
}

pub(crate) fn main() -> Outcome {
    let folder = tempfile::tempdir()?;
    let root = tiny_scene(folder.path())?;
    let options = LoadOptions { resolution: Resolution::MaxSide(32), ..LoadOptions::default() };
    let known = Scene::open(&root, &options)?;

    // The same scene as a camera table: the folder loses its transforms, and gets a table that lasts five seconds.
    let mut table = String::from("split,image,seconds,x,y,z\n");
    for split in [Split::Train, Split::Test] {
        for frame in known.frames(split) {
            let [x, y, z] = frame.camera.center().to_array();
            table += &format!("{split},{split}/{}.png,{},{x},{y},{z}\n", frame.name, 5.0 * frame.time);
        }
        fs::remove_file(root.join(format!("transforms_{split}.json")))?;
    }
    fs::write(root.join("cameras.csv"), table)?;

    // Without the layout the folder is not recognized. With it, the folder is recognized by its files or by the
    // layout's name.
    let refused = Scene::open(&root, &options).unwrap_err();
    assert!(matches!(refused, DataError::UnknownLayout { .. }), "{refused}");
    let layouts = Layouts::default().with(CameraTable);
    let scene = Scene::open_with(&layouts, &root, &options)?;
    let by_name = LoadOptions { layout: Some("camera-table".into()), ..options.clone() };
    assert_eq!(Scene::open_with(&layouts, &root, &by_name)?, scene);

    // Cameras, times and images are those of the original layout.
    assert_eq!((scene.layout, scene.train.len(), scene.test.len()), ("camera-table", 12, 2));
    let store = ImageStore::new(&options, 1 << 20);
    for (ours, theirs) in scene.train.iter().chain(&scene.test).zip(known.train.iter().chain(&known.test)) {
        assert!(ours.camera.rotation.abs_diff_eq(theirs.camera.rotation, 1e-5));
        assert!(ours.camera.translation.abs_diff_eq(theirs.camera.translation, 1e-4));
        assert!((ours.time - theirs.time).abs() < 1e-6);
        assert_eq!(store.get(ours)?, store.get(theirs)?);
    }

    // A mistake in the table is named with file, line and remedy.
    fs::write(root.join("cameras.csv"), "split,image,seconds,x,y,z\ntrain,train/r_000.png,noon,0,-4,1\n")?;
    let message = Scene::open_with(&layouts, &root, &options).unwrap_err().to_string();
    assert!(message.contains("cameras.csv: line 2: `noon` is not a finite number"), "{message}");
    println!("read {} training and {} test frames of layout `{}`", scene.train.len(), scene.test.len(), scene.layout);
    Ok(())
}
