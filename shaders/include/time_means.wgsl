// Sizes of two planes over time, and the weight of a time in the mean of each.

struct Parameters {
    channels: u32,
    a_length: u32,
    b_length: u32,
    unused: u32,
    a_times: u32,
    b_times: u32,
    a_share: f32,
    b_share: f32,
}
