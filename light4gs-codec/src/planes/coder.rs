//! All planes: encode, decode.

use super::{
    exact_model::ExactModel,
    plan::{PlanePlan, plan, stages},
    plane_parameters::{Part, PlaneParameters},
    walk::{Grid, walk},
};
use crate::{
    CodecError, ContextModelArrays, HexPlaneArrays, PerGroup, Plane,
    adaptive::Damaged,
    entropy::{SymbolCoder, SymbolReader, SymbolWriter, gaussian_table},
    executor::{AnchorMap, PaddedMap},
    parallel,
    sections::SectionKind,
};

const SECTION: &str = SectionKind::HexPlanes.name();

/// What [`encode`] makes.
#[derive(Debug)]
pub(crate) struct CodedPlanes {
    /// One entry a sub-stream, in the order of [`sub_streams`].
    pub(crate) sub_streams: Vec<Vec<u8>>,
    /// The planes as a decoder gets them.
    pub(crate) decoded: HexPlaneArrays,
}

/// The planes in the order of the stream, each with its first sub-stream.
pub(crate) fn stream_order(plans: &[PlanePlan]) -> Vec<(usize, usize)> {
    let mut start = 0;
    stages(plans.len() / 6)
        .flatten()
        .map(|index| {
            let first = start;
            start += plans[index].sub_streams();
            (index, first)
        })
        .collect()
}

/// Codes planes whose arrays agree with the model and the head. `steps` has one entry, or one a scale; `hyper_symbols`
/// has those of each plane with a hyperprior, `[N, H/4, W/4]`.
pub(crate) fn encode(
    hexplane: &HexPlaneArrays,
    model: &ContextModelArrays,
    steps: &[PerGroup],
    hyper_symbols: &[Vec<i32>],
) -> Result<CodedPlanes, CodecError> {
    let coder = PlaneCoder::new(model, hexplane.multipliers.len(), steps);
    let mut sub_streams = Vec::new();
    let decoded = coder.run(
        hexplane.clone(),
        |plane_coder, index, planes| {
            let mut values = planes.planes[index].values.clone();
            let streams = plane_coder.encode_plane(index, planes, &mut values, hyper_symbols)?;
            Ok((values, streams))
        },
        |streams| sub_streams.extend(streams),
    )?;
    Ok(CodedPlanes { sub_streams, decoded })
}

/// Reads planes into `hexplane`, whose planes have their sizes but no values.
pub(crate) fn decode(
    hexplane: HexPlaneArrays,
    model: &ContextModelArrays,
    steps: &[PerGroup],
    sub_streams: &[&[u8]],
) -> Result<HexPlaneArrays, CodecError> {
    let coder = PlaneCoder::new(model, hexplane.multipliers.len(), steps);
    let order = stream_order(&coder.plans);
    coder.run(
        hexplane,
        |plane_coder, index, planes| {
            let first = order.iter().find(|(plane, _)| *plane == index).expect("the order has every plane").1;
            let streams = &sub_streams[first..first + plane_coder.plans[index].sub_streams()];
            let values = plane_coder.decode_plane(index, planes, streams).map_err(|Damaged| {
                CodecError::invalid(SECTION, format!("symbols of planes[{index}]"), "damaged", "what an encoder writes")
            })?;
            Ok((values, ()))
        },
        |()| (),
    )
}

struct PlaneCoder<'a> {
    model: ExactModel,
    plans: Vec<PlanePlan>,
    steps: &'a [PerGroup],
}

impl<'a> PlaneCoder<'a> {
    fn new(model: &ContextModelArrays, scales: usize, steps: &'a [PerGroup]) -> Self {
        Self { model: ExactModel::new(model), plans: plan(&model.shape, scales), steps }
    }

    /// Does `work` for every plane, those of a stage at once, and replaces the planes' values by what it returns.
    fn run<T: Send>(
        &self,
        mut hexplane: HexPlaneArrays,
        work: impl Fn(&Self, usize, &HexPlaneArrays) -> Result<(Vec<f32>, T), CodecError> + Sync + Send,
        mut collect: impl FnMut(T),
    ) -> Result<HexPlaneArrays, CodecError> {
        for stage in stages(hexplane.multipliers.len()) {
            let results = parallel::map(stage.len(), |i| work(self, stage[i], &hexplane));
            for (index, result) in stage.into_iter().zip(results) {
                let (values, other) = result?;
                hexplane.planes[index].values = values;
                collect(other);
            }
        }
        Ok(hexplane)
    }

    fn grid(&self, plan: &PlanePlan) -> Grid {
        let step = self.steps.get(plan.scale).unwrap_or(&self.steps[0]).of(plan.space_time);
        Grid { step, centre: self.model.shape.centres.of(plan.space_time) }
    }

