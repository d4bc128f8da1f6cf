// Color of every Gaussian from its spherical harmonics, seen from the camera.
//
// Each invocation computes one Gaussian. It reads means, sh_dc and sh_rest, and writes vector 2 of its splat: the
// color, not below zero, and a number: 1, 2, 4 for a channel that was clamped, 8 for a color that is not finite.

@group(0) @binding(0) var<storage, read_write> means: array<f32>;
@group(0) @binding(1) var<storage, read_write> sh_dc: array<f32>;
@group(0) @binding(2) var<storage, read_write> sh_rest: array<f32>;
@group(0) @binding(3) var<storage, read_write> splats: array<vec4<f32>>;
@group(0) @binding(4) var<uniform> view: View;

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
    splats[4u * i + 2u] = vec4<f32>(max(color, vec3<f32>(0.0)), state);
}
