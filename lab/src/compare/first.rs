//! The first build in a new process.
//!
//! A process that has built before keeps memory, code and tables. So `compare` starts its own program once
//! for every first build; that process loads the scene, builds, and prints the time.

use std::env;
use std::ffi::OsStr;
use std::io::{self, Write as _};
use std::process::{Command, Stdio};

use anyhow::{Context as _, Result, ensure};
use clap::ValueEnum as _;
use serde::{Deserialize, Serialize};

use super::input::Input;
use super::process::give_back_heap;
use super::samples::Watch;
use super::shown::Shown;
use super::system::System;
use super::system_named;
use crate::camera::Up;
use crate::cli::FirstBuildArgs;
use crate::field::Field;
use crate::scene::Scene;

/// The name of the command that builds once.
pub const COMMAND: &str = "first-build";

/// The time of a first build, and its page faults.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FirstBuild {
    /// From the mesh to a structure that answers.
    pub seconds: f64,
    /// Pages that were first touched during the build.
    pub page_faults: Option<u64>,
}

/// A function that builds for the first time with a system.
pub type FirstBuilds<'a> = dyn Fn(&dyn System) -> Result<FirstBuild> + 'a;

/// Builds once in this process and prints the time as JSON.
///
/// # Errors
/// If there is no such scene or system, or it cannot be built.
pub fn run(args: &FirstBuildArgs) -> Result<()> {
    let system = system_named(&args.system)?;
    let first = in_this_process(&args.scene, args.shown(), args.up, system.as_ref())?;
    Ok(writeln!(io::stdout(), "{}", serde_json::to_string(&first)?)?)
}

/// Loads a scene and builds once over what it shows, in this process.
///
/// # Errors
/// If the scene cannot be loaded, or the structure not be built.
pub fn in_this_process(
    scene: &OsStr,
    shown: Shown,
    up: Option<Up>,
    system: &dyn System,
) -> Result<FirstBuild> {
    let scene = Scene::load(scene)?;
    let field = Field::over(&scene, shown.instances(), up);
    let input = Input::of(scene, shown, field.as_ref());
    // Free what loading has left on the heap.
    give_back_heap();
    let watch = Watch::start();
    let mut measured = None;
    system.build(&input, &mut |_| {
        measured.get_or_insert_with(|| watch.stop());
        Ok(())
    })?;
    let (seconds, page_faults) = measured.context("nothing was built")?;
    Ok(FirstBuild { seconds, page_faults })
}

/// Builds as `in_this_process` does, in a process that is started for it, on the core of this one.
///
/// # Errors
/// If that process fails.
pub fn in_new_process(
    scene: &OsStr,
    shown: Shown,
    up: Option<Up>,
    system: &dyn System,
) -> Result<FirstBuild> {
    let program = env::current_exe().context("this program has no file")?;
    let mut command = Command::new(program);
    command.arg(COMMAND).arg(scene).arg(system.name());
    command.args(shown.words()).stderr(Stdio::inherit());
    if let Some(up) = up.and_then(|up| up.to_possible_value()) {
        command.args(["--up", up.get_name()]);
    }
    let output = command.output().context("cannot start a process for a first build")?;
    ensure!(output.status.success(), "the process for a first build failed");
    serde_json::from_slice(&output.stdout).context("a first build printed no time")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_first_build_takes_time_and_names_what_is_missing() {
        let (system, knot) = (system_named("one-level").unwrap(), "procedural:knot:500".as_ref());
        let first = in_this_process(knot, Shown::Mesh, None, system.as_ref()).unwrap();
        assert!(first.seconds > 0.0);
        let system = system_named("bvh").unwrap();
        let field =
            in_this_process(knot, Shown::Instances(9), Some(Up::Z), system.as_ref()).unwrap();
        assert!(field.seconds > 0.0);
        let spheres = in_this_process(knot, Shown::Spheres, None, system.as_ref());
        assert!(spheres.unwrap().seconds > 0.0);
        let json = serde_json::to_string(&first).unwrap();
        assert_eq!(serde_json::from_str::<FirstBuild>(&json).unwrap(), first);
        assert!(
            in_this_process("no/such.ply".as_ref(), Shown::Mesh, None, system.as_ref()).is_err()
        );
        let error = system_named("nothing").map(drop).unwrap_err();
        assert!(error.to_string().contains("nothing"), "{error}");
    }
}
