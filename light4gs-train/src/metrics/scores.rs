//! The metrics by name, and the scores of an image.

use burn::tensor::Tensor;
use serde::ser::{Serialize, SerializeMap, Serializer};

use super::lpips::{Lpips, LpipsNetwork};
use super::{d_ssim, masked_psnr, masked_ssim, ms_ssim, psnr, ssim, ssim_valid};

/// A metric of how alike two images are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Metric {
    /// Peak signal-to-noise ratio over the whole image, dB.
    Psnr,
    /// SSIM with zeros around the image, as 3DGS.
    Ssim,
    /// SSIM over windows inside the image, as TensorFlow, and scikit-image with Gaussian weights.
    SsimValid,
    /// MS-SSIM over five scales.
    MsSsim,
    /// `(1 - MS-SSIM) / 2`, as in the tables of 4DGS and Light4GS.
    DSsim,
    /// LPIPS.
    Lpips(LpipsNetwork),
    /// [`Metric::Psnr`] over the pixels of the dataset's mask.
    MaskedPsnr,
    /// [`Metric::Ssim`] over the windows around those pixels.
    MaskedSsim,
    /// LPIPS over those pixels.
    MaskedLpips(LpipsNetwork),
}

impl Metric {
    /// What every evaluation has, or says why it has not.
    pub const ALWAYS: [Self; 7] = [
        Self::Psnr,
        Self::Ssim,
        Self::SsimValid,
        Self::MsSsim,
        Self::DSsim,
        Self::Lpips(LpipsNetwork::Alex),
        Self::Lpips(LpipsNetwork::Vgg),
    ];

    /// What there is only where the dataset has masks.
    pub const MASKED: [Self; 4] = [
        Self::MaskedPsnr,
        Self::MaskedSsim,
        Self::MaskedLpips(LpipsNetwork::Alex),
        Self::MaskedLpips(LpipsNetwork::Vgg),
    ];

    /// Its key in JSON.
    pub fn key(self) -> &'static str {
        match self {
            Self::Psnr => "psnr",
            Self::Ssim => "ssim",
            Self::SsimValid => "ssim_valid",
            Self::MsSsim => "ms_ssim",
            Self::DSsim => "d_ssim",
            Self::Lpips(LpipsNetwork::Alex) => "lpips_alex",
            Self::Lpips(LpipsNetwork::Vgg) => "lpips_vgg",
            Self::MaskedPsnr => "masked_psnr",
            Self::MaskedSsim => "masked_ssim",
            Self::MaskedLpips(LpipsNetwork::Alex) => "masked_lpips_alex",
            Self::MaskedLpips(LpipsNetwork::Vgg) => "masked_lpips_vgg",
        }
    }

    /// The head of its column.
    pub fn label(self) -> &'static str {
        match self {
            Self::Psnr => "PSNR dB",
            Self::Ssim => "SSIM",
            Self::SsimValid => "SSIM valid",
            Self::MsSsim => "MS-SSIM",
            Self::DSsim => "D-SSIM",
            Self::Lpips(LpipsNetwork::Alex) => "LPIPS alex",
            Self::Lpips(LpipsNetwork::Vgg) => "LPIPS vgg",
            Self::MaskedPsnr => "mPSNR dB",
            Self::MaskedSsim => "mSSIM",
            Self::MaskedLpips(LpipsNetwork::Alex) => "mLPIPS alex",
            Self::MaskedLpips(LpipsNetwork::Vgg) => "mLPIPS vgg",
        }
    }

    /// What a cell says in place of a number that is absent.
    pub fn absence(self) -> &'static str {
        match self {
            Self::Lpips(_) | Self::MaskedLpips(_) => "no weights",
            Self::SsimValid | Self::MsSsim | Self::DSsim => "image too small",
            Self::Psnr | Self::Ssim | Self::MaskedPsnr | Self::MaskedSsim => "none",
        }
    }

    /// A number as a cell shows it.
    pub fn format(self, value: Option<f64>) -> String {
        match (self, value) {
            (_, None) => self.absence().to_owned(),
            (_, Some(value)) if value.is_nan() => "\u{2013}".to_owned(),
            (_, Some(f64::INFINITY)) => "\u{221e}".to_owned(),
            (Self::Psnr | Self::MaskedPsnr, Some(value)) => format!("{value:.2}"),
            (_, Some(value)) => format!("{value:.4}"),
        }
    }
}

