// Real spherical harmonics up to degree 3 and their derivatives, with the signs of the original 3DGS code.

const C0: f32 = 0.2820948;
const C1: f32 = 0.4886025;
const C2_0: f32 = 1.0925484;
const C2_2: f32 = 0.31539157;
const C2_4: f32 = 0.5462742;
const C3_0: f32 = 0.5900436;
const C3_1: f32 = 2.8906114;
const C3_2: f32 = 0.4570458;
const C3_3: f32 = 0.37317634;
const C3_5: f32 = 1.4453057;

fn coefficient_count(degree: u32) -> u32 {
    return (degree + 1u) * (degree + 1u);
}

// Values at a unit direction, for all degrees; the caller uses those up to the active one.
fn harmonics(d: vec3<f32>) -> array<f32, 16> {
    let x = d.x;
    let y = d.y;
    let z = d.z;
    let xx = x * x;
    let yy = y * y;
    let zz = z * z;
    return array<f32, 16>(
        C0,
        -C1 * y,
        C1 * z,
        -C1 * x,
        C2_0 * x * y,
        -C2_0 * y * z,
        C2_2 * (2.0 * zz - xx - yy),
        -C2_0 * x * z,
        C2_4 * (xx - yy),
        -C3_0 * y * (3.0 * xx - yy),
        C3_1 * x * y * z,
        -C3_2 * y * (4.0 * zz - xx - yy),
        C3_3 * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        -C3_2 * x * (4.0 * zz - xx - yy),
        C3_5 * z * (xx - yy),
        -C3_0 * x * (xx - 3.0 * yy),
    );
}

// Derivatives by x, y and z of the polynomials as written above.
fn harmonics_gradient(d: vec3<f32>) -> array<vec3<f32>, 16> {
    let x = d.x;
    let y = d.y;
    let z = d.z;
    let xx = x * x;
    let yy = y * y;
    let zz = z * z;
    return array<vec3<f32>, 16>(
        vec3<f32>(0.0),
        vec3<f32>(0.0, -C1, 0.0),
        vec3<f32>(0.0, 0.0, C1),
        vec3<f32>(-C1, 0.0, 0.0),
        vec3<f32>(C2_0 * y, C2_0 * x, 0.0),
        vec3<f32>(0.0, -C2_0 * z, -C2_0 * y),
        vec3<f32>(-2.0 * C2_2 * x, -2.0 * C2_2 * y, 4.0 * C2_2 * z),
        vec3<f32>(-C2_0 * z, 0.0, -C2_0 * x),
        vec3<f32>(2.0 * C2_4 * x, -2.0 * C2_4 * y, 0.0),
        vec3<f32>(-C3_0 * 6.0 * x * y, -C3_0 * (3.0 * xx - 3.0 * yy), 0.0),
        vec3<f32>(C3_1 * y * z, C3_1 * x * z, C3_1 * x * y),
        vec3<f32>(C3_2 * 2.0 * x * y, -C3_2 * (4.0 * zz - xx - 3.0 * yy), -C3_2 * 8.0 * y * z),
        vec3<f32>(-C3_3 * 6.0 * x * z, -C3_3 * 6.0 * y * z, C3_3 * (6.0 * zz - 3.0 * xx - 3.0 * yy)),
        vec3<f32>(-C3_2 * (4.0 * zz - 3.0 * xx - yy), C3_2 * 2.0 * x * y, -C3_2 * 8.0 * x * z),
        vec3<f32>(C3_5 * 2.0 * x * z, -C3_5 * 2.0 * y * z, C3_5 * (xx - yy)),
        vec3<f32>(-C3_0 * (3.0 * xx - 3.0 * yy), C3_0 * 6.0 * x * y, 0.0),
    );
}
