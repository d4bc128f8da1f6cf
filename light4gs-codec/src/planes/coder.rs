//! All planes: encode, decode.

use super::{
    cost,
    exact_model::ExactModel,
    plan::{stages, stream_order, sub_streams},
    plane_parameters::{Part, PlaneParameters},
    walk::{Grid, walk},
};
use crate::{
    CodecError, ContextModelArrays, FeaturePlaneArrays, Limits, PerGroup, Plane,
    adaptive::Damaged,
    budget::Budget,
    bytes::Section,
    entropy::{SymbolCoder, SymbolReader, SymbolWriter, gaussian_table},
    network::kernels::AnchorMap,
    parallel,
    plane_layout::{PlaneLayout, PlaneShape},
};

const SECTION: &str = Section::FeaturePlanes.name();

/// What [`encode`] makes.
#[derive(Debug)]
pub(crate) struct CodedPlanes {
    /// One entry for each sub-stream, in the order of [`stream_order`].
    pub(crate) sub_streams: Vec<Vec<u8>>,
    /// The planes as a decoder gets them.
    pub(crate) decoded: FeaturePlaneArrays,
}

/// Codes planes whose arrays fit the model. `steps` has one entry, or one for each scale; `latent_symbols` has those of
/// each plane with a latent, `[N, H/4, W/4]`.
pub(crate) fn encode(
    planes: &FeaturePlaneArrays,
    model: &ContextModelArrays,
    steps: &[PerGroup],
    latent_symbols: &[Vec<i32>],
    limits: &Limits,
) -> Result<CodedPlanes, CodecError> {
    let layout = planes.layout()?;
    let coder = PlaneCoder::new(model, &layout, steps, &Budget::new(limits))?;
    let mut sub_streams = Vec::new();
    let decoded = coder.run(
        planes.clone(),
        |plane_coder, index, planes| {
            let mut values = planes.planes[index].values.clone();
            let streams = plane_coder.encode_plane(index, planes, &mut values, latent_symbols)?;
            Ok((values, streams))
        },
        |streams| sub_streams.extend(streams),
    )?;
    Ok(CodedPlanes { sub_streams, decoded })
}

/// Reads planes of a layout.
pub(crate) fn decode(
    layout: &PlaneLayout,
    model: &ContextModelArrays,
    steps: &[PerGroup],
    streams: &[&[u8]],
    budget: &Budget,
) -> Result<FeaturePlaneArrays, CodecError> {
    let coder = PlaneCoder::new(model, layout, steps, budget)?;
    streams.iter().try_for_each(|stream| budget.stream(SECTION, stream.len()))?;
    let order = stream_order(model, layout);
    coder.run(
        FeaturePlaneArrays::without_values(model.channels, layout),
        |plane_coder, index, planes| {
            let first = order.iter().find(|(plane, _)| *plane == index).expect("the order has every plane").1;
            let streams = &streams[first..first + sub_streams(model, index)];
            let values = plane_coder.decode_plane(index, planes, streams).map_err(|Damaged| {
                let field = format!("symbols of plane {}", layout.planes()[index].name());
                CodecError::invalid(SECTION, field, "damaged", "symbols as an encoder writes them")
            })?;
            Ok((values, ()))
        },
        |()| (),
    )
}

/// Refuses planes whose decoding costs more than the limits allow.
pub(crate) fn check_cost(layout: &PlaneLayout, model: &ContextModelArrays, limits: &Limits) -> Result<(), CodecError> {
    PlaneCoder::new(model, layout, &[], &Budget::new(limits)).map(drop)
}

struct PlaneCoder<'a> {
    model: ExactModel<'a>,
    stages: Vec<Vec<usize>>,
    steps: &'a [PerGroup],
}

impl<'a> PlaneCoder<'a> {
    /// Refuses what the limits do not allow.
    fn new(
        model: &'a ContextModelArrays,
        layout: &'a PlaneLayout,
        steps: &'a [PerGroup],
        budget: &Budget,
    ) -> Result<Self, CodecError> {
        let stages = stages(model, layout);
        let model = ExactModel::new(model, layout, budget)?;
        cost::ask(&model, &stages, budget)?;
        Ok(Self { model, stages, steps })
    }

    /// Does `work` for every plane, for all planes of a stage at the same time, and replaces the planes' values by its
    /// results.
    fn run<T: Send>(
        &self,
        mut planes: FeaturePlaneArrays,
        work: impl Fn(&Self, usize, &FeaturePlaneArrays) -> Result<(Vec<f32>, T), CodecError> + Sync + Send,
        mut collect: impl FnMut(T),
    ) -> Result<FeaturePlaneArrays, CodecError> {
        for stage in &self.stages {
            let results = parallel::map(stage.len(), |i| work(self, stage[i], &planes));
            for (&index, result) in stage.iter().zip(results) {
                let (values, other) = result?;
                planes.planes[index].values = values;
                collect(other);
            }
        }
        Ok(planes)
    }

    fn name(&self, plane: usize) -> String {
        self.model.layout.planes()[plane].name()
    }

    fn grid(&self, plane: usize) -> Grid {
        let PlaneShape { scale, axes, .. } = self.model.layout.planes()[plane];
        let step = self.steps.get(scale).unwrap_or(&self.steps[0]).of(axes);
        Grid { step, center: self.model.center_of(plane) }
    }

