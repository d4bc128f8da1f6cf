//! Streams of few bytes that claim to hold much: legal, or almost legal, written from docs/format.md.

use light4gs_codec::network_weights::{self, WeightPrecision, WeightTensor};

use crate::{
    parts::{Parts, varint},
    random::Random,
};

/// Puts a bomb into a stream, and returns the bomb's name.
pub(crate) fn arm(parts: &mut Parts, random: &mut Random) -> &'static str {
    match random.below(5) {
        0 => {
            let count = gaussians(parts, random);
            parts.set(2, 1, 0, [varint(count), vec![0]].concat());
            "Gaussians that take no bits"
        }
        1 => {
            let most = random.pick(&[1 << 10, 1 << 21]);
            let count = if random.chance(2) {
                few_gaussians(parts, most.min(1 << 12), random)
            } else {
                gaussians(parts, random)
            };
            harmonics(parts, count, random);
            "harmonics that take no bits"
        }
        2 => {
            motion(parts, random);
            "weights that take no bits"
        }
        _ => {
            planes(parts, random);
            "planes that take no bits"
        }
    }
}

/// Quantized Gaussians; returns their number.
fn gaussians(parts: &mut Parts, random: &mut Random) -> u64 {
    let most = random.pick(&[1 << 18, 1 << 20, 1 << 22]);
    let count = random.scale(most);
    let mut payload = (count as u32).to_le_bytes().to_vec();
    let step = random.pick(&[1.0f32, 1.2e-38, 1e30, 0.01]);
    [0.0f32, 0.0, 0.0, step].iter().for_each(|value| payload.extend(value.to_le_bytes()));
    payload.push(random.below(21) as u8);
    [0.1f32, 0.1, step, 0.1].iter().for_each(|value| payload.extend(value.to_le_bytes()));
    let streams: Vec<Vec<u8>> = (0..5)
        .map(|_| {
            let length = random.scale(1 << 16) as usize;
            if random.chance(3) { random.bytes(length) } else { vec![0xff; length] }
        })
        .collect();
    streams.iter().for_each(|stream| payload.extend((stream.len() as u32).to_le_bytes()));
    payload.extend(streams.concat());
    payload.resize(payload.len().max(count.div_ceil(8) as usize), 0);
    parts.set(1, 1, 1, payload);
    count
}

/// Gaussians of zeros as float32; returns their number.
fn few_gaussians(parts: &mut Parts, most: u64, random: &mut Random) -> u64 {
    let count = random.scale(most);
    let mut payload = (count as u32).to_le_bytes().to_vec();
    payload.resize(4 + 56 * count as usize, 0);
    parts.set(1, 1, 0, payload);
    count
}

/// A description, and the lengths of weights and biases.
#[derive(Default)]
struct Network {
    description: Vec<u8>,
    lengths: Vec<u64>,
}

