//! The Gaussians of a scene at any time: what a player runs for each frame.

use super::query::{Between, multiply_by_space_samples, normalized, scales};
use crate::{
    AttributeValues, CodecError, CoordinateMapping, GaussianArrays, Limits, MotionNetwork, MotionOutput, MotionSource,
    Plane, SceneData,
    network::{
        Dependence, Program, Workspace,
        kernels::{LANES, Lanes, kept},
    },
    planes, sh_rest_coefficients,
};

/// A scene's motion, prepared for evaluation at many times.
///
/// Values that do not depend on the time are computed once: for each Gaussian the product of its space-only samples (`4
/// · features` bytes), and the network's values of attributes and points alone, such as the weights of control nodes (4
/// bytes a channel). Values that depend on the time alone are computed once for each time. The evaluator runs any
/// [`MotionNetwork`], follows the model's conventions (docs/design.md) to float tolerance, takes less than a
/// microsecond for each Gaussian, and uses one thread.
///
/// ```
/// use light4gs_codec::{GaussianArrays, MotionEvaluator, SceneData};
///
/// let scene = SceneData::default();
/// let evaluator = MotionEvaluator::new(&scene)?;
/// let mut moved = scene.gaussians.clone();
/// evaluator.apply(&scene.gaussians, 0.5, 0..moved.len(), &mut moved);
/// assert_eq!(moved, scene.gaussians); // nothing moves here
/// # Ok::<(), light4gs_codec::CodecError>(())
/// ```
#[derive(Debug)]
pub struct MotionEvaluator {
    motion: Option<Motion>,
}

#[derive(Debug)]
struct Motion {
    program: Program,
    /// `[blocks, kept channels]`: the program's values of the place alone; empty where they are computed anew for each
    /// time.
    kept: Vec<Lanes>,
    sources: Vec<MotionSource>,
    outputs: Vec<MotionOutput>,
    mapping: CoordinateMapping,
    channels: usize,
    features: usize,
    /// Coordinates of the canonical centers along x, y, z, eight Gaussians at a time.
    points: Vec<[Lanes; 3]>,
    /// `[blocks, features]`: products of the samples of the planes without time; empty where no source is features.
    space_features: Vec<Lanes>,
    /// For each scale the planes with time.
    time_planes: Vec<Vec<Plane>>,
}

/// A plane over an axis and time at one time: `[samples, channels]`.
struct Line {
    axis: usize,
    samples: u32,
    values: Vec<f32>,
}

impl MotionEvaluator {
    /// Prepares the motion of a scene. The network's values that do not depend on the time are kept if they take at
    /// most [`Limits::memory_bytes`] of the default limits.
    ///
    /// # Errors
    /// A network that contradicts itself or the planes; an attribute that the scene needs and nobody knows
    /// ([`SceneData::check_attributes_are_known`]).
    pub fn new(scene: &SceneData) -> Result<Self, CodecError> {
        Self::keeping(scene, Limits::default().memory_bytes)
    }

