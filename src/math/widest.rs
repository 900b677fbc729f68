//! Loops compiled for the widest vectors of the processor that runs them.

/// A computation for [`widest`]. Its body must be `#[inline(always)]`: a struct with its own `run` is inlined, a long
/// closure mostly is not, and is then compiled for the narrowest vectors.
pub(crate) trait Kernel {
    type Output;

    fn run(self) -> Self::Output;
}

impl<T, F: FnOnce() -> T> Kernel for F {
    type Output = T;

    #[inline(always)]
    fn run(self) -> T {
        self()
    }
}

/// Runs `kernel` with the processor's AVX-512 or AVX2 where it has them.
///
/// The result does not depend on the width: the compiler neither reorders sums nor fuses products into them, except
/// where a kernel asks for `mul_add`, which is exact everywhere.
#[inline]
pub(crate) fn widest<K: Kernel>(kernel: K) -> K::Output {
    match wide(kernel) {
        Ok(output) => output,
        Err(kernel) => kernel.run(),
    }
}

/// Returns whether the processor has wide vectors. Those other than x86-64 have one width, which counts as wide.
#[inline]
pub(crate) fn is_wide() -> bool {
    #[cfg(target_arch = "x86_64")]
    let is_wide = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
    #[cfg(not(target_arch = "x86_64"))]
    let is_wide = true;
    is_wide
}

/// As [`widest`], on processors with wide vectors alone: a kernel is long to compile, and its caller may have another way. It comes back where
/// there are none.
#[inline]
pub(crate) fn wide<K: Kernel>(kernel: K) -> Result<K::Output, K> {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx512f,avx512bw,avx512cd,avx512dq,avx512vl,avx2,fma")]
        fn avx512<K: Kernel>(kernel: K) -> K::Output {
            kernel.run()
        }
        #[target_feature(enable = "avx2,fma")]
        fn avx2<K: Kernel>(kernel: K) -> K::Output {
            kernel.run()
        }
        if is_wide() {
            if is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512bw")
                && is_x86_feature_detected!("avx512cd")
                && is_x86_feature_detected!("avx512dq")
                && is_x86_feature_detected!("avx512vl")
            {
                // SAFETY: the processor has all the instructions that `avx512` is compiled with.
                return Ok(unsafe { avx512(kernel) });
            }
            // SAFETY: the processor has all the instructions that `avx2` is compiled with.
            return Ok(unsafe { avx2(kernel) });
        }
        Err(kernel)
    }
    #[cfg(not(target_arch = "x86_64"))]
    Ok(kernel.run())
}