/// Random nodes on inputs of the given channels, made to end with the given number of channels. `maps` where a node may
/// read more than one place.
fn network(inputs: &[u64], outputs: u64, maps: bool, random: &mut Random) -> Network {
    let mut nodes: Vec<Vec<u8>> = Vec::new();
    let mut channels = inputs.to_vec();
    let mut lengths = Vec::new();
    let widest = random.pick(&[8, 64, 1 << 9, 1 << 13]);
    let widest = random.scale(widest);
    for _ in 0..random.scale(40) {
        let value = if random.chance(3) { random.below(channels.len()) } else { channels.len() - 1 };
        let from = channels[value];
        let mut own = from;
        let read = varint(value as u64);
        let mut node = match random.below(if maps { 15 } else { 8 }) {
            0 | 1 => {
                own = random.scale(widest);
                lengths.extend([own * from, own]);
                [vec![0], read, varint(own)].concat()
            }
            2 => {
                // One group per channel: many small matrices.
                lengths.extend([from, from]);
                [vec![1], read, varint(from), vec![1], varint(from)].concat()
            }
            3 => [vec![5], read].concat(),
            4 => [vec![7], read, random.pick(&[0.3f32, 1e-3, 1e-38, -2.0]).to_le_bytes().to_vec()].concat(),
            5 => {
                let other = random.below(channels.len());
                own += channels[other];
                [vec![13, 2], read, varint(other as u64)].concat()
            }
            6 => [vec![14], read.clone(), read].concat(),
            7 => [vec![15], read.clone(), read].concat(),
            8 => {
                own = random.scale(64);
                let kernel = random.pick(&[3u64, 5, 7]);
                lengths.extend([own * from * kernel * kernel, own]);
                [vec![1], read, varint(own), vec![kernel as u8], vec![1]].concat()
            }
            9 => {
                own = random.scale(32);
                lengths.extend([own * from * 25, own]);
                [vec![3], read, varint(own)].concat()
            }
            10 => [vec![8], read].concat(),
            11 => [vec![11], read].concat(),
            12 => [vec![8], read].concat(),
            13 => [vec![9 + random.below(2) as u8], read].concat(),
            _ => [vec![12], read].concat(),
        };
        nodes.push(std::mem::take(&mut node));
        channels.push(own);
        if channels.iter().sum::<u64>() > 1 << 16 {
            break;
        }
    }
    let mut last = channels.len() - 1;
    if maps {
        nodes.push([vec![8], varint(last as u64)].concat());
        channels.push(channels[last]);
        last += 1;
    }
    lengths.extend([channels[last] * outputs, outputs]);
    nodes.push([vec![0], varint(last as u64), varint(outputs)].concat());
    let mut description = varint(inputs.len() as u64);
    inputs.iter().for_each(|&channels| description.extend(varint(channels)));
    description.extend(varint(nodes.len() as u64));
    description.extend(nodes.concat());
    description.extend([varint(1), varint(last as u64 + 1)].concat());
    Network { description, lengths }
}

/// Weights of these lengths: zeros, which take almost no bytes, or numbers whose products are subnormal.
fn weights(lengths: &[u64], random: &mut Random) -> Vec<u8> {
    let total: u64 = lengths.iter().sum();
    if total > 1 << 21 {
        return vec![0; 1 << 13];
    }
    let (value, precision) = match random.below(4) {
        0 => (1e-20, WeightPrecision::Bits(8)),
        1 => (2e-38, WeightPrecision::Step(f32::MIN_POSITIVE)),
        2 => (0.5, WeightPrecision::Bits(8)),
        _ => (0.0, WeightPrecision::Bits(8)),
    };
    let values: Vec<Vec<f32>> = lengths.iter().map(|&length| vec![value; length as usize]).collect();
    let tensors: Vec<_> = values.iter().map(|values| WeightTensor { name: "w", values, row: 16, precision }).collect();
    network_weights::encode("bomb", &tensors).map_or_else(|_| vec![0; 1 << 13], |encoded| encoded.bytes)
}

fn harmonics(parts: &mut Parts, count: u64, random: &mut Random) {
    let degree = 1 + random.below(3) as u64;
    let network = network(&[3], 6 * ((degree + 1) * (degree + 1) - 1), false, random);
    let weights = weights(&network.lengths, random);
    let mut payload = [varint(count), vec![degree as u8]].concat();
    payload.extend(0.02f32.to_le_bytes());
    payload.extend([vec![1], network.description, vec![0], varint(weights.len() as u64), weights].concat());
    payload.extend(vec![0; degree as usize]);
    parts.set(2, 3, 1, payload);
}

fn motion(parts: &mut Parts, random: &mut Random) {
    let network = network(&[1], 3, false, random);
    let mut lengths = network.lengths;
    let length = random.scale(1 << 19);
    lengths.push(length);
    let mut payload = b"\x06random\x01".to_vec();
    payload.extend([network.description, vec![2], vec![0], vec![1], vec![1, b't', 1], varint(length)].concat());
    payload.extend(weights(&lengths, random));
    parts.set(4, 1, 1, payload);
}

