//! Cameras, times and splits from the images' names, for captures whose files do not have them.

use super::files::{natural, stem_of};
use super::moment::moment;
use crate::options::{CamerasFrom, LoadOptions, TimesFrom};
use crate::scene::Reading;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::Path;

/// Where no camera can be held out, one of this many times is.
const HELD_OUT_EVERY: usize = 8;
/// A rig with fewer cameras cannot do without one.
const LEAST_CAMERAS: usize = 4;
/// If the numbers have larger gaps than this factor, they are no frame numbers.
const SPARSEST: f64 = 20.0;
/// Words before the number of a camera, lower case.
const CAMERA_WORDS: [&str; 3] = ["cam", "camera", "view"];
/// Times of day that follow each other in a capture are closer than this, seconds.
const LONGEST_PAUSE: f64 = 600.0;

/// Camera and time of an image.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::layouts) struct Place {
    /// The camera, counted from 0 in natural order of the cameras' names.
    pub(in crate::layouts) camera: u32,
    /// Time in `[0, 1]`.
    pub(in crate::layouts) time: f64,
}

/// Cameras and times of images, and where they come from.
pub(in crate::layouts) struct Sequence {
    /// One for each image.
    pub(in crate::layouts) places: Vec<Place>,
    pub(in crate::layouts) reading: Reading,
    /// Intervals of frames from time 0 to time 1, where numbers in the names count frames.
    pub(in crate::layouts) intervals: Option<f64>,
}

/// What a name says: its camera, and what counts its time.
type Key = (String, Instant);

/// A time in a name. Numbers of all kinds are exact as float64 up to 2^53.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Instant(f64);

impl Eq for Instant {}