    fn encode_plane(
        &self,
        index: usize,
        planes: &FeaturePlaneArrays,
        values: &mut [f32],
        latent_symbols: &[Vec<i32>],
    ) -> Result<Vec<Vec<u8>>, CodecError> {
        let size = size_of(&planes.planes[index]);
        let mut streams = Vec::new();
        let mut latent = Vec::new();
        if self.model.arrays.prior(index).has_latent() {
            let mut writer = SymbolWriter::default();
            latent = self.code_latent(size, &mut writer, &latent_symbols[index]).map_err(|Damaged| {
                let expected = "symbols within ±4194304";
                CodecError::invalid(SECTION, format!("latent of plane {}", self.name(index)), "out of range", expected)
            })?;
            streams.push(writer.finish(&self.model.latent_distributions));
        }
        let parameters = PlaneParameters::new(&self.model, index, size, planes, &latent);
        let grid = self.grid(index);
        let mut coders = coders(&self.model, index, SymbolWriter::default);
        walk(&parameters, grid, size, values, &mut coders).map_err(|Damaged| {
            let found = format!("more than 4194304 steps of {} from its center", grid.step);
            let field = format!("a value of plane {}", self.name(index));
            CodecError::invalid(SECTION, field, found, "fewer; make the step larger")
        })?;
        let levels = &gaussian_table().levels;
        streams.extend(coders.iter().map(|(_, writer)| writer.finish(levels)));
        Ok(streams)
    }

    fn decode_plane(&self, index: usize, planes: &FeaturePlaneArrays, streams: &[&[u8]]) -> Result<Vec<f32>, Damaged> {
        let size = size_of(&planes.planes[index]);
        let mut readers =
            streams.iter().map(|bytes| SymbolReader::new(bytes)).collect::<Result<Vec<_>, _>>()?.into_iter();
        let mut next = || readers.next().expect("one reader a sub-stream");
        let mut latent = Vec::new();
        if self.model.arrays.prior(index).has_latent() {
            let mut reader = next();
            latent = self.code_latent(size, &mut reader, &[])?;
            reader.finish()?;
        }
        let parameters = PlaneParameters::new(&self.model, index, size, planes, &latent);
        let mut values = vec![0.0; self.model.arrays.channels as usize * size[0] * size[1]];
        let mut coders = coders(&self.model, index, next);
        walk(&parameters, self.grid(index), size, &mut values, &mut coders)?;
        coders.into_iter().try_for_each(|(_, reader)| reader.finish())?;
        Ok(values)
    }

    /// Codes the symbols of a latent: channel, row, column. A decoder ignores the values in `symbols`.
    fn code_latent(
        &self,
        [height, width]: [usize; 2],
        coder: &mut impl SymbolCoder,
        symbols: &[i32],
    ) -> Result<Vec<i32>, Damaged> {
        let distributions = &self.model.latent_distributions;
        let area = height / 4 * (width / 4);
        let code = |at: usize| coder.code(distributions, (at / area) as u16, || symbols[at]);
        (0..distributions.len() * area).map(code).collect()
    }
}

/// Scales and means of every value of a plane, given this plane and the planes that it is coded from, all decoded; and
/// the symbols of its latent, if it has one. Values are `[M, height, width]`.
pub(crate) fn parameters(
    planes: &FeaturePlaneArrays,
    model: &ContextModelArrays,
    latent_symbols: &[i32],
    index: usize,
    limits: &Limits,
) -> Result<(Vec<f32>, Vec<f32>), CodecError> {
    let layout = planes.layout()?;
    let coder = PlaneCoder::new(model, &layout, &[], &Budget::new(limits))?;
    let model = &coder.model;
    let plane = &planes.planes[index];
    let size = size_of(plane);
    let parameters = PlaneParameters::new(model, index, size, planes, latent_symbols);
    let anchors = AnchorMap::new(&plane.values, size, model.center_of(index));
    let (mut scales, mut means) = (vec![0.0; plane.values.len()], vec![0.0; plane.values.len()]);
    for (part, ()) in coders(model, index, || ()) {
        for y in 0..size[0] {
            let row = parameters.row(y, part, (part == Part::Others).then_some(&anchors));
            let columns = part.columns(y);
            for (all, row) in [(&mut scales, &row.scales), (&mut means, &row.means)] {
                for (channel, values) in row.chunks_exact(part.count(size[1])).enumerate() {
                    let start = (channel * size[0] + y) * size[1] + columns.first;
                    all[start..].iter_mut().step_by(columns.step).zip(values).for_each(|(to, &value)| *to = value);
                }
            }
        }
    }
    Ok((scales, means))
}

fn size_of(plane: &Plane) -> [usize; 2] {
    [plane.height as usize, plane.width as usize]
}

/// One coder for each part of the plane.
fn coders<C>(model: &ExactModel<'_>, plane: usize, mut coder: impl FnMut() -> C) -> Vec<(Part, C)> {
    let has_anchors = model.arrays.prior(plane).has_anchors();
    let parts: &[Part] = if has_anchors { &[Part::Anchors, Part::Others] } else { &[Part::All] };
    parts.iter().map(|&part| (part, coder())).collect()
}
