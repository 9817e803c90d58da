//! C programs that use the library by its header and the archive alone.
//!
//! Each program ends at the first check that fails. The tests run them with sanitizers, as C++, with the
//! shared library, and under valgrind, which unlike the sanitizers also checks the library's code.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, OnceLock};
use std::{env, fs, thread};

use hgrid_tests::artefact::{
    Flavour, clang, compiler, compilers, cpp_compiler, is_cpp, library_dir, output,
    output_watching_threads, root, run, static_library,
};
use hgrid_tests::tools::{command, is_installed, skip};
use tempfile::TempDir;

use crate::header::DIALECTS;

/// Programs that check themselves and print what they reached (see `promises`), and the flavour of the
/// library that they need.
const PROGRAMS: [(&str, Flavour); 23] = [
    ("queries", Flavour::Bare),
    ("options", Flavour::Bare),
    ("batches", Flavour::Bare),
    ("memory", Flavour::Bare),
    ("budgets", Flavour::Bare),
    ("methods", Flavour::Bare),
    ("parallel", Flavour::Bare),
    ("progress", Flavour::Bare),
    ("nested", Flavour::Bare),
    ("threads", Flavour::Bare),
    ("nulls", Flavour::Bare),
    ("structs", Flavour::Bare),
    ("regions", Flavour::Bare),
    ("refusals", Flavour::Bare),
    ("blobs", Flavour::Bare),
    ("stored", Flavour::Bare),
    ("refits", Flavour::Bare),
    ("joined", Flavour::Bare),
    ("scenes", Flavour::Bare),
    ("scene_batches", Flavour::Bare),
    ("scene_refusals", Flavour::Bare),
    ("packed_scenes", Flavour::Bare),
    ("create", Flavour::Malloc),
];

/// Sanitizer flags, with optimisation off: optimised programs take four times as long to compile.
pub(crate) const SANITIZERS: [&str; 4] =
    ["-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-fno-omit-frame-pointer", "-O0"];

/// The argument that makes a program do a part of its work, if it can. The test with sanitizers runs all of it, except
/// for `stack`, which has a slow test for all.
const PART: &str = "part";

/// Compiles a program of this folder against a library.
pub(crate) fn compile(
    name: &str,
    mut compiler: Command,
    flags: &[&str],
    library: &Path,
    dir: &Path,
) -> PathBuf {
    let program = dir.join(name);
    let is_cpp = compiler.get_args().any(|arg| arg.to_string_lossy().starts_with("-std=c++"));
    let language = if is_cpp { "c++" } else { "c" };
    let source = root().join("tests/c_abi").join(name).with_extension("c");
    // The programs, not the library, need more than plain C: page protection and threads.
    compiler.args(["-D_DEFAULT_SOURCE", "-pthread", "-g", "-O1"]).args(flags);
    compiler.args(["-x", language]).arg(source).args(["-x", "none"]).arg(library);
    run(compiler.arg("-o").arg(&program));
    program
}

/// Returns the programs, compiled once without sanitizers.
fn plain() -> impl Iterator<Item = (PathBuf, Flavour)> {
    static DIR: OnceLock<PathBuf> = OnceLock::new();
    let dir = DIR.get_or_init(|| {
        let dir = Path::new(env!("CARGO_TARGET_TMPDIR")).join("c_abi");
        fs::create_dir_all(&dir).expect("a folder");
        side_by_side(PROGRAMS.into(), |(name, flavour)| {
            compile(name, compiler("c99"), &[], &flavour.static_library(), &dir);
        });
        dir
    });
    PROGRAMS.into_iter().map(move |(name, flavour)| (dir.join(name), flavour))
}

/// Returns what the programs print, compiled with sanitizers and run once.
pub(crate) fn printed() -> &'static str {
    static PRINTED: OnceLock<String> = OnceLock::new();
    PRINTED.get_or_init(|| {
        let dir = TempDir::new().expect("a folder");
        let printed = Mutex::new(String::new());
        side_by_side(PROGRAMS.into(), |(name, flavour)| {
            let library = flavour.static_library();
            let program = compile(name, compiler("c99"), &SANITIZERS, &library, dir.path());
            let output = String::from_utf8(run(&mut Command::new(program)).stdout).expect("text");
            *printed.lock().expect("no thread panics while it appends") += &output;
        });
        printed.into_inner().expect("no thread panicked")
    })
}

