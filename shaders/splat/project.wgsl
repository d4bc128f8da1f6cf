// Projects every Gaussian to the screen, with its color as the camera sees it, and counts the cells that it touches.
//
// Each invocation computes one Gaussian. It reads its attributes, and writes to `projected`: the four vectors of its splat, behind
// those of all its key in the order of depths, and behind these its radius. Depths are positive, so their bits have the
// same order, and less those of the nearest depth they fit into DEPTH_BITS, which is fewer digits to sort: all up to 4e9 times the
// nearest, beyond which all count as equally far. A Gaussian without cells has the largest key.

// #include exponential, activation, scale_and_opacity, arithmetic, view, splat, quaternion, covariance, spherical_harmonics

@group(0) @binding(0) var<storage, read_write> means: array<f32>;
@group(0) @binding(1) var<storage, read_write> quats: array<f32>;
@group(0) @binding(2) var<storage, read_write> scales: array<f32>;
@group(0) @binding(3) var<storage, read_write> opacities: array<f32>;
@group(0) @binding(4) var<storage, read_write> screen_offsets: array<f32>;
@group(0) @binding(5) var<storage, read_write> sh_dc: array<f32>;
@group(0) @binding(6) var<storage, read_write> sh_rest: array<f32>;
@group(0) @binding(7) var<storage, read_write> projected: array<vec4<u32>>;
@group(0) @binding(8) var<uniform> view: View;

const NO_DEPTH: u32 = (1u << DEPTH_BITS) - 1u;

fn write_vector(i: u32, k: u32, vector: vec4<f32>) {
    projected[4u * i + k] = bitcast<vec4<u32>>(vector);
}

// Size of an array of `count` vectors, rounded up so that the next array can be bound behind it.
fn aligned(count: u32) -> u32 {
    return (count + ALIGNMENT / 4u - 1u) / (ALIGNMENT / 4u) * (ALIGNMENT / 4u);
}

fn write_key_and_radius(i: u32, key: u32, radius: i32) {
    let keys = aligned(4u * view.counts.x);
    let radii = keys + aligned((view.counts.x + 3u) / 4u);
    projected[keys + i / 4u][i % 4u] = key;
    projected[radii + i / 4u][i % 4u] = bitcast<u32>(radius);
}

fn write_nothing(i: u32, radius: i32) {
    write_vector(i, 0u, vec4<f32>(0.0));
    write_vector(i, 1u, vec4<f32>(0.0));
    write_vector(i, 3u, vec4<f32>(0.0));
    write_key_and_radius(i, NO_DEPTH, radius);
}

// Color, not below zero, and a number: 1, 2, 4 for a channel that was clamped, 8 for a color that is not finite.
fn color_of(i: u32, mean: vec3<f32>) -> vec4<f32> {
    let basis = harmonics(direction_of(mean - view.center.xyz));
    var color = basis[0] * vec3<f32>(sh_dc[3u * i], sh_dc[3u * i + 1u], sh_dc[3u * i + 2u]) + 0.5;
    let used = coefficient_count(view.counts.y);
    let first = 3u * view.counts.z * i;
    for (var k = 1u; k < 16u; k++) {
        if (k < used) {
            let at = first + 3u * (k - 1u);
            color += basis[k] * vec3<f32>(sh_rest[at], sh_rest[at + 1u], sh_rest[at + 2u]);
        }
    }
    var state = select(0.0, 1.0, color.x < 0.0) + select(0.0, 2.0, color.y < 0.0) + select(0.0, 4.0, color.z < 0.0);
    if (!is_finite3(color)) {
        state = 8.0;
    }
    return vec4<f32>(max(color, vec3<f32>(0.0)), state);
}

