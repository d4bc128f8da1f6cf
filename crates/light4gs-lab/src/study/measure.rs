//! The measures of a run, and the columns of tables.

use light4gs_keys::choice;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::results::RunResult;

choice! {
    /// A quantity that is measured on a finished run.
    #[derive(PartialOrd, Ord)]
    pub enum Measure: "measure" {
        /// Mean PSNR of the test split (the first measured one where there is none), dB.
        Psnr = "psnr",
        /// Mean SSIM of the same split.
        Ssim = "ssim",
        /// Mean MS-SSIM of the same split.
        MsSsim = "ms_ssim",
        /// Mean LPIPS (AlexNet) of the same split; only where `eval.lpips` names the weights.
        Lpips = "lpips",
        /// Mean PSNR of the validation split, dB.
        ValPsnr = "val_psnr",
        /// PSNR of the same split as [`Self::Psnr`] over all pixels that move, dB; only where the dataset has masks.
        MovingPsnr = "moving_psnr",
        /// The same over all pixels that stand still.
        StillPsnr = "still_psnr",
        /// SSIM over all pixels that move.
        MovingSsim = "moving_ssim",
        /// SSIM over all pixels that stand still.
        StillSsim = "still_ssim",
        /// PSNR over the worst pixels of the same split: the 5 % of each view with the largest squared errors, dB.
        WorstPsnr = "worst_psnr",
        /// Size of the file.
        Bytes = "bytes",
        /// Size of the Gaussians: their attributes and spherical harmonics.
        GaussianBytes = "gaussian_bytes",
        /// Size of the spherical harmonics beyond degree 0, with their model.
        ShBytes = "sh_bytes",
        /// Size of the feature planes: values and context model.
        PlaneBytes = "plane_bytes",
        /// Size of the context model alone.
        ContextBytes = "context_bytes",
        /// Size of the motion network.
        MotionBytes = "motion_bytes",
        /// Gaussians in the file.
        Gaussians = "gaussians",
        /// Smallest step of the planes.
        LeastStep = "least_step",
        /// Largest step of the planes.
        MostStep = "most_step",
        /// Minutes of training.
        Minutes = "minutes",
        /// Seconds of fitting entropy models to a scene that was trained without them.
        FitSeconds = "fit_seconds",
        /// Seconds of encoding, the check by decoding included.
        EncodeSeconds = "encode_seconds",
        /// Seconds of decoding.
        DecodeSeconds = "decode_seconds",
        /// Milliseconds of rendering a frame.
        RenderMilliseconds = "render_milliseconds",
        /// Encoding, spread over the frames of the scene: milliseconds.
        EncodePerFrame = "encode_per_frame",
        /// Decoding, spread over the frames of the scene: milliseconds.
        DecodePerFrame = "decode_per_frame",
        /// Encoding, decoding and rendering of one frame: milliseconds.
        EndToEnd = "end_to_end",
        /// Frames per second, decoding excluded.
        Fps = "fps",
    }
}

