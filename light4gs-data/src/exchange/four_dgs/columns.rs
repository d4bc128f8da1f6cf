//! The Gaussians of a sample as the container's whole numbers, and as streams of them.

use fourdgs::codec::DEFLATE;
use fourdgs::opcode as attribute;
use fourdgs::quantization::{Bounds, Profile, Steps, mu_step, quantize_rotation, rct_forward, rint};
use fourdgs::stream::encode_stream;

use super::super::conventions::{srgb_to_linear, unit_xyzw};
use crate::ply::GaussianPly;
use crate::points::SH_C0;

/// Effort of the compression of streams: the container's default.
const LEVEL: u32 = 6;
/// The least number whose logarithm is stored.
const LEAST: f64 = 1e-30;
/// The scale of Gaussians where there are none.
const USUAL_SCALE: f64 = 1e-3;
/// The container's Gaussians fade with their distance in time. These fade so slowly, in durations of the scene, that it
/// cannot be seen.
const FADING: f64 = 1000.0;
/// What does not change as long as a Gaussian lives.
const OF_LIFETIME: [u8; 3] = [attribute::A_SIGMA_T, attribute::A_FLAGS, attribute::A_WINDOW_INDEX];
/// What changes do not differ from, but state once more.
const STATED_ANEW: [u8; 2] = [attribute::A_ROTATION_INDEX, attribute::A_ROTATION];

/// How numbers are rounded in a file.
pub(super) struct Grid {
    pub(super) origin: [f64; 3],
    pub(super) steps: Steps,
    /// The deviation in time of all Gaussians, rounded.
    sigma: i64,
}

impl Grid {
    /// A grid for Gaussians like these in a scene of `duration` seconds.
    pub(super) fn of(typical: &GaussianPly, duration: f64) -> Self {
        let mut scales: Vec<f32> = typical.log_scales.iter().flatten().map(|scale| scale.exp()).collect();
        scales.sort_by(f32::total_cmp);
        let middle = scales.len() / 2;
        // The median.
        let scale = match scales.get(middle) {
            None => USUAL_SCALE,
            Some(&upper) => {
                let lower = scales[middle - usize::from(scales.len().is_multiple_of(2))];
                0.5 * (f64::from(lower) + f64::from(upper))
            }
        };
        let steps = Steps::of(&Bounds::for_profile(Profile::Fine, scale));
        let lowest = |axis: usize| typical.means.iter().map(|mean| f64::from(mean[axis])).reduce(f64::min);
        let sigma = rint((FADING * duration).ln() / steps.sigma_log);
        Self { origin: [0, 1, 2].map(|axis| lowest(axis).unwrap_or(0.0)), steps, sigma }
    }

    /// Whether numbers can be rounded at all.
    pub(super) fn is_usable(&self) -> bool {
        let steps = [self.steps.pos, self.steps.scale_log, self.steps.motion, self.steps.time];
        steps.iter().all(|step| step.is_finite() && *step > 0.0) && self.origin.iter().all(|place| place.is_finite())
    }
}

/// The numbers of one attribute, row by row.
struct Column {
    attribute: u8,
    channels: usize,
    values: Vec<i64>,
}

impl Column {
    fn of<const N: usize>(attribute: u8, rows: impl Iterator<Item = [i64; N]>) -> Self {
        Self { attribute, channels: N, values: rows.flatten().collect() }
    }

    fn row(&self, row: usize) -> &[i64] {
        &self.values[self.channels * row..][..self.channels]
    }

    fn is_one_of(&self, attributes: &[u8]) -> bool {
        attributes.contains(&self.attribute)
    }

    fn encode(&self) -> fourdgs::Result<Vec<u8>> {
        encode_stream(self.attribute, &self.values, self.channels, DEFLATE, LEVEL, true)
    }
}

/// The Gaussians of a sample.
pub(super) struct Columns {
    /// Identity of the first Gaussian; those of the others follow.
    first_id: i64,
    count: usize,
    /// In the order of the attributes' numbers.
    columns: Vec<Column>,
}

