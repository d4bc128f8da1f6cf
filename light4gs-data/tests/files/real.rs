//! Captures that are not in the repository: folders named in `LIGHT4GS_CAPTURES`, separated by colons. Their points must
//! have the colors of the images where they project, and not those of the mirrored or turned images.

use light4gs_data::{Frame, ImageStore, LoadOptions, RgbImage8, Scene};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Mean difference between the colors of points and of the pixels where they project, after `turn` of pixel and size.
fn difference(
    scene: &Scene,
    frame: &Frame,
    image: &RgbImage8,
    turn: impl Fn(usize, usize, usize, usize) -> (usize, usize),
) -> f32 {
    let (width, height) = (image.width as usize, image.height as usize);
    let (mut sum, mut count) = (0.0, 0);
    for (position, color) in scene.points.positions.iter().zip(&scene.points.colors) {
        let (u, v, depth) = frame.camera.project((*position).into());
        let (x, y) = (u.round(), v.round());
        if depth <= 0.0 || x < 0.0 || y < 0.0 || x >= width as f32 || y >= height as f32 {
            continue;
        }
        let (x, y) = turn(x as usize, y as usize, width, height);
        let pixel = &image.pixels[3 * (y * width + x)..][..3];
        sum += pixel.iter().zip(color).map(|(a, b)| (f32::from(*a) - 255.0 * b).abs()).sum::<f32>() / 3.0;
        count += 1;
    }
    assert!(count > 100, "only {count} points are in {}", frame.name);
    sum / count as f32
}

fn look(root: &Path) {
    let begun = Instant::now();
    let options = LoadOptions::default();
    let scene = Scene::open(root, &options).unwrap();
    println!(
        "{}: layout {}, {} train, {} test, {} points, extent {:.3}, opened in {:.2?}; {:?}",
        root.display(),
        scene.layout,
        scene.train.len(),
        scene.test.len(),
        scene.points.len(),
        scene.extent,
        begun.elapsed(),
        scene.notes
    );
    let store = ImageStore::new(&options, 1 << 28);
    // Clouds are of the beginning.
    for frames in [&scene.train, &scene.test] {
        let Some(first) = frames.iter().min_by(|a, b| a.time.total_cmp(&b.time)) else { continue };
        let image = store.get(first).unwrap();
        let straight = difference(&scene, first, &image, |x, y, _, _| (x, y));
        let mirrored = difference(&scene, first, &image, |x, y, width, _| (width - 1 - x, y));
        let upside_down = difference(&scene, first, &image, |x, y, _, height| (x, height - 1 - y));
        println!("  {}: {straight:.1} straight, {mirrored:.1} mirrored, {upside_down:.1} upside down", first.name);
        if let Some(folder) = std::env::var_os("LIGHT4GS_CAPTURES_OUT").map(PathBuf::from) {
            overlay(&scene, first, &image)
                .save_png(&folder.join(format!("{}-{}.png", scene.name, first.name)))
                .unwrap();
        }
        assert!(straight < 0.7 * mirrored.min(upside_down));
    }
}

/// The image beside itself with the points on it.
fn overlay(scene: &Scene, frame: &Frame, image: &RgbImage8) -> RgbImage8 {
    let (width, height) = (image.width as usize, image.height as usize);
    let mut pixels = Vec::with_capacity(6 * width * height);
    let mut marked = image.pixels.clone();
    for (position, color) in scene.points.positions.iter().zip(&scene.points.colors) {
        let (u, v, depth) = frame.camera.project((*position).into());
        if depth > 0.0 && u >= 0.0 && v >= 0.0 && u < width as f32 - 1.0 && v < height as f32 - 1.0 {
            for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                let at = 3 * ((v as usize + dy) * width + u as usize + dx);
                marked[at..at + 3].copy_from_slice(&color.map(|c| (c * 255.0) as u8));
            }
        }
    }
    for row in 0..height {
        let range = 3 * row * width..3 * (row + 1) * width;
        pixels.extend_from_slice(&image.pixels[range.clone()]);
        pixels.extend_from_slice(&marked[range]);
    }
    RgbImage8 { width: 2 * image.width, height: image.height, pixels }
}

#[test]
#[ignore = "needs captures: LIGHT4GS_CAPTURES=FOLDER:FOLDER"]
fn points_have_the_colors_of_the_images() {
    let list = std::env::var_os("LIGHT4GS_CAPTURES").expect("LIGHT4GS_CAPTURES names folders, separated by colons");
    let roots: Vec<PathBuf> = std::env::split_paths(&list).filter(|root| !root.as_os_str().is_empty()).collect();
    assert!(!roots.is_empty(), "LIGHT4GS_CAPTURES is empty");
    roots.iter().for_each(|root| look(root));
}
