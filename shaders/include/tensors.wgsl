// Several tensors in one buffer. The uniform of a kernel, `tensors`, has their number as `count`, and as the first word of
// `places` where each begins.

// The last tensor that does not begin behind this place.
fn tensor_at(place: u32) -> u32 {
    var tensor = 0u;
    var behind = tensors.count;
    while (behind - tensor > 1u) {
        let middle = (tensor + behind) / 2u;
        if (tensors.places[middle].x <= place) {
            tensor = middle;
        } else {
            behind = middle;
        }
    }
    return tensor;
}
