//! Eight float32 lanes: one thin type for AVX2 + FMA, one for all other processors.
//!
//! The rasterizer's inner loops are generic over [`Lanes`]. [`dispatch`] chooses the implementation at run time, once
//! for each call, so one binary serves old and new processors. The results of the two differ in the last bits (fused
//! and separate multiply-add), but never between two runs on one machine.

/// Lanes in a vector.
pub const LANES: usize = 8;

/// Eight float32 values that are computed on together. A mask is a vector whose lanes are all ones or all zeros.
pub trait Lanes: Copy {
    /// `value` in all lanes.
    fn splat(value: f32) -> Self;
    /// Reads eight values.
    fn load(from: &[f32; LANES]) -> Self;
    /// Writes the lanes.
    fn store(self, to: &mut [f32; LANES]);
    /// `self + other`.
    fn add(self, other: Self) -> Self;
    /// `self - other`.
    fn sub(self, other: Self) -> Self;
    /// `self * other`.
    fn mul(self, other: Self) -> Self;
    /// `self / other`.
    fn div(self, other: Self) -> Self;
    /// The smaller; `other` where either is NaN.
    fn min(self, other: Self) -> Self;
    /// The larger; `other` where either is NaN.
    fn max(self, other: Self) -> Self;
    /// The square root.
    fn sqrt(self) -> Self;
    /// `self * b + c`
    fn mul_add(self, b: Self, c: Self) -> Self;
    /// Mask of `self >= other`.
    fn at_least(self, other: Self) -> Self;
    /// `self & other`, bit by bit.
    fn and(self, other: Self) -> Self;
    /// `self | other`, bit by bit.
    fn or(self, other: Self) -> Self;
    /// `!self & other`
    fn and_not(self, other: Self) -> Self;
    /// Lanes of `yes` where the mask is set, else of `no`.
    fn select(self, yes: Self, no: Self) -> Self;
    /// Bit i is the sign of lane i; for a mask, whether lane i is set.
    fn signs(self) -> u32;
    /// `2^n` for lanes that hold `n + 1.5 · 2^23`, with `n` a whole number in [-126, 127]: `n` is in their lowest bits.
    fn exp2_of_rounded(self) -> Self;
    /// The sum of the lanes, `((0 + 4) + (2 + 6)) + ((1 + 5) + (3 + 7))`.
    fn sum(self) -> f32;
    /// The sums of eight vectors, each `((0 + 1) + (2 + 3)) + ((4 + 5) + (6 + 7))` of its lanes. Less work than one by
    /// one.
    fn sums(vectors: &[Self; LANES]) -> [f32; LANES];

    /// 2^x for x in [-126, 1], relative error below 2e-7: a polynomial of degree six, fitted for the least relative
    /// error (1.9e-9 before rounding) on [-1/2, 1/2].
    #[inline(always)]
    fn exp2(self) -> Self {
        // Adding 1.5 * 2^23 rounds to an integer, which is then in the low mantissa bits.
        let magic = Self::splat(12_582_912.0);
        let x = self.max(Self::splat(-126.0));
        let shifted = x.add(magic);
        let r = x.sub(shifted.sub(magic));
        let p = Self::splat(1.534_581_2e-4);
        let p = p.mul_add(r, Self::splat(1.339_993_1e-3));
        let p = p.mul_add(r, Self::splat(9.618_489e-3));
        let p = p.mul_add(r, Self::splat(5.550_328_6e-2));
        let p = p.mul_add(r, Self::splat(0.240_226_46));
        let p = p.mul_add(r, Self::splat(std::f32::consts::LN_2));
        let p = p.mul_add(r, Self::splat(1.0));
        p.mul(shifted.exp2_of_rounded())
    }
}

/// A computation that is generic over the vector type; [`dispatch`] runs it.
pub trait LaneKernel {
    /// What it gives.
    type Output;
    /// Computes it.
    fn run<L: Lanes>(self) -> Self::Output;
}

/// Runs the kernel with the best vectors of this processor.
pub fn dispatch<K: LaneKernel>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma") {
        if std::arch::is_x86_feature_detected!("avx512f") && std::arch::is_x86_feature_detected!("avx512vl") {
            // SAFETY: all four features were just found on this processor.
            return unsafe { avx2::run_with_more_registers(kernel) };
        }
        // SAFETY: both features were just found on this processor.
        return unsafe { avx2::run(kernel) };
    }
    kernel.run::<Portable>()
}

/// Plain arrays, which the compiler vectorizes for the target.
#[derive(Clone, Copy)]
pub(crate) struct Portable([f32; LANES]);

impl Portable {
    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        Self(std::array::from_fn(|i| f(self.0[i], other.0[i])))
    }

    #[inline(always)]
    fn zip_bits(self, other: Self, f: impl Fn(u32, u32) -> u32) -> Self {
        self.zip(other, |a, b| f32::from_bits(f(a.to_bits(), b.to_bits())))
    }
}