impl Ord for Instant {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl PartialOrd for Instant {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

/// Cameras and times of images, from their paths relative to the folder of images.
///
/// A date with a time of day gives the time; otherwise the last number of a name counts the times. The text beside it,
/// with the folder, names the camera: `cam03/0017.png`, `cam03_0017.png` and `0017_cam03.png` are all time 17 of camera 3, and
/// `frame_0017.png` alone is a moving camera. Where an image was left out, the numbers leave a gap in time, as they
/// should. Names without such numbers are taken in natural order, one time each.
pub(in crate::layouts) fn sequence(names: &[String], options: &LoadOptions) -> Sequence {
    let camera = |name: &str, rest: String| match options.cameras {
        CamerasFrom::Auto => rest,
        CamerasFrom::One => String::new(),
        CamerasFrom::Folder => folder_of(name),
    };
    let keys = |key: fn(&str) -> Option<Key>| -> Option<Vec<Key>> {
        let of = |name: &String| key(name).map(|(rest, instant)| (camera(name, rest), instant));
        names.iter().map(of).collect()
    };
    let chosen = options.cameras != CamerasFrom::Auto;
    let auto = options.times == TimesFrom::Auto;
    let by_moment = || {
        keys(camera_and_moment)
            .filter(|_| auto)
            .filter(|keys| are_moments(names, keys))
            .and_then(|keys| places(&keys, chosen, f64::INFINITY))
    };
    let by_number = || {
        keys(camera_and_number)
            .filter(|_| options.times != TimesFrom::Order)
            .and_then(|keys| places(&keys, chosen, SPARSEST))
    };
    let (found, times) = match (by_moment(), by_number) {
        // Its span are seconds.
        (Some((places, _)), _) => ((places, None), "the date and time of day in the images' names"),
        (None, by_number) => match by_number() {
            Some((places, None)) => {
                ((places, None), "the order of the numbers in the images' names, which have large gaps")
            }
            Some(found) => (found, "the last number in the images' names"),
            None => {
                let places = in_order(names, options.cameras);
                ((places, None), "the order of the images' names, one step each")
            }
        },
    };
    let (places, intervals) = found;
    let cameras = places.iter().map(|place| place.camera).max().map_or(0, |last| last + 1);
    let cameras = match (cameras, options.cameras) {
        (1, _) => "one moving camera".to_owned(),
        (count, CamerasFrom::Folder) => format!("{count}, one a folder"),
        (count, _) => format!("{count}, by the text of the images' names and folders beside what counts the time"),
    };
    Sequence { places, reading: Reading { cameras, times: times.to_owned(), unposed: 0 }, intervals }
}

/// Whether moments in names are meant as such. A time of day without a date is one only where it runs on: cameras that are
/// numbered like hours would leave gaps of an hour.
fn are_moments(names: &[String], keys: &[Key]) -> bool {
    if names.iter().all(|name| moment(&stem_of(Path::new(name))).is_some_and(|moment| moment.dated)) {
        return true;
    }
    let mut seconds: Vec<f64> = keys.iter().map(|(_, instant)| instant.0).collect();
    seconds.sort_by(f64::total_cmp);
    seconds.windows(2).all(|pair| pair[1] - pair[0] <= LONGEST_PAUSE)
}

/// One time for each name of a camera, in natural order.
fn in_order(names: &[String], cameras: CamerasFrom) -> Vec<Place> {
    let mut order: Vec<usize> = (0..names.len()).collect();
    order.sort_by(|a, b| natural(&names[*a], &names[*b]));
    let camera = |name: &str| if cameras == CamerasFrom::Folder { folder_of(name) } else { String::new() };
    let mut known: Vec<(String, u64)> = Vec::new();
    let mut places = vec![Place { camera: 0, time: 0.0 }; names.len()];
    let mut ranks = vec![0; names.len()];
    for i in order {
        let name = camera(&names[i]);
        let at = known.iter().position(|(camera, _)| *camera == name).unwrap_or_else(|| {
            known.push((name, 0));
            known.len() - 1
        });
        (places[i].camera, ranks[i]) = (at as u32, known[at].1);
        known[at].1 += 1;
    }
    let last = ranks.iter().copied().max().unwrap_or(0);
    for (place, rank) in places.iter_mut().zip(ranks) {
        place.time = share(rank, last);
    }
    places
}

/// Places of images, and what they count from the first to the last; `None` for that where ranks stand for times, since the gaps
/// between them are too large. `None` altogether where the keys
/// count something else than times: there are as many cameras as names, or two images have the same place.
fn places(keys: &[Key], chosen: bool, sparsest: f64) -> Option<(Vec<Place>, Option<f64>)> {
    let mut cameras: Vec<&str> = keys.iter().map(|(camera, _)| camera.as_str()).collect();
    cameras.sort_by(|a, b| natural(a, b));
    cameras.dedup();
    let instants: BTreeSet<Instant> = keys.iter().map(|(_, instant)| *instant).collect();
    let unique: BTreeSet<&Key> = keys.iter().collect();
    if unique.len() < keys.len() || (!chosen && cameras.len() > 1 && 2 * cameras.len() > keys.len()) {
        return None;
    }
    let (first, last) = (instants.first()?.0, instants.last()?.0);
    let sparse = last - first > sparsest * instants.len() as f64;
    let ranks: BTreeMap<Instant, u64> =
        instants.iter().enumerate().map(|(rank, instant)| (*instant, rank as u64)).collect();
    let time = |instant: Instant| {
        if sparse {
            share(ranks[&instant], instants.len() as u64 - 1)
        } else if last > first {
            (instant.0 - first) / (last - first)
        } else {
            0.0
        }
    };
    let numbers: HashMap<&str, u32> = cameras.iter().enumerate().map(|(i, name)| (*name, i as u32)).collect();
    Some((
        keys.iter().map(|(name, instant)| Place { camera: numbers[name.as_str()], time: time(*instant) }).collect(),
        (!sparse).then_some(last - first),
    ))
}

fn share(part: u64, whole: u64) -> f64 {
    if whole == 0 { 0.0 } else { part as f64 / whole as f64 }
}

/// The folder of a path, as text.
fn folder_of(name: &str) -> String {
    Path::new(name).parent().map(|parent| parent.to_string_lossy().into_owned()).unwrap_or_default()
}

/// The folder and the stem without its moment, and that moment.
fn camera_and_moment(name: &str) -> Option<Key> {
    let stem = stem_of(Path::new(name));
    let moment = moment(&stem)?;
    let (start, end) = moment.place;
    Some((format!("{}/{}|{}", folder_of(name), &stem[..start], &stem[end..]), Instant(moment.seconds)))
}

/// Where the last number of a text stands.
fn last_number(text: &str) -> Option<(usize, usize)> {
    let end = text.rfind(|c: char| c.is_ascii_digit())? + 1;
    let start = text[..end].rfind(|c: char| !c.is_ascii_digit());
    Some((start.map_or(0, |i| i + text[i..].chars().next().map_or(1, char::len_utf8)), end))
}

/// Whether a text ends in a word for a camera, as `0017_cam` before the number of the camera.
fn ends_in_camera(text: &str) -> bool {
    let word = text.trim_end_matches(['_', '-', '.', ' ']).to_ascii_lowercase();
    CAMERA_WORDS.iter().any(|camera| word.ends_with(camera))
}

/// The folder and the stem without the number that counts times, and that number: the last one, or the one before where the
/// last one is that of a camera.
fn camera_and_number(name: &str) -> Option<Key> {
    let stem = stem_of(Path::new(name));
    let (start, end) = last_number(&stem)?;
    let before = last_number(&stem[..start]).filter(|_| ends_in_camera(&stem[..start]));
    let (start, end) = before.unwrap_or((start, end));
    let number: u64 = stem[start..end].parse().ok().filter(|number| *number < 1 << 53)?;
    Some((format!("{}/{}|{}", folder_of(name), &stem[..start], &stem[end..]), Instant(number as f64)))
}

/// Whether each image is held out for testing, in a dataset without splits. From a rig, camera 0 is held out, as is
/// usual; with fewer than 4 cameras, or a moving one, every eighth time, from the middle of the first eight. Of a still
/// scene, whose images all have the same time, it is every eighth image, and of a single image none.
pub(in crate::layouts) fn held_out(places: &[Place]) -> Vec<bool> {
    let cameras: BTreeSet<u32> = places.iter().map(|place| place.camera).collect();
    if cameras.len() >= LEAST_CAMERAS {
        let first = cameras.first().copied();
        return places.iter().map(|place| Some(place.camera) == first).collect();
    }
    let mut instants: Vec<f64> = places.iter().map(|place| place.time).collect();
    instants.sort_by(f64::total_cmp);
    instants.dedup();
    if instants.len() == 1 {
        let offset = (HELD_OUT_EVERY / 2).min(places.len() / 2);
        return (0..places.len()).map(|i| places.len() > 1 && i % HELD_OUT_EVERY == offset).collect();
    }
    let offset = (HELD_OUT_EVERY / 2).min(instants.len() / 2);
    let rank = |time: f64| instants.partition_point(|t| *t < time);
    places.iter().map(|place| rank(place.time) % HELD_OUT_EVERY == offset).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(names: &[&str]) -> Vec<(u32, f64)> {
        let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        with(&LoadOptions::default(), &names)
    }

    fn with(options: &LoadOptions, names: &[String]) -> Vec<(u32, f64)> {
        sequence(names, options).places.iter().map(|place| (place.camera, place.time)).collect()
    }

    #[test]
    fn moments_in_names_are_times() {
        let minutes = ["2026-11-28_12-30-10.png", "2026-11-28_12-30-50.png", "2026-11-28_12-31-30.png"];
        assert_eq!(read(&minutes), [(0, 0.0), (0, 0.5), (0, 1.0)]);
        assert_eq!(read(&["12-59-50.png", "13-00-10.png", "13-00-30.png"]), [(0, 0.0), (0, 0.5), (0, 1.0)]);
        // Two cameras, and bursts that are counted.
        let rig = ["l_20261128_123010.png", "l_20261128_123020.png", "r_20261128_123010.png", "r_20261128_123020.png"];
        assert_eq!(read(&rig), [(0, 0.0), (0, 1.0), (1, 0.0), (1, 1.0)]);
        let burst = ["20261128_123010_0001.png", "20261128_123010_0002.png", "20261128_123010_0003.png"];
        assert_eq!(read(&burst), [(0, 0.0), (0, 0.5), (0, 1.0)]);
        // Cameras, takes and frames that look like times of day.
        let numbered = ["01-00-05.png", "01-00-06.png", "02-00-05.png", "02-00-06.png"];
        assert_eq!(read(&numbered), [(0, 0.0), (0, 1.0), (1, 0.0), (1, 1.0)]);
    }

    #[test]
    fn cameras_and_times_can_be_said() {
        let names = ["a/01.png", "a/02.png", "b/31.png", "b/36.png"].map(str::to_owned);
        let options = |cameras, times| LoadOptions { cameras, times, ..Default::default() };
        let read = |cameras, times| with(&options(cameras, times), &names);
        assert_eq!(read(CamerasFrom::One, TimesFrom::Order)[3], (0, 1.0));
        assert_eq!(read(CamerasFrom::Folder, TimesFrom::Order), [(0, 0.0), (0, 1.0), (1, 0.0), (1, 1.0)]);
        assert_eq!(read(CamerasFrom::Folder, TimesFrom::Number)[2], (1, 30.0 / 35.0));
        assert_eq!(read(CamerasFrom::One, TimesFrom::Number)[2], (0, 30.0 / 35.0));
        let said = sequence(&names, &options(CamerasFrom::Folder, TimesFrom::Order)).reading;
        assert!(said.cameras.starts_with("2,") && said.times.contains("order"), "{said:?}");
    }

    #[test]
    fn a_number_behind_a_word_for_a_camera_counts_cameras() {
        let expected = [(0, 0.0), (1, 0.0), (0, 0.5), (1, 0.5), (0, 1.0), (1, 1.0)];
        for word in ["cam", "Camera_", "view-"] {
            let names = [1, 2, 3].map(|time| [0, 1].map(|camera| format!("frame_{time:04}_{word}{camera}.png")));
            assert_eq!(with(&LoadOptions::default(), &names.concat()), expected, "{word}");
        }
        // Alone, it counts times.
        assert_eq!(read(&["cam1.png", "cam2.png", "cam3.png"]), [(0, 0.0), (0, 0.5), (0, 1.0)]);
        assert_eq!(read(&["view_01.png", "view_02.png"]), [(0, 0.0), (0, 1.0)]);
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
        let still: Vec<Place> = (0..12).map(|_| Place { camera: 0, time: 0.0 }).collect();
        assert_eq!((0..12).filter(|i| held_out(&still)[*i]).collect::<Vec<_>>(), [4]);
        assert_eq!((held_out(&still[..2]), held_out(&still[..1])), (vec![false, true], vec![false]));
        let rig: Vec<Place> = (0..4).flat_map(|c| (0..3).map(move |i| place(c, i, 3))).collect();
        assert_eq!(held_out(&rig).iter().filter(|test| **test).count(), 3);
        assert!(held_out(&rig)[..3].iter().all(|test| *test));
    }
}
