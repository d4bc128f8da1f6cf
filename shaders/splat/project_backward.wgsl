// Adds up every Gaussian's sums over its cells, and computes from these the gradients of its attributes, through the
// projection.
//
// Each invocation computes one Gaussian. It reads its attributes, its splat, and the sums of its intersections, which
// begin at ten times `first_of_gaussian`, and adds them in their order, so that the result is the same in every run.
// Every gradient is written once: `gradients` holds those of means [N, 3], quats [N, 4], scales [N, 3], opacities [N],
// sh_dc [N, 3], sh_rest [N, K, 3] and screen offsets [N, 2], at the places in `places`.

// #include exponential, activation, scale_and_opacity, arithmetic, view, quaternion, covariance, spherical_harmonics

struct Places {
    // means, quats, scales, opacities
    a: vec4<u32>,
    // sh_dc, sh_rest, screen offsets
    b: vec4<u32>,
}

struct Parameters {
    view: View,
    places: Places,
}

@group(0) @binding(0) var<storage, read_write> means: array<f32>;
@group(0) @binding(1) var<storage, read_write> quats: array<f32>;
@group(0) @binding(2) var<storage, read_write> scales: array<f32>;
@group(0) @binding(3) var<storage, read_write> sh_rest: array<f32>;
@group(0) @binding(4) var<storage, read_write> splats: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> first_of_gaussian: array<u32>;
@group(0) @binding(6) var<storage, read_write> sums: array<f32>;
@group(0) @binding(7) var<storage, read_write> gradients: array<f32>;
@group(0) @binding(8) var<uniform> parameters: Parameters;

var<private> view: View;

// From the gradient by a scale; 0 where the bound was reached, which BOUND_REACHED has the bits of.
fn by_place_of_scale(upstream: vec3<f32>, scale: vec3<f32>) -> vec3<f32> {
    if (LOGARITHMS == 0u) {
        return upstream;
    }
    return select(upstream * scale, vec3<f32>(0.0), scale >= vec3<f32>(bitcast<f32>(BOUND_REACHED)));
}

// From the gradient by an opacity.
fn by_place_of_opacity(upstream: f32, opacity: f32) -> f32 {
    if (LOGARITHMS == 0u) {
        return upstream;
    }
    return upstream * (opacity * (1.0 - opacity));
}

fn write3(at: u32, value: vec3<f32>) {
    gradients[at] = value.x;
    gradients[at + 1u] = value.y;
    gradients[at + 2u] = value.z;
}

// Gradients of the harmonics, and the gradient of the mean through the viewing direction.
fn color_backward(i: u32, mean: vec3<f32>, upstream: vec3<f32>, state: u32) -> vec3<f32> {
    let offset = mean - view.center.xyz;
    let distance = sqrt(dot3(offset, offset));
    let direction = direction_of(offset);
    let basis = harmonics(direction);
    let clamped = (vec3<u32>(state) & vec3<u32>(1u, 2u, 4u)) != vec3<u32>(0u);
    let d_color = select(upstream, vec3<f32>(0.0), clamped);
    write3(parameters.places.b.x + 3u * i, basis[0] * d_color);
    let slopes = harmonics_gradient(direction);
    let used = coefficient_count(view.counts.y);
    let rest = view.counts.z;
    var d_direction = vec3<f32>(0.0);
    for (var k = 1u; k < 16u; k++) {
        let at = 3u * (rest * i + k - 1u);
        if (k < used) {
            write3(parameters.places.b.y + at, basis[k] * d_color);
            d_direction += slopes[k] * dot3(d_color, vec3<f32>(sh_rest[at], sh_rest[at + 1u], sh_rest[at + 2u]));
        }
    }
    for (var k = used; k <= rest; k++) {
        write3(parameters.places.b.y + 3u * (rest * i + k - 1u), vec3<f32>(0.0));
    }
    if (view.counts.y == 0u || distance == 0.0) {
        return vec3<f32>(0.0);
    }
    return (d_direction - direction * dot3(direction, d_direction)) / distance;
}

