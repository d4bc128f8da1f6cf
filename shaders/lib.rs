//! The WGSL kernels of Light4GS's wgpu back end: each constant is a file of a folder here, named after it, with its
//! includes.
//!
//! `README.md` says what each kernel does. The host side is `light4gs_model::gpu`: it assembles a kernel from constants
//! (those of rendering come from `light4gs_codec::rendering`), then includes, then the kernel itself.

#![no_std]

use include::{
    ARITHMETIC, COVARIANCE, DISPATCH, EXPONENTIAL, FOOTPRINT, MIXTURE, NODE, NODE_MOTION, NODE_SPLINE, PIXELS, PLANES,
    POSE, QUATERNION, SPHERICAL_HARMONICS, SPLAT, VIEW,
};

/// One kernel: a file of a folder here, with its includes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shader {
    /// The file's name without its ending.
    pub name: &'static str,
    /// The includes that come before it, in this order.
    pub includes: &'static [&'static str],
    /// The file.
    pub source: &'static str,
}

macro_rules! shaders {
    ($($(#[$doc:meta])* $constant:ident = $folder:literal / $name:literal [$($include:ident),*];)*) => {
        $($(#[$doc])* pub const $constant: Shader = Shader {
            name: $name,
            includes: &[DISPATCH, $($include),*],
            source: include_str!(concat!($folder, "/", $name, ".wgsl")),
        };)*

        /// All of them.
        pub const ALL: &[Shader] = &[$($constant),*];
    };
}

shaders! {
    /// One Adam step, fused: one pass over parameter, gradient and both moments (Kingma and Ba, 2015).
    ADAM = "training" / "adam" [];
    /// Sorts the Gaussians' numbers of cells by depth.
    CELL_COUNTS = "splatting" / "cell_counts" [];
    /// Second half of the query's derivative: every cell adds up the gradients from the samples around it.
    PLANE_GATHER = "planes" / "plane_gather" [PLANES];
    /// Converts one plane from [C, H · W] to the layout of `include/planes.wgsl`.
    PLANE_PACK = "planes" / "plane_pack" [];
    /// Some columns of a matrix in their place, and zeros elsewhere.
    PLACE_COLUMNS = "elementwise" / "place_columns" [];
    /// Features at points: the product over the planes of a scale of their bilinear samples.
    PLANE_QUERY = "planes" / "plane_query" [PLANES];
    /// First half of the query's derivative: the gradients from every point to each of its samples, and the
    /// points' own gradients.
    PLANE_QUERY_BACKWARD = "planes" / "plane_query_backward" [PLANES];
    /// Rows of a table, the means over their neighbors, and the nearest of these.
    NEIGHBORHOODS = "rate" / "neighborhoods" [];
    /// Derivative of rows of a table and their neighbors: every number of the table adds up its gradients.
    NEIGHBORHOODS_BACKWARD = "rate" / "neighborhoods_backward" [];
    /// Sums of the differences of two images, block by block.
    IMAGE_DIFFERENCE = "training" / "image_difference" [];
    /// Derivative of the mean difference of two images by the first.
    IMAGE_DIFFERENCE_BACKWARD = "training" / "image_difference_backward" [];
    /// A mean from the sums of blocks.
    MEAN_OF_SUMS = "training" / "mean_of_sums" [];
    /// Lists the intersections, the pairs of a cell and a Gaussian that touches it, nearest Gaussian first.
    INTERSECT = "splatting" / "intersect" [ARITHMETIC, VIEW, SPLAT];
    /// Gradient through max(x, bound) that also passes below the bound where a descent step would increase x
    /// (Ballé et al. 2018).
    LOWER_BOUND_BACKWARD = "elementwise" / "lower_bound_backward" [];
    /// Bits of the values of channels under mixtures of logistics.
    MIXTURE_BITS = "rate" / "mixture_bits" [EXPONENTIAL, MIXTURE];
    /// Derivative of the bits under mixtures of logistics.
    MIXTURE_BITS_BACKWARD = "rate" / "mixture_bits_backward" [EXPONENTIAL, MIXTURE];
    /// Control nodes at a time: their poses.
    NODE_POSES = "nodes" / "node_poses" [QUATERNION, NODE_SPLINE, NODE_MOTION];
    /// Derivative of the poses of control nodes.
    NODE_POSES_BACKWARD = "nodes" / "node_poses_backward" [QUATERNION, NODE_SPLINE, NODE_MOTION];
    /// Second half of the regularizer of control nodes: the loss, and all gradients.
    NODE_REGULARIZER = "nodes" / "node_regularizer" [NODE_SPLINE];
    /// First half of the regularizer of control nodes: the distance of each from the place where its neighbors see it.
    NODE_STRAIN = "nodes" / "node_strain" [EXPONENTIAL, QUATERNION, NODE_SPLINE, NODE_MOTION];
    /// The standard normal distribution function, by Chebyshev's fit of erfc with a small relative error
    /// everywhere (Press et al., Numerical Recipes, section 6.2): the coefficients and the order of operations of
    /// `light4gs-model/src/ops`.
    NORMAL_CDF = "elementwise" / "normal_cdf" [EXPONENTIAL];
    /// Derivative of the standard normal distribution function: its density times the upstream gradient.
    NORMAL_CDF_BACKWARD = "elementwise" / "normal_cdf_backward" [EXPONENTIAL];
    /// Exclusive prefix sum, in place.
    PREFIX_SUM = "sorting" / "prefix_sum" [];
    /// Projects every Gaussian to the screen and counts the cells that it touches.
    PROJECT = "splatting" / "project" [ARITHMETIC, VIEW, SPLAT, QUATERNION, COVARIANCE, SPHERICAL_HARMONICS];
    /// Adds up every Gaussian's sums over its cells, and computes from these the gradients of its attributes.
    PROJECT_BACKWARD = "splatting" / "project_backward" [ARITHMETIC, VIEW, QUATERNION, COVARIANCE, SPHERICAL_HARMONICS];
    /// First half of a pass of the radix sort: how often each digit occurs in each block.
    RADIX_COUNT = "sorting" / "radix_count" [];
    /// Second half of a pass of the radix sort: moves keys and values to their places.
    RADIX_SCATTER = "sorting" / "radix_scatter" [];
    /// Where each of a number of groups begins among sorted keys.
    RANGES = "sorting" / "ranges" [];
    /// Blends the splats of every cell, front to back.
    RASTERIZE = "splatting" / "rasterize" [ARITHMETIC, VIEW, PIXELS, FOOTPRINT];
    /// Derivative of the blending with respect to every splat, front to back like the forward pass.
    RASTERIZE_BACKWARD = "splatting" / "rasterize_backward" [ARITHMETIC, VIEW, PIXELS, FOOTPRINT];
    /// Every value times one factor that stands on the device.
    SCALE = "elementwise" / "scale" [];
    /// The exponential of what is at most a bound.
    BOUNDED_EXPONENTIAL = "elementwise" / "bounded_exponential" [EXPONENTIAL];
    /// Derivative of the bounded exponential: its slope times the upstream gradient.
    BOUNDED_EXPONENTIAL_BACKWARD = "elementwise" / "bounded_exponential_backward" [];
    /// The logistic function.
    SIGMOID = "elementwise" / "sigmoid" [EXPONENTIAL];
    /// Derivative of the logistic function: its slope times the upstream gradient.
    SIGMOID_BACKWARD = "elementwise" / "sigmoid_backward" [];
    /// The contributions of every splat to one image, without its color: the sums for significance pruning
    /// (paper III-B).
    SIGNIFICANCE = "splatting" / "significance" [ARITHMETIC, VIEW, PIXELS, FOOTPRINT];
    /// Adds up every Gaussian's sums over its cells.
    SIGNIFICANCE_GATHER = "splatting" / "significance_gather" [];
    /// Linear blend skinning: positions and rotations of the Gaussians after the nodes have moved.
    SKINNING = "skinning" / "skinning" [EXPONENTIAL, QUATERNION, POSE, NODE];
    /// One of the parts of skinning's derivative: the gradients of the Gaussians' affinities.
    SKINNING_AFFINITIES = "skinning" / "skinning_affinities" [EXPONENTIAL, POSE, NODE];
    /// First of the parts of skinning's derivative: the gradients of the Gaussians, and the values that they hand to
    /// the nodes.
    SKINNING_BACKWARD = "skinning" / "skinning_backward" [QUATERNION, POSE];
    /// Last of the parts of skinning's derivative: adds up the slices, in their order.
    SKINNING_GATHER = "skinning" / "skinning_gather" [];
    /// One of the parts of skinning's derivative: the sums over a slice of the Gaussians, for the gradients of the
    /// nodes.
    SKINNING_NODES = "skinning" / "skinning_nodes" [EXPONENTIAL, POSE, NODE];
    /// Counts the invocations of a subgroup in a workgroup that is meant to be one subgroup.
    SUBGROUPS = "elementwise" / "subgroups" [];
    /// Values with uniform noise.
    UNIFORM_NOISE = "elementwise" / "uniform_noise" [];
}

/// Code that several kernels share.
pub mod include {
    macro_rules! wgsl {
        ($($(#[$doc:meta])* $name:ident = $file:literal;)*) => {
            $($(#[$doc])* pub const $name: &str = include_str!(concat!($file, ".wgsl"));)*
        };
    }

    wgsl! {
        /// Finite numbers, and sums of products term by term.
        ARITHMETIC = "include/arithmetic";
        /// The steps of the EWA projection that both directions need (Zwicker et al. 2001): from a Gaussian
        /// to the factor of its 2D covariance.
        COVARIANCE = "include/covariance";
        /// Workgroups are dispatched in two dimensions, since one holds at most 65535.
        DISPATCH = "include/dispatch";
        /// The exponential of numbers up to 0, to about one unit in the last place.
        EXPONENTIAL = "include/exponential";
        /// A splat's alpha at four pixels of a column.
        FOOTPRINT = "include/footprint";
        /// The mixture of logistics of a channel, and the mass of the interval around a value.
        MIXTURE = "include/mixture";
        /// A node at one time.
        NODE = "include/node";
        /// Translation and rotation of a control node at a time.
        NODE_MOTION = "include/node_motion";
        /// Knots of the splines of control nodes, and those that count at a time.
        NODE_SPLINE = "include/node_spline";
        /// Bilinear samples of the planes of a scale.
        PLANES = "include/planes";
        /// The pixels of one invocation of a team: one column of the cell, every ROW_STEP-th row, four rows
        /// to a vector.
        PIXELS = "include/pixels";
        /// The pose of a node, or the blended one of a Gaussian.
        POSE = "include/pose";
        /// Quaternions (w, x, y, z): rotations from unit ones, and Hamilton's product.
        QUATERNION = "include/quaternion";
        /// Real spherical harmonics up to degree 3 and their derivatives, with the signs of the original 3DGS
        /// code.
        SPHERICAL_HARMONICS = "include/spherical_harmonics";
        /// One Gaussian on the screen: four vectors in `splats`, at 4 * Gaussian.
        SPLAT = "include/splat";
        /// Values on which a team agrees, in a form that every compiler knows to be uniform.
        TEAM_AGREED = "team/agreed";
        /// Values on which a team agrees, for Mesa's software driver, where the other form is slow.
        TEAM_TRUSTED = "team/trusted";
        /// A team whose members communicate through subgroup operations.
        TEAM_SUBGROUP = "team/subgroup";
        /// Sum over a small team that is a subgroup: member by member, the same order in every run.
        TEAM_SUM_OF_FEW = "team/sum_of_few";
        /// Sum over a large team that is a subgroup: by halves, the same order in every run.
        TEAM_SUM_OF_MANY = "team/sum_of_many";
        /// A team whose members communicate through workgroup memory.
        TEAM_WORKGROUP = "team/workgroup";
        /// The view: one uniform for all kernels of an image.
        VIEW = "include/view";
    }
}
