//! hgrid and the ray tracers of other libraries (peers), over the same rays: the `compare` command.
//!
//! ```text
//! workloads: the rays, and the answers of hgrid to them
//!     |
//! system: builds, then traces slices of rays in one mode or more
//!     |-- grid: a system for each method          '-- peers: a system for each other library
//!     |
//! race: all systems in turn --> numbers --> tables, ratios, charts
//! ```
//!
//! The peers are behind the features `peers` and `embree`, because Embree needs its library on the system and tinybvh a
//! C++ compiler. Without these features the command says how to build with them. docs/performance.md says how each
//! system is set up and measured.

pub mod agreement;
mod charts;
pub mod first;
mod grid;
#[cfg(feature = "embree")]
mod heap;
pub mod input;
mod instanced;
pub mod mode;
pub mod numbers;
pub mod peers;
pub mod points;
pub mod process;
pub mod race;
mod random;
pub mod ratios;
mod samples;
pub mod shown;
pub mod spheres;
mod stage;
pub mod system;
mod tables;
pub mod workloads;

use std::ffi::OsString;
use std::io::{self, Write as _};
use std::path::Path;

use anyhow::{Context as _, Error, Result, ensure};
use clap::ValueEnum as _;
use hgrid_core::{Method, Parameters, Quality};

use crate::cli::CompareArgs;
use crate::file;
use crate::image::{check_sources, check_writable, in_folder};
use crate::notices::say;
use crate::scene;
use grid::{GridSystem, HIGH};
use numbers::Comparison;
use peers::Peer;
use race::Plan;
use shown::Shown;
use system::System;
use workloads::{Amount, Workload};

/// Measures, prints, writes and draws.
///
/// # Errors
/// If this program was built without the peers, a scene cannot be loaded, a structure cannot be
/// built, two methods of hgrid disagree, or a file cannot be written.
pub fn run(args: &CompareArgs) -> Result<()> {
    if let Some(path) = &args.json {
        check_results(path, &args.scenes)?;
    }
    let mut systems = methods_of(&args.methods, args.quality.unwrap_or_default());
    systems.extend(peers::systems(&args.peers)?);
    scene::check(&args.scenes)?;
    match &args.output {
        Some(folder) => in_folder(folder, || measure(args, systems)),
        None => measure(args, systems),
    }
}

/// Measures, prints and writes, and draws into the folder, which is there.
fn measure(args: &CompareArgs, mut systems: Vec<Box<dyn System>>) -> Result<()> {
    process::pin_to_one_core()?;

    process::keep_heap();
    let first = first::in_new_process;
    let asked =
        |workload: &Workload| args.workloads.is_empty() || args.workloads.contains(workload);
    let mut workloads: Vec<_> = Workload::ALL.into_iter().filter(asked).collect();
    let shown = args.shown();
    leave_out(&mut systems, &mut workloads, shown)?;
    let amount = Amount::of(&workloads);
    let plan = Plan { repeat: args.repeat, workloads, amount, shown, first };
    // A scene takes minutes: its numbers are in the file before the next one begins.
    let keep = |comparison: &Comparison| {
        let Some(path) = &args.json else { return Ok(()) };
        let json = serde_json::to_string_pretty(comparison)? + "\n";
        file::write(path, |file| file.write_all(json.as_bytes()))
    };
    let (comparison, failed) =
        Comparison::measure(&args.scenes, &systems, &args.picture, &plan, keep)?;
    let drawn = args.output.as_ref().map_or(Ok(()), |folder| comparison.draw(folder));
    let text = if args.markdown { comparison.markdown() } else { comparison.text() };
    let printed = writeln!(io::stdout(), "{text}");
    failed.map_or(Ok(()), Err)?;
    drawn?;
    Ok(printed?)
}

/// Refuses to write results over a mesh.
fn check_results(path: &Path, scenes: &[OsString]) -> Result<()> {
    for scene in scenes {
        check_sources(path, scene, "results")?;
    }
    check_writable(path)
}

