// The attributes whose numbers have densities, as consecutive channels. The uniform of a kernel, `parameters`, has them as
// `attributes`.

struct Attributes {
    // Of each attribute: its first channel, its channels, the place of its step. One that does not exist has no channels.
    rows: array<vec4<u32>, MOST_ATTRIBUTES>,
}

// The attribute of a channel.
fn attribute_of(channel: u32) -> vec4<u32> {
    var found = parameters.attributes.rows[0];
    for (var k = 1u; k < MOST_ATTRIBUTES; k++) {
        let next = parameters.attributes.rows[k];
        if (next.y > 0u && next.x <= channel) {
            found = next;
        }
    }
    return found;
}
