//! The paper's ablation tables: one scene, several runs, each with another part switched off.

use serde::Serialize;

use crate::config::Config;
use crate::error::TrainError;
use crate::evaluation::Evaluation;

/// A table of runs. Each variant is laid over the same configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum AblationTable {
    /// Parts of the context model (paper, table on MHCM).
    Context,
    /// Pruning, rate in the loss, adaptive steps (paper, table on rate and distortion).
    RateDistortion,
    /// Models of the spherical harmonics.
    SphericalHarmonics,
    /// The three sizes, the middle one in the paper's profile, and the uncompressed baseline.
    Sizes,
}

/// A row: its name, and the presets laid on top.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Variant {
    /// For the table and the run's folder.
    pub name: &'static str,
    /// Presets, laid on top in this order.
    pub presets: &'static [&'static str],
}

impl AblationTable {
    /// The rows. All but those of the sizes stand on the middle size.
    pub fn variants(self) -> &'static [Variant] {
        const fn variant(name: &'static str, presets: &'static [&'static str]) -> Variant {
            Variant { name, presets }
        }
        match self {
            Self::Context => {
                const {
                    &[
                        variant("full", &["medium"]),
                        variant("no-checkerboard", &["medium", "ablation-no-checkerboard"]),
                        variant("no-inter-plane", &["medium", "ablation-no-inter-plane"]),
                        variant("no-inter-scale", &["medium", "ablation-no-inter-scale"]),
                        variant("no-hyperprior", &["medium", "ablation-no-hyperprior"]),
                        variant("no-context", &["medium", "ablation-no-context"]),
                        variant("high-scale-hyperprior", &["medium", "ablation-high-scale-hyperprior"]),
                    ]
                }
            }
            Self::RateDistortion => {
                const {
                    &[
                        variant("full", &["medium"]),
                        variant("fixed-steps", &["medium", "ablation-fixed-steps"]),
                        variant("no-pruning", &["medium", "ablation-no-pruning"]),
                        variant("no-rate", &["medium", "ablation-no-rate"]),
                        variant("float32", &["ablation-float32"]),
                    ]
                }
            }
            Self::SphericalHarmonics => {
                const {
                    &[
                        variant("factorized", &["medium"]),
                        variant("mixture", &["medium", "ablation-sh-mixture"]),
                        variant("autoregressive", &["medium", "ablation-sh-autoregressive"]),
                        variant("hexplane-coupled", &["medium", "ablation-sh-hexplane"]),
                    ]
                }
            }
            Self::Sizes => {
                const {
                    &[
                        variant("float32", &["ablation-float32"]),
                        variant("high", &["high"]),
                        variant("medium", &["medium"]),
                        variant("paper-profile", &["medium", "paper-profile"]),
                        variant("small", &["small"]),
                    ]
                }
            }
        }
    }
}

impl Variant {
    /// Its configuration over a base.
    pub fn config(&self, base: &str, overrides: &[String]) -> Result<Config, TrainError> {
        let names = std::iter::once(base).chain(self.presets.iter().copied()).collect::<Vec<_>>();
        Ok(Config::load(&names.join("+"), overrides)?)
    }
}

/// What a row shows.
#[derive(Clone, Debug, Serialize)]
pub struct AblationRow {
    /// The variant.
    pub name: String,
    /// Mean test PSNR, dB; the first measured split where there is no test split.
    pub psnr: f64,
    /// Mean SSIM of that split.
    pub ssim: f64,
    /// Of the file.
    pub bytes: u64,
    /// By section, header included.
    pub sections: Vec<(String, u64)>,
    /// Gaussians in the file.
    pub gaussians: usize,
    /// Of training.
    pub minutes: f64,
}

impl AblationRow {
    /// From a run's evaluation.
    pub fn new(name: &str, evaluation: &Evaluation) -> Self {
        let split = evaluation.splits.iter().find(|split| split.split == "test").or(evaluation.splits.first());
        Self {
            name: name.to_owned(),
            psnr: split.map_or(f64::NAN, |split| split.scores.psnr()),
            ssim: split.map_or(f64::NAN, |split| split.scores.ssim()),
            bytes: evaluation.bytes,
            sections: evaluation.sections.iter().map(|section| (section.name.clone(), section.bytes)).collect(),
            gaussians: evaluation.gaussians,
            minutes: evaluation.training_seconds.unwrap_or(f64::NAN) / 60.0,
        }
    }

    /// Bytes of a section, 0 where the file has none.
    pub fn section(&self, name: &str) -> u64 {
        self.sections.iter().find(|(known, _)| known == name).map_or(0, |(_, bytes)| *bytes)
    }
}

/// The table in Markdown, for `docs/`.
pub fn to_markdown(rows: &[AblationRow]) -> String {
    let mut text = String::from(
        "| variant | PSNR dB | SSIM | bytes | Gaussians | gaussians | SH | MLP | context model | hexplanes | minutes |\n\
         |---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for row in rows {
        let [gaussians, sh, network, context, planes] =
            ["gaussians", "sh", "motion", "context_model", "hexplanes"].map(|name| row.section(name));
        text += &format!(
            "| {} | {:.2} | {:.4} | {} | {} | {gaussians} | {sh} | {network} | {context} | {planes} | {:.1} |\n",
            row.name, row.psnr, row.ssim, row.bytes, row.gaussians, row.minutes
        );
    }
    text
}
