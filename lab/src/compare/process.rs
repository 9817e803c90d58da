//! Facts about this process that the system reports, and settings of it.

use anyhow::Result;

/// Returns the minor page faults so far: pages that the system provided at their first touch. `None` if the
/// system does not report them.
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

/// Pins this thread, and all threads that it will start, to the core that it runs on.
///
/// If a library starts threads, they share this core.
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

/// Lets the heap keep freed memory, so that a build can reuse the memory of the one before. By default, the
/// heap returns large blocks to the system.
pub fn keep_heap() {
    #[cfg(feature = "embree")]
    super::heap::keep();
}

/// Returns the heap's unused memory to the system.
pub fn give_back_heap() {
    #[cfg(feature = "embree")]
    super::heap::give_back();
}

/// Returns the target of the program: the architecture and the widest vectors that it may use.
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