    /// As [`MotionEvaluator::new`], with at most `most_bytes` for the network's values that do not depend on the time.
    /// If they take more, they are computed anew for each time. The Gaussians are the same to the last bit.
    ///
    /// # Errors
    /// As [`MotionEvaluator::new`].
    pub fn keeping(scene: &SceneData, most_bytes: u64) -> Result<Self, CodecError> {
        scene.check_attributes_are_known()?;
        let Some(MotionNetwork { network, sources, outputs }) = &scene.motion.network else {
            return Ok(Self { motion: None });
        };
        let limits = Limits::large();
        scene.motion.check(&limits)?;
        planes::head::check(&scene.feature_planes, &limits)?;
        scene.motion.check_sources(scene.feature_planes.features(), &scene.gaussians)?;
        let channels = scene.feature_planes.channels as usize;
        let features = scene.feature_planes.features() as usize;
        let dependence = sources.iter().map(|source| match source {
            MotionSource::Time => Dependence::TIME,
            MotionSource::Features => Dependence::TIME_AND_PLACE,
            MotionSource::Point | MotionSource::Attribute(_) => Dependence::PLACE,
        });
        let mut motion = Motion {
            program: Program::over_time(network, &dependence.collect::<Vec<_>>()),
            kept: Vec::new(),
            sources: sources.clone(),
            outputs: outputs.clone(),
            mapping: scene.coordinates.mapping,
            channels,
            features,
            points: Vec::with_capacity(scene.gaussians.len().div_ceil(LANES)),
            space_features: Vec::new(),
            time_planes: Vec::new(),
        };
        for means in scene.gaussians.means.chunks(LANES) {
            let mut points = [[0.0; LANES]; 3];
            for (lane, &mean) in means.iter().enumerate() {
                let point = normalized(&scene.coordinates, mean);
                points.iter_mut().zip(point).for_each(|(lanes, coordinate)| lanes[lane] = coordinate);
            }
            motion.points.push(points);
        }
        if features > 0 && sources.contains(&MotionSource::Features) {
            let with_time =
                |scale: &[Plane]| scale.iter().filter(|plane| plane.axes.is_space_time()).cloned().collect();
            motion.time_planes = scales(&scene.feature_planes.planes).map(with_time).collect();
            motion.space_features = motion.products_over_space(&scene.feature_planes.planes);
        }
        let lanes = (motion.program.kept_channels() as u64).saturating_mul(motion.points.len() as u64);
        if lanes.saturating_mul(size_of::<Lanes>() as u64) <= most_bytes {
            motion.kept = motion.values_of_places(&scene.gaussians, lanes as usize);
        }
        Ok(Self { motion: Some(motion) })
    }

    /// Whether anything but the spherical harmonics beyond degree 0 may change with time.
    pub fn moves(&self) -> bool {
        self.motion.is_some()
    }

    /// Whether the attribute of an output may change with time. It does not matter whether the output is added or
    /// replaces it.
    pub fn changes(&self, output: MotionOutput) -> bool {
        let same = |other: &MotionOutput| other.added() == output.added();
        self.motion.as_ref().is_some_and(|motion| motion.outputs.iter().any(same))
    }

    /// Writes the Gaussians of a `range` at a `time` in [0, 1] into `moved`: attributes before their activations. The
    /// `canonical` Gaussians are those of the scene for which the evaluator was made, and `moved` is as long. A long scene can be done in parts, so
    /// that a player can respond in between; parts that begin at a multiple of 8 are fastest.
    ///
    /// # Panics
    /// If the arrays have other lengths than the scene's, or the range goes beyond them.
    pub fn apply(
        &self,
        canonical: &GaussianArrays,
        time: f32,
        range: std::ops::Range<usize>,
        moved: &mut GaussianArrays,
    ) {
        moved.means[range.clone()].copy_from_slice(&canonical.means[range.clone()]);
        moved.log_scales[range.clone()].copy_from_slice(&canonical.log_scales[range.clone()]);
        moved.quats[range.clone()].copy_from_slice(&canonical.quats[range.clone()]);
        moved.opacity_logits[range.clone()].copy_from_slice(&canonical.opacity_logits[range.clone()]);
        let Some(motion) = &self.motion else { return };
        if self.changes(MotionOutput::Sh) {
            let rest = 3 * sh_rest_coefficients(canonical.sh_degree);
            let rest = rest * range.start..rest * range.end;
            moved.sh_dc[range.clone()].copy_from_slice(&canonical.sh_dc[range.clone()]);
            moved.sh_rest[rest.clone()].copy_from_slice(&canonical.sh_rest[rest]);
        }
        let time = motion.mapping.time(time);
        let lines = motion.lines_at(time);
        let mut workspace = motion.program.workspace_over_time();
        let mut product = vec![0.0; motion.features];
        for (input, source) in motion.sources.iter().enumerate() {
            if *source == MotionSource::Time {
                motion.program.input_lanes(&mut workspace, input)[0] = [kept(time); LANES];
            }
        }
        motion.program.run_time(&mut workspace);
        let attributes = motion.attributes(canonical);
        let kept_channels = motion.program.kept_channels();
        let computes_places = kept_channels > 0 && motion.kept.is_empty();
        for block in range.start / LANES..range.end.div_ceil(LANES) {
            for (input, source) in motion.sources.iter().enumerate() {
                if *source != MotionSource::Features {
                    if computes_places || motion.program.reads_input(input) {
                        motion.set_input_of_place(&attributes[input], block, input, &mut workspace);
                    }
                } else if motion.features > 0 {
                    let inputs = motion.program.input_lanes(&mut workspace, input);
                    motion.set_features(block, &lines, &mut product, inputs);
                }
            }
            if computes_places {
                motion.program.run_place(&mut workspace);
            } else {
                motion.program.load(&motion.kept[block * kept_channels..][..kept_channels], &mut workspace);
            }
            motion.program.run(&mut workspace);
            let lanes = range.start.max(block * LANES)..range.end.min((block + 1) * LANES);
            for (index, output) in motion.outputs.iter().enumerate() {
                let values = motion.program.output_lanes(&workspace, index);
                match output.replaces() {
                    true => lanes.clone().for_each(|gaussian| change(*output, values, gaussian, moved, |_, new| new)),
                    false => {
                        lanes.clone().for_each(|gaussian| change(*output, values, gaussian, moved, |old, by| old + by));
                    }
                }
            }
        }
    }
}

