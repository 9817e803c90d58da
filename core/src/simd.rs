//! Chooses the vector instructions of builds and queries: detects them once, and never uses more than the machine has.
//!
//! A [`Kernel`] is code generic over the vectors of `fearless_simd`; [`dispatch`] compiles it once for each level that
//! the target may meet (for AVX-512 only if it [is wide](Kernel::IS_WIDE)) and runs the one that was asked for, or the
//! nearest below. Every level gives the same hits, bit for bit: the kernels use nothing that rounds differently, and
//! fused multiply-adds only where the product is exact or no hit depends on the last bits (slab tests of groups and the
//! filters).
//!
//! ```text
//! target          at build time                     at run time
//! x86-64, i686    Sse2                              Avx2; Avx512 for groups of rays (Ice Lake, Zen 4 on)
//! AArch64         Neon
//! wasm32          Simd128, if built with +simd128
//! all others      Scalar
//! ```
//!
//! Here is all the `unsafe` of the crate: the questions to the processor, the tokens that stand
//! for its answers, and prefetches.

use fearless_simd::Simd;

/// The vector instructions that queries use. All give the same hits, bit for bit.
///
/// A level that the machine lacks cannot be forced on it: queries then use the nearest level below that it has.
///
/// ```
/// use hgrid_core::SimdLevel;
/// let best = SimdLevel::detect();
/// assert!(best.is_available());
/// assert_eq!(SimdLevel::available().last(), Some(best));
/// ```
#[non_exhaustive]
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum SimdLevel {
    /// No vectors: for targets whose compiler may use none.
    Scalar,
    /// Four lanes on `WebAssembly`, in modules built for them.
    Simd128,
    /// Four lanes on `AArch64`.
    Neon,
    /// Four lanes on x86, where every 64-bit processor has them.
    Sse2,
    /// Eight lanes on x86 (the level x86-64-v3).
    Avx2,
    /// Sixteen lanes for groups of rays, the eight of AVX2 for all else, on x86 (the AVX-512 of Ice Lake and Zen 4).
    Avx512,
}

impl SimdLevel {
    /// Every level of every target, from narrow to wide where one machine may have several.
    pub const ALL: &'static [Self] =
        &[Self::Scalar, Self::Simd128, Self::Neon, Self::Sse2, Self::Avx2, Self::Avx512];

    /// The best level of this machine.
    ///
    /// Asks the processor the first time, and whether the operating system keeps the wide registers.
    #[inline]
    #[must_use]
    pub fn detect() -> Self {
        machine::detect()
    }

    /// The levels of this machine, the best one last.
    ///
    /// ```
    /// use hgrid_core::SimdLevel;
    /// assert!(SimdLevel::available().any(|level| level == SimdLevel::detect()));
    /// ```
    pub fn available() -> impl Iterator<Item = Self> {
        Self::ALL.iter().copied().filter(|level| level.is_available())
    }

    /// Returns true if this machine has this level.
    #[must_use]
    pub fn is_available(self) -> bool {
        machine::BASE <= self && self <= Self::detect()
    }

    /// Returns true if kernels fuse products with sums at this level.
    #[cfg(test)]
    pub(crate) const fn fuses(self) -> bool {
        matches!(self, Self::Neon | Self::Avx2 | Self::Avx512)
    }

    /// Returns the name in lower case.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Scalar => "scalar",
            Self::Simd128 => "simd128",
            Self::Neon => "neon",
            Self::Sse2 => "sse2",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }
}

/// True if the target is a microcontroller, where flash matters more than a few instructions a ray.
pub(crate) const IS_SMALL: bool = cfg!(all(target_os = "none", target_pointer_width = "32"));

/// Functions that are inlined, except on a microcontroller: there all callers share one copy.
macro_rules! inline_unless_small {
    ($($function:item)*) => {$(
        #[cfg_attr(all(target_os = "none", target_pointer_width = "32"), inline(never))]
        #[cfg_attr(not(all(target_os = "none", target_pointer_width = "32")), inline(always))]
        $function
    )*};
}
pub(crate) use inline_unless_small;