/// Removes systems and workloads that cannot take the instances or spheres that are shown, and prints their names.
fn leave_out(
    systems: &mut Vec<Box<dyn System>>,
    workloads: &mut Vec<Workload>,
    shown: Shown,
) -> Result<()> {
    let Some((option, items)) = shown.option() else { return Ok(()) };
    let answers = |system: &dyn System, workload| !system.modes(workload, shown).is_empty();
    let mut names = Vec::new();
    workloads.retain(|&workload| {
        let is_kept = systems.iter().any(|system| answers(system.as_ref(), workload));
        if !is_kept {
            names.push(workload.name().to_owned());
        }
        is_kept
    });
    systems.retain(|system| {
        let is_kept = workloads.iter().any(|&workload| answers(system.as_ref(), workload));
        if !is_kept {
            names.push(system.name());
        }
        is_kept
    });
    let names = names.join(", ");
    ensure!(
        !systems.is_empty(),
        "nothing to measure: {option} is for bvh and Embree, and for the workloads primary, ao, bounce and \
         random; left out were {names}"
    );
    if !names.is_empty() {
        say(&format!("left out, because they have no {items}: {names}"));
    }
    Ok(())
}

/// Returns a system for each method, at its default density; for all methods if none is named.
#[must_use]
pub fn methods(methods: &[Method]) -> Vec<Box<dyn System>> {
    methods_of(methods, Quality::default())
}

/// Returns the same systems, with trees of a quality.
fn methods_of(methods: &[Method], quality: Quality) -> Vec<Box<dyn System>> {
    let methods = if methods.is_empty() { Method::ALL } else { methods };
    let parameters = |method| match method {
        Method::Bvh => Parameters::Bvh { quality },
        _ => Parameters::new(method),
    };
    let system = |&method| Box::new(GridSystem::new(parameters(method).into())) as Box<dyn System>;
    methods.iter().map(system).collect()
}

/// Returns the system with a name: a method or a peer.
///
/// # Errors
/// If there is no such system, or it does not start.
pub fn system_named(name: &str) -> Result<Box<dyn System>> {
    let (of, quality) = match name.strip_suffix(HIGH) {
        Some(of) => (of, Quality::High),
        None => (name, Quality::Fast),
    };
    let mut found = match Method::ALL.iter().find(|method| method.name() == of) {
        Some(&method) => methods_of(&[method], quality),
        None => peers::systems(&[Peer::from_str(name, false).map_err(Error::msg)?])?,
    };
    found.pop().context("a name without a system")
}

#[cfg(test)]
mod tests {
    use std::fs;

    use clap::Parser as _;

    use super::numbers::Kind;
    use super::*;

    /// Compares systems on small scenes, in all workloads.
    fn compare(systems: &[Box<dyn System>]) -> Comparison {
        compare_on(&Workload::ALL, systems)
    }

    fn compare_on(workloads: &[Workload], systems: &[Box<dyn System>]) -> Comparison {
        compare_of(Shown::Mesh, workloads, systems)
    }

    fn compare_of(shown: Shown, workloads: &[Workload], systems: &[Box<dyn System>]) -> Comparison {
        measure_with(&[], shown, workloads, systems).unwrap()
    }

    fn measure_with(
        words: &[&str],
        shown: Shown,
        workloads: &[Workload],
        systems: &[Box<dyn System>],
    ) -> Result<Comparison> {
        let scenes = ["hgrid", "procedural:knot:2000", "procedural:soup:500", "--size", "48"];
        let args = CompareArgs::parse_from(scenes.iter().chain(words));
        let amount = Amount { random_rays: 2000, near_points: 500, far_points: 50 };
        let plan = Plan {
            repeat: 2,
            workloads: workloads.to_vec(),
            amount,
            shown,
            first: first::in_this_process,
        };
        let nothing = |_: &Comparison| Ok(());
        let (comparison, failed) =
            Comparison::measure(&args.scenes, systems, &args.picture, &plan, nothing)?;
        failed.map_or(Ok(comparison), Err)
    }