/// Context-coded planes of any size, whose sub-streams are empty: all symbols are the first of their table.
fn planes(parts: &mut Parts, random: &mut Random) {
    let widest = random.pick(&[4, 64, 4096]);
    let channels = random.scale(widest);
    let most = random.pick(&[1 << 4, 1 << 6, 1 << 8, 1 << 13]);
    let sides: [u64; 4] = std::array::from_fn(|_| 4 * random.scale(most));
    let scales = 1 + random.below(3) as u64;
    let mut payload = varint(channels);
    payload.extend(varint(scales));
    for _ in 0..scales {
        let multiplier = random.scale(4);
        payload.push(0b11_1111);
        sides[..3].iter().for_each(|side| payload.extend(varint(side * multiplier)));
        payload.extend(varint(sides[3]));
    }
    payload.push(1);
    let step = random.pick(&[0.1f32, 0.1, 0.1, 1e-17, 1e-17, 1e-38]);
    [step, 0.1].iter().for_each(|step| payload.extend(step.to_le_bytes()));

    // The first network is the distribution; the others are conditions that read the plane xy of the scale.
    let anchors = random.chance(3);
    let conditions = random.below(4);
    let outputs: Vec<u64> = (0..conditions).map(|_| random.scale(2 * channels)).collect();
    let mut read: Vec<u64> = outputs.clone();
    read.push(2 * channels);
    let pointwise = {
        let mut only = network(&read[read.len() - 1..], 2 * channels, false, random);
        if conditions > 0 {
            only = concatenation(&read, 2 * channels);
        }
        only
    };
    let mut networks = vec![pointwise];
    networks.extend(outputs.iter().map(|&outputs| network(&[channels], outputs, true, random)));
    let last = if anchors { checkerboard(channels) } else { network(&[channels], 2 * channels, true, random) };
    networks.push(last);
    if random.chance(4) {
        // Networks that nothing uses.
        networks.extend((0..random.below(28)).map(|_| network(&[1], 1, true, random)));
    }
    let mut model = varint(channels);
    model.extend([0; 8]);
    model.push(0);
    model.push(networks.len() as u8);
    networks.iter().for_each(|network| model.extend(&network.description));
    model.push(2);
    model.extend([0, conditions as u8 + 1]);
    model.extend(vec![0; conditions + 1]);
    model.extend([0, conditions as u8 + 1]);
    (0..conditions).for_each(|condition| model.extend([condition as u8 + 2, 0]));
    model.extend([conditions as u8 + 2, if anchors { 6 } else { 0 }]);
    model.extend(varint(6 * scales));
    model.extend([0, 1, 1, 1, 1, 1].repeat(scales as usize));
    let lengths: Vec<u64> = networks.iter().flat_map(|network| network.lengths.iter().copied()).collect();
    model.extend(weights(&lengths, random));
    parts.set(6, 1, 1, model);

    let streams = scales * (6 + if anchors { 5 } else { 0 });
    payload.extend(vec![0; streams as usize]);
    parts.set(5, 2, 1, payload);
    // Without motion nothing needs other features.
    parts.set(4, 1, 0, vec![0; 3]);
    if random.chance(2) {
        parts.set(2, 1, 0, vec![0, 0]);
        parts.set(1, 1, 0, vec![0; 4]);
    }
}

/// All inputs concatenated, and one linear layer.
fn concatenation(inputs: &[u64], outputs: u64) -> Network {
    let mut description = varint(inputs.len() as u64);
    inputs.iter().for_each(|&channels| description.extend(varint(channels)));
    description.extend([2, 13, inputs.len() as u8]);
    description.extend(0..inputs.len() as u8);
    description.extend([vec![0x80], varint(outputs), vec![1, inputs.len() as u8 + 1]].concat());
    Network { description, lengths: vec![inputs.iter().sum::<u64>() * outputs, outputs] }
}

/// The context from the anchors: one masked convolution of kernel 5, one group per channel.
fn checkerboard(channels: u64) -> Network {
    let mut description = [vec![1], varint(channels), vec![1, 4, 0], varint(2 * channels), vec![5]].concat();
    description.extend([varint(channels), vec![1, 1]].concat());
    Network { description, lengths: vec![2 * channels * 12, 2 * channels] }
}
