//! The scores of one view, and over several views.

use burn::tensor::Tensor;
use light4gs_data::{PixelMask, Region};
use serde::ser::{Serialize, SerializeMap, Serializer};

use super::lpips::Lpips;
use super::{
    Metric, PixelMap, RegionMetric, d_ssim, decibels, ms_ssim, psnr, squared_differences, ssim, ssim_map, ssim_valid,
};

/// The scores of one view, or over several.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scores(Vec<Score>);

#[derive(Clone, Copy, Debug, PartialEq)]
struct Score {
    metric: Metric,
    value: f64,
    /// The weight where the number is pooled with those of other views: its pixels.
    pixels: u64,
}

impl Scores {
    /// Measures an image against the truth, both `[H, W, 3]` in [0, 1], over all pixels and over regions that are not empty.
    pub fn measure(image: &Tensor<3>, truth: &Tensor<3>, regions: &[(Region, PixelMask)], lpips: &[Lpips]) -> Self {
        let pair = || (image.clone(), truth.clone());
        let number = |value: Tensor<1>| value.into_scalar::<f64>();
        let call = |measure: fn(Tensor<3>, Tensor<3>) -> Option<Tensor<1>>| {
            let (image, truth) = pair();
            measure(image, truth).map(number)
        };
        let mut scores = Self::default();
        scores.set(Metric::Psnr, Some(psnr(image.clone(), truth.clone())));
        scores.set(Metric::Ssim, call(|a, b| Some(ssim(a, b))));
        scores.set(Metric::SsimValid, call(ssim_valid));
        let multiscale = call(ms_ssim);
        scores.set(Metric::MsSsim, multiscale);
        scores.set(Metric::DSsim, multiscale.map(d_ssim));
        for network in lpips {
            let (image, truth) = pair();
            scores.set(Metric::Lpips(network.network()), network.distance(image, truth).map(number));
        }
        let map = |map: fn(Tensor<3>, Tensor<3>) -> Tensor<3>| {
            let (image, truth) = pair();
            PixelMap::of(map(image, truth))
        };
        let errors = map(squared_differences);
        scores.set_over(Metric::WorstPsnr, errors.mean_of_worst());
        let regions: Vec<_> = regions.iter().filter(|(_, mask)| mask.pixels.contains(&1)).collect();
        if regions.is_empty() {
            return scores;
        }
        let mut maps = vec![(RegionMetric::Psnr, errors), (RegionMetric::Ssim, map(ssim_map))];
        for network in lpips {
            let (image, truth) = pair();
            let map = network.distance_map(image, truth).map(PixelMap::of);
            maps.extend(map.map(|map| (RegionMetric::Lpips(network.network()), map)));
        }
        for (metric, map) in &maps {
            for (region, mask) in &regions {
                scores.set_over(Metric::Of(*region, *metric), map.mean_over(mask));
            }
        }
        scores
    }

    fn set(&mut self, metric: Metric, value: Option<f64>) {
        self.0.extend(value.map(|value| Score { metric, value, pixels: 1 }));
    }

    /// Adds a metric that is a mean over the given number of pixels. For a PSNR the mean squared error is given.
    fn set_over(&mut self, metric: Metric, mean: Option<(f64, u64)>) {
        let value = |mean| if metric.is_psnr() { decibels(mean) } else { mean };
        self.0.extend(mean.map(|(mean, pixels)| Score { metric, value: value(mean), pixels }));
    }

    /// From known numbers. Where they are pooled with others, each has the same weight.
    pub fn from_values(values: impl IntoIterator<Item = (Metric, f64)>) -> Self {
        Self(values.into_iter().map(|(metric, value)| Score { metric, value, pixels: 1 }).collect())
    }

    fn score(&self, metric: Metric) -> Option<&Score> {
        self.0.iter().find(|score| score.metric == metric)
    }

    /// A number, if it was measured.
    pub fn get(&self, metric: Metric) -> Option<f64> {
        self.score(metric).map(|score| score.value)
    }

    /// PSNR in dB; NaN where nothing was measured.
    pub fn psnr(&self) -> f64 {
        self.get(Metric::Psnr).unwrap_or(f64::NAN)
    }

    /// SSIM as 3DGS; NaN where nothing was measured.
    pub fn ssim(&self) -> f64 {
        self.get(Metric::Ssim).unwrap_or(f64::NAN)
    }

    /// The figures over several views, for each metric over the views that have it: the mean of the views' numbers. For
    /// the moving region, the still region and the worst pixels it is the number over all such pixels together.
    pub fn over<'a>(views: impl Iterator<Item = &'a Self> + Clone) -> Self {
        let over = |metric: Metric| {
            let measured = views.clone().filter_map(|scores| scores.score(metric));
            if metric.is_pooled() { pooled(metric, measured) } else { mean(metric, measured) }
        };
        Self(Metric::ALWAYS.into_iter().chain(Metric::of_regions()).filter_map(over).collect())
    }

    /// The columns of a table of these scores: the metrics that are always measured, then those of regions that some
    /// scores have.
    pub fn columns<'a>(all: impl Iterator<Item = &'a Self> + Clone) -> Vec<Metric> {
        let present = |metric: &Metric| all.clone().any(|scores| scores.get(*metric).is_some());
        Metric::ALWAYS.into_iter().chain(Metric::of_regions().filter(present)).collect()
    }
}

fn mean<'a>(metric: Metric, measured: impl Iterator<Item = &'a Score>) -> Option<Score> {
    let (mut sum, mut count) = (0.0, 0);
    for score in measured {
        (sum, count) = (sum + score.value, count + 1);
    }
    (count > 0).then(|| Score { metric, value: sum / f64::from(count), pixels: 1 })
}

/// Over all pixels together. For a PSNR the error is averaged, not the PSNR.
fn pooled<'a>(metric: Metric, measured: impl Iterator<Item = &'a Score>) -> Option<Score> {
    let (mut sum, mut pixels) = (0.0, 0);
    for score in measured {
        let value = if metric.is_psnr() { 10f64.powf(-score.value / 10.0) } else { score.value };
        (sum, pixels) = (sum + value * score.pixels as f64, pixels + score.pixels);
    }
    let mean = sum / pixels as f64;
    let value = if metric.is_psnr() { decibels(mean) } else { mean };
    (pixels > 0).then_some(Score { metric, value, pixels })
}

/// A map from keys to numbers, without the absent ones.
impl Serialize for Scores {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.0.len()))?;
        for score in &self.0 {
            map.serialize_entry(&score.metric.key(), &score.value)?;
        }
        map.end()
    }
}
