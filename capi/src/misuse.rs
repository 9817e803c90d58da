//! Mistakes that a query without a status can only answer with a miss. Debug builds stop at them.
//!
//! Release builds answer as the header says.

use crate::query_types::hgrid_ray;
use crate::scene::hgrid_ray_f64;
use crate::status::{hgrid_status, text};

/// True in debug builds of the C library. Tests compile these sources into a Rust program (feature `rlib`) and
/// make such mistakes on purpose.
const STOPS: bool = cfg!(debug_assertions) && !cfg!(feature = "rlib");

/// Returns options as they were read; stops a debug build if they break the rules.
#[inline(always)]
pub(crate) fn checked<T>(options: Result<T, hgrid_status>) -> Result<T, hgrid_status> {
    if STOPS {
        let reason = options.as_ref().err().map_or(c"", |&status| text(status));
        let reason = reason.to_str().unwrap_or_default();
        assert!(options.is_ok(), "a query got options that break the rules: {reason}");
    }
    options
}

/// A ray as C knows it.
pub(crate) trait CallersRay: Copy {
    /// Returns false if all bytes that are read are 0: then nobody has written the ray.
    fn is_written(&self) -> bool;

    /// Returns the ray of a query of one ray; stops a debug build if nobody has written it. (A ray that was written but
    /// has no direction is a miss in all builds, as the header says.)
    #[inline(always)]
    fn checked(self) -> Self {
        if STOPS {
            assert!(
                self.is_written(),
                "a query got a ray of zeros, which hits nothing: set its direction and t_max"
            );
        }
        self
    }
}

impl CallersRay for hgrid_ray {
    fn is_written(&self) -> bool {
        let Self { origin: [a, b, c], t_min, direction: [d, e, f], t_max } = *self;
        [a, b, c, t_min, d, e, f, t_max].map(f32::to_bits) != [0; 8]
    }
}

impl CallersRay for hgrid_ray_f64 {
    fn is_written(&self) -> bool {
        let Self { origin, direction: [a, b, c], t_min, t_max, reserved: _ } = *self;
        origin.map(f64::to_bits) != [0; 3] || [a, b, c, t_min, t_max].map(f32::to_bits) != [0; 5]
    }
}