impl Motion {
    /// The attributes that are inputs.
    fn attributes<'a>(&self, canonical: &'a GaussianArrays) -> Vec<Option<AttributeValues<'a>>> {
        let attribute = |source: &MotionSource| match source {
            MotionSource::Attribute(name) => canonical.attribute(name),
            MotionSource::Features | MotionSource::Point | MotionSource::Time => None,
        };
        self.sources.iter().map(attribute).collect()
    }

    /// Sets an input that does not depend on the time.
    fn set_input_of_place(
        &self,
        attribute: &Option<AttributeValues<'_>>,
        block: usize,
        input: usize,
        workspace: &mut Workspace,
    ) {
        let inputs = self.program.input_lanes(workspace, input);
        match (&self.sources[input], attribute) {
            (MotionSource::Point, _) => inputs.copy_from_slice(&self.points[block]),
            (_, Some(attribute)) => set_attribute(attribute, block, inputs),
            _ => {}
        }
    }

    /// `[blocks, kept channels]`: the program's values of the place alone, `count` in all.
    fn values_of_places(&self, canonical: &GaussianArrays, count: usize) -> Vec<Lanes> {
        let mut values = Vec::with_capacity(count);
        if count == 0 {
            return values;
        }
        let mut workspace = self.program.workspace_over_time();
        let attributes = self.attributes(canonical);
        for block in 0..self.points.len() {
            for (input, attribute) in attributes.iter().enumerate() {
                self.set_input_of_place(attribute, block, input, &mut workspace);
            }
            self.program.run_place(&mut workspace);
            self.program.save(&workspace, &mut values);
        }
        values
    }

    /// `[blocks, features]`: the product of the samples of the planes without time.
    fn products_over_space(&self, planes: &[Plane]) -> Vec<Lanes> {
        let mut products = vec![[1.0; LANES]; self.points.len() * self.features];
        let mut product = vec![0.0; self.channels];
        for (points, block) in self.points.iter().zip(products.chunks_exact_mut(self.features.max(1))) {
            for lane in 0..LANES {
                for (planes, features) in scales(planes).zip(block.chunks_exact_mut(self.channels)) {
                    product.fill(1.0);
                    multiply_by_space_samples(planes, points.map(|lanes| lanes[lane]), &mut product);
                    features.iter_mut().zip(&product).for_each(|(feature, &product)| feature[lane] = product);
                }
            }
        }
        products
    }

    /// The planes with time at a time, scale by scale.
    fn lines_at(&self, time: f32) -> Vec<Vec<Line>> {
        let line = |plane: &Plane| {
            let row = Between::of(2.0 * time - 1.0, plane.height);
            let width = plane.width as usize;
            let mut values = vec![0.0; width * self.channels];
            for (channel, map) in plane.values.chunks_exact(width * plane.height as usize).enumerate() {
                let (low, high) = (&map[row.low * width..], &map[row.high * width..]);
                for x in 0..width {
                    values[x * self.channels + channel] = row.between(low[x], high[x]);
                }
            }
            let [axis, _] = plane.axes.axes();
            Line { axis, samples: plane.width, values }
        };
        self.time_planes.iter().map(|planes| planes.iter().map(line).collect()).collect()
    }

    /// Features of eight Gaussians, `[features]`. `product` is memory.
    fn set_features(&self, block: usize, lines: &[Vec<Line>], product: &mut [f32], inputs: &mut [Lanes]) {
        inputs.copy_from_slice(&self.space_features[block * self.features..][..self.features]);
        for lane in 0..LANES {
            let point = self.points[block].map(|lanes| lanes[lane]);
            for (lines, product) in lines.iter().zip(product.chunks_exact_mut(self.channels)) {
                match &lines[..] {
                    [] => product.fill(1.0),
                    [x] => set_to_product([x], point, product),
                    [x, y] => set_to_product([x, y], point, product),
                    [x, y, z, ..] => set_to_product([x, y, z], point, product),
                }
            }
            inputs.iter_mut().zip(&*product).for_each(|(input, &product)| input[lane] *= product);
        }
    }
}

