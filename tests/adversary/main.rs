//! Compares every query with a reference that shares nothing with the library.
//!
//! A pair is one ray put to one method. For each ray the reference decides every triangle without rounding
//! (`hgrid_tests::reference`). Every entry point of every method must agree with it, at every SIMD level and
//! with masks, culling, a triangle to skip and filters ([`run`]).
//!
//! `HGRID_PAIRS` sets the number of pairs, `HGRID_SEED` the seed, and `HGRID_FIRST` the number of the first
//! mesh. Each run prints its record as JSON; record.json holds the records of long runs.

mod meshes;
mod rays;
mod run;

use std::time::{SystemTime, UNIX_EPOCH};

use hgrid_tests::{rounds, setting};

/// Returns the time in UTC, to the second.
fn now() -> String {
    let seconds = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_secs();
    let (days, second) = (seconds / 86_400, seconds % 86_400);
    // Count years from March, so that a leap day is the last day of its year (Hinnant 2013).
    let z = days + 719_468;
    let (era, day) = (z / 146_097, z % 146_097);
    let year = (day - day / 1460 + day / 36_524 - day / 146_096) / 365;
    let day = day - (365 * year + year / 4 - year / 100);
    let month = (5 * day + 2) / 153;
    let (day, month) = (day - (153 * month + 2) / 5 + 1, (month + 2) % 12 + 1);
    let year = era * 400 + year + u64::from(month <= 2);
    let [h, m, s] = [second / 3600, second / 60 % 60, second % 60];
    format!("{year}-{month:02}-{day:02}T{h:02}:{m:02}:{s:02}Z")
}

/// Returns the processor's name, where the system tells it, with the architecture and the system.
fn machine() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let line = text.lines().find(|line| line.starts_with("model name"));
    let name = line.and_then(|line| line.split(": ").nth(1)).unwrap_or("unknown");
    format!("{name}, {} {}", std::env::consts::ARCH, std::env::consts::OS)
}

#[test]
#[cfg_attr(miri, ignore = "hours")]
fn every_method_answers_as_exact_arithmetic_does() {
    let (pairs, seed) = (setting("HGRID_PAIRS", rounds(50_000) as u64), setting("HGRID_SEED", 1));
    let begin = now();
    let done = run::run(seed, setting("HGRID_FIRST", 0), pairs);
    let record = serde_json::json!({
        "command": format!("HGRID_PAIRS={pairs} HGRID_SEED={seed} cargo test --test adversary every -- --nocapture"),
        "begin": begin,
        "end": now(),
        "machine": machine(),
        "seed": seed,
        "pairs": done.pairs,
        "rays": done.rays,
        "meshes": done.meshes,
        "ray_triangles": done.ray_triangles,
        "hits": done.hits,
        "open": done.open,
        "differences": done.differences.len(),
        "levels": done.levels,
    });
    println!("{record:#}");
    assert!(done.differences.is_empty(), "{}", done.differences.join("\n"));
    // Rays that hit nothing prove little, and a rule that leaves many pairs open would be no rule.
    assert!(done.hits > done.rays / 2 && done.open < done.ray_triangles / 500, "{record:#}");
}
