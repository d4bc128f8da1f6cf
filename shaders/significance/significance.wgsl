// The contributions of every splat to one image, without its color: the sums for significance pruning (paper III-B).
//
// Teams, cells, pixels and decisions are as in `rasterize.wgsl`. For each of its intersections it writes three sums
// over the cell's pixels, at three times the intersection's number: the pixels that blend the splat, T · alpha, and T,
// with T the transmittance before the splat. No other invocation writes there, so the sums do not depend on any order.
// Between two chunks of a list, `carried` holds T of every pixel, negative where it has stopped.

// #include arithmetic, view, pixels, footprint

@group(0) @binding(0) var<storage, read_write> starts: array<u32>;
@group(0) @binding(1) var<storage, read_write> order: array<u32>;
@group(0) @binding(2) var<storage, read_write> gaussians: array<u32>;
@group(0) @binding(3) var<storage, read_write> splats: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> sums: array<f32>;
@group(0) @binding(5) var<storage, read_write> carried: array<f32>;
@group(0) @binding(6) var<uniform> view: View;

fn total(v: vec4<f32>) -> f32 {
    return (v.x + v.y) + (v.z + v.w);
}

@compute @workgroup_size(TEAM)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let cell = flat_group(group, groups);
    if (cell >= view.cells.x * view.cells.y) {
        return;
    }
    let own = own_pixels(cell, lane);
    let chunk = chunk_of(team_uniform(starts[cell], lane), team_uniform(starts[cell + 1u], lane));
    let x = f32(own.x);

    // T, negative once the pixel has stopped.
    var transmittance: array<vec4<f32>, QUADS>;
    for (var k = 0u; k < PIXELS; k++) {
        var before = -1.0;
        if (in_image(own, k)) {
            before = 1.0;
            if (view.cells.z > 0u) {
                before = carried[pixel_index(own, k)];
            }
        }
        transmittance[k / 4u][k % 4u] = before;
    }

    for (var batch = chunk.x; batch < chunk.y; batch += TEAM) {
        var open = transmittance[0] > vec4<f32>(0.0);
        for (var quad = 1u; quad < QUADS; quad++) {
            open = open | (transmittance[quad] > vec4<f32>(0.0));
        }
        let size = min(TEAM, chunk.y - batch);
        let number = order[batch + min(lane, size - 1u)];
        // The sums of the member's own splat.
        var own_sums = vec4<f32>(0.0);
        if (team_any(any(open), lane)) {
            let mine = 4u * gaussians[number];
            team_share(splats[mine], splats[mine + 1u], vec4<f32>(0.0), lane);
            for (var member = 0u; member < size; member++) {
                let center = team_read(0u, member);
                let conic = team_read(1u, member).xyz;
                var pixels = vec4<f32>(0.0);
                var weights = vec4<f32>(0.0);
                var transmittances = vec4<f32>(0.0);
                for (var quad = 0u; quad < QUADS; quad++) {
                    let f = footprint(conic, center.w, center.x - x, center.y - quad_rows(own, quad));
                    let t = transmittance[quad];
                    let weight = t * f.alpha;
                    let after = t - weight;
                    let taken = f.hit & (after >= vec4<f32>(MIN_TRANSMITTANCE));
                    transmittance[quad] = select(t, select(-abs(t), after, taken), f.hit);
                    pixels += select(vec4<f32>(0.0), vec4<f32>(1.0), taken);
                    weights += select(vec4<f32>(0.0), weight, taken);
                    transmittances += select(vec4<f32>(0.0), t, taken);
                }
                let all = team_sum(vec4<f32>(total(pixels), total(weights), total(transmittances), 0.0), lane);
                own_sums = select(own_sums, all, lane == member);
            }
        }
        if (lane < size) {
            sums[3u * number] = own_sums.x;
            sums[3u * number + 1u] = own_sums.y;
            sums[3u * number + 2u] = own_sums.z;
        }
    }

    if (view.cells.w == 0u) {
        for (var k = 0u; k < PIXELS; k++) {
            if (in_image(own, k)) {
                carried[pixel_index(own, k)] = transmittance[k / 4u][k % 4u];
            }
        }
    }
}