fn write_nothing(i: u32) {
    write3(parameters.places.a.x + 3u * i, vec3<f32>(0.0));
    for (var k = 0u; k < 4u; k++) {
        gradients[parameters.places.a.y + 4u * i + k] = 0.0;
    }
    write3(parameters.places.a.z + 3u * i, vec3<f32>(0.0));
    gradients[parameters.places.a.w + i] = 0.0;
    write3(parameters.places.b.x + 3u * i, vec3<f32>(0.0));
    for (var k = 0u; k < 3u * view.counts.z; k++) {
        gradients[parameters.places.b.y + 3u * view.counts.z * i + k] = 0.0;
    }
    gradients[parameters.places.b.z + 2u * i] = 0.0;
    gradients[parameters.places.b.z + 2u * i + 1u] = 0.0;
}

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    view = parameters.view;
    let i = flat_group(group, groups) * WORKGROUP + lane;
    if (i >= view.counts.x) {
        return;
    }
    let count = u32(splats[4u * i + 3u].w);
    if (count == 0u) {
        write_nothing(i);
        return;
    }
    var linear = vec4<f32>(0.0);
    var moments = vec4<f32>(0.0);
    var moments_y = vec2<f32>(0.0);
    var at = 10u * first_of_gaussian[i];
    for (var k = 0u; k < count; k++) {
        linear += vec4<f32>(sums[at], sums[at + 1u], sums[at + 2u], sums[at + 3u]);
        moments += vec4<f32>(sums[at + 4u], sums[at + 5u], sums[at + 6u], sums[at + 7u]);
        moments_y += vec2<f32>(sums[at + 8u], sums[at + 9u]);
        at += 10u;
    }
    let conic = splats[4u * i + 1u].xyz;
    let opacity = splats[4u * i].w;
    // p is the gradient of the exponent -(a dx² + c dy²)/2 - b dx dy, and alpha is proportional to the opacity.
    let d_position = vec2<f32>(
        -conic.x * moments.y - conic.y * moments.z,
        -conic.y * moments.y - conic.z * moments.z,
    );
    let d_conic = vec3<f32>(-0.5 * moments.w, -moments_y.x, -0.5 * moments_y.y);
    gradients[parameters.places.a.w + i] = by_place_of_opacity(moments.x / opacity, opacity);
    let d_offset = d_position * (0.5 * vec2<f32>(view.size.xy));
    gradients[parameters.places.b.z + 2u * i] = d_offset.x;
    gradients[parameters.places.b.z + 2u * i + 1u] = d_offset.y;

    let mean = vec3<f32>(means[3u * i], means[3u * i + 1u], means[3u * i + 2u]);
    let scale = scale_of(vec3<f32>(scales[3u * i], scales[3u * i + 1u], scales[3u * i + 2u]));
    let raw_quat = vec4<f32>(quats[4u * i], quats[4u * i + 1u], quats[4u * i + 2u], quats[4u * i + 3u]);
    let g = geometry_of(mean, raw_quat, scale);

    // From the conic to the covariance: d(inverse) = -Q dC Q.
    let half_gb = 0.5 * d_conic.y;
    let m00 = d_conic.x * conic.x + half_gb * conic.y;
    let m01 = d_conic.x * conic.y + half_gb * conic.z;
    let m10 = half_gb * conic.x + d_conic.z * conic.y;
    let m11 = half_gb * conic.y + d_conic.z * conic.z;
    let g_xx = -(conic.x * m00 + conic.y * m10);
    let g_xy = -(conic.x * m01 + conic.y * m11) - (conic.y * m00 + conic.z * m10);
    let g_yy = -(conic.y * m01 + conic.z * m11);

    // From the covariance to its factor V = (J W) (R S), two rows.
    let d_factor_x = 2.0 * g_xx * g.factor_x + g_xy * g.factor_y;
    let d_factor_y = g_xy * g.factor_x + 2.0 * g_yy * g.factor_y;
    // d(RS) = (J W)^T dV: column j is the sum over rows of row · dV_j.
    let d_rs_x = g.row_x * d_factor_x.x + g.row_y * d_factor_y.x;
    let d_rs_y = g.row_x * d_factor_x.y + g.row_y * d_factor_y.y;
    let d_rs_z = g.row_x * d_factor_x.z + g.row_y * d_factor_y.z;
    let d_scale =
        vec3<f32>(dot3(d_rs_x, g.rotation.axis_x), dot3(d_rs_y, g.rotation.axis_y), dot3(d_rs_z, g.rotation.axis_z));
    write3(parameters.places.a.z + 3u * i, by_place_of_scale(d_scale, scale));
    let d_quat =
        rotation_backward(g.quat, g.quat_norm, d_rs_x * g.scale.x, d_rs_y * g.scale.y, d_rs_z * g.scale.z);
    for (var k = 0u; k < 4u; k++) {
        gradients[parameters.places.a.y + 4u * i + k] = d_quat[k];
    }
    // d(J W) = dV (R S)^T
    let scaled_x = d_factor_x * g.scale;
    let scaled_y = d_factor_y * g.scale;
    let d_row_x = g.rotation.axis_x * scaled_x.x + g.rotation.axis_y * scaled_x.y + g.rotation.axis_z * scaled_x.z;
    let d_row_y = g.rotation.axis_x * scaled_y.x + g.rotation.axis_y * scaled_y.y + g.rotation.axis_z * scaled_y.z;

    // From J W to the view position, with J the projection's Jacobian at the clamped slope.
    let inverse_z = 1.0 / g.position.z;
    let focal = vec2<f32>(view.axis_x.w, view.axis_y.w);
    let forward = world_row(2u);
    let along_rows = vec2<f32>(
        dot3(d_row_x, world_row(0u) - g.slope.x * forward),
        dot3(d_row_y, world_row(1u) - g.slope.y * forward),
    );
    let along_forward = vec2<f32>(dot3(d_row_x, forward), dot3(d_row_y, forward));
    let d_slope = select(-along_forward * focal * inverse_z, vec2<f32>(0.0), g.slope_clamped);
    // From the center on the screen.
    let d_pixel = d_position * focal * inverse_z;
    let d_view_xy = d_slope * inverse_z + d_pixel;
    let d_view_z = -along_rows * focal * inverse_z * inverse_z - d_slope * g.position.xy * inverse_z * inverse_z
        - d_pixel * g.position.xy * inverse_z;
    let d_view = vec3<f32>(d_view_xy, d_view_z.x + d_view_z.y + linear.w);
    var d_mean = world_row(0u) * d_view.x + world_row(1u) * d_view.y + world_row(2u) * d_view.z;
    d_mean += color_backward(i, mean, linear.xyz, u32(splats[4u * i + 2u].w));
    write3(parameters.places.a.x + 3u * i, d_mean);
}
