// The layers of a deformation network, as the host describes them.

const MOST_LAYERS: u32 = 16u;
// A vector has a channel's numbers of four successive rows.
const QUADS: u32 = ROWS / 4u;

struct Network {
    rows: u32,
    // Numbers in a row of features.
    features: u32,
    // Numbers in a row of the network's output.
    outputs: u32,
    // Numbers in a row of the outputs of all hidden layers.
    hidden: u32,
    layers: u32,
    // Two more numbers that each kernel explains.
    first: u32,
    second: u32,
    // Of each layer: its inputs and outputs, and where its weights and its biases begin.
    sizes: array<vec4<u32>, MOST_LAYERS>,
    // Of each layer: four numbers that each kernel explains.
    places: array<vec4<u32>, MOST_LAYERS>,
}
