//! The ranks of an MPI program draw together what one process draws alone.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use hgrid_tests::artefact::{output, root, run, warnings};
use hgrid_tests::tools::{command, is_installed};
use tempfile::TempDir;

use crate::pictures::ascii;
use crate::programs::{drawing, kept, link, printed, raytracer};

/// Builds the program once, if there is an MPI.
fn mpi() -> Option<&'static Path> {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    is_installed("mpi").then(|| {
        &**PROGRAM.get_or_init(|| {
            kept("mpi", |program| {
                link(warnings(command("mpicc"), "c99"), &drawing(&["mpi.c"]), &[], program);
            })
        })
    })
}

/// Returns a command that runs `count` ranks on this machine, with any number of cores and as any user.
fn ranks(count: u32, program: &Path) -> Command {
    let mut mpirun = command("mpirun");
    mpirun.args(["-n", &count.to_string()]).arg(program).current_dir(root());
    mpirun
        .env("OMPI_MCA_rmaps_base_oversubscribe", "1")
        .env("OMPI_ALLOW_RUN_AS_ROOT", "1")
        .env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1");
    mpirun
}

/// The mesh and the grid of the built-in scene are sent in several pieces each.
#[test]
fn four_ranks_draw_the_picture_of_one() {
    let dir = TempDir::new().expect("a folder");
    let Some(program) = mpi() else { return };
    let [together, alone] = ["together.ppm", "alone.ppm"].map(|name| dir.path().join(name));
    let said = printed(ranks(4, program).args(["--size", "300", "-o"]).arg(&together));
    assert!(said.contains("for 500000 triangles\n"), "{said}");
    assert!(said.contains("ranks: 4\n"), "{said}");
    assert!(said.contains("picture of one process: the same, byte by byte\n"), "{said}");
    run(raytracer().args(["--size", "300", "--shadows", "-o"]).arg(&alone));
    assert!(fs::read(together).expect("a picture") == fs::read(alone).expect("a picture"));
}

/// Some ranks may have nothing to draw, and one rank is enough.
#[test]
fn any_number_of_ranks_draws_any_scene() {
    let dir = TempDir::new().expect("a folder");
    let Some(program) = mpi() else { return };
    let [scene, picture] = ["house.ply", "picture.ppm"].map(|name| dir.path().join(name));
    fs::write(&scene, ascii()).expect("a file");
    for (count, size) in [(1, "20"), (3, "20"), (4, "5")] {
        run(ranks(count, program).arg(&scene).args(["--size", size, "-o"]).arg(&picture));
        let expected = dir.path().join("expected.ppm");
        run(raytracer().arg(&scene).args(["--size", size, "--shadows", "-o"]).arg(&expected));
        let [drawn, expected] = [&picture, &expected].map(|path| fs::read(path).expect("a file"));
        assert!(drawn == expected, "{count} ranks, {size} pixels");
    }
}

/// The rank that finds an error ends the others.
#[test]
fn errors_end_all_ranks() {
    let Some(program) = mpi() else { return };
    for (words, message) in [
        (&["--fast"][..], "mpi: unknown option --fast: mpi --help names all of them\n"),
        (&["a.ply", "b.ply"], "mpi: one scene at a time: a.ply or b.ply?\n"),
        (&["--size", "many"], "mpi: --size is a number from 1 to 16384, not `many`\n"),
        (&["a.ply", "-o", "a.ply"], "mpi: a.ply is read and would be overwritten: name another"),
        (&["no/such.ply"], "mpi: no/such.ply: cannot be opened: No such file"),
        (&["-o", "no/such/folder/a.ppm"], "mpi: no/such/folder/a.ppm: cannot be written: No such"),
    ] {
        let output = output(ranks(2, program).args(words));
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success() && said.contains(message), "{words:?}: {said}");
    }
}
