//! What each kernel of `light4gs-shaders` is put together from.

use light4gs_shaders::include::{
    ARITHMETIC, COVARIANCE, DISPATCH, EXPONENTIAL, FOOTPRINT, HEXPLANE, PIXELS, QUATERNION, SPHERICAL_HARMONICS, SPLAT,
    TEAM_SUBGROUP, TEAM_SUM_OF_FEW, TEAM_SUM_OF_MANY, TEAM_WORKGROUP, VIEW,
};

/// Members of a team meet through subgroup operations; they are few.
pub(super) const TEAM_OF_FEW: &[&str] = &[TEAM_SUBGROUP, TEAM_SUM_OF_FEW];
/// Members of a team meet through subgroup operations; they are many.
pub(super) const TEAM_OF_MANY: &[&str] = &[TEAM_SUBGROUP, TEAM_SUM_OF_MANY];
/// Members of a team meet in workgroup memory.
pub(super) const TEAM_WITHOUT_SUBGROUPS: &[&str] = &[TEAM_WORKGROUP];

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
            Stage { name: $name, includes: &[DISPATCH, $($include),*], source: light4gs_shaders::$constant };)*
    };
}

stages! {
    COLOR = "color" [ARITHMETIC, VIEW, COVARIANCE, QUATERNION, SPHERICAL_HARMONICS];
    PROJECT = "project" [ARITHMETIC, VIEW, SPLAT, QUATERNION, COVARIANCE];
    CELL_COUNTS = "cell_counts" [];
    INTERSECT = "intersect" [ARITHMETIC, VIEW, SPLAT];
    PREFIX_SUM = "prefix_sum" [];
    RADIX_COUNT = "radix_count" [];
    RADIX_SCATTER = "radix_scatter" [];
    RANGES = "ranges" [];
    RASTERIZE = "rasterize" [ARITHMETIC, VIEW, PIXELS, FOOTPRINT];
    RASTERIZE_BACKWARD = "rasterize_backward" [ARITHMETIC, VIEW, PIXELS, FOOTPRINT];
    PROJECT_BACKWARD = "project_backward" [ARITHMETIC, VIEW, QUATERNION, COVARIANCE, SPHERICAL_HARMONICS];
    HEXPLANE_PACK = "hexplane_pack" [];
    HEXPLANE_QUERY = "hexplane_query" [HEXPLANE];
    HEXPLANE_QUERY_BACKWARD = "hexplane_query_backward" [HEXPLANE];
    HEXPLANE_GATHER = "hexplane_gather" [HEXPLANE];
    ADAM = "adam" [];
    SIGNIFICANCE = "significance" [ARITHMETIC, VIEW, PIXELS, FOOTPRINT];
    SIGNIFICANCE_GATHER = "significance_gather" [];
    NORMAL_CDF = "normal_cdf" [EXPONENTIAL];
    NORMAL_CDF_BACKWARD = "normal_cdf_backward" [EXPONENTIAL];
    LOWER_BOUND_BACKWARD = "lower_bound_backward" [];
    SUBGROUPS = "subgroups" [];
}
