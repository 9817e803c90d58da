//! Facts that the system tells of this process, and settings that it is told.

use anyhow::Result;

/// Minor page faults so far: pages that were given when they were first touched. `None` if
/// the system does not tell.
#[must_use]
pub fn page_faults() -> Option<u64> {
    #[cfg(feature = "embree")]
    {
        use nix::sys::resource::{UsageWho, getrusage};
        let usage = getrusage(UsageWho::RUSAGE_SELF).ok()?;
        u64::try_from(usage.minor_page_faults()).ok()
    }
    #[cfg(not(feature = "embree"))]
    None
}

/// Keeps this thread, and all that it will start, on the core that it runs on.
///
/// A library that starts threads then shares one core among them, as if it had one.
///
/// # Errors
/// If the system refuses.
pub fn pin_to_one_core() -> Result<()> {
    #[cfg(feature = "embree")]
    {
        use anyhow::Context as _;
        use nix::sched::{CpuSet, sched_getcpu, sched_setaffinity};
        use nix::unistd::Pid;
        let mut cores = CpuSet::new();
        let this_thread = Pid::from_raw(0);
        sched_getcpu()
            .and_then(|core| cores.set(core))
            .and_then(|()| sched_setaffinity(this_thread, &cores))
            .context("cannot stay on one core")?;
    }
    Ok(())
}

/// Lets the heap keep what is freed, so that a build can use the memory of the one before. (It gives
/// large blocks back to the system otherwise.)
pub fn keep_heap() {
    #[cfg(feature = "embree")]
    super::heap::keep();
}

/// Gives the system what the heap does not use.
pub fn give_back_heap() {
    #[cfg(feature = "embree")]
    super::heap::give_back();
}

/// Returns what the program was compiled for: the architecture and the widest vectors that it may use.
#[must_use]
pub fn target() -> String {
    let vectors = [
        ("AVX-512", cfg!(target_feature = "avx512f")),
        ("AVX2", cfg!(target_feature = "avx2")),
        ("SSE4.2", cfg!(target_feature = "sse4.2")),
    ];
    let vectors = vectors.into_iter().find(|(_, is_allowed)| *is_allowed);
    let vectors = vectors.map_or("baseline", |(name, _)| name);
    format!("{}, {vectors}", std::env::consts::ARCH)
}