impl Lanes for Portable {
    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self([value; LANES])
    }
    #[inline(always)]
    fn load(from: &[f32; LANES]) -> Self {
        Self(*from)
    }
    #[inline(always)]
    fn store(self, to: &mut [f32; LANES]) {
        *to = self.0;
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.zip(other, |a, b| a / b)
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.zip(other, |a, b| if a < b { a } else { b })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.zip(other, |a, b| if a > b { a } else { b })
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.map(f32::sqrt))
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] * b.0[i] + c.0[i]))
    }
    #[inline(always)]
    fn at_least(self, other: Self) -> Self {
        self.zip(other, |a, b| f32::from_bits(if a >= b { u32::MAX } else { 0 }))
    }
    #[inline(always)]
    fn and(self, other: Self) -> Self {
        self.zip_bits(other, |a, b| a & b)
    }
    #[inline(always)]
    fn or(self, other: Self) -> Self {
        self.zip_bits(other, |a, b| a | b)
    }
    #[inline(always)]
    fn and_not(self, other: Self) -> Self {
        self.zip_bits(other, |a, b| !a & b)
    }
    #[inline(always)]
    fn select(self, yes: Self, no: Self) -> Self {
        self.and(yes).or(self.and_not(no))
    }
    #[inline(always)]
    fn signs(self) -> u32 {
        (0..LANES).fold(0, |bits, lane| bits | (self.0[lane].to_bits() >> 31) << lane)
    }
    #[inline(always)]
    fn exp2_of_rounded(self) -> Self {
        Self(self.0.map(|x| f32::from_bits((x.to_bits() << 23).wrapping_add(1.0f32.to_bits()))))
    }
    #[inline(always)]
    fn sum(self) -> f32 {
        let a = self.0;
        ((a[0] + a[4]) + (a[2] + a[6])) + ((a[1] + a[5]) + (a[3] + a[7]))
    }
    #[inline(always)]
    fn sums(vectors: &[Self; LANES]) -> [f32; LANES] {
        std::array::from_fn(|k| {
            let a = vectors[k].0;
            ((a[0] + a[1]) + (a[2] + a[3])) + ((a[4] + a[5]) + (a[6] + a[7]))
        })
    }
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use super::{LANES, LaneKernel, Lanes};
    use std::arch::x86_64::*;

    /// # Safety
    /// The processor must have AVX2 and FMA.
    #[target_feature(enable = "avx2,fma")]
    pub(super) unsafe fn run<K: LaneKernel>(kernel: K) -> K::Output {
        kernel.run::<Avx2>()
    }

    /// The same operations on the same eight lanes, so the results have the same bits; but the compiler has 32
    /// registers instead of 16.
    ///
    /// # Safety
    /// The processor must have AVX2, FMA, AVX-512F and AVX-512VL.
    #[target_feature(enable = "avx2,fma,avx512f,avx512vl")]
    pub(super) unsafe fn run_with_more_registers<K: LaneKernel>(kernel: K) -> K::Output {
        kernel.run::<Avx2>()
    }

    /// Only the functions above make values of this type, so every intrinsic below runs where AVX2 and FMA were found.
    #[derive(Clone, Copy)]
    pub(super) struct Avx2(__m256);

    // SAFETY of every block: see the type. Loads and stores go through references to whole arrays.
    #[expect(clippy::undocumented_unsafe_blocks, reason = "one argument holds for all of them")]
    impl Lanes for Avx2 {
        #[inline(always)]
        fn splat(value: f32) -> Self {
            Self(unsafe { _mm256_set1_ps(value) })
        }
        #[inline(always)]
        fn load(from: &[f32; LANES]) -> Self {
            Self(unsafe { _mm256_loadu_ps(from.as_ptr()) })
        }
        #[inline(always)]
        fn store(self, to: &mut [f32; LANES]) {
            unsafe { _mm256_storeu_ps(to.as_mut_ptr(), self.0) }
        }
        #[inline(always)]
        fn add(self, other: Self) -> Self {
            Self(unsafe { _mm256_add_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn sub(self, other: Self) -> Self {
            Self(unsafe { _mm256_sub_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn mul(self, other: Self) -> Self {
            Self(unsafe { _mm256_mul_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn div(self, other: Self) -> Self {
            Self(unsafe { _mm256_div_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn min(self, other: Self) -> Self {
            Self(unsafe { _mm256_min_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn max(self, other: Self) -> Self {
            Self(unsafe { _mm256_max_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn sqrt(self) -> Self {
            Self(unsafe { _mm256_sqrt_ps(self.0) })
        }
        #[inline(always)]
        fn mul_add(self, b: Self, c: Self) -> Self {
            Self(unsafe { _mm256_fmadd_ps(self.0, b.0, c.0) })
        }
        #[inline(always)]
        fn at_least(self, other: Self) -> Self {
            Self(unsafe { _mm256_cmp_ps::<_CMP_GE_OQ>(self.0, other.0) })
        }
        #[inline(always)]
        fn and(self, other: Self) -> Self {
            Self(unsafe { _mm256_and_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn or(self, other: Self) -> Self {
            Self(unsafe { _mm256_or_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn and_not(self, other: Self) -> Self {
            Self(unsafe { _mm256_andnot_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn select(self, yes: Self, no: Self) -> Self {
            Self(unsafe { _mm256_blendv_ps(no.0, yes.0, self.0) })
        }
        #[inline(always)]
        fn signs(self) -> u32 {
            unsafe { _mm256_movemask_ps(self.0) as u32 }
        }
        #[inline(always)]
        fn exp2_of_rounded(self) -> Self {
            Self(unsafe {
                let shifted = _mm256_slli_epi32::<23>(_mm256_castps_si256(self.0));
                _mm256_castsi256_ps(_mm256_add_epi32(shifted, _mm256_set1_epi32(0x3f80_0000)))
            })
        }
        #[inline(always)]
        fn sum(self) -> f32 {
            unsafe {
                let half = _mm_add_ps(_mm256_castps256_ps128(self.0), _mm256_extractf128_ps::<1>(self.0));
                let pair = _mm_add_ps(half, _mm_movehl_ps(half, half));
                _mm_cvtss_f32(_mm_add_ss(pair, _mm_shuffle_ps::<1>(pair, pair)))
            }
        }
        #[inline(always)]
        fn sums(vectors: &[Self; LANES]) -> [f32; LANES] {
            let mut sums = [0.0; LANES];
            unsafe {
                let pairs = |k: usize| _mm256_hadd_ps(vectors[k].0, vectors[k + 1].0);
                // The lower halves of four vectors' lanes, then the upper halves.
                let first = _mm256_hadd_ps(pairs(0), pairs(2));
                let second = _mm256_hadd_ps(pairs(4), pairs(6));
                let low = _mm256_permute2f128_ps::<0x20>(first, second);
                let high = _mm256_permute2f128_ps::<0x31>(first, second);
                _mm256_storeu_ps(sums.as_mut_ptr(), _mm256_add_ps(low, high));
            }
            sums
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Exp2Error;
    impl LaneKernel for Exp2Error {
        type Output = f32;
        fn run<L: Lanes>(self) -> f32 {
            let mut worst = 0.0f32;
            for i in 0..10_000 {
                let x = -(i as f32) * 0.0126;
                let mut out = [0.0; LANES];
                L::splat(x).exp2().store(&mut out);
                let truth = (x as f64).exp2();
                worst = worst.max(((out[3] as f64 - truth) / truth).abs() as f32);
            }
            worst
        }
    }

    /// The results of every operation on some pairs and triples of values, as bits. The result of the fused
    /// multiply-add is rounded.
    struct EveryOperation;
    impl LaneKernel for EveryOperation {
        type Output = Vec<u32>;
        fn run<L: Lanes>(self) -> Vec<u32> {
            let a = [0.0, -0.0, 1.5, -2.25, 1e-30, 3e8, 7.0, -126.0];
            let b = [1.0, -1.0, 1.5, 0.75, 2e-30, -3e8, 0.1, 5.0];
            let c = [-1.0, 4.0, 0.5, 0.0, 1.0, 2.0, -7.0, 9.0];
            let mut found = Vec::new();
            let mut keep = |vector: L| {
                let mut out = [0.0; LANES];
                vector.store(&mut out);
                found.extend(out.map(f32::to_bits));
            };
            let (x, y, z) = (L::load(&a), L::load(&b), L::load(&c));
            let mask = x.at_least(y);
            for vector in [x.add(y), x.sub(y), x.mul(y), x.div(y), x.min(y), x.max(y), x.max(z).sqrt()] {
                keep(vector);
            }
            for vector in [mask, mask.and(y), mask.or(z), mask.and_not(x), mask.select(y, z), y.exp2_of_rounded()] {
                keep(vector);
            }
            // Products with few bits, so that fused and separate rounding agree.
            keep(L::splat(1.5).mul_add(L::load(&c), L::splat(0.25)));
            found.push(mask.signs());
            found.push(L::load(&c).sum().to_bits());
            found.extend(L::sums(&[x, y, z, x, z, y, x, z]).map(f32::to_bits));
            found
        }
    }

    #[test]
    fn every_operation_is_the_same_on_every_vector_type() {
        assert_eq!(dispatch(EveryOperation), EveryOperation.run::<Portable>());
    }

    #[test]
    fn exp2_is_accurate_on_every_vector_type() {
        for error in [dispatch(Exp2Error), Exp2Error.run::<Portable>()] {
            assert!(error < 2e-7, "{error}");
        }
    }
}