/// True if the target has vectors at all. Without them eight or sixteen lanes one after the other
/// are up to twice the work, much code, and minutes of compilation.
pub(crate) const HAS_VECTORS: bool = cfg!(any(
    all(
        any(target_arch = "x86", target_arch = "x86_64"),
        target_feature = "sse2",
        target_feature = "fxsr"
    ),
    all(target_arch = "aarch64", target_feature = "neon"),
    all(target_arch = "wasm32", target_feature = "simd128")
));

/// Code for any vector instructions.
///
/// Functions that `run` calls on vectors must be `#[inline(always)]` down to the last one: only what
/// ends up inside [`dispatch`], or in a `Simd::vectorize` of its own (`pairs.rs`), is compiled for the level.
pub(crate) trait Kernel {
    type Output;

    /// True if the kernel uses sixteen lanes. [`dispatch`] compiles only such kernels for AVX-512: with eight lanes
    /// AVX2 was as fast on the one processor where both were measured, and a third copy of each kernel costs size.
    #[allow(dead_code, reason = "only x86 has levels of several widths")]
    const IS_WIDE: bool = false;

    fn run<S: Simd>(self, simd: S) -> Self::Output;
}

/// Runs a kernel at a level, or at the nearest one below that the machine has and the kernel is compiled for.
#[inline(always)]
pub(crate) fn dispatch<K: Kernel>(level: SimdLevel, kernel: K) -> K::Output {
    machine::dispatch(level, kernel)
}

/// True if [`prefetch`] does something.
pub(crate) const HAS_PREFETCH: bool = machine::HAS_PREFETCH;

/// Asks the processor to load the cache line at an address, without waiting for it.
#[inline(always)]
pub(crate) fn prefetch<T>(at: &T) {
    machine::prefetch(at);
}

/// x86 with the vectors that its 64-bit processors all have: wider ones are found at run time.
#[cfg(all(
    any(target_arch = "x86", target_arch = "x86_64"),
    target_feature = "sse2",
    target_feature = "fxsr"
))]
mod machine {
    #[cfg(target_arch = "x86")]
    use core::arch::x86::{__cpuid, __cpuid_count, _MM_HINT_T0, _mm_prefetch, _xgetbv};
    #[cfg(target_arch = "x86_64")]
    use core::arch::x86_64::{__cpuid, __cpuid_count, _MM_HINT_T0, _mm_prefetch, _xgetbv};
    use core::sync::atomic::{AtomicU8, Ordering};

    use fearless_simd::Simd;
    use fearless_simd::x86::{Avx2, Avx512, Sse2};

    use super::{Kernel, SimdLevel};

    pub(super) const BASE: SimdLevel = SimdLevel::Sse2;

    /// The answer of [`ask`], kept because `cpuid` takes a hundred cycles, under a hypervisor thousands. All threads
    /// write the same value.
    static DETECTED: AtomicU8 = AtomicU8::new(UNKNOWN);
    const UNKNOWN: u8 = u8::MAX;

    pub(super) const HAS_PREFETCH: bool = true;

    #[inline(always)]
    #[expect(unsafe_code, reason = "the instruction takes a pointer")]
    pub(super) fn prefetch<T>(at: &T) {
        // SAFETY: it never faults and changes nothing that a program can see.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(core::ptr::from_ref(at).cast()) };
    }

    #[inline]
    pub(super) fn detect() -> SimdLevel {
        const AVX2: u8 = SimdLevel::Avx2 as u8;
        const AVX512: u8 = SimdLevel::Avx512 as u8;
        match DETECTED.load(Ordering::Relaxed) {
            AVX512 => SimdLevel::Avx512,
            AVX2 => SimdLevel::Avx2,
            UNKNOWN => {
                let level = ask();
                DETECTED.store(level as u8, Ordering::Relaxed);
                level
            }
            _ => BASE,
        }
    }

    #[inline(always)]
    #[expect(unsafe_code, reason = "a token is a promise about the machine, kept by `detect`")]
    pub(super) fn dispatch<K: Kernel>(level: SimdLevel, kernel: K) -> K::Output {
        match level.min(detect()) {
            SimdLevel::Avx512 if K::IS_WIDE => {
                // SAFETY: `detect` found every instruction set that `avx512` names.
                let simd = unsafe { avx512() };
                simd.vectorize(
                    #[inline(always)]
                    || kernel.run(simd),
                )
            }
            SimdLevel::Avx512 | SimdLevel::Avx2 => {
                // SAFETY: `detect` found every instruction set that `avx2` names.
                let simd = unsafe { avx2() };
                simd.vectorize(
                    #[inline(always)]
                    || kernel.run(simd),
                )
            }
            _ => {
                // SAFETY: this module exists where the target promises `sse2` and `fxsr`.
                let simd = unsafe { sse2() };
                base(simd, kernel)
            }
        }
    }

