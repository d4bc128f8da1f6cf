//! The metrics by name.

use light4gs_data::Region;

use super::lpips::LpipsNetwork;

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
    /// Peak signal-to-noise ratio over the worst pixels: the 5 % of the view with the largest squared errors, dB.
    WorstPsnr,
    /// A metric over a region that the dataset's mask marks.
    Of(Region, RegionMetric),
}

/// A metric over a part of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum RegionMetric {
    /// Peak signal-to-noise ratio, dB.
    Psnr,
    /// The mean of SSIM's map, with zeros around the image.
    Ssim,
    /// The mean of LPIPS' map at the size of the image.
    Lpips(LpipsNetwork),
}

impl RegionMetric {
    const ALL: [Self; 4] = [Self::Psnr, Self::Ssim, Self::Lpips(LpipsNetwork::Alex), Self::Lpips(LpipsNetwork::Vgg)];

    /// The same metric over the whole image.
    fn whole(self) -> Metric {
        match self {
            Self::Psnr => Metric::Psnr,
            Self::Ssim => Metric::Ssim,
            Self::Lpips(network) => Metric::Lpips(network),
        }
    }
}

impl Metric {
    /// Metrics that every evaluation has. Where one is absent, its cell says why.
    pub const ALWAYS: [Self; 8] = [
        Self::Psnr,
        Self::Ssim,
        Self::SsimValid,
        Self::MsSsim,
        Self::DSsim,
        Self::Lpips(LpipsNetwork::Alex),
        Self::Lpips(LpipsNetwork::Vgg),
        Self::WorstPsnr,
    ];

    /// Metrics that exist only where the dataset has masks, in the order of columns: the moving region beside the still
    /// one.
    pub fn of_regions() -> impl Iterator<Item = Self> {
        let motion =
            RegionMetric::ALL.into_iter().flat_map(|metric| [(Region::Moving, metric), (Region::Still, metric)]);
        let masked = RegionMetric::ALL.into_iter().map(|metric| (Region::Masked, metric));
        motion.chain(masked).map(|(region, metric)| Self::Of(region, metric))
    }

    /// Its key in JSON.
    pub fn key(self) -> String {
        let key = match self {
            Self::Psnr => "psnr",
            Self::Ssim => "ssim",
            Self::SsimValid => "ssim_valid",
            Self::MsSsim => "ms_ssim",
            Self::DSsim => "d_ssim",
            Self::Lpips(LpipsNetwork::Alex) => "lpips_alex",
            Self::Lpips(LpipsNetwork::Vgg) => "lpips_vgg",
            Self::WorstPsnr => "worst_psnr",
            Self::Of(region, metric) => {
                let region = match region {
                    Region::Moving => "moving",
                    Region::Still => "still",
                    Region::Masked => "masked",
                };
                return format!("{region}_{}", metric.whole().key());
            }
        };
        key.to_owned()
    }

    /// The head of its column.
    pub fn label(self) -> String {
        let label = match self {
            Self::Psnr => "PSNR dB",
            Self::Ssim => "SSIM",
            Self::SsimValid => "SSIM valid",
            Self::MsSsim => "MS-SSIM",
            Self::DSsim => "D-SSIM",
            Self::Lpips(LpipsNetwork::Alex) => "LPIPS alex",
            Self::Lpips(LpipsNetwork::Vgg) => "LPIPS vgg",
            Self::WorstPsnr => "worst 5 % dB",
            Self::Of(Region::Moving, RegionMetric::Psnr) => "moving dB",
            Self::Of(Region::Still, RegionMetric::Psnr) => "still dB",
            Self::Of(Region::Moving, metric) => return format!("moving {}", metric.whole().label()),
            Self::Of(Region::Still, metric) => return format!("still {}", metric.whole().label()),
            Self::Of(Region::Masked, metric) => return format!("m{}", metric.whole().label()),
        };
        label.to_owned()
    }

    /// The text of a cell whose number is absent.
    pub fn absence(self) -> &'static str {
        match self {
            Self::Lpips(_) | Self::Of(_, RegionMetric::Lpips(_)) => "no weights",
            Self::SsimValid | Self::MsSsim | Self::DSsim => "image too small",
            Self::Psnr | Self::Ssim | Self::WorstPsnr | Self::Of(..) => "none",
        }
    }

    /// A number as it is written in a cell.
    pub fn format(self, value: Option<f64>) -> String {
        match value {
            None => self.absence().to_owned(),
            Some(value) if value.is_nan() => "\u{2013}".to_owned(),
            Some(f64::INFINITY) => "\u{221e}".to_owned(),
            Some(value) if self.is_psnr() => format!("{value:.2}"),
            Some(value) => format!("{value:.4}"),
        }
    }

    /// Whether it is a PSNR, in dB.
    pub(super) fn is_psnr(self) -> bool {
        matches!(self, Self::Psnr | Self::WorstPsnr | Self::Of(_, RegionMetric::Psnr))
    }

    /// Whether its figure over several views is computed over all their pixels together, rather than as the mean of the
    /// views' figures. The moving region may be a twentieth of one view and a third of the next.
    pub(super) fn is_pooled(self) -> bool {
        matches!(self, Self::WorstPsnr | Self::Of(Region::Moving | Region::Still, _))
    }
}
