//! `hgrid compare` as a program: it starts itself for first builds, which a unit test cannot check.

use std::io;
use std::process::{Command, Output};

fn hgrid(words: &str) -> io::Result<Output> {
    Command::new(env!("CARGO_BIN_EXE_hgrid")).args(words.split(' ')).output()
}

#[test]
fn a_first_build_prints_its_time() {
    let output = hgrid("first-build procedural:knot:500 one-level").unwrap();
    let first: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(output.status.success() && first["seconds"].as_f64() > Some(0.0), "{first}");

    let output = hgrid("first-build procedural:knot:500 bvh --spheres").unwrap();
    let first: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(output.status.success() && first["seconds"].as_f64() > Some(0.0), "{first}");

    let output = hgrid("first-build procedural:knot:500 nothing").unwrap();
    assert!(!output.status.success() && output.stdout.is_empty());
}

#[cfg(feature = "embree")]
#[test]
fn first_builds_have_processes_of_their_own() {
    let file = std::env::temp_dir().join(format!("hgrid-first-{}.json", std::process::id()));
    let words = format!(
        "compare procedural:knot:500 --size 16 --repeat 1 --methods one-level \
         --peers embree-low,embree-dynamic --workloads primary --json {}",
        file.display()
    );
    let output = hgrid(&words).unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(text.contains("first in a new process") && text.contains("embree-dynamic is Embree"));

    let json: serde_json::Value = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
    std::fs::remove_file(&file).unwrap();
    for system in json["scenes"][0]["systems"].as_array().unwrap() {
        assert_eq!(system["first_build"]["samples"].as_array().unwrap().len(), 3, "{system}");
        assert_eq!(system["rebuild"]["samples"].as_array().unwrap().len(), 1, "{system}");
    }
}

/// A comparison succeeds although nobody reads the notice of what is left out.
#[cfg(all(feature = "embree", target_os = "linux"))]
#[test]
fn a_full_standard_error_ends_no_comparison() {
    let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
    let words = "compare procedural:knot:500 --instances 9 --size 16 --repeat 1 --methods bvh,fixed \
         --peers embree-low --workloads primary";
    let mut command = Command::new(env!("CARGO_BIN_EXE_hgrid"));
    let output = command.args(words.split_whitespace()).stderr(full).output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && text.contains("9 instances"), "{text}");
}

/// A scene that cannot be measured, and an output that takes no text, leave the numbers in the file.
#[cfg(all(feature = "embree", target_os = "linux"))]
#[test]
fn numbers_that_were_measured_are_kept() {
    let folder = std::env::temp_dir().join(format!("hgrid-kept-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let [far, json] = ["far.obj", "kept.json"].map(|name| folder.join(name));
    std::fs::write(&far, "v 900 0 0\nv 901 0 0\nv 900 1 0\nf 1 2 3\n").unwrap();
    let words = format!(
        "compare procedural:soup:300 {} procedural:knot:500 --eye 0,0,9 --target 0,0,0 --size 16 \
         --repeat 1 --methods bvh --peers embree-low --workloads primary --json {}",
        far.display(),
        json.display()
    );
    let mut command = Command::new(env!("CARGO_BIN_EXE_hgrid"));
    let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
    let output = command.args(words.split(' ')).stdout(full).output().unwrap();
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success() && error.contains("far.obj`: no ray hits"), "{error}");
    let json: serde_json::Value = serde_json::from_slice(&std::fs::read(&json).unwrap()).unwrap();
    std::fs::remove_dir_all(&folder).unwrap();
    let scenes = json["scenes"].as_array().unwrap();
    let names: Vec<_> = scenes.iter().map(|scene| scene["scene"].as_str().unwrap()).collect();
    assert_eq!(names, ["procedural:soup:300", "procedural:knot:500"]);
}

#[cfg(feature = "embree")]
#[test]
fn instances_are_for_trees_and_embree() {
    let file = std::env::temp_dir().join(format!("hgrid-instances-{}.json", std::process::id()));
    let others = if cfg!(feature = "peers") { "parry-ploc," } else { "" };
    let words = format!(
        "compare procedural:knot:500 --instances 30 --size 32 --repeat 1 --methods one-level,bvh \
         --peers {others}embree-low,embree-dynamic,embree-medium,embree-compact --workloads primary,ao,near --json {}",
        file.display()
    );
    let output = hgrid(&words).unwrap();
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{error}");
    let left_out =
        if cfg!(feature = "peers") { "near, one-level, parry-ploc" } else { "near, one-level" };
    assert!(
        error.contains(&format!("left out, because they have no instances: {left_out}")),
        "{error}"
    );
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(text.contains("knot:500: 30 instances of 500 triangles"), "{text}");
    assert!(text.contains("index bytes per instance / best peer"), "{text}");

    let json: serde_json::Value = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
    std::fs::remove_file(&file).unwrap();
    let scene = &json["scenes"][0];
    let systems = scene["systems"].as_array().unwrap();
    let names: Vec<_> = systems.iter().filter_map(|system| system["system"].as_str()).collect();
    assert_eq!(scene["instances"], 30);
    assert_eq!(names, ["bvh", "embree-low", "embree-dynamic", "embree-medium", "embree-compact"]);
    for system in systems {
        // The matrix, the place and the box of an instance take less than the structure of the mesh.
        let each = system["index_bytes"].as_u64().unwrap() / 30;
        assert!((96..4000).contains(&each), "{system}");
        assert!(system["peak_bytes"].as_u64() >= system["index_bytes"].as_u64(), "{system}");
    }
}

#[cfg(feature = "embree")]
#[test]
fn spheres_are_for_trees_and_embree() {
    let file = std::env::temp_dir().join(format!("hgrid-spheres-{}.json", std::process::id()));
    let words = format!(
        "compare procedural:knot:500 --spheres --size 32 --repeat 1 --methods one-level,bvh \
         --peers embree-low,embree-compact --workloads primary,ao,far --json {}",
        file.display()
    );
    let output = hgrid(&words).unwrap();
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{error}");
    assert!(error.contains("left out, because they have no spheres: far, one-level"), "{error}");
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(text.contains("knot:500: 500 spheres, hits: primary "), "{text}");
    assert!(text.contains("index bytes per sphere / best peer"), "{text}");
    assert!(text.contains("first in a new process"), "{text}");

    let json: serde_json::Value = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
    std::fs::remove_file(&file).unwrap();
    let scene = &json["scenes"][0];
    assert_eq!((&scene["spheres"], &scene["instances"]), (&true.into(), &0.into()));
    for system in scene["systems"].as_array().unwrap() {
        for run in system["runs"].as_array().unwrap() {
            assert!(run["hits"].as_u64() > Some(0) && run["differing"] == 0, "{system}");
        }
    }
}

#[cfg(feature = "peers")]
#[test]
fn instances_are_not_for_other_methods_and_peers() {
    let words = "compare procedural:knot:500 --instances 3 --methods fixed --peers bvh-crate";
    let output = hgrid(words).unwrap();
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(
        !output.status.success() && error.contains("--instances compares bvh with Embree"),
        "{error}"
    );
}
