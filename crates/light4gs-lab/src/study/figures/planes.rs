//! Figures of the feature planes: the distribution of their values, and maps of their bits.

use light4gs_data::RgbImage8;
use light4gs_report::inferno;
use light4gs_train::compression::BitMap;
use light4gs_train::error::TrainError;
use light4gs_train::run::RunFolder;

use super::{Content, Figure};
use crate::study::manifest::StudyFolder;
use crate::study::plots::{Mark, ScatterPlot, Series, draw};
use crate::study::results::RunResult;

/// Bins of a histogram.
const BINS: usize = 120;
/// Share of the values at each end that a histogram omits.
const TAIL: f64 = 0.001;
/// Share of the places of bit maps that have the brightest color.
const BRIGHTEST: f64 = 0.002;
/// Pixels between two planes.
const GAP: usize = 3;
/// An image is enlarged to at least this height, by whole factors.
const LEAST_HEIGHT: usize = 96;

/// Histograms of the decoded values of all planes, one line for each run.
pub(super) fn values(
    folder: &StudyFolder,
    scene: &str,
    runs: &[(String, &RunResult)],
) -> Result<Option<Figure>, TrainError> {
    let mut all = Vec::new();
    for (label, run) in runs {
        let data = light4gs_codec::read_file_with_limits(
            &folder.path(&run.run).join("scene.l4gs"),
            &light4gs_codec::Limits::large(),
        )?;
        let values: Vec<f32> = data.feature_planes.planes.into_iter().flat_map(|plane| plane.values).collect();
        all.push((label.clone(), values));
    }
    let mut together: Vec<f32> = all.iter().flat_map(|(_, values)| values).copied().collect();
    if together.is_empty() {
        return Ok(None);
    }
    together.sort_by(f32::total_cmp);
    let at = |share: f64| f64::from(together[((together.len() - 1) as f64 * share) as usize]);
    let (low, high) = (at(TAIL), at(1.0 - TAIL));
    let width = ((high - low) / BINS as f64).max(f64::MIN_POSITIVE);
    let series = all.into_iter().map(|(label, values)| {
        let mut counts = vec![0usize; BINS];
        for value in &values {
            let bin = (f64::from(*value) - low) / width;
            if (0.0..BINS as f64).contains(&bin) {
                counts[bin as usize] += 1;
            }
        }
        let center = |bin: usize| low + (bin as f64 + 0.5) * width;
        let share = |count: usize| count as f64 / values.len().max(1) as f64;
        let points = counts.iter().enumerate().map(|(bin, count)| (center(bin), share(*count))).collect();
        Series { label, mark: Mark::Line, points }
    });
    let plot = ScatterPlot {
        title: format!("Values of the decoded planes: {scene}"),
        x_label: "value".to_owned(),
        y_label: "share of the values".to_owned(),
        logarithmic: false,
        series: series.collect(),
        levels: Vec::new(),
    };
    Ok(Some(Figure {
        section: "Distribution of plane values",
        name: format!("plane-values-{scene}"),
        caption: format!(
            "{BINS} bins of all planes together; the outermost {TAIL} of the values at each end are left out."
        ),
        content: Content::Drawing(draw(&plot)?),
    }))
}

/// The bits of every plane of every run, with one color scale.
pub(super) fn bit_maps(
    folder: &StudyFolder,
    scene: &str,
    runs: &[(String, &RunResult)],
) -> Result<Option<Figure>, TrainError> {
    let mut all = Vec::new();
    for (label, run) in runs {
        let (run_folder, _, _) = RunFolder::open(&folder.path(&run.run))?;
        let maps: Vec<BitMap> = run_folder.read_json("bit_maps.json")?.unwrap_or_default();
        if let Some(map) = maps.iter().find(|map| map.bits.len() as u64 != u64::from(map.width) * u64::from(map.height))
        {
            let (run, name) = (&run.run, &map.name);
            return Err(TrainError::Input(format!("{run}/bit_maps.json: plane {name} is not as large as it says")));
        }
        all.push((label.clone(), maps));
    }
    let mut bits: Vec<f32> = all.iter().flat_map(|(_, maps)| maps).flat_map(|map| map.bits.iter().copied()).collect();
    bits.sort_unstable_by(f32::total_cmp);
    // If the brightest color were that of a few places with several times the bits of all others, all others would be
    // dark.
    let most = bits.get((bits.len() as f64 * (1.0 - BRIGHTEST)) as usize).copied().unwrap_or(0.0);
    if most <= 0.0 {
        return Ok(None);
    }
    let images = all.into_iter().filter(|(_, maps)| !maps.is_empty());
    let images = images.map(|(label, maps)| {
        let names = maps.iter().map(|map| map.name.as_str()).collect::<Vec<_>>().join(" ");
        (format!("{label}: {names}"), stitch(&maps, most))
    });
    Ok(Some(Figure {
        section: "Bit allocation",
        name: format!("bit-maps-{scene}"),
        caption: format!(
            "{scene}: bits at each place of a plane, all channels together, from 0 (black) to {most:.1} and more (yellow), \
             the same in all images."
        ),
        content: Content::Images(images.collect()),
    }))
}

/// Planes side by side.
fn stitch(maps: &[BitMap], most: f32) -> RgbImage8 {
    let tallest = maps.iter().map(|map| map.height as usize).max().unwrap_or(1).max(1);
    let factor = LEAST_HEIGHT.div_ceil(tallest).max(1);
    let width = maps.iter().map(|map| map.width as usize * factor + GAP).sum::<usize>().max(GAP + 1) - GAP;
    let height = tallest * factor;
    let mut pixels = vec![255; width * height * 3];
    let mut left = 0;
    for map in maps {
        for y in 0..map.height as usize * factor {
            for x in 0..map.width as usize * factor {
                let bits = map.bits[(y / factor) * map.width as usize + x / factor];
                let place = (y * width + left + x) * 3;
                pixels[place..place + 3].copy_from_slice(&inferno(bits / most));
            }
        }
        left += map.width as usize * factor + GAP;
    }
    RgbImage8 { width: width as u32, height: height as u32, pixels }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_stand_side_by_side() {
        let map = |width: u32, height: u32| BitMap {
            name: "0.xy".into(),
            width,
            height,
            bits: vec![1.0; (width * height) as usize],
        };
        let image = stitch(&[map(8, 96), map(4, 48)], 1.0);
        assert_eq!((image.width, image.height), (15, 96));
        let pixel = |x: usize, y: usize| &image.pixels[(y * 15 + x) * 3..][..3];
        assert_eq!(pixel(0, 0), inferno(1.0));
        assert_eq!(pixel(9, 0), [255; 3]);
        assert_eq!(pixel(14, 95), [255; 3], "below the lower plane");
        assert_eq!(stitch(&[], 1.0).width, 1);
    }
}
