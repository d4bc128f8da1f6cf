//! Cameras, times and splits from the images' names, for captures whose files do not have them.

use super::files::{natural, stem_of};
use std::collections::{BTreeSet, HashMap};
use std::path::Path;

/// Where no camera can be held out, one of this many times is.
const HELD_OUT_EVERY: usize = 8;
/// A rig with fewer cameras cannot do without one.
const LEAST_CAMERAS: usize = 4;
/// If the numbers have larger gaps than this factor, they are no frame numbers.
const SPARSEST: u64 = 20;

/// Camera and time of an image.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::layouts) struct Place {
    /// The camera, counted from 0 in natural order of the cameras' names.
    pub(in crate::layouts) camera: u32,
    /// Time in `[0, 1]`.
    pub(in crate::layouts) time: f64,
}

/// Cameras and times of images, from their paths relative to the folder of images.
///
/// The last number of a name counts the times. The text before it, with the folder, names the camera:
/// `cam03/0017.png` and `cam03_0017.png` are both time 17 of camera `cam03`, and `frame_0017.png` alone is a moving
/// camera. Where an image was left out, the numbers leave a gap in time, as they should. Names without such numbers are
/// taken in natural order, one time each.
pub(in crate::layouts) fn places(names: &[String]) -> Vec<Place> {
    numbered(names).unwrap_or_else(|| {
        let mut order: Vec<usize> = (0..names.len()).collect();
        order.sort_by(|a, b| natural(&names[*a], &names[*b]));
        let mut places = vec![Place { camera: 0, time: 0.0 }; names.len()];
        for (rank, i) in order.into_iter().enumerate() {
            places[i].time = share(rank as u64, names.len().saturating_sub(1) as u64);
        }
        places
    })
}

fn numbered(names: &[String]) -> Option<Vec<Place>> {
    let keys: Vec<(String, u64)> = names.iter().map(|name| camera_and_number(name)).collect::<Option<_>>()?;
    let mut cameras: Vec<&str> = keys.iter().map(|(camera, _)| camera.as_str()).collect();
    cameras.sort_by(|a, b| natural(a, b));
    cameras.dedup();
    let instants: BTreeSet<u64> = keys.iter().map(|(_, number)| *number).collect();
    let unique: BTreeSet<&(String, u64)> = keys.iter().collect();
    // If there are as many cameras as names, or two images with the same place, the numbers count something else.
    if unique.len() < keys.len() || (cameras.len() > 1 && 2 * cameras.len() > keys.len()) {
        return None;
    }
    let (first, last) = (*instants.first()?, *instants.last()?);
    let sparse = last - first > SPARSEST * instants.len() as u64;
    let ranks: HashMap<u64, u64> = instants.iter().enumerate().map(|(rank, number)| (*number, rank as u64)).collect();
    let time = |number: u64| {
        if sparse { share(ranks[&number], instants.len() as u64 - 1) } else { share(number - first, last - first) }
    };
    let camera = |name: &str| cameras.iter().position(|known| *known == name).unwrap_or(0) as u32;
    Some(keys.iter().map(|(name, number)| Place { camera: camera(name), time: time(*number) }).collect())
}

fn share(part: u64, whole: u64) -> f64 {
    if whole == 0 { 0.0 } else { part as f64 / whole as f64 }
}

/// The folder and the stem up to its last number, and that number.
fn camera_and_number(name: &str) -> Option<(String, u64)> {
    let path = Path::new(name);
    let stem = stem_of(path);
    let end = stem.rfind(|c: char| c.is_ascii_digit())? + 1;
    let start = stem[..end]
        .rfind(|c: char| !c.is_ascii_digit())
        .map_or(0, |i| i + stem[i..].chars().next().map_or(1, char::len_utf8));
    let number = stem[start..end].parse().ok()?;
    let folder = path.parent().map(|parent| parent.to_string_lossy().into_owned()).unwrap_or_default();
    Some((format!("{folder}/{}|{}", &stem[..start], &stem[end..]), number))
}

