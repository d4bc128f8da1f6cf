//! The context model and the quantization steps as the codec's plain arrays.

use light4gs_codec::plane_layout::{PlaneAxes, PlaneLayout};
use light4gs_codec::{CodecError, Condition, ContextModelArrays, FrequencyTable, LatentArrays, PerGroup, PlanePrior};

use super::ContextModel;
use super::prior::{DescribedCondition, DescribedPrior, Passes, PriorPart};
use crate::entropy::quantization_steps::PlaneSteps;

impl PlaneSteps {
    /// A pair of steps for each scale of a layout, or one for all where they are the same. In a scale, the space-only
    /// planes have one step and the space-time planes have one; a scale that has planes of only one group gives both
    /// the same step.
    pub fn to_groups(&self, layout: &PlaneLayout) -> Vec<PerGroup> {
        let steps = self.values();
        let pair = |scale: usize| {
            let of = |space_time: bool| {
                let mut planes = layout.scale(scale);
                planes
                    .find(|plane| layout.planes()[*plane].axes.is_space_time() == space_time)
                    .map(|plane| steps[plane])
            };
            let any = steps[layout.scale(scale).start];
            PerGroup { space_only: of(false).unwrap_or(any), space_time: of(true).unwrap_or(any) }
        };
        let mut groups: Vec<PerGroup> = (0..layout.scales()).map(pair).collect();
        if groups.iter().all(|group| *group == groups[0]) {
            groups.truncate(1);
        }
        groups
    }
}

impl ContextModel {
    /// The data of a composition of parts that a decoder needs, for planes of a layout. Call [`Self::update_quantiles`]
    /// first: the hyperprior's tables extend to its quantiles.
    ///
    /// # Errors
    /// A density from which no frequency table can be made; the message says why.
    pub fn to_arrays_with(
        &self,
        parts: &[Box<dyn PriorPart + '_>],
        layout: &PlaneLayout,
    ) -> Result<ContextModelArrays, CodecError> {
        let mut arrays = ContextModelArrays {
            channels: self.entropy_parameters.channels() as u32,
            centers: PerGroup {
                space_only: self.center_of(PlaneAxes::Xy) as f32,
                space_time: self.center_of(PlaneAxes::Xt) as f32,
            },
            ..ContextModelArrays::default()
        };
        let described = |plane: usize| {
            let mut described = parts.iter().filter_map(|part| part.describe(layout, plane));
            described.next().unwrap_or_else(DescribedPrior::constant)
        };
        for plane in 0..layout.len() {
            let DescribedPrior { parameters, mut context, passes } = described(plane);
            if let (Some(checkerboard), Passes::AnchorsFirst) = (&self.checkerboard, passes) {
                context = Some(checkerboard.describe());
            }
            let conditions = [parameters, context].map(|condition| {
                let DescribedCondition { network, sources } = condition?;
                Some(Condition { network: place(&mut arrays.networks, network), sources })
            });
            let distribution = place(&mut arrays.networks, self.entropy_parameters.network());
            let prior = place(&mut arrays.priors, PlanePrior { conditions: conditions.to_vec(), distribution });
            arrays.plane_priors.push(prior);
        }
        if let Some(hyperprior) = &self.hyperprior {
            let bottleneck = &hyperprior.bottleneck;
            let table = |(channel, range): (usize, std::ops::RangeInclusive<i32>)| {
                FrequencyTable::from_pmf(*range.start(), &bottleneck.pmf(range)[channel])
            };
            let tables = bottleneck.symbol_ranges().into_iter().enumerate().map(table).collect::<Result<_, _>>()?;
            arrays.latent = Some(LatentArrays { tables, medians: bottleneck.medians().into_data().iter().collect() });
        }
        Ok(arrays)
    }
}

/// The index of an item in a list; a new item is appended. So an item that several planes use is stored once.
fn place<T: PartialEq>(list: &mut Vec<T>, item: T) -> u32 {
    let place = list.iter().position(|other| *other == item).unwrap_or(list.len());
    if place == list.len() {
        list.push(item);
    }
    place as u32
}