    // The tokens. Each function enables what `ask` asks for (the last one what this module's target has). If a later
    // version of `fearless_simd` required more, the safe call in it would not compile.

    #[inline]
    #[target_feature(enable = "adx,aes,avx512bitalg,avx512bw,avx512cd,avx512dq,avx512f")]
    #[target_feature(enable = "avx512ifma,avx512vbmi,avx512vbmi2,avx512vl,avx512vnni")]
    #[target_feature(enable = "avx512vpopcntdq,avx2,bmi1,bmi2,cmpxchg16b,f16c,fma,fxsr,gfni,lzcnt")]
    #[target_feature(enable = "movbe,pclmulqdq,popcnt,rdrand,rdseed,sha,vaes,vpclmulqdq,xsave")]
    #[target_feature(enable = "xsavec,xsaveopt,xsaves")]
    fn avx512() -> Avx512 {
        Avx512::assume_supported()
    }

    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2,cmpxchg16b,f16c,fma,fxsr,lzcnt,movbe,popcnt,xsave")]
    fn avx2() -> Avx2 {
        Avx2::assume_supported()
    }

    #[inline]
    #[target_feature(enable = "fxsr,sse,sse2")]
    fn sse2() -> Sse2 {
        Sse2::assume_supported()
    }

    /// Out of line as the others: inlined, its stack would be added to theirs.
    #[inline(never)]
    fn base<K: Kernel>(simd: Sse2, kernel: K) -> K::Output {
        kernel.run(simd)
    }

    /// Asks the processor for every feature that the tokens promise, not only for those that name them.
    #[cold]
    #[allow(unused_unsafe, reason = "__cpuid is safe since Rust 1.94, _xgetbv is not")]
    #[expect(unsafe_code, reason = "the question to the processor")]
    fn ask() -> SimdLevel {
        // `cpuid` is forbidden in an enclave, and Miri has no processor.
        if cfg!(any(miri, target_env = "sgx")) {
            return BASE;
        }
        let leaf = |leaf, sub_leaf| {
            // SAFETY: every processor with SSE2 has `cpuid`, and no leaf of it has side effects.
            let last = unsafe { __cpuid(leaf & 0x8000_0000) }.eax;
            // SAFETY: as above.
            (leaf <= last).then(|| unsafe { __cpuid_count(leaf, sub_leaf) })
        };
        let (Some(basic), Some(extended), Some(states), Some(amd)) =
            (leaf(1, 0), leaf(7, 0), leaf(0xd, 1), leaf(0x8000_0001, 0))
        else {
            return BASE;
        };
        let has = |word: u32, bits: &[u32]| bits.iter().all(|bit| word >> bit & 1 == 1);

        // xsave and its use by the operating system, then the registers that it saves.
        if !has(basic.ecx, &[26, 27]) {
            return BASE;
        }
        // SAFETY: the bit above says that the instruction may be used; register 0 always exists.
        let saved = unsafe { _xgetbv(0) };
        let saves = |mask| saved & mask == mask;
        let (xmm_ymm, xmm_ymm_zmm) = (0b110, 0b1110_0110);

        // fma, cmpxchg16b, movbe, popcnt, avx, f16c; bmi1, avx2, bmi2; lzcnt.
        let is_avx2 = saves(xmm_ymm)
            && has(basic.ecx, &[12, 13, 22, 23, 28, 29])
            && has(extended.ebx, &[3, 5, 8])
            && has(amd.ecx, &[5]);
        // pclmulqdq, aes, rdrand; avx512f, avx512dq, rdseed, adx, avx512ifma, avx512cd, sha,
        // avx512bw, avx512vl; avx512vbmi, avx512vbmi2, gfni, vaes, vpclmulqdq, avx512vnni,
        // avx512bitalg, avx512vpopcntdq; xsaveopt, xsavec, xsaves.
        let is_avx512 = is_avx2
            && saves(xmm_ymm_zmm)
            && has(basic.ecx, &[1, 25, 30])
            && has(extended.ebx, &[16, 17, 18, 19, 21, 28, 29, 30, 31])
            && has(extended.ecx, &[1, 6, 8, 9, 10, 11, 12, 14])
            && has(states.eax, &[0, 1, 3]);
        if is_avx512 {
            SimdLevel::Avx512
        } else if is_avx2 {
            SimdLevel::Avx2
        } else {
            BASE
        }
    }
}

