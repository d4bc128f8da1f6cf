//! Where the numbers of each layer are in a workgroup's memory, which holds only those that are still needed.

use super::NetworkLayout;

/// Places of channels in a workgroup's memory.
#[derive(Debug)]
#[cfg_attr(not(feature = "wgpu"), allow(dead_code, reason = "without kernels of a GPU only the end is asked for"))]
pub(super) struct Slots {
    /// The first channel of the features, or of their gradient.
    pub(super) features: usize,
    /// The first channel of each layer's output, or of its gradient. Forward, outputs of layers that are not hidden have none.
    pub(super) layers: Vec<usize>,
    /// One after the last channel of all.
    pub(super) end: usize,
}

/// Channels that are taken.
#[derive(Debug, Default)]
struct Memory {
    /// First and one after the last, ascending.
    taken: Vec<[usize; 2]>,
    end: usize,
}

impl Memory {
    /// The first gap that is wide enough.
    fn take(&mut self, channels: usize) -> usize {
        let mut start = 0;
        let mut place = self.taken.len();
        for (next, [first, end]) in self.taken.iter().enumerate() {
            if start + channels <= *first {
                place = next;
                break;
            }
            start = *end;
        }
        self.taken.insert(place, [start, start + channels]);
        self.end = self.end.max(start + channels);
        start
    }

    fn free(&mut self, start: usize) {
        self.taken.retain(|[first, _]| *first != start);
    }
}

/// What a layer reads: another layer's output, or the features.
type Source = Option<usize>;

impl NetworkLayout {
    fn last_reader(&self, source: Source) -> Option<usize> {
        self.layers().iter().rposition(|layer| layer.input == source)
    }

    /// For the forward pass: features and outputs of hidden layers are there until their last reader has run.
    pub(super) fn forward_slots(&self) -> Slots {
        let mut memory = Memory::default();
        let features = memory.take(self.features());
        let mut slots = vec![0; self.layers().len()];
        for (number, layer) in self.layers().iter().enumerate() {
            if self.is_hidden(number) {
                slots[number] = memory.take(layer.outputs);
            }
            if self.last_reader(layer.input) == Some(number) {
                memory.free(layer.input.map_or(features, |input| slots[input]));
            }
        }
        Slots { features, layers: slots, end: memory.end }
    }

    /// For the backward pass, from the last layer to the first: a gradient is there from its layer's last reader on, that of the
    /// features to the end.
    pub(super) fn backward_slots(&self) -> Slots {
        let mut memory = Memory::default();
        let mut features = 0;
        let mut slots = vec![0; self.layers().len()];
        for (number, layer) in self.layers().iter().enumerate().rev() {
            if !self.is_hidden(number) {
                slots[number] = memory.take(layer.outputs);
            }
            if self.last_reader(layer.input) == Some(number) {
                let slot = memory.take(layer.inputs);
                match layer.input {
                    Some(input) => slots[input] = slot,
                    None => features = slot,
                }
            }
            memory.free(slots[number]);
        }
        Slots { features, layers: slots, end: memory.end }
    }

    /// Channels that a workgroup's memory must hold.
    pub(super) fn channels_at_once(&self) -> usize {
        self.forward_slots().end.max(self.backward_slots().end)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A trunk of two layers and two heads.
    fn trunk_and_heads() -> NetworkLayout {
        let mut layout = NetworkLayout::default();
        let first = layout.add(None, [20, 8]);
        let trunk = layout.add(Some(first), [8, 6]);
        for outputs in [3, 4] {
            let hidden = layout.add(Some(trunk), [6, 5]);
            layout.add(Some(hidden), [5, outputs]);
        }
        layout
    }

    #[test]
    fn what_is_not_needed_any_more_makes_room() {
        let forward = trunk_and_heads().forward_slots();
        // The trunk's second layer is where the features were, and the heads' hidden layers are behind it.
        assert_eq!((forward.features, &forward.layers[..2]), (0, &[20, 0][..]));
        assert_eq!((forward.layers[2], forward.layers[4], forward.end), (6, 6, 28));

        let backward = trunk_and_heads().backward_slots();
        // The heads in turn, where the memory begins; the trunk's gradient stays behind them until its first layer is reached.
        assert_eq!(backward.layers, [0, 9, 3, 0, 4, 0]);
        assert_eq!((backward.features, backward.end), (8, 28));
    }
}
