//! Gaussians for files of other programs.

use light4gs_codec::GaussianArrays;
use light4gs_data::GaussianPly;

/// A text with the attributes that a file of another program cannot hold: all but the `held` ones.
pub(super) fn left_out<'a>(gaussians: impl IntoIterator<Item = &'a GaussianArrays>, held: &[&str]) -> String {
    let further = gaussians.into_iter().flat_map(|gaussians| &gaussians.further);
    let names: Vec<&str> = further.map(|attribute| attribute.name.as_str()).collect();
    left_out_names(names.into_iter().filter(|name| !held.contains(name)))
}

/// The same of names.
pub(super) fn left_out_names<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    let names: Vec<&str> = names.into_iter().collect();
    if names.is_empty() { String::new() } else { format!(", without the attributes {}", names.join(", ")) }
}

/// Gaussians for files of other programs, with harmonics of degree 3. A further attribute becomes properties `NAME_0`,
/// `NAME_1`...
pub(super) fn plain_gaussians(arrays: GaussianArrays) -> GaussianPly {
    let per_gaussian = if arrays.is_empty() { 0 } else { arrays.sh_rest.len() / (3 * arrays.len()) };
    let rest = |i: usize| {
        std::array::from_fn(|coefficient| {
            if coefficient >= per_gaussian {
                return [0.0; 3];
            }
            let at = 3 * (i * per_gaussian + coefficient);
            [arrays.sh_rest[at], arrays.sh_rest[at + 1], arrays.sh_rest[at + 2]]
        })
    };
    let further = arrays.further.iter().flat_map(|attribute| {
        let column = move |channel: usize| {
            let values = attribute.values.iter().skip(channel).step_by(attribute.width as usize);
            (format!("{}_{channel}", attribute.name), values.copied().collect())
        };
        (0..attribute.width as usize).map(column)
    });
    GaussianPly {
        further: further.collect(),
        sh_rest: (0..arrays.means.len()).map(rest).collect(),
        means: arrays.means,
        sh_dc: arrays.sh_dc,
        opacity_logits: arrays.opacity_logits,
        log_scales: arrays.log_scales,
        quats: arrays.quats,
    }
}