fn count_cells(splat: Splat) -> u32 {
    if (splat.reach < 0.0) {
        return 0u;
    }
    let rectangle = cell_rectangle(splat);
    if (any(rectangle.low >= rectangle.high)) {
        return 0u;
    }
    var count = 0u;
    var column = rectangle.low.x;
    var row = rectangle.low.y;
    while (row < rectangle.high.y) {
        count += select(0u, 1u, reaches(splat, column, row));
        column += 1u;
        if (column == rectangle.high.x) {
            column = rectangle.low.x;
            row += 1u;
        }
    }
    return count;
}

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = flat_group(group, groups) * WORKGROUP + lane;
    if (i >= view.counts.x) {
        return;
    }
    let mean = vec3<f32>(means[3u * i], means[3u * i + 1u], means[3u * i + 2u]);
    let scale = scale_of(vec3<f32>(scales[3u * i], scales[3u * i + 1u], scales[3u * i + 2u]));
    let quat = vec4<f32>(quats[4u * i], quats[4u * i + 1u], quats[4u * i + 2u], quats[4u * i + 3u]);
    let screen_offset = vec2<f32>(screen_offsets[2u * i], screen_offsets[2u * i + 1u]);
    let opacity = opacity_of(opacities[i]);
    let color = color_of(i, mean);
    write_vector(i, 2u, color);
    let g = geometry_of(mean, quat, scale);
    let position = g.position;
    let attributes_finite = is_finite3(mean) && is_finite3(scale) && is_finite3(quat.xyz) && is_finite(quat.w)
        && is_finite(screen_offset.x) && is_finite(screen_offset.y) && is_finite(opacity);
    if (!(attributes_finite && is_finite(g.quat_norm) && g.quat_norm > 1e-12 && is_finite3(position))
        || color.w == 8.0) {
        write_nothing(i, INVALID_RADIUS);
        return;
    }
    if (position.z <= NEAR) {
        write_nothing(i, 0);
        return;
    }

    let xx = dot3(g.factor_x, g.factor_x) + DILATION;
    let xy = dot3(g.factor_x, g.factor_y);
    let yy = dot3(g.factor_y, g.factor_y) + DILATION;
    let determinant = xx * yy - xy * xy;
    if (!is_finite(determinant)) {
        write_nothing(i, INVALID_RADIUS);
        return;
    }
    if (determinant <= 0.0) {
        write_nothing(i, 0);
        return;
    }
    let middle = 0.5 * (xx + yy);
    let largest = middle + sqrt(max(middle * middle - determinant, 0.1));
    let radius = ceil(3.0 * sqrt(largest));
    let offset = screen_offset * (0.5 * vec2<f32>(view.size.xy));
    let x = view.axis_x.w * position.x / position.z + view.axis_z.w - 0.5 + offset.x;
    let y = view.axis_y.w * position.y / position.z + view.translation.w - 0.5 + offset.y;
    if (!(is_finite(x) && is_finite(y) && is_finite(radius))) {
        write_nothing(i, INVALID_RADIUS);
        return;
    }

    var splat: Splat;
    splat.position = vec2<f32>(x, y);
    splat.depth = position.z;
    splat.opacity = opacity;
    splat.conic = vec3<f32>(yy / determinant, -xy / determinant, xx / determinant);
    splat.reach = -1.0;
    if (opacity >= MIN_ALPHA) {
        splat.reach = 2.0 * log(opacity / MIN_ALPHA);
    }
    splat.variance = vec2<f32>(xx, yy);
    splat.radius = radius;
    let tiles = tile_rectangle(splat.position, radius);
    if (any(tiles.low >= tiles.high)) {
        write_nothing(i, 0);
        return;
    }
    let count = count_cells(splat);
    write_vector(i, 0u, vec4<f32>(x, y, position.z, opacity));
    write_vector(i, 1u, vec4<f32>(splat.conic, splat.reach));
    write_vector(i, 3u, vec4<f32>(splat.variance, radius, f32(count)));
    let key = select(min(bitcast<u32>(position.z) - NEAR_BITS, NO_DEPTH - 1u), NO_DEPTH, count == 0u);
    // Larger radii become 2^31 - 1, the largest integer.
    let whole = select(i32(min(radius, 2147483520.0)), 2147483647, radius >= 2147483648.0);
    write_key_and_radius(i, key, whole);
}