    #[test]
    fn rays_of_a_camera_that_sees_nothing_are_not_measured() {
        let away = ["--eye", "0,0,99", "--target", "0,0,199"];
        let of =
            |workload| measure_with(&away, Shown::Mesh, &[workload], &methods(&[Method::Fixed]));
        for workload in [Workload::Primary, Workload::Ao, Workload::Bounce] {
            let message = format!("{:#}", of(workload).unwrap_err());
            assert!(message.contains("no ray hits anything"), "{message}");
        }
        of(Workload::Random).unwrap();
    }

    #[test]
    fn every_method_has_its_rows_and_every_file_its_names() {
        let comparison = compare(&methods(&[]));
        let (text, markdown) = (comparison.text(), comparison.markdown());
        for method in Method::ALL {
            assert!(text.matches(method.name()).count() >= 4, "{text}");
            assert!(markdown.contains(&format!("| {}", method.name())), "{markdown}");
        }
        assert!(text.contains("knot:2000: 2.00K triangles, hits: primary "), "{text}");
        assert!(markdown.contains("### soup:500"), "{markdown}");
        assert!(!text.contains("hgrid / peer"), "{text}");
        for table in markdown.split("\n\n").filter(|part| part.starts_with('|')) {
            let columns = |line: &str| line.matches('|').count();
            let first = table.lines().next().map_or(0, columns);
            assert!(table.lines().all(|line| columns(line) == first), "{table}");
        }

        let folder = std::env::temp_dir().join(format!("hgrid-compare-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        comparison.draw(&folder).unwrap();
        for name in ["compare_times", "compare_bytes"] {
            let svg = fs::read_to_string(folder.join(name).with_extension("svg")).unwrap();
            assert!(svg.contains("knot:2000") && svg.contains("one"), "{svg}");
            assert!(folder.join(name).with_extension("png").exists());
        }
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn only_what_is_asked_is_measured() {
        let comparison = compare_on(&[Workload::Ao], &methods(&[Method::Fixed]));
        let runs = &comparison.scenes[0].systems[0].runs;
        assert!(runs.iter().all(|run| run.workload == Workload::Ao) && !runs.is_empty());
        let text = comparison.text();
        assert!(text.contains("ao (s)") && !text.contains("random (s)"), "{text}");
        let Amount { random_rays, near_points, far_points } = Amount::of(&[Workload::Near]);
        assert!(near_points > 0 && random_rays + far_points == 0);
    }

    #[test]
    fn json_has_every_sample() {
        let json = serde_json::to_value(compare(&methods(&[Method::Fixed]))).unwrap();
        let system = &json["scenes"][0]["systems"][0];
        assert_eq!(system["system"], "fixed");
        assert_eq!(system["first_build"]["samples"].as_array().unwrap().len(), 3);
        assert_eq!(system["rebuild"]["samples"].as_array().unwrap().len(), 2);
        assert_eq!(system["runs"][1]["workload"], "ao");
        assert!(json["machine"]["rustc"].is_string() && json["target"].is_string());
    }

    #[test]
    fn what_has_no_instances_is_left_out() {
        let [mut systems, mut others] = [methods(&[]), methods(&[Method::Fixed])];
        let mut workloads = Workload::ALL.to_vec();
        let shown = Shown::Instances(9);
        leave_out(&mut systems, &mut workloads, shown).unwrap();
        let names: Vec<_> = systems.iter().map(|system| system.name()).collect();
        assert_eq!(names, [Method::Bvh.name()]);
        assert_eq!(workloads, Workload::ALL[..4]);
        let error = leave_out(&mut others, &mut workloads, shown).unwrap_err().to_string();
        assert!(error.contains("fixed") && error.contains("random"), "{error}");
        let error = leave_out(&mut methods(&[Method::Fixed]), &mut workloads, Shown::Spheres);
        let error = error.unwrap_err().to_string();
        assert!(error.contains("--spheres is for bvh and Embree"), "{error}");
    }

    /// Checks a comparison on fields of instances, which all of its systems can take.
    fn check_instances(systems: &[Box<dyn System>], ratios: usize) {
        const COUNT: u32 = 40;
        let workloads = &Workload::ALL[..4];
        let comparison = compare_of(Shown::Instances(COUNT), workloads, systems);
        for scene in &comparison.scenes {
            assert_eq!(scene.shown, Shown::Instances(COUNT));
            assert_eq!(scene.systems.len(), systems.len());
            for system in &scene.systems {
                let name = &system.system;
                assert_eq!(system.items(), u64::from(COUNT));
                // For Embree some bytes are measured on the heap of the whole program, which other tests use, too.
                // So tests/compare.rs checks Embree's.
                if !system.is_peer {
                    let each = system.index_bytes_per_item();
                    assert!((96.0..4000.0).contains(&each), "{name}: {each}");
                }
                assert!(system.peak_bytes >= system.index_bytes, "{name}");
                assert!(system.first_build.seconds > 0.0 && system.rebuild.seconds > 0.0);
                assert!(system.time_to_image(Kind::Rebuild).is_none());
                for workload in workloads {
                    assert!(system.best(*workload).is_some(), "{name}: {workload:?}");
                }
                for run in &system.runs {
                    assert!(
                        run.hits > 0 && run.hits < run.rays && !run.is_off(),
                        "{name}: {run:?}"
                    );
                }
            }
            assert_eq!(scene.ratios.len(), ratios, "{:#?}", scene.ratios);
        }
        let text = comparison.text();
        assert!(text.contains("knot:2000: 40 instances of 2.00K triangles, hits: "), "{text}");
        assert!(text.contains("rebuild (ns/inst)") && text.contains("index (B/inst)"), "{text}");
        assert!(text.contains("rebuilds of the scene alone"), "{text}");
    }

    /// Checks a comparison on spheres, which all of its systems can take.
    fn check_spheres(systems: &[Box<dyn System>], ratios: usize) {
        let workloads = &Workload::ALL[..4];
        let comparison = compare_of(Shown::Spheres, workloads, systems);
        for scene in &comparison.scenes {
            assert_eq!((scene.shown, scene.systems.len()), (Shown::Spheres, systems.len()));
            for system in &scene.systems {
                let name = &system.system;
                assert_eq!(system.items(), scene.facts.triangles as u64);
                let each = system.index_bytes_per_item();
                assert!((24.0..2000.0).contains(&each), "{name}: {each}");
                assert!(system.peak_bytes >= system.index_bytes, "{name}");
                assert!(system.first_build.seconds > 0.0 && system.rebuild.seconds > 0.0);
                assert!(system.time_to_image(Kind::Rebuild).is_none());
                for workload in workloads {
                    assert!(system.best(*workload).is_some(), "{name}: {workload:?}");
                }
                for run in &system.runs {
                    let is_some = run.hits > 0 && run.hits < run.rays;
                    assert!(is_some && !run.is_off(), "{name}: {run:?}");
                }
            }
            assert_eq!(scene.ratios.len(), ratios, "{:#?}", scene.ratios);
        }
        let text = comparison.text();
        assert!(text.contains("knot:2000: 2.00K spheres, hits: primary "), "{text}");
        assert!(text.contains("rebuild (ns/sph)") && text.contains("index (B/sph)"), "{text}");
        assert!(text.contains("without the spheres"), "{text}");
        let json = serde_json::to_value(&comparison).unwrap();
        let scene = &json["scenes"][0];
        assert_eq!((&scene["instances"], &scene["spheres"]), (&0.into(), &true.into()));
    }

    #[test]
    fn spheres_are_compared_in_trees() {
        check_spheres(&methods(&[Method::Bvh]), 0);
    }

    #[test]
    fn instances_are_compared_in_scenes() {
        check_instances(&methods(&[Method::Bvh]), 0);
    }

    /// Every way to build with Embree.
    #[cfg(feature = "embree")]
    const EMBREE: [Peer; 7] = [
        Peer::EmbreeLow,
        Peer::EmbreeDynamic,
        Peer::EmbreeMedium,
        Peer::EmbreeHigh,
        Peer::EmbreeRobust,
        Peer::EmbreeCompact,
        Peer::EmbreeLowCompact,
    ];

    /// Qualities and the flag COMPACT reach Embree: they show in its bytes.
    #[cfg(feature = "embree")]
    #[test]
    fn embree_builds_as_its_names_say() {
        let systems = peers::systems(&EMBREE).unwrap();
        let comparison = compare_on(&[Workload::Ao], &systems);
        let [knot, soup] = [&comparison.scenes[0].systems, &comparison.scenes[1].systems];
        let bytes = |systems: &[numbers::SystemNumbers], peer: Peer| {
            let system = systems.iter().find(|system| system.system == peer.name()).unwrap();
            (system.index_bytes, system.peak_bytes)
        };
        for (compact, other) in
            [(Peer::EmbreeCompact, Peer::EmbreeMedium), (Peer::EmbreeLowCompact, Peer::EmbreeLow)]
        {
            let [compact, other] = [compact, other].map(|peer| bytes(knot, peer));
            assert!(10 * compact.0 < 7 * other.0 && compact.1 < other.1, "{compact:?}, {other:?}");
        }
        let [high, medium] = [Peer::EmbreeHigh, Peer::EmbreeMedium].map(|peer| bytes(soup, peer).0);
        assert!(high > medium, "{high}, {medium}: no triangle was split");
    }

    #[cfg(feature = "embree")]
    #[test]
    fn embree_agrees_with_hgrid_on_instances() {
        let mut systems = methods(&[Method::Bvh]);
        systems.extend(peers::systems(&EMBREE).unwrap());
        // The rows: two builds, bytes kept and bytes at most, coherent and single primary rays, ao, bounces,
        // and random rays against both qualities.
        check_instances(&systems, 10);
    }

    #[cfg(feature = "embree")]
    #[test]
    fn embree_agrees_with_hgrid_on_spheres() {
        let mut systems = methods(&[Method::Bvh]);
        systems.extend(peers::systems(&EMBREE).unwrap());
        // The same rows as on instances.
        check_spheres(&systems, 10);
    }

    #[cfg(not(feature = "embree"))]
    #[test]
    fn without_the_peers_nothing_is_measured() {
        let args = CompareArgs::parse_from(["hgrid", "no/such.ply"]);
        let error = format!("{:#}", run(&args).unwrap_err());
        assert!(error.contains("--features peers") && !error.contains("such.ply"), "{error}");
    }

    #[cfg(feature = "embree")]
    #[test]
    fn all_peers_agree_with_hgrid() {
        let mut systems = methods(&[]);
        systems.extend(peers::systems(&[]).unwrap());
        let comparison = compare(&systems);
        for scene in &comparison.scenes {
            assert_eq!(scene.systems.len(), systems.len());
            for system in &scene.systems {
                let name = &system.system;
                // The heap is that of the whole program, and other tests use it too.
                if !system.is_peer || name.starts_with("embree") {
                    assert!(system.index_bytes > 0, "{name}");
                    assert!(system.peak_bytes >= system.index_bytes, "{name}");
                }
                for run in &system.runs {
                    assert!(run.hits > 0 && !run.is_off(), "{name}: {run:?}");
                    assert_eq!(run.samples.len(), 2);
                }
            }
            assert_eq!(scene.ratios.len(), 14);
        }
        assert!(comparison.text().contains("time to image / best peer"));
    }
}
