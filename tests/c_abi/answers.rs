//! Rust, C and C++ get the same answers, which are those of brute force, from one table of queries.

use std::fs;
use std::path::Path;
use std::process::Command;

use hgrid_core::{Coherence, Config, Counters, Grid, Hit, QueryOptions, Ray, Strided, StridedMut};
use hgrid_tests::artefact::{clang, compiler, cpp_compiler, root, run, static_library};
use hgrid_tests::owned::Owned;
use tempfile::TempDir;

use crate::cases::{Built, Case, Group, Point, accepted, bytes, cases, verdict};
use crate::programs::SANITIZERS;

/// Runs all queries of a case in Rust; returns the work of each group.
fn check_in_rust(case: &Case, grid: &Grid<'_>) -> Vec<u64> {
    let mut all_work = Vec::new();
    for group in &case.groups {
        let mut work = [Counters::default(); 2];
        for (ray, offered) in case.rays.iter().zip(&group.offered) {
            check_ray(grid, group, ray, offered, &mut work);
        }
        let numbers = |w: Counters| [w.primitive_tests, w.cell_steps, w.grid_steps];
        all_work.extend(work.into_iter().flat_map(numbers));
    }
    check_batches(grid, &case.rays, &case.groups[0]);
    for &Point { point, max, mask, skip, ref answer } in &case.points {
        let mut options = QueryOptions { mask, skip, ..QueryOptions::default() };
        assert_eq!(grid.closest_point(point, max, &mut options), *answer, "{point:?} {max}");
    }
    all_work
}

/// Checks the queries with a group's options, and the hits that its filter is offered.
fn with_options(
    &Group { mask, cull, skip, rule, .. }: &Group,
    offered: &[Hit],
    counters: Option<&mut Counters>,
    ask: impl FnOnce(&mut QueryOptions<'_>),
) {
    let mut asked = 0;
    let mut filter = |_: usize, hit: &Hit| {
        assert_eq!(Some(hit), offered.get(asked), "out of order");
        asked += 1;
        verdict(rule, hit.primitive)
    };
    let mut options = QueryOptions { mask, cull, skip, counters, ..QueryOptions::default() };
    if rule != 0 {
        options.filter = Some(&mut filter);
    }
    ask(&mut options);
}

/// Checks every query of one ray.
fn check_ray(
    grid: &Grid<'_>,
    group: &Group,
    ray: &Ray,
    offered: &[Hit],
    [closest, any]: &mut [Counters; 2],
) {
    let expected = accepted(group.rule, offered);
    with_options(group, offered, Some(closest), |options| {
        assert_eq!(grid.intersect_with(ray, options), expected.first().copied(), "{ray:?}");
    });
    with_options(group, offered, Some(any), |options| {
        assert_eq!(grid.occluded_with(ray, options), !expected.is_empty(), "{ray:?}");
    });
    for room in [0, 1, 17, expected.len(), expected.len() + 1] {
        with_options(group, offered, None, |options| {
            let mut hits = vec![Hit::MISS; room];
            assert_eq!(grid.intersect_all(ray, options, &mut hits), expected.len(), "{ray:?}");
            let written = room.min(expected.len());
            assert_eq!(hits[..written], expected[..written], "room for {room}, {ray:?}");
        });
    }
}

/// Checks batches of all rays, without options.
fn check_batches(grid: &Grid<'_>, rays: &[Ray], group: &Group) {
    for coherence in [Coherence::Incoherent, Coherence::Coherent] {
        let mut hits = vec![Hit::MISS; rays.len()];
        let mut occluded = vec![7; rays.len()];
        grid.intersect_n(&Strided::new(rays), &mut StridedMut::new(&mut hits), coherence)
            .and_then(|()| {
                let mut occluded = StridedMut::new(&mut occluded);
                grid.occluded_n(&Strided::new(rays), &mut occluded, coherence)
            })
            .expect("sound arrays");
        for ((hit, occluded), offered) in hits.iter().zip(occluded).zip(&group.offered) {
            assert_eq!(*hit, offered.first().copied().unwrap_or(Hit::MISS));
            assert_eq!(occluded, u8::from(!offered.is_empty()));
        }
    }
}

/// Builds in Rust and runs all queries; returns the blob and the work that C and C++ must reproduce.
fn built(case: &Case, config: &Config) -> Built {
    let owned = Owned::build(&case.view(), config).expect("a sound mesh");
    let grid = owned.open(&case.view()).expect("its own mesh");
    let counters = check_in_rust(case, &grid);
    Built { blob: grid.blob().to_vec(), counters }
}

/// Compiles a program that runs all queries, and runs it; returns the number of answers it compared.
fn ask(mut compiler: Command, source: &str, flags: &[&str], table: &Path) -> usize {
    let program = table.with_extension("program");
    let language = if source.ends_with(".cpp") { "c++" } else { "c" };
    let is_cpp = format!("{compiler:?}").contains("-std=c++");
    let language = if is_cpp { "c++" } else { language };
    compiler.args(["-D_DEFAULT_SOURCE", "-g"]).args(flags).args(["-x", language]);
    compiler.arg(root().join("tests/c_abi").join(source)).args(["-x", "none"]);
    run(compiler.arg(static_library()).arg("-o").arg(&program));
    let printed = run(Command::new(&program).arg(table)).stdout;
    let printed = String::from_utf8(printed).expect("text");
    printed.trim().parse().expect("a number of answers")
}

/// A compiler if there is one, the program's source, and flags.
type Asker<'f> = (Option<Command>, &'static str, &'f [&'static str]);

#[test]
fn rust_c_and_cpp_answer_as_brute_force_does() {
    let sanitized: Vec<_> = SANITIZERS.into_iter().chain(["-O1"]).collect();
    all_answer(
        false,
        [
            (Some(compiler("c99")), "answers.c", &sanitized),
            (cpp_compiler("c++17"), "answers.cpp", &sanitized),
        ],
    );
}

#[test]
#[ignore = "slow: half a million questions to each of five programs"]
fn all_compilers_answer_as_brute_force_does() {
    let sanitized: Vec<_> = SANITIZERS.into_iter().chain(["-O1"]).collect();
    all_answer(
        true,
        [
            (Some(compiler("c99")), "answers.c", &sanitized),
            (cpp_compiler("c++17"), "answers.cpp", &sanitized),
            (cpp_compiler("c++17"), "answers.c", &["-O2"]),
            (clang("c17"), "answers.c", &["-O2"]),
            (clang("c++20"), "answers.cpp", &["-O2", "-fno-exceptions", "-fno-rtti"]),
        ],
    );
}

/// Compiles and runs the programs for which there is a compiler, about the whole table or a part of it.
fn all_answer<const N: usize>(is_whole: bool, askers: [Asker<'_>; N]) {
    let cases = cases(is_whole);
    let dir = TempDir::new().expect("a folder");
    let table = dir.path().join("table");
    fs::write(&table, bytes(&cases, built)).expect("a file");

    let askers = askers
        .into_iter()
        .filter_map(|(compiler, source, flags)| Some(ask(compiler?, source, flags, &table)));
    let counts: Vec<_> = askers.collect();
    // Without another compiler there are no counts.
    let Some(&all) = counts.first() else { return };
    // Every program compared all answers.
    let least = if is_whole { 500_000 } else { 250_000 };
    assert!(all > least && counts.iter().all(|&count| count == all), "{counts:?}");
}
