//! The files of `shaders/`, and what each of them includes.

macro_rules! wgsl {
    ($file:literal) => {
        include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../shaders/", $file, ".wgsl"))
    };
}

const DISPATCH: &str = wgsl!("include/dispatch");
const CONSTANTS: &str = wgsl!("include/constants");
const VIEW: &str = wgsl!("include/view");
const SPLAT: &str = wgsl!("include/splat");
const HARMONICS: &str = wgsl!("include/spherical_harmonics");
const QUATERNION: &str = wgsl!("include/quaternion");
const COVARIANCE: &str = wgsl!("include/covariance");
const PIXELS: &str = wgsl!("include/pixels");
const FOOTPRINT: &str = wgsl!("include/footprint");
const EXPONENTIAL: &str = wgsl!("include/exponential");
const PLANES: &str = wgsl!("include/hexplane");

/// Members of a team meet through subgroup operations; they are few.
pub(super) const TEAM_OF_FEW: &[&str] = &[wgsl!("include/team_subgroup"), wgsl!("include/team_sum_of_few")];
/// Members of a team meet through subgroup operations; they are many.
pub(super) const TEAM_OF_MANY: &[&str] = &[wgsl!("include/team_subgroup"), wgsl!("include/team_sum_of_many")];
/// Members of a team meet in workgroup memory.
pub(super) const TEAM_WITHOUT_SUBGROUPS: &[&str] = &[wgsl!("include/team_workgroup")];

/// One kernel: a file of `shaders/` with what it includes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stage {
    /// The file's name without its ending.
    pub(super) name: &'static str,
    pub(super) includes: &'static [&'static str],
    pub(super) source: &'static str,
}

macro_rules! stages {
    ($($constant:ident = $name:literal [$($include:ident),*];)*) => {
        $(pub(super) const $constant: Stage =
            Stage { name: $name, includes: &[DISPATCH, $($include),*], source: wgsl!($name) };)*
    };
}

stages! {
    COLOR = "color" [CONSTANTS, VIEW, COVARIANCE, QUATERNION, HARMONICS];
    PROJECT = "project" [CONSTANTS, VIEW, SPLAT, QUATERNION, COVARIANCE];
    CELL_COUNTS = "cell_counts" [];
    INTERSECT = "intersect" [CONSTANTS, VIEW, SPLAT];
    PREFIX_SUM = "prefix_sum" [];
    RADIX_COUNT = "radix_count" [];
    RADIX_SCATTER = "radix_scatter" [];
    RANGES = "ranges" [];
    RASTERIZE = "rasterize" [CONSTANTS, VIEW, PIXELS, FOOTPRINT];
    RASTERIZE_BACKWARD = "rasterize_backward" [CONSTANTS, VIEW, PIXELS, FOOTPRINT];
    PROJECT_BACKWARD = "project_backward" [CONSTANTS, VIEW, QUATERNION, COVARIANCE, HARMONICS];
    HEXPLANE_PACK = "hexplane_pack" [];
    HEXPLANE_QUERY = "hexplane_query" [PLANES];
    HEXPLANE_QUERY_BACKWARD = "hexplane_query_backward" [PLANES];
    HEXPLANE_GATHER = "hexplane_gather" [PLANES];
    ADAM = "adam" [];
    SIGNIFICANCE = "significance" [CONSTANTS, VIEW, PIXELS, FOOTPRINT];
    SIGNIFICANCE_GATHER = "significance_gather" [];
    NORMAL_CDF = "normal_cdf" [EXPONENTIAL];
    NORMAL_CDF_BACKWARD = "normal_cdf_backward" [EXPONENTIAL];
    LOWER_BOUND_BACKWARD = "lower_bound_backward" [];
    SUBGROUPS = "subgroups" [];
}
