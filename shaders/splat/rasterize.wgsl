// Blends the splats of every cell, front to back.
//
// A team (one workgroup) owns one cell of CELL × CELL pixels; an invocation owns PIXELS of them, in one column. The
// team fetches TEAM splats at a time, one for each member, and each member then blends all of them. For each pixel:
//
//   alpha = min(0.99, opacity · exp(-q)),  skipped below 1/255
//   stop before the splat that would take the transmittance T below 1e-4
//   color += T · alpha · color_i,  depth += T · alpha · z_i,  T *= 1 - alpha
//
// Reads the cell's range in `order` (the numbers of intersections by cell) and `gaussians` (their Gaussians). Writes
// `rendering`: color over the background [H, W, 3], then alpha [H, W], then depth [H, W]. Between two chunks of a list
// (see `chunk_of`) the image holds the sums so far, and, in place of alpha, T, which is negative where the pixel has
// stopped.

// #include arithmetic, view, pixels, footprint

@group(0) @binding(0) var<storage, read_write> starts: array<u32>;
@group(0) @binding(1) var<storage, read_write> order: array<u32>;
@group(0) @binding(2) var<storage, read_write> gaussians: array<u32>;
@group(0) @binding(3) var<storage, read_write> splats: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> rendering: array<f32>;
@group(0) @binding(5) var<uniform> view: View;

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
    var red: array<vec4<f32>, QUADS>;
    var green: array<vec4<f32>, QUADS>;
    var blue: array<vec4<f32>, QUADS>;
    var depth: array<vec4<f32>, QUADS>;
    for (var k = 0u; k < PIXELS; k++) {
        let inside = in_image(own, k);
        transmittance[k / 4u][k % 4u] = select(-1.0, 1.0, inside);
        if (view.cells.z > 0u && inside) {
            let at = pixel_index(own, k);
            red[k / 4u][k % 4u] = rendering[3u * at];
            green[k / 4u][k % 4u] = rendering[3u * at + 1u];
            blue[k / 4u][k % 4u] = rendering[3u * at + 2u];
            transmittance[k / 4u][k % 4u] = rendering[view.pixels.x + at];
            depth[k / 4u][k % 4u] = rendering[view.pixels.y + at];
        }
    }

    for (var batch = chunk.x; batch < chunk.y; batch += TEAM) {
        var open = transmittance[0] > vec4<f32>(0.0);
        for (var quad = 1u; quad < QUADS; quad++) {
            open = open | (transmittance[quad] > vec4<f32>(0.0));
        }
        if (!team_any(any(open), lane)) {
            break;
        }
        let mine = 4u * gaussians[order[min(batch + lane, chunk.y - 1u)]];
        team_share(splats[mine], splats[mine + 1u], splats[mine + 2u], lane);
        let size = min(TEAM, chunk.y - batch);
        for (var member = 0u; member < size; member++) {
            let center = team_read(0u, member);
            let conic = team_read(1u, member).xyz;
            let color = team_read(2u, member).xyz;
            for (var quad = 0u; quad < QUADS; quad++) {
                let f = footprint(conic, center.w, center.x - x, center.y - quad_rows(own, quad));
                let t = transmittance[quad];
                let after = t - t * f.alpha;
                let taken = f.hit & (after >= vec4<f32>(MIN_TRANSMITTANCE));
                let weight = select(vec4<f32>(0.0), t * f.alpha, taken);
                red[quad] += weight * color.x;
                green[quad] += weight * color.y;
                blue[quad] += weight * color.z;
                depth[quad] += weight * center.z;
                transmittance[quad] = select(t, select(-abs(t), after, taken), f.hit);
            }
        }
    }

    for (var k = 0u; k < PIXELS; k++) {
        if (in_image(own, k)) {
            let at = pixel_index(own, k);
            var rgb = vec3<f32>(red[k / 4u][k % 4u], green[k / 4u][k % 4u], blue[k / 4u][k % 4u]);
            var alpha = transmittance[k / 4u][k % 4u];
            if (view.cells.w == 1u) {
                rgb += abs(alpha) * view.background.xyz;
                alpha = 1.0 - abs(alpha);
            }
            rendering[3u * at] = rgb.x;
            rendering[3u * at + 1u] = rgb.y;
            rendering[3u * at + 2u] = rgb.z;
            rendering[view.pixels.x + at] = alpha;
            rendering[view.pixels.y + at] = depth[k / 4u][k % 4u];
        }
    }
}
