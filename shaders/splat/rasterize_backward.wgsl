// Derivative of the blending with respect to every splat, front to back like the forward pass.
//
// With v_i the splat's color and depth weighted by the upstream gradient, the pixel's value is S = sum_i w_i v_i +
// T_end · v_background, and dS/dalpha_i = T_i v_i - (S - sum_{j<=i} w_j v_j) / (1 - alpha_i). S is known from the
// finished image, so a running remainder is enough.
//
// Teams, cells and pixels are as in `rasterize.wgsl`. Also reads the finished image and `upstream`, its gradient, in
// the same layout; only that of the color if COLOR_ALONE is 1. For each of its intersections it writes ten sums over the cell's pixels, at ten times the
// intersection's number: gradients of red, green, blue and depth, then the moments of p = alpha · dS/dalpha: p, p dx, p
// dy, p dx², p dx dy, p dy². No other invocation writes there, so the sums do not depend on any order. Between two
// chunks of a list, `carried` holds T and the remainder of every pixel.

// #include arithmetic, view, pixels, footprint

@group(0) @binding(0) var<storage, read_write> starts: array<u32>;
@group(0) @binding(1) var<storage, read_write> order: array<u32>;
@group(0) @binding(2) var<storage, read_write> gaussians: array<u32>;
@group(0) @binding(3) var<storage, read_write> splats: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> rendering: array<f32>;
@group(0) @binding(5) var<storage, read_write> upstream: array<f32>;
@group(0) @binding(6) var<storage, read_write> sums: array<f32>;
@group(0) @binding(7) var<storage, read_write> carried: array<f32>;
@group(0) @binding(8) var<uniform> view: View;

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
    let pixel_count = view.size.x * view.size.y;
    let x = f32(own.x);

    // T, negative once the pixel has stopped; the remainder of S; the gradients of the pixel's values.
    var transmittance: array<vec4<f32>, QUADS>;
    var left: array<vec4<f32>, QUADS>;
    var up_red: array<vec4<f32>, QUADS>;
    var up_green: array<vec4<f32>, QUADS>;
    var up_blue: array<vec4<f32>, QUADS>;
    var up_depth: array<vec4<f32>, QUADS>;
    for (var k = 0u; k < PIXELS; k++) {
        let quad = k / 4u;
        let place_in_quad = k % 4u;
        transmittance[quad][place_in_quad] = -1.0;
        if (in_image(own, k)) {
            let at = pixel_index(own, k);
            let rgb = vec3<f32>(upstream[3u * at], upstream[3u * at + 1u], upstream[3u * at + 2u]);
            var up_alpha = 0.0;
            var up_z = 0.0;
            if (COLOR_ALONE == 0u) {
                up_alpha = upstream[view.pixels.x + at];
                up_z = upstream[view.pixels.y + at];
            }
            up_red[quad][place_in_quad] = rgb.x;
            up_green[quad][place_in_quad] = rgb.y;
            up_blue[quad][place_in_quad] = rgb.z;
            up_depth[quad][place_in_quad] = up_z;
            if (view.cells.z > 0u) {
                transmittance[quad][place_in_quad] = carried[at];
                left[quad][place_in_quad] = carried[pixel_count + at];
            } else {
                transmittance[quad][place_in_quad] = 1.0;
                let color = vec3<f32>(rendering[3u * at], rendering[3u * at + 1u], rendering[3u * at + 2u]);
                // The background's value; alpha is 1 - T, hence the minus.
                left[quad][place_in_quad] = dot3(color, rgb) + rendering[view.pixels.y + at] * up_z
                    - (1.0 - rendering[view.pixels.x + at]) * up_alpha;
            }
        }
    }

    for (var batch = chunk.x; batch < chunk.y; batch += TEAM) {
        var open = transmittance[0] > vec4<f32>(0.0);
        for (var quad = 1u; quad < QUADS; quad++) {
            open = open | (transmittance[quad] > vec4<f32>(0.0));
        }
        let size = min(TEAM, chunk.y - batch);
        let number = order[batch + min(lane, size - 1u)];
        // The sums of the member's own splat: red, green, blue, depth; p, p dx, p dy, p dx²; p dx dy, p dy².
        var linear = vec4<f32>(0.0);
        var moments = vec4<f32>(0.0);
        var moments_y = vec4<f32>(0.0);
        if (team_any(any(open), lane)) {
            let mine = 4u * gaussians[number];
            team_share(splats[mine], splats[mine + 1u], splats[mine + 2u], lane);
            for (var member = 0u; member < size; member++) {
                let center = team_read(0u, member);
                let conic = team_read(1u, member).xyz;
                let color = team_read(2u, member).xyz;
                let dx = center.x - x;
                var sum_red = vec4<f32>(0.0);
                var sum_green = vec4<f32>(0.0);
                var sum_blue = vec4<f32>(0.0);
                var sum_depth = vec4<f32>(0.0);
                var sum_p = vec4<f32>(0.0);
                var sum_py = vec4<f32>(0.0);
                var sum_pyy = vec4<f32>(0.0);
                for (var quad = 0u; quad < QUADS; quad++) {
                    let dy = center.y - quad_rows(own, quad);
                    let f = footprint(conic, center.w, dx, dy);
                    let t = transmittance[quad];
                    let after = t - t * f.alpha;
                    let taken = f.hit & (after >= vec4<f32>(MIN_TRANSMITTANCE));
                    transmittance[quad] = select(t, select(-abs(t), after, taken), f.hit);
                    let weight = select(vec4<f32>(0.0), t * f.alpha, taken);
                    sum_red += weight * up_red[quad];
                    sum_green += weight * up_green[quad];
                    sum_blue += weight * up_blue[quad];
                    sum_depth += weight * up_depth[quad];
                    let value = weight * (color.x * up_red[quad] + color.y * up_green[quad] + color.z * up_blue[quad]
                        + center.z * up_depth[quad]);
                    left[quad] -= value;
                    // alpha · dS/dalpha, with alpha folded into the weight.
                    let behind = f.alpha * left[quad] / (1.0 - f.alpha);
                    let p = select(vec4<f32>(0.0), value - behind, taken & f.free);
                    let py = p * dy;
                    sum_p += p;
                    sum_py += py;
                    sum_pyy += py * dy;
                }
                let p = total(sum_p);
                let px = p * dx;
                let py = total(sum_py);
                let all_linear =
                    team_sum(vec4<f32>(total(sum_red), total(sum_green), total(sum_blue), total(sum_depth)), lane);
                let all_moments = team_sum(vec4<f32>(p, px, py, px * dx), lane);
                let all_moments_y = team_sum(vec4<f32>(py * dx, total(sum_pyy), 0.0, 0.0), lane);
                let is_mine = lane == member;
                linear = select(linear, all_linear, is_mine);
                moments = select(moments, all_moments, is_mine);
                moments_y = select(moments_y, all_moments_y, is_mine);
            }
        }
        if (lane < size) {
            let at = 10u * number;
            sums[at] = linear.x;
            sums[at + 1u] = linear.y;
            sums[at + 2u] = linear.z;
            sums[at + 3u] = linear.w;
            sums[at + 4u] = moments.x;
            sums[at + 5u] = moments.y;
            sums[at + 6u] = moments.z;
            sums[at + 7u] = moments.w;
            sums[at + 8u] = moments_y.x;
            sums[at + 9u] = moments_y.y;
        }
    }

    if (view.cells.w == 0u) {
        for (var k = 0u; k < PIXELS; k++) {
            if (in_image(own, k)) {
                let at = pixel_index(own, k);
                carried[at] = transmittance[k / 4u][k % 4u];
                carried[pixel_count + at] = left[k / 4u][k % 4u];
            }
        }
    }
}