impl Measure {
    /// Heading of a column, with its unit.
    pub fn heading(self) -> &'static str {
        match self {
            Self::Psnr => "PSNR dB",
            Self::Ssim => "SSIM",
            Self::MsSsim => "MS-SSIM",
            Self::Lpips => "LPIPS alex",
            Self::ValPsnr => "val PSNR dB",
            Self::MovingPsnr => "moving dB",
            Self::StillPsnr => "still dB",
            Self::MovingSsim => "moving SSIM",
            Self::StillSsim => "still SSIM",
            Self::WorstPsnr => "worst 5 % dB",
            Self::Bytes => "file, bytes",
            Self::GaussianBytes => "Gaussians, bytes",
            Self::ShBytes => "SH, bytes",
            Self::PlaneBytes => "feature planes, bytes",
            Self::ContextBytes => "context model, bytes",
            Self::MotionBytes => "network, bytes",
            Self::Gaussians => "Gaussians",
            Self::LeastStep => "least step",
            Self::MostStep => "largest step",
            Self::Minutes => "training, min",
            Self::FitSeconds => "fitting, s",
            Self::EncodeSeconds => "encoding, s",
            Self::DecodeSeconds => "decoding, s",
            Self::RenderMilliseconds => "rendering, ms per frame",
            Self::EncodePerFrame => "encoding, ms per frame",
            Self::DecodePerFrame => "decoding, ms per frame",
            Self::EndToEnd => "end to end, ms per frame",
            Self::Fps => "FPS",
        }
    }

    /// Short name, for headings of differences.
    fn short(self) -> &'static str {
        self.heading().split(',').next().unwrap_or_default().trim_end_matches(" dB")
    }

    /// Digits after the point.
    pub fn digits(self) -> usize {
        match self {
            Self::Bytes | Self::GaussianBytes | Self::ShBytes | Self::PlaneBytes | Self::ContextBytes => 0,
            Self::MotionBytes | Self::Gaussians => 0,
            Self::Minutes | Self::FitSeconds | Self::Fps => 1,
            Self::Psnr | Self::ValPsnr | Self::MovingPsnr | Self::StillPsnr | Self::WorstPsnr => 2,
            Self::EncodeSeconds | Self::DecodeSeconds | Self::RenderMilliseconds => 2,
            Self::EncodePerFrame | Self::DecodePerFrame | Self::EndToEnd => 2,
            Self::Ssim
            | Self::MsSsim
            | Self::Lpips
            | Self::MovingSsim
            | Self::StillSsim
            | Self::LeastStep
            | Self::MostStep => 4,
        }
    }

    /// Whether it needs what only some studies have: masks of the dataset, weights of LPIPS.
    pub fn may_be_absent(self) -> bool {
        matches!(self, Self::MovingPsnr | Self::StillPsnr | Self::MovingSsim | Self::StillSsim | Self::Lpips)
    }

    /// Whether it is a time, which differs in every run.
    pub fn is_time(self) -> bool {
        matches!(
            self,
            Self::Minutes
                | Self::FitSeconds
                | Self::EncodeSeconds
                | Self::DecodeSeconds
                | Self::RenderMilliseconds
                | Self::EncodePerFrame
                | Self::DecodePerFrame
                | Self::EndToEnd
                | Self::Fps
        )
    }

    /// Its value in a run; `None` if it was not measured, or is not finite.
    pub fn of(self, run: &RunResult) -> Option<f64> {
        let section = |names: &[&str]| -> Option<f64> {
            let bytes = run.sections.iter().filter(|(name, _)| names.contains(&name.as_str())).map(|(_, bytes)| *bytes);
            Some(bytes.sum::<u64>() as f64)
        };
        let per_frame = |seconds: Option<f64>| Some(1e3 * seconds? / run.frames? as f64);
        let render = 1e3 / run.fps;
        let value = match self {
            Self::Psnr => run.quality.psnr,
            Self::Ssim => run.quality.ssim,
            Self::MsSsim => run.quality.ms_ssim,
            Self::Lpips => run.quality.lpips_alex,
            Self::ValPsnr => run.val_psnr,
            Self::MovingPsnr => run.quality.moving_psnr,
            Self::StillPsnr => run.quality.still_psnr,
            Self::MovingSsim => run.quality.moving_ssim,
            Self::StillSsim => run.quality.still_ssim,
            Self::WorstPsnr => run.quality.worst_psnr,
            Self::Bytes => Some(run.bytes as f64),
            Self::GaussianBytes => section(&["gaussians", "sh"]),
            Self::ShBytes => section(&["sh"]),
            Self::PlaneBytes => section(&["feature_planes", "context_model"]),
            Self::ContextBytes => section(&["context_model"]),
            Self::MotionBytes => section(&["motion"]),
            Self::Gaussians => Some(run.gaussians as f64),
            Self::LeastStep => run.steps.iter().copied().reduce(f64::min),
            Self::MostStep => run.steps.iter().copied().reduce(f64::max),
            Self::Minutes => run.training_seconds.map(|seconds| seconds / 60.0),
            Self::FitSeconds => run.fit_seconds,
            Self::EncodeSeconds => run.encode_seconds,
            Self::DecodeSeconds => Some(run.decode_seconds),
            Self::RenderMilliseconds => Some(render),
            Self::EncodePerFrame => per_frame(run.encode_seconds),
            Self::DecodePerFrame => per_frame(Some(run.decode_seconds)),
            Self::EndToEnd => {
                per_frame(run.encode_seconds.map(|encode| encode + run.decode_seconds)).map(|t| t + render)
            }
            Self::Fps => Some(run.fps),
        };
        value.filter(|value| value.is_finite())
    }
}

/// How a column shows a measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// The value itself.
    Value,
    /// As the difference to the reference.
    Difference,
    /// As that difference in percent of the reference.
    Percent,
}

/// A column of a table: `psnr`, `psnr:difference`, `bytes:percent`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Column {
    /// The measure.
    pub measure: Measure,
    /// How it is shown.
    pub form: Form,
}

/// The columns of a study that does not choose any. Those of regions show where the datasets have masks.
pub(super) fn default_columns() -> Vec<Column> {
    let value = |measure| Column { measure, form: Form::Value };
    let percent = |measure| Column { measure, form: Form::Percent };
    vec![
        value(Measure::Psnr),
        percent(Measure::Psnr),
        value(Measure::MovingPsnr),
        value(Measure::StillPsnr),
        value(Measure::Ssim),
        value(Measure::MovingSsim),
        value(Measure::StillSsim),
        value(Measure::Bytes),
        percent(Measure::Bytes),
        value(Measure::Gaussians),
    ]
}

impl Column {
    /// Its heading.
    pub fn heading(&self) -> String {
        match self.form {
            Form::Value => self.measure.heading().to_owned(),
            Form::Difference => format!("Δ{}", self.measure.heading()),
            Form::Percent => format!("Δ{} %", self.measure.short()),
        }
    }
}

impl std::fmt::Display for Column {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.form {
            Form::Value => write!(formatter, "{}", self.measure),
            Form::Difference => write!(formatter, "{}:difference", self.measure),
            Form::Percent => write!(formatter, "{}:percent", self.measure),
        }
    }
}

impl Serialize for Column {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Column {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        let (measure, form) = text.split_once(':').unwrap_or((&text, "value"));
        let measure = measure.parse().map_err(D::Error::custom)?;
        let form = match form {
            "value" => Form::Value,
            "difference" => Form::Difference,
            "percent" => Form::Percent,
            _ => {
                let expected = "nothing, `:difference` or `:percent` follows the measure";
                return Err(D::Error::custom(format!("column `{text}`: {expected}")));
            }
        };
        Ok(Self { measure, form })
    }
}