/// What was measured of one view, or the mean over some.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scores(Vec<(Metric, f64)>);

impl Scores {
    /// Measures an image against the truth, both `[H, W, 3]` in [0, 1]; over the pixels of a mask `[H, W]` too, where there is
    /// one that is not empty.
    pub fn measure(image: &Tensor<3>, truth: &Tensor<3>, mask: Option<&Tensor<2>>, lpips: &[Lpips]) -> Self {
        let pair = || (image.clone(), truth.clone());
        let number = |value: Tensor<1>| value.into_scalar::<f64>();
        let call = |measure: fn(Tensor<3>, Tensor<3>) -> Option<Tensor<1>>| {
            let (image, truth) = pair();
            measure(image, truth).map(number)
        };
        let mut scores = Self::default();
        scores.0.push((Metric::Psnr, psnr(image.clone(), truth.clone())));
        scores.set(Metric::Ssim, call(|a, b| Some(ssim(a, b))));
        scores.set(Metric::SsimValid, call(ssim_valid));
        let multiscale = call(ms_ssim);
        scores.set(Metric::MsSsim, multiscale);
        scores.set(Metric::DSsim, multiscale.map(d_ssim));
        for network in lpips {
            let (image, truth) = pair();
            scores.set(Metric::Lpips(network.network()), network.distance(image, truth).map(number));
        }
        let Some(mask) = mask.filter(|mask| (*mask).clone().sum().into_scalar::<f64>() > 0.0) else { return scores };
        let mask = || mask.clone();
        scores.set(Metric::MaskedPsnr, Some(masked_psnr(image.clone(), truth.clone(), mask())));
        scores.set(Metric::MaskedSsim, Some(number(masked_ssim(image.clone(), truth.clone(), mask()))));
        for network in lpips {
            let (image, truth) = pair();
            let distance = network.masked_distance(image, truth, mask()).map(number);
            scores.set(Metric::MaskedLpips(network.network()), distance);
        }
        scores
    }

    fn set(&mut self, metric: Metric, value: Option<f64>) {
        self.0.extend(value.map(|value| (metric, value)));
    }

    /// From numbers that are known.
    pub fn from_values(values: impl IntoIterator<Item = (Metric, f64)>) -> Self {
        Self(values.into_iter().collect())
    }

    /// A number, if it was measured.
    pub fn get(&self, metric: Metric) -> Option<f64> {
        self.0.iter().find(|(known, _)| *known == metric).map(|(_, value)| *value)
    }

    /// PSNR in dB; NaN where nothing was measured.
    pub fn psnr(&self) -> f64 {
        self.get(Metric::Psnr).unwrap_or(f64::NAN)
    }

    /// SSIM as 3DGS; NaN where nothing was measured.
    pub fn ssim(&self) -> f64 {
        self.get(Metric::Ssim).unwrap_or(f64::NAN)
    }

    /// The mean of each measure over the views that have it.
    pub fn mean<'a>(views: impl Iterator<Item = &'a Self> + Clone) -> Self {
        let mean = |metric: Metric| {
            let (mut sum, mut count) = (0.0, 0);
            for value in views.clone().filter_map(|scores| scores.get(metric)) {
                (sum, count) = (sum + value, count + 1);
            }
            (count > 0).then(|| (metric, sum / f64::from(count)))
        };
        Self(Metric::ALWAYS.into_iter().chain(Metric::MASKED).filter_map(mean).collect())
    }

    /// The columns of a table of these scores: what is always measured, then what some of them have with masks.
    pub fn columns<'a>(all: impl Iterator<Item = &'a Self> + Clone) -> Vec<Metric> {
        let present = |metric: &Metric| all.clone().any(|scores| scores.get(*metric).is_some());
        Metric::ALWAYS.into_iter().chain(Metric::MASKED.into_iter().filter(present)).collect()
    }
}

/// A map from keys to numbers, absent ones left out.
impl Serialize for Scores {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.0.len()))?;
        for (metric, value) in &self.0 {
            map.serialize_entry(metric.key(), value)?;
        }
        map.end()
    }
}