#[test]
fn they_pass_as_c99_with_sanitizers() {
    assert!(!printed().is_empty());
}

/// Returns the sources of this folder that compile as they are: tests put examples of the header into the others.
fn sources(dialect: &str) -> Vec<PathBuf> {
    let is_whole = |path: &PathBuf| {
        let name = path.file_name().expect("a name").to_string_lossy();
        // hgrid.hpp needs C++14.
        name.ends_with(".c") && !["created.c", "tile.c"].contains(&&*name)
            || name.ends_with(".cpp") && ["c++14", "c++17", "c++20"].contains(&dialect)
    };
    let entries = fs::read_dir(root().join("tests/c_abi")).expect("this folder");
    entries.map(|entry| entry.expect("a file").path()).filter(is_whole).collect()
}

/// Other tests run each program in one or two dialects, with one compiler for each.
#[test]
fn no_compiler_warns_about_them_in_an_old_dialect() {
    nobody_warns_about_them(&["c++14"], 1);
}

#[test]
#[ignore = "slow: compiles all programs a dozen times"]
fn no_compiler_warns_about_them_in_any_dialect() {
    nobody_warns_about_them(&DIALECTS, usize::MAX);
}

/// Compiles the programs with the first so many compilers for each dialect.
fn nobody_warns_about_them(dialects: &[&'static str], count: usize) {
    let dir = TempDir::new().expect("a folder");
    let commands = dialects.iter().flat_map(|&dialect| {
        // Some warnings need the optimiser.
        let is_optimised = ["c17", "c++17"].contains(&dialect);
        let flags = if is_optimised { &["-O1", "-c"][..] } else { &["-fsyntax-only"] };
        let language = if is_cpp(dialect) { "c++" } else { "c" };
        let dir = dir.path();
        compilers(dialect).take(count).enumerate().map(move |(which, mut compiler)| {
            let folder = dir.join(format!("{dialect}-{which}"));
            fs::create_dir(&folder).expect("a folder");
            compiler.current_dir(folder).args(flags).args(["-D_DEFAULT_SOURCE", "-pthread"]);
            compiler.args(["-x", language]).args(sources(dialect));
            compiler
        })
    });
    run_side_by_side(commands.collect());
}

/// Returns programs of all kinds: queries, scenes, and memory that the library allocates itself.
fn some() -> impl Iterator<Item = (&'static str, Flavour)> {
    PROGRAMS.into_iter().filter(|(name, _)| ["queries", "scenes", "create"].contains(name))
}

#[test]
fn some_pass_as_cpp_with_the_larger_flavour() {
    pass_as_cpp_with_the_larger_flavour(some());
}

#[test]
#[ignore = "slow: compiles all programs"]
fn they_pass_as_cpp_with_the_larger_flavour() {
    pass_as_cpp_with_the_larger_flavour(PROGRAMS.into_iter());
}

fn pass_as_cpp_with_the_larger_flavour(programs: impl Iterator<Item = (&'static str, Flavour)>) {
    let dir = TempDir::new().expect("a folder");
    for (name, _) in programs {
        let (flags, library) = (["-DHGRID_MALLOC"], Flavour::Malloc.static_library());
        let Some(compiler) = clang("c++17").or_else(|| cpp_compiler("c++17")) else { return };
        run(Command::new(compile(name, compiler, &flags, &library, dir.path())).arg(PART));
    }
}

#[test]
fn some_pass_with_the_shared_libraries() {
    pass_with_the_shared_libraries(some());
}

#[test]
#[ignore = "slow: compiles all programs"]
fn they_pass_with_the_shared_libraries() {
    pass_with_the_shared_libraries(PROGRAMS.into_iter());
}

/// Compiles each program once: both flavours of the library have the same name, and the larger one must work
/// for all programs.
fn pass_with_the_shared_libraries(programs: impl Iterator<Item = (&'static str, Flavour)>) {
    let dir = TempDir::new().expect("a folder");
    for (name, flavour) in programs {
        let compiler = clang("c11").unwrap_or_else(|| compiler("c11"));
        let program = compile(name, compiler, &[], &flavour.shared_library(), dir.path());
        for library in [flavour, Flavour::Malloc] {
            run(Command::new(&program).arg(PART).env("LD_LIBRARY_PATH", library.dir()));
        }
    }
}

/// Works on all items, on as many at once as there are cores.
fn side_by_side<T: Send>(items: Vec<T>, work: impl Fn(T) + Sync) {
    let items = Mutex::new(items);
    let next = || items.lock().expect("no thread panics while it takes one").pop();
    let work_on_all = || {
        while let Some(item) = next() {
            work(item);
        }
    };
    let count = thread::available_parallelism().map_or(1, usize::from);
    thread::scope(|scope| (0..count).for_each(|_| drop(scope.spawn(work_on_all))));
}

/// Runs all commands.
fn run_side_by_side(commands: Vec<Command>) {
    side_by_side(commands, |mut command| drop(run(&mut command)));
}

/// Runs all programs in valgrind, which is slow: a part of their work, unless `HGRID_WHOLE` is set, as in
/// `.ci/slow valgrind`.
fn run_in_valgrind(programs: &[PathBuf], options: &[&str]) {
    let valgrind = programs.iter().map(|program| {
        let mut valgrind = command("valgrind");
        valgrind.args(["--quiet", "--error-exitcode=99"]).args(options).arg(program);
        if env::var_os("HGRID_WHOLE").is_none() {
            valgrind.arg(PART);
        }
        valgrind
    });
    run_side_by_side(valgrind.collect());
}

#[test]
#[ignore = "slow: valgrind"]
fn they_pass_under_valgrind() {
    if !is_installed("valgrind") {
        return;
    }
    let programs = plain().map(|(program, _)| program);
    // Another tool checks the program with threads.
    run_in_valgrind(&programs.filter(|path| !path.ends_with("threads")).collect::<Vec<_>>(), &[]);
}

/// Optimised code without sanitizers lays out its memory as that of users, and nothing slows its threads down.
#[test]
#[ignore = "slow: compiles all programs"]
fn they_pass_as_they_are() {
    run_side_by_side(plain().map(|(program, _)| Command::new(program)).collect());
}

/// Runs the programs with concurrent queries and parallel builds.
#[test]
#[ignore = "slow: valgrind"]
fn valgrind_sees_no_thread_get_in_the_way_of_another() {
    if !is_installed("valgrind") {
        return;
    }
    let is_about = |path: &PathBuf| path.ends_with("threads") || path.ends_with("parallel");
    let programs: Vec<_> = plain().map(|(program, _)| program).filter(is_about).collect();
    assert_eq!(programs.len(), 2);
    run_in_valgrind(&programs, &["--tool=drd"]);
}

#[test]
fn no_thread_gets_in_the_way_of_another() {
    if !is_installed("tsan") {
        return;
    }
    let dir = TempDir::new().expect("a folder");
    let flags = ["-fsanitize=thread"];
    let [source, empty] = ["empty.c", "empty"].map(|name| dir.path().join(name));
    fs::write(&source, "int main(void) { return 0; }\n").expect("a file");
    let usual: fn() -> Option<Command> = || Some(compiler("c99"));
    let clang: fn() -> Option<Command> =
        || if is_installed("libclang-rt") { clang("c99") } else { None };
    for compiler in [usual, clang] {
        let (Some(mut check), Some(compiler)) = (compiler(), compiler()) else { continue };
        if !output(check.args(flags).arg(&source).arg("-o").arg(&empty)).status.success() {
            skip("a compiler without ThreadSanitizer (for clang: libclang-rt-dev)");
            continue;
        }
        let program = compile("threads", compiler, &flags, &static_library(), dir.path());
        let Some(output) = output_watching_threads(&mut Command::new(program)) else {
            skip("ThreadSanitizer cannot run on this kernel");
            continue;
        };
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
}

/// The header promises 9 KiB for a ray or a point (docs/embedded.md: 7 KiB in a tree of up to 14 levels), 40 KiB for a
/// batch, 18 KiB for a build, 96 KiB for one with tasks and 13 KiB for a task; for a ray in scenes 8 KiB for each of
/// them and 9 KiB for a grid; for a batch in a scene 80 KiB, and 8 KiB for each scene inside it.
#[test]
fn queries_and_builds_take_little_stack() {
    takes_little_stack(&[PART]);
}

#[test]
#[ignore = "slow: crowds in crowds"]
fn queries_and_builds_over_crowds_take_little_stack() {
    takes_little_stack(&[]);
}

fn takes_little_stack(arguments: &[&str]) {
    let dir = TempDir::new().expect("a folder");
    let program = compile("stack", compiler("c99"), &[], &static_library(), dir.path());
    let printed = run(Command::new(program).args(arguments)).stdout;
    let printed = String::from_utf8(printed).expect("text");
    let most = |name: &str| {
        let line = printed.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
        line.and_then(|bytes| bytes.parse::<usize>().ok()).expect("a number")
    };
    // The stack of a walk through a deep tree; a ray that does not need it takes less than what is added to it.
    let deep = 449 * 8;
    for name in ["one", "options", "closest", "shapes"] {
        assert!((deep + 2000..9 << 10).contains(&most(name)), "{name}: {}", most(name));
    }
    assert!(most("levels") > 14, "no deep tree");
    // A ray for which its first stack is too short takes a second one, which is small in a tree of few levels.
    let small = 99 * 8;
    for (name, least) in [("one", 2800), ("options", 4100), ("closest", 2000), ("shapes", 1900)] {
        let bytes = most(&format!("{name}_few"));
        assert!((small + least..7 << 10).contains(&bytes), "{name}: {bytes} with few levels");
    }
    // The buffers alone hold 128 rays and 128 hits.
    for name in ["many", "shapes_many"] {
        assert!((128 * 48..40 << 10).contains(&most(name)), "{name}: {}", most(name));
    }
    for name in ["build", "scenes"] {
        assert!((2000..18 << 10).contains(&most(name)), "{name}: {}", most(name));
    }
    // One scene, and four nested scenes, over a tangle. Over the sheet and its crowds they take 7.6 and 16.7 KiB.
    for (name, scenes, least) in [("scene", 1, 11 << 10), ("nested", 4, 17 << 10)] {
        let promised = (8 * scenes + 9) << 10;
        assert!((least..promised).contains(&most(name)), "{name}: {}", most(name));
    }
    // The buffers hold the rays of a group twice, outside and inside an instance.
    for (name, inside) in [("scene_many", 0), ("nested_many", 3)] {
        let promised = (80 + 8 * inside) << 10;
        assert!((2 * 64 * 48..promised).contains(&most(name)), "{name}: {}", most(name));
    }
    // The build has room for 64 tasks.
    assert!((20 << 10..96 << 10).contains(&most("tasks")), "tasks: {}", most("tasks"));
    assert!((500..13 << 10).contains(&most("task")), "task: {}", most("task"));
}

#[test]
fn the_library_links_by_its_name_alone() {
    let dir = TempDir::new().expect("a folder");
    let program = dir.path().join("queries");
    let mut compiler = compiler("c99");
    compiler.arg("-D_DEFAULT_SOURCE").arg(root().join("tests/c_abi/queries.c"));
    compiler.arg("-L").arg(library_dir()).arg("-lhgrid").arg("-o").arg(&program);
    run(compiler.arg(format!("-Wl,-rpath,{}", library_dir().display())));
    // Cargo sets a path for shared libraries, which would come first.
    run(Command::new(program).env_remove("LD_LIBRARY_PATH"));
}
