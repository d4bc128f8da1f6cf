//! Gaussians at one time to an image, within a bound of memory.

use light4gs_codec::rendering::{TILE, opacity, scale};
use light4gs_codec::{CodecError, GaussianArrays, Limits};
use light4gs_data::Camera;

use crate::splatting::{CHANNELS, GaussianSlices, TileLists, assemble, rasterize};
use crate::view::View;

/// Most memory of a shown scene, and of an image that is drawn, as a multiple of [`Limits::memory_bytes`]. (Decoding
/// takes at most one of these.)
const SHARES: u64 = 8;

/// Bytes of an intersection (a Gaussian in a tile): the tile twice, the Gaussian, its place, and twice the pixels that
/// it hits, since a growing list may have twice the room that it needs.
const PAIR_BYTES: u64 = 4 * 6;

/// What showing a decoded file may take.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Allowance {
    limits: Limits,
    /// Most memory, bytes.
    pub(crate) memory_bytes: u64,
}

impl Allowance {
    /// For a stream of a length in bytes.
    pub(crate) fn of_stream(limits: &Limits, bytes: usize) -> Self {
        let memory_bytes = limits.memory_bytes.max(4 * bytes as u64).saturating_mul(SHARES);
        Self { limits: *limits, memory_bytes }
    }

    /// The larger of two, which have the same limits.
    pub(crate) fn max(self, other: Self) -> Self {
        if self.memory_bytes < other.memory_bytes { other } else { self }
    }

    /// An image `[height, width, 3]` of Gaussians over a background. `numbers` are those of all Gaussians together, and `count`
    /// is how many Gaussians there are, at most; `at` gives them. Memory is counted before it is taken.
    pub(crate) fn image(
        &self,
        camera: &Camera,
        background: [f32; 3],
        (count, numbers): (usize, usize),
        at: impl FnOnce() -> Result<GaussianArrays, CodecError>,
    ) -> Result<Vec<f32>, CodecError> {
        self.limits.check_image(camera.width, camera.height)?;
        if camera.width == 0 || camera.height == 0 {
            return Ok(Vec::new());
        }
        let view = View { camera: *camera, background, sh_degree: 0 };
        let fixed = gaussian_bytes(count, numbers) + pixel_bytes(&view);
        check_memory("memory of the image", fixed, self.memory_bytes)?;

        let moved = at()?;
        let view = View { sh_degree: usize::from(moved.sh_degree), ..view };
        let scales: Vec<f32> = moved.log_scales.as_flattened().iter().map(|&log_scale| scale(log_scale)).collect();
        let opacities: Vec<f32> = moved.opacity_logits.iter().map(|&logit| opacity(logit)).collect();
        let gaussians = GaussianSlices {
            means: moved.means.as_flattened(),
            quats: moved.quats.as_flattened(),
            scales: &scales,
            opacities: &opacities,
            sh_dc: moved.sh_dc.as_flattened(),
            sh_rest: &moved.sh_rest,
            screen_offsets: &vec![0.0; 2 * moved.len()],
        };
        let pairs = TileLists::most_pairs(&gaussians, &view);
        check_memory("memory of the image", fixed.saturating_add(pairs.saturating_mul(PAIR_BYTES)), self.memory_bytes)?;
        // They are counted in 32 bits.
        check_memory("number of pairs of a tile and a Gaussian in it", pairs, u32::MAX.into())?;

        let lists = TileLists::build(&gaussians, &view);
        let mut image = assemble(&rasterize(&lists, &view), &view);
        image.truncate(3 * camera.width as usize * camera.height as usize);
        Ok(image)
    }
}

/// Bytes of the Gaussians while drawing: the moved ones, the activated ones, those on the screen.
fn gaussian_bytes(count: usize, numbers: usize) -> u64 {
    4 * numbers as u64 + count as u64 * (4 * 6 + TileLists::BYTES_OF_A_GAUSSIAN)
}

/// Bytes of the tiles' and the image's pixels.
fn pixel_bytes(view: &View) -> u64 {
    let pixels = u64::from(view.camera.width) * u64::from(view.camera.height);
    let in_tiles = (view.tiles_across() * view.tiles_down() * TILE * TILE) as u64;
    4 * CHANNELS as u64 * (pixels + in_tiles)
}

pub(crate) fn check_memory(field: &str, found: u64, limit: u64) -> Result<(), CodecError> {
    if found <= limit {
        return Ok(());
    }
    Err(CodecError::OverLimit { section: "rendering", field: field.into(), found, limit })
}