/// All other targets: their instructions are known at build time.
#[cfg(not(all(
    any(target_arch = "x86", target_arch = "x86_64"),
    target_feature = "sse2",
    target_feature = "fxsr"
)))]
mod machine {
    use fearless_simd::Simd;

    use super::{Kernel, SimdLevel};

    pub(super) const BASE: SimdLevel =
        if cfg!(all(target_arch = "aarch64", target_feature = "neon")) {
            SimdLevel::Neon
        } else if cfg!(all(target_arch = "wasm32", target_feature = "simd128")) {
            SimdLevel::Simd128
        } else {
            SimdLevel::Scalar
        };

    pub(super) const HAS_PREFETCH: bool = false;

    pub(super) const fn prefetch<T>(_: &T) {}

    #[inline]
    pub(super) const fn detect() -> SimdLevel {
        BASE
    }

    /// Out of line as on x86: two calls of a kernel share its code.
    #[inline(never)]
    pub(super) fn dispatch<K: Kernel>(_: SimdLevel, kernel: K) -> K::Output {
        let simd = token();
        simd.vectorize(
            #[inline(always)]
            || kernel.run(simd),
        )
    }

    #[cfg(all(target_arch = "aarch64", target_feature = "neon"))]
    #[inline(always)]
    #[expect(unsafe_code, reason = "a token is a promise about the machine, made by the target")]
    fn token() -> impl Simd {
        // SAFETY: this function exists where the target promises `neon`.
        unsafe { fearless_simd::aarch64::Neon::assume_supported() }
    }

    #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
    #[inline(always)]
    fn token() -> impl Simd {
        fearless_simd::wasm32::WasmSimd128::assume_supported()
    }

    #[cfg(not(any(
        all(target_arch = "aarch64", target_feature = "neon"),
        all(target_arch = "wasm32", target_feature = "simd128")
    )))]
    #[inline(always)]
    const fn token() -> impl Simd {
        fearless_simd::Fallback::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;

    struct Name;

    impl Kernel for Name {
        type Output = alloc::string::String;
        const IS_WIDE: bool = true;

        fn run<S: Simd>(self, _: S) -> Self::Output {
            core::any::type_name::<S>().rsplit(':').next().unwrap_or_default().to_lowercase()
        }
    }

    #[test]
    fn a_level_runs_as_itself_or_as_the_next_below() {
        let available: Vec<_> = SimdLevel::available().collect();
        assert_eq!(available.first(), Some(&machine::BASE));
        assert_eq!(available.last(), Some(&SimdLevel::detect()));
        for &level in SimdLevel::ALL {
            let below = available.iter().rfind(|&&available| available <= level);
            let runs = below.unwrap_or(&machine::BASE);
            let name = if *runs == SimdLevel::Scalar { "fallback" } else { runs.name() };
            assert!(dispatch(level, Name).ends_with(name), "{level:?}");
        }
    }

    #[test]
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    fn detection_agrees_with_the_standard_librarys() {
        extern crate std;
        let avx512 = std::is_x86_feature_detected!("avx512vl")
            && std::is_x86_feature_detected!("avx512vpopcntdq")
            && std::is_x86_feature_detected!("xsaves")
            && std::is_x86_feature_detected!("sha");
        let avx2 = std::is_x86_feature_detected!("avx2") && std::is_x86_feature_detected!("movbe");
        let level = SimdLevel::detect();
        assert!(level < SimdLevel::Avx512 || avx512, "{level:?}");
        assert!(level < SimdLevel::Avx2 || avx2, "{level:?}");
        assert!(level >= SimdLevel::Avx2 || !avx2, "{level:?}");
    }
}