/// Sets `product [channels]` to the product of the lines' samples at a point.
fn set_to_product<const N: usize>(lines: [&Line; N], point: [f32; 3], product: &mut [f32]) {
    let channels = product.len();
    let samples = lines.map(|line| {
        let place = Between::of(point[line.axis], line.samples);
        (&line.values[place.low * channels..][..channels], &line.values[place.high * channels..][..channels], place)
    });
    for (channel, product) in product.iter_mut().enumerate() {
        let sample = |(low, high, place): (&[f32], &[f32], Between)| place.between(low[channel], high[channel]);
        *product = samples[1..].iter().fold(sample(samples[0]), |product, &other| product * sample(other));
    }
}

/// An attribute of eight Gaussians, `[width]`; zeros beyond the last one.
fn set_attribute(attribute: &AttributeValues<'_>, block: usize, inputs: &mut [Lanes]) {
    let (width, values) = (attribute.width, attribute.values);
    inputs.fill([0.0; LANES]);
    let rows = values[(block * LANES * width).min(values.len())..].chunks_exact(width).take(LANES);
    for (lane, row) in rows.enumerate() {
        inputs.iter_mut().zip(row).for_each(|(lanes, &value)| lanes[lane] = kept(value));
    }
}

/// Changes a value of a Gaussian by an output of the network: the output is added, or replaces the value.
fn change(
    output: MotionOutput,
    values: &[Lanes],
    gaussian: usize,
    moved: &mut GaussianArrays,
    operation: impl Fn(f32, f32) -> f32,
) {
    let lane = gaussian % LANES;
    let apply = |attribute: &mut [f32], values: &[Lanes]| {
        attribute.iter_mut().zip(values).for_each(|(old, lanes)| *old = operation(*old, lanes[lane]));
    };
    match output.added() {
        MotionOutput::Position => apply(&mut moved.means[gaussian], values),
        MotionOutput::LogScale => apply(&mut moved.log_scales[gaussian], values),
        MotionOutput::Quaternion => apply(&mut moved.quats[gaussian], values),
        MotionOutput::OpacityLogit => apply(&mut moved.opacity_logits[gaussian..=gaussian], values),
        _ => {
            apply(&mut moved.sh_dc[gaussian], values);
            let rest = 3 * sh_rest_coefficients(moved.sh_degree);
            apply(&mut moved.sh_rest[gaussian * rest..][..rest], &values[3..]);
        }
    }
}

impl SceneData {
    /// The centers of the Gaussians at a `time` in [0, 1], in world units: the canonical ones where nothing moves, or
    /// where the motion is no [`MotionNetwork`].
    ///
    /// For tools that inspect a file without a back end. Each call makes a new [`MotionEvaluator`].
    ///
    /// # Errors
    /// A network that contradicts itself or the planes.
    pub fn positions_at(&self, time: f32) -> Result<Vec<[f32; 3]>, CodecError> {
        let motion = self.motion.network.as_ref();
        let moves = |output: &MotionOutput| output.added() == MotionOutput::Position;
        if !motion.is_some_and(|motion| motion.outputs.iter().any(moves)) {
            return Ok(self.gaussians.means.clone());
        }
        let mut moved = self.gaussians.clone();
        // For a single time nothing is worth keeping.
        MotionEvaluator::keeping(self, 0)?.apply(&self.gaussians, time, 0..moved.len(), &mut moved);
        Ok(moved.means)
    }
}