/// Whether each image is held out for testing, in a dataset without splits. From a rig, camera 0 is held out, as is
/// usual; with fewer than 4 cameras, or a moving one, every eighth time, from the middle of the first eight.
pub(in crate::layouts) fn held_out(places: &[Place]) -> Vec<bool> {
    let cameras: BTreeSet<u32> = places.iter().map(|place| place.camera).collect();
    if cameras.len() >= LEAST_CAMERAS {
        let first = cameras.first().copied();
        return places.iter().map(|place| Some(place.camera) == first).collect();
    }
    let mut instants: Vec<f64> = places.iter().map(|place| place.time).collect();
    instants.sort_by(f64::total_cmp);
    instants.dedup();
    let offset = (HELD_OUT_EVERY / 2).min(instants.len() / 2);
    let rank = |time: f64| instants.partition_point(|t| *t < time);
    places.iter().map(|place| rank(place.time) % HELD_OUT_EVERY == offset).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(names: &[&str]) -> Vec<(u32, f64)> {
        let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        places(&names).iter().map(|place| (place.camera, place.time)).collect()
    }

    #[test]
    fn one_moving_camera_with_a_gap() {
        let found = read(&["frame_0001.png", "frame_0002.png", "frame_0005.JPG"]);
        assert_eq!(found, [(0, 0.0), (0, 0.25), (0, 1.0)]);
        assert_eq!(read(&["a.png"]), [(0, 0.0)]);
    }

    #[test]
    fn rigs_in_folders_and_in_names() {
        let expected = [(1, 0.0), (0, 1.0), (0, 0.0), (1, 1.0)];
        assert_eq!(read(&["cam10/00.png", "cam2/01.png", "cam2/00.png", "cam10/01.png"]), expected);
        assert_eq!(read(&["c10_00.png", "c2_01.png", "c2_00.png", "c10_01.png"]), expected);
        assert_eq!(
            read(&["0_left.png", "1_left.png", "0_right.png", "1_right.png"]),
            [(0, 0.0), (0, 1.0), (1, 0.0), (1, 1.0)]
        );
    }

    #[test]
    fn names_that_do_not_count_are_taken_in_order() {
        assert_eq!(read(&["b.png", "a.png", "c.png"]), [(0, 0.5), (0, 0.0), (0, 1.0)]);
        assert_eq!(read(&["17.5.png", "19.25.png", "18.125.png"]), [(0, 0.0), (0, 1.0), (0, 0.5)]);
        assert_eq!(read(&["ä1.png", "日本2.png", "ö.png"]).len(), 3);
        // Times of day have large gaps, so only their order is used.
        assert_eq!(read(&["IMG_120000.jpg", "IMG_120500.jpg", "IMG_235959.jpg"]), [(0, 0.0), (0, 0.5), (0, 1.0)]);
        assert_eq!(read(&["99999999999999999999999.png", "1.png"]), [(0, 1.0), (0, 0.0)]);
    }

    #[test]
    fn what_is_held_out() {
        let place = |camera, instant: u32, of: u32| Place { camera, time: f64::from(instant) / f64::from(of - 1) };
        let moving: Vec<Place> = (0..20).map(|i| place(0, i, 20)).collect();
        let tests: Vec<usize> = (0..20).filter(|i| held_out(&moving)[*i]).collect();
        assert_eq!(tests, [4, 12]);
        let few: Vec<Place> = (0..2).map(|i| place(0, i, 2)).collect();
        assert_eq!(held_out(&few), [false, true]);
        let rig: Vec<Place> = (0..4).flat_map(|c| (0..3).map(move |i| place(c, i, 3))).collect();
        assert_eq!(held_out(&rig).iter().filter(|test| **test).count(), 3);
        assert!(held_out(&rig)[..3].iter().all(|test| *test));
    }
}
