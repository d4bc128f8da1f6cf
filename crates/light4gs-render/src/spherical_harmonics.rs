//! Real spherical harmonics up to degree 3 and their derivatives (Sloan, *Efficient Spherical Harmonic Evaluation*,
//! JCGT 2013), with the signs of the original 3DGS code.

const C0: f32 = 0.282_094_8;
const C1: f32 = 0.488_602_5;
const C2: [f32; 5] = [1.092_548_4, -1.092_548_4, 0.315_391_57, -1.092_548_4, 0.546_274_2];
const C3: [f32; 7] = [-0.590_043_6, 2.890_611_4, -0.457_045_8, 0.373_176_34, -0.457_045_8, 1.445_305_7, -0.590_043_6];

/// Coefficients of a channel at a degree.
pub const fn coefficient_count(degree: usize) -> usize {
    (degree + 1) * (degree + 1)
}

/// Basis values at the unit direction `[x, y, z]`; entries above `degree` are zero.
pub fn basis(degree: usize, [x, y, z]: [f32; 3]) -> [f32; 16] {
    let mut b = [0.0; 16];
    b[0] = C0;
    if degree > 0 {
        b[1] = -C1 * y;
        b[2] = C1 * z;
        b[3] = -C1 * x;
    }
    if degree > 1 {
        let (xx, yy, zz) = (x * x, y * y, z * z);
        b[4] = C2[0] * x * y;
        b[5] = C2[1] * y * z;
        b[6] = C2[2] * (2.0 * zz - xx - yy);
        b[7] = C2[3] * x * z;
        b[8] = C2[4] * (xx - yy);
        if degree > 2 {
            b[9] = C3[0] * y * (3.0 * xx - yy);
            b[10] = C3[1] * x * y * z;
            b[11] = C3[2] * y * (4.0 * zz - xx - yy);
            b[12] = C3[3] * z * (2.0 * zz - 3.0 * xx - 3.0 * yy);
            b[13] = C3[4] * x * (4.0 * zz - xx - yy);
            b[14] = C3[5] * z * (xx - yy);
            b[15] = C3[6] * x * (xx - 3.0 * yy);
        }
    }
    b
}

/// Derivatives of the basis by x, y and z, of the polynomials as written in [`basis`].
pub fn basis_gradient(degree: usize, [x, y, z]: [f32; 3]) -> [[f32; 3]; 16] {
    let mut d = [[0.0; 3]; 16];
    if degree > 0 {
        d[1] = [0.0, -C1, 0.0];
        d[2] = [0.0, 0.0, C1];
        d[3] = [-C1, 0.0, 0.0];
    }
    if degree > 1 {
        let (xx, yy, zz) = (x * x, y * y, z * z);
        d[4] = [C2[0] * y, C2[0] * x, 0.0];
        d[5] = [0.0, C2[1] * z, C2[1] * y];
        d[6] = [-2.0 * C2[2] * x, -2.0 * C2[2] * y, 4.0 * C2[2] * z];
        d[7] = [C2[3] * z, 0.0, C2[3] * x];
        d[8] = [2.0 * C2[4] * x, -2.0 * C2[4] * y, 0.0];
        if degree > 2 {
            d[9] = [C3[0] * 6.0 * x * y, C3[0] * (3.0 * xx - 3.0 * yy), 0.0];
            d[10] = [C3[1] * y * z, C3[1] * x * z, C3[1] * x * y];
            d[11] = [C3[2] * -2.0 * x * y, C3[2] * (4.0 * zz - xx - 3.0 * yy), C3[2] * 8.0 * y * z];
            d[12] = [C3[3] * -6.0 * x * z, C3[3] * -6.0 * y * z, C3[3] * (6.0 * zz - 3.0 * xx - 3.0 * yy)];
            d[13] = [C3[4] * (4.0 * zz - 3.0 * xx - yy), C3[4] * -2.0 * x * y, C3[4] * 8.0 * x * z];
            d[14] = [C3[5] * 2.0 * x * z, C3[5] * -2.0 * y * z, C3[5] * (xx - yy)];
            d[15] = [C3[6] * (3.0 * xx - 3.0 * yy), C3[6] * -6.0 * x * y, 0.0];
        }
    }
    d
}