impl Columns {
    /// Gaussians that came at `birth` seconds; none where a number is not finite.
    pub(super) fn of(gaussians: &GaussianPly, grid: &Grid, birth: f64, first_id: i64) -> Option<Self> {
        let GaussianPly { means, sh_dc, opacity_logits, log_scales, quats, .. } = gaussians;
        let Grid { origin, steps, sigma } = grid;
        let is_finite = |rows: &[[f32; 3]]| rows.iter().flatten().all(|value| value.is_finite());
        let scales: Vec<[f32; 3]> = log_scales.iter().map(|scale| scale.map(f32::exp)).collect();
        let count = means.len();
        if !(is_finite(means) && is_finite(sh_dc) && is_finite(&scales)) || opacity_logits.iter().any(|l| l.is_nan()) {
            return None;
        }
        let rounded = |value: f32, step: f64, origin: f64| rint((f64::from(value) - origin) / step);
        let positions = means.iter().map(|mean| [0, 1, 2].map(|axis| rounded(mean[axis], steps.pos, origin[axis])));
        let scales = scales.iter().map(|row| row.map(|scale| rint(f64::from(scale).max(LEAST).ln() / steps.scale_log)));
        let rotations: Vec<(i64, [i64; 3])> =
            quats.iter().map(|quat| quantize_rotation(unit_xyzw(*quat).map(f64::from), steps.rot)).collect();
        let colors = sh_dc.iter().map(|dc| {
            let linear = dc.map(|value| srgb_to_linear((value * SH_C0 + 0.5).clamp(0.0, 1.0)));
            rct_forward(linear.map(|value| rounded(value, steps.rgb, 0.0)))
        });
        let opacities = opacity_logits.iter().map(|logit| [rounded(1.0 / (1.0 + (-logit).exp()), steps.alpha, 0.0)]);
        let birth = rint(birth / mu_step(*sigma, steps.sigma_log, false, steps.time));
        let all = |value: i64| std::iter::repeat_n([value], count);
        let columns = vec![
            Column::of(attribute::A_POSITION, positions),
            Column::of(attribute::A_SCALE, scales),
            Column::of(attribute::A_ROTATION_INDEX, rotations.iter().map(|(largest, _)| [*largest])),
            Column::of(attribute::A_ROTATION, rotations.iter().map(|(_, others)| *others)),
            Column::of(attribute::A_COLOR, colors),
            Column::of(attribute::A_OPACITY, opacities),
            // Samples follow each other; nothing moves in between.
            Column::of(attribute::A_MOTION, std::iter::repeat_n([0; 3], count)),
            Column::of(attribute::A_MU_T, all(birth)),
            Column::of(attribute::A_SIGMA_T, all(*sigma)),
            Column::of(attribute::A_FLAGS, all(0)),
            Column::of(attribute::A_WINDOW_INDEX, all(0)),
        ];
        Some(Self { first_id, count, columns })
    }

    /// Number of Gaussians.
    pub(super) fn len(&self) -> usize {
        self.count
    }

    /// Identity of the first Gaussian.
    pub(super) fn first_id(&self) -> i64 {
        self.first_id
    }

    /// The streams of a keyframe.
    pub(super) fn keyframe(&self) -> fourdgs::Result<Vec<u8>> {
        self.encode(self.identities(0..self.count), self.columns.iter().map(Column::encode))
    }

    /// The streams of what has changed since a sample of the same Gaussians, and the number of Gaussians in them.
    pub(super) fn changes(&self, before: &Self) -> fourdgs::Result<(u32, Vec<u8>)> {
        let pairs = || {
            let pairs = self.columns.iter().zip(&before.columns);
            pairs.filter(|(column, _)| !column.is_one_of(&OF_LIFETIME))
        };
        let has_changed = |row: &usize| pairs().any(|(column, before)| column.row(*row) != before.row(*row));
        let rows: Vec<usize> = (0..self.count).filter(has_changed).collect();
        if rows.is_empty() {
            return Ok((0, Vec::new()));
        }
        let difference = |(column, before): (&Column, &Column)| {
            let stated_anew = column.is_one_of(&STATED_ANEW);
            let values = rows.iter().flat_map(|&row| {
                let pairs = column.row(row).iter().zip(before.row(row));
                pairs.map(move |(value, before)| if stated_anew { *value } else { value - before })
            });
            Column { values: values.collect(), ..*column }.encode()
        };
        let bytes = self.encode(self.identities(rows.iter().copied()), pairs().map(difference))?;
        Ok((rows.len() as u32, bytes))
    }

    fn identities(&self, rows: impl Iterator<Item = usize>) -> Column {
        Column::of(attribute::A_GAUSSIAN_ID, rows.map(|row| [self.first_id + row as i64]))
    }

    fn encode(
        &self,
        identities: Column,
        streams: impl Iterator<Item = fourdgs::Result<Vec<u8>>>,
    ) -> fourdgs::Result<Vec<u8>> {
        let mut bytes = identities.encode()?;
        for stream in streams {
            bytes.extend(stream?);
        }
        Ok(bytes)
    }
}
