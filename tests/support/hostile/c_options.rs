//! Query options: in C as a fuzzer chooses them, and the same in Rust.

use std::cell::RefCell;
use std::ffi::c_void;
use std::ptr::null_mut;

use arbitrary::{Arbitrary, Result, Unstructured};
use hgrid_capi::*;
use hgrid_core::{Counters, Cull, Hit, INVALID_ID, QueryOptions, Verdict};

use super::memory::{Lent, Struct, rarely};

/// Returns the bits of a hit.
pub(super) fn bits(hit: &Hit) -> [u32; 4] {
    [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.primitive]
}

/// Returns the bits of a C hit.
pub(super) fn c_bits(hit: &hgrid_hit) -> [u32; 4] {
    [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.primitive]
}

/// Options, and the memory that they point to.
pub(super) struct Options {
    options: Struct<hgrid_query_options>,
    filter: Lent<Filter>,
    counters: Lent<hgrid_counters>,
    /// Not read here, but it must live as long as the options that point to it.
    _scratch: Lent<[u8; SCRATCH]>,
}

/// More scratch than a window on the stack.
const SCRATCH: usize = 9000;

/// A filter whose verdict on a hit is two of its bits, chosen by the triangle's id.
struct Filter {
    verdicts: u32,
    shown: RefCell<Vec<(usize, [u32; 4])>>,
}

impl Filter {
    fn ask(&self, ray: usize, hit: [u32; 4]) -> u32 {
        let mut shown = self.shown.borrow_mut();
        shown.push((ray, hit));
        self.verdicts >> (hit[3] % 16 * 2) & 3
    }
}

unsafe extern "C" fn filter(
    context: *mut c_void,
    ray: usize,
    hit: *const hgrid_hit,
) -> hgrid_verdict {
    // SAFETY: the library passes on the context of the options, a `Filter`.
    let filter = unsafe { &*context.cast::<Filter>() };
    // SAFETY: the library passes a valid hit, as the header promises.
    filter.ask(ray, c_bits(unsafe { &*hit }))
}

/// The hits that the filter was shown by queries in Rust, and their work.
#[derive(Default)]
pub(super) struct Told {
    shown: Vec<(usize, [u32; 4])>,
    work: Counters,
}

impl Options {
    pub(super) fn new(u: &mut Unstructured<'_>) -> Result<Self> {
        let counters =
            Lent::new(hgrid_counters { primitive_tests: 1, cell_steps: 2, grid_steps: 3 });
        let verdicts = u32::arbitrary(u)?;
        let context = Lent::new(Filter { verdicts, shown: RefCell::default() });
        let [has_filter, has_counters, is_plain] = <[bool; 3]>::arbitrary(u)?;
        let mut options = hgrid_query_options {
            struct_size: 0,
            mask: u32::MAX,
            cull: HGRID_CULL_NONE,
            skip: INVALID_ID,
            context: context.as_ptr().cast(),
            filter: if has_filter { Some(filter) } else { None },
            counters: if has_counters { counters.as_ptr() } else { null_mut() },
            scratch: null_mut(),
            scratch_bytes: 0,
            filter_mask: 0,
            reserved: 0,
        };
        let scratch = Lent::new([0xa5; SCRATCH]);
        if bool::arbitrary(u)? {
            let from = u.int_in_range(0..=9)?;
            options.scratch = scratch.as_ptr().cast::<u8>().wrapping_add(from).cast();
            options.scratch_bytes = u.int_in_range(0..=SCRATCH - from)?;
        }
        if !is_plain {
            options.mask = u8::arbitrary(u)?.into();
            options.cull = u.int_in_range(0..=2)?;
            options.skip = u8::arbitrary(u)?.into();
            options.filter_mask = u8::arbitrary(u)?.into();
        }
        if rarely(u, 32)? {
            options.cull = u32::arbitrary(u)?;
        }
        Ok(Self { options: Struct::new(u, options)?, filter: context, counters, _scratch: scratch })
    }

    /// Returns true if the options are valid; NULL is.
    pub(super) fn are_sound(&self) -> bool {
        self.options.is_null() || self.options.is_sound() && self.cull().is_some()
    }

    pub(super) fn as_ptr(&self) -> *const hgrid_query_options {
        self.options.as_ptr()
    }

    fn cull(&self) -> Option<Cull> {
        [Cull::None, Cull::Back, Cull::Front].get(self.options.value().cull as usize).copied()
    }

    /// Runs a query in Rust as C runs it for the ray with this index.
    pub(super) fn ask<T>(
        &self,
        told: &mut Told,
        ray: usize,
        ask: impl FnOnce(&mut QueryOptions<'_>) -> T,
    ) -> T {
        if self.options.is_null() {
            return ask(&mut QueryOptions::default());
        }
        let hgrid_query_options { mask, skip, filter, filter_mask, .. } = *self.options.value();
        let verdicts = self.filter.verdicts;
        let Told { shown, work } = told;
        let again = Filter { verdicts, shown: RefCell::new(std::mem::take(shown)) };
        let mut offer = |_, hit: &Hit| match again.ask(ray, bits(hit)) {
            HGRID_ACCEPT => Verdict::Accept,
            HGRID_ACCEPT_AND_STOP => Verdict::AcceptAndStop,
            _ => Verdict::Reject,
        };
        let cull = self.cull().unwrap_or_default();
        let mut options = QueryOptions { mask, cull, skip, ..QueryOptions::counting(work) };
        if filter.is_some() {
            options.filter = Some(&mut offer);
        }
        options.filter_mask = if filter_mask == 0 { u32::MAX } else { filter_mask };
        let answer = ask(&mut options);
        *shown = again.shown.into_inner();
        answer
    }

    /// Returns true if the filter was shown the same hits, and the counters have the same work, as in Rust.
    pub(super) fn agree(&self, told: &Told) -> bool {
        let is_counting = !self.options.is_null() && !self.options.value().counters.is_null();
        let work = if is_counting { told.work } else { Counters::default() };
        let hgrid_counters { primitive_tests, cell_steps, grid_steps } = *self.counters;
        *self.filter.shown.borrow() == told.shown
            && [primitive_tests, cell_steps, grid_steps]
                == [work.primitive_tests + 1, work.cell_steps + 2, work.grid_steps + 3]
    }

    /// Returns the same for a batch of occlusion queries: the filter may be shown fewer hits of a ray that an
    /// opaque triangle blocks.
    pub(super) fn agree_but_for_blocked_rays(&self, told: &Told, is_blocked: &[bool]) -> bool {
        let seen = self.filter.shown.borrow();
        let of = |all: &[(usize, [u32; 4])], ray| -> Vec<[u32; 4]> {
            all.iter().filter(|(place, _)| *place == ray).map(|(_, hit)| *hit).collect()
        };
        let agrees = |(ray, &is_blocked): (usize, &bool)| {
            let (told, seen) = (of(&told.shown, ray), of(&seen, ray));
            told == seen || is_blocked && told.starts_with(&seen)
        };
        let all = Told { shown: seen.clone(), work: told.work };
        seen.is_sorted_by_key(|(place, _)| *place)
            && is_blocked.iter().enumerate().all(agrees)
            && seen.iter().all(|(place, _)| *place < is_blocked.len())
            && {
                drop(seen);
                self.agree(&all)
            }
    }

    /// Returns true if rays of a batch may be traced together.
    pub(super) fn let_rays_go_together(&self) -> bool {
        self.options.is_null() || self.options.value().counters.is_null()
    }

    /// Returns true if there is a filter.
    pub(super) fn have_filter(&self) -> bool {
        !self.options.is_null() && self.options.value().filter.is_some()
    }
}