    fn encode_plane(
        &self,
        index: usize,
        planes: &HexPlaneArrays,
        values: &mut [f32],
        hyper_symbols: &[Vec<i32>],
    ) -> Result<Vec<Vec<u8>>, CodecError> {
        let plan = &self.plans[index];
        let size = size_of(&planes.planes[index]);
        let mut streams = Vec::new();
        let hyperprior = plan.has_hyperprior().then(|| {
            let mut writer = SymbolWriter::default();
            let map = self.code_hyperprior(size, &mut writer, &hyper_symbols[index]);
            streams.push(writer.finish(&self.model.hyper_distributions));
            map
        });
        let hyperprior = hyperprior.transpose().map_err(|Damaged| {
            let expected = "symbols within ±4194304";
            CodecError::invalid(SECTION, format!("hyperprior of planes[{index}]"), "out of range", expected)
        })?;
        let parameters = PlaneParameters::new(&self.model, plan, size, planes, hyperprior);
        let grid = self.grid(plan);
        let mut coders = coders(plan, SymbolWriter::default);
        walk(&parameters, grid, size, values, &mut coders).map_err(|Damaged| {
            let found = format!("more than 4194304 steps of {} from its centre", grid.step);
            CodecError::invalid(SECTION, format!("a value of planes[{index}]"), found, "fewer; make the step larger")
        })?;
        let levels = &gaussian_table().levels;
        streams.extend(coders.iter().map(|(_, writer)| writer.finish(levels)));
        Ok(streams)
    }

    fn decode_plane(&self, index: usize, planes: &HexPlaneArrays, streams: &[&[u8]]) -> Result<Vec<f32>, Damaged> {
        let plan = &self.plans[index];
        let size = size_of(&planes.planes[index]);
        let mut readers =
            streams.iter().map(|bytes| SymbolReader::new(bytes)).collect::<Result<Vec<_>, _>>()?.into_iter();
        let mut next = || readers.next().expect("one reader a sub-stream");
        let hyperprior = match plan.has_hyperprior() {
            true => {
                let mut reader = next();
                let map = self.code_hyperprior(size, &mut reader, &[])?;
                reader.finish()?;
                Some(map)
            }
            false => None,
        };
        let parameters = PlaneParameters::new(&self.model, plan, size, planes, hyperprior);
        let mut values = vec![0.0; self.model.shape.channels as usize * size[0] * size[1]];
        let mut coders = coders(plan, next);
        walk(&parameters, self.grid(plan), size, &mut values, &mut coders)?;
        coders.into_iter().try_for_each(|(_, reader)| reader.finish())?;
        Ok(values)
    }

    /// Codes the hyperprior's symbols, channel, row, column. A decoder's `symbols` are not looked at.
    fn code_hyperprior(
        &self,
        [height, width]: [usize; 2],
        coder: &mut impl SymbolCoder,
        symbols: &[i32],
    ) -> Result<PaddedMap, Damaged> {
        let size = [height / 4, width / 4];
        let distributions = &self.model.hyper_distributions;
        let area = size[0] * size[1];
        let coded = (0..distributions.len() * area)
            .map(|at| coder.code(distributions, (at / area) as u16, || symbols[at]))
            .collect::<Result<Vec<_>, _>>()?;
        Ok(self.model.hyperprior(&coded, size))
    }
}

/// Scales and means of every value of a plane, given that and the planes that it is coded from, all decoded; and the
/// symbols of its hyperprior, where it has one. Values are `[M, height, width]`.
pub(crate) fn parameters(
    hexplane: &HexPlaneArrays,
    model: &ContextModelArrays,
    hyper_symbols: &[i32],
    index: usize,
) -> (Vec<f32>, Vec<f32>) {
    let model = ExactModel::new(model);
    let plan = plan(&model.shape, hexplane.multipliers.len())[index];
    let plane = &hexplane.planes[index];
    let size = size_of(plane);
    let hyperprior = plan.has_hyperprior().then(|| model.hyperprior(hyper_symbols, [size[0] / 4, size[1] / 4]));
    let parameters = PlaneParameters::new(&model, &plan, size, hexplane, hyperprior);
    let anchors = AnchorMap::new(&plane.values, size, model.shape.centres.of(plan.space_time));
    let (mut scales, mut means) = (vec![0.0; plane.values.len()], vec![0.0; plane.values.len()]);
    for (part, ()) in coders(&plan, || ()) {
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
    (scales, means)
}

fn size_of(plane: &Plane) -> [usize; 2] {
    [plane.height as usize, plane.width as usize]
}

/// One coder a part of the plane.
fn coders<C>(plan: &PlanePlan, mut coder: impl FnMut() -> C) -> Vec<(Part, C)> {
    let parts: &[Part] = if plan.checkerboard { &[Part::Anchors, Part::Others] } else { &[Part::All] };
    parts.iter().map(|&part| (part, coder())).collect()
}
