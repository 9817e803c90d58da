//! The header is current, and complete without any other file.

use std::collections::BTreeMap;
use std::fs;
use std::process::Command;
use std::sync::OnceLock;

use hgrid_core::{Config, Method, Parameters, Quality, Scene, Sizes};
use hgrid_tests::artefact::{Flavour, compiler, compilers, is_cpp, root, run, static_library};
use tempfile::TempDir;

/// The C and C++ dialects that renderers are written in.
pub(crate) const DIALECTS: [&str; 7] = ["c99", "c11", "c17", "c++11", "c++14", "c++17", "c++20"];

/// Returns the committed header.
pub(crate) fn committed() -> String {
    fs::read_to_string(root().join("include/hgrid.h")).expect("include/hgrid.h")
}

/// Returns the header as a program for a flavour sees it: without `HGRID_MALLOC`, the lines that need it are missing.
pub(crate) fn seen_by(flavour: Flavour) -> String {
    let (mut header, mut rest) = (String::new(), committed());
    while let Some((before, behind)) = rest.split_once("\n#if defined(HGRID_MALLOC)\n") {
        let (inside, behind) = behind.split_once("\n#endif\n").expect("its end");
        header.push_str(before);
        header.push('\n');
        if flavour == Flavour::Malloc {
            header.push_str(inside);
            header.push('\n');
        }
        rest = behind.to_owned();
    }
    header + &rest
}

/// Returns the functions that the header declares.
pub(crate) fn functions(flavour: Flavour) -> Vec<String> {
    let header = seen_by(flavour);
    let is_code = |line: &&str| !line.starts_with([' ', '#', '/']) && !line.starts_with("typedef");
    let calls = header.lines().filter(is_code);
    let names = calls.filter_map(|line| line.split_once('(')?.0.rsplit([' ', '*']).next());
    names.map(str::to_owned).collect()
}

/// Returns the header's comment on a function, each paragraph in one line.
pub(crate) fn documentation(function: &str) -> String {
    let header = committed();
    let is_text = |line: &&str| !line.contains(&format!("{function}(")) || line.starts_with(' ');
    let before: Vec<_> = header.lines().take_while(is_text).collect();
    let before = before.join("\n");
    let (_, text) = before.rsplit_once("/**").expect("a comment");
    text.replace("\n * ", " ")
}

/// A parameter of a function.
pub(crate) struct Parameter {
    pub(crate) name: String,
    /// The type without `const`, `struct` and `*`.
    pub(crate) kind: String,
    pub(crate) is_pointer: bool,
}

/// Returns the parameters of a function, in order.
pub(crate) fn parameters(function: &str) -> Vec<Parameter> {
    let header = committed();
    let is_declared =
        |line: &&str| line.contains(&format!("{function}(")) && !line.starts_with(' ');
    let (start, _) = header
        .split_once(header.lines().find(is_declared).expect("a function"))
        .expect("the declaration");
    let declaration = header[start.len()..].split_once(");").expect("an end").0;
    let (_, list) = declaration.split_once('(').expect("parameters");
    let parameters =
        list.split(',').map(str::trim).filter(|text| !text.is_empty() && *text != "void");
    let parameter = |text: &str| {
        let words = text.split([' ', '*']).filter(|word| !["", "const", "struct"].contains(word));
        let words: Vec<_> = words.map(str::to_owned).collect();
        let [kind, name] = &words[..] else { panic!("{function}: {text}") };
        let is_pointer = text.contains('*');
        Parameter { name: name.clone(), kind: kind.clone(), is_pointer }
    };
    parameters.map(parameter).collect()
}

/// Returns the C functions in the header's comments.
pub(crate) fn examples(header: &str) -> Vec<String> {
    let blocks = header.split("```").skip(1).step_by(2);
    let blocks = blocks.filter_map(|block| block.strip_prefix("c\n"));
    // A field's comment is indented.
    let code = |line: &str| {
        let line = line.trim_start();
        format!("{}\n", line.strip_prefix('*').unwrap_or(line).trim_end())
    };
    blocks.map(|block| block.lines().map(code).collect()).collect()
}

/// Returns the statuses that the header defines.
pub(crate) fn statuses() -> BTreeMap<String, i32> {
    let header = committed();
    let lines = header.lines().filter_map(|line| line.strip_prefix("#define "));
    let pairs = lines.filter_map(|line| line.split_once(' '));
    pairs
        .filter(|(name, _)| *name == "HGRID_OK" || name.starts_with("HGRID_ERROR_"))
        .map(|(name, value)| (name.to_owned(), value.parse().expect("a number")))
        .collect()
}

/// Returns the output of `facts.c`.
fn facts() -> &'static str {
    static FACTS: OnceLock<String> = OnceLock::new();
    FACTS.get_or_init(|| {
        let dir = TempDir::new().expect("a folder");
        let program = dir.path().join("facts");
        let source = root().join("tests/c_abi/facts.c");
        run(compiler("c99").arg(source).arg(static_library()).arg("-o").arg(&program));
        String::from_utf8(run(&mut Command::new(program)).stdout).expect("text")
    })
}

/// Returns the value of a fact.
fn fact(name: &str) -> &'static str {
    let value = facts().lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
    value.unwrap_or_else(|| panic!("no {name} in facts.c"))
}

#[test]
fn it_is_current() {
    let package = root().join("capi");
    let config = cbindgen::Config::from_file(package.join("cbindgen.toml")).expect("cbindgen.toml");
    let builder = cbindgen::Builder::new().with_config(config).with_crate(package);
    let mut generated = Vec::new();
    builder.generate().expect("cbindgen understands the sources").write(&mut generated);
    let generated = String::from_utf8(generated).expect("text");
    // C89 has no other comments; cbindgen writes two of these lines itself. The section is for readers of Rust: the
    // head of the header says it once.
    let generated = generated
        .replace(" *\n * # Safety\n * Pointers are as the head of this file says.\n", "")
        .replace("// extern \"C\"", "/* extern \"C\" */")
        .replace("// __cplusplus", "/* __cplusplus */");
    assert!(!generated.contains("# Safety"), "the safety of a function in words of its own");

    if std::env::var_os("HGRID_BLESS").is_some() {
        // Replace the file in one step: other tests read it meanwhile.
        let fresh = root().join("include/hgrid.h.fresh");
        fs::write(&fresh, &generated).expect("include/ can be written");
        fs::rename(fresh, root().join("include/hgrid.h")).expect("include/ can be written");
    }
    assert!(
        committed() == generated,
        "include/hgrid.h is out of date: HGRID_BLESS=1 cargo test --test c_abi"
    );
}

#[test]
fn it_compiles_alone_in_every_dialect() {
    let dir = TempDir::new().expect("a folder");
    let source = dir.path().join("twice.c");
    fs::write(&source, "#include <hgrid.h>\n#include <hgrid.h>\n").expect("a file");
    for_every_compiler(|compiler, language| {
        run(compiler.args(["-fsyntax-only", "-x", language]).arg(&source));
    });
}

#[test]
fn it_compiles_in_the_oldest_dialect_with_all_that_it_defines() {
    let dir = TempDir::new().expect("a folder");
    let source = dir.path().join("old.c");
    fs::write(&source, "#define HGRID_MALLOC\n#include <hgrid.h>\n").expect("a file");
    for mut compiler in compilers("c89") {
        // The compiler's own <stdbool.h> needs one of them, because `_Bool` is younger.
        let named = ["-Wno-long-long", "-Wno-unknown-warning-option", "-Wno-c99-extensions"];
        run(compiler.arg("-pedantic-errors").args(named).arg("-fsyntax-only").arg(&source));
    }
}

/// Programs that are compiled without floating-point registers, such as kernels, pass floats elsewhere than
/// the library does.
#[test]
fn no_function_takes_or_returns_a_float_by_value() {
    let declarations = declarations(&committed());
    assert!(declarations.len() > functions(Flavour::Malloc).len());
    for declaration in declarations {
        let words = declaration.split(['(', ')', ',']).map(str::trim);
        for word in words.filter(|word| !word.contains('*')) {
            let is_float = word.split(' ').any(|part| ["float", "double"].contains(&part));
            assert!(!is_float, "{declaration}");
        }
    }
}

/// Returns all functions, function types and function pointers of the header, each in one line.
fn declarations(header: &str) -> Vec<String> {
    let is_text = |line: &&str| !line.trim_start().starts_with(['*', '/', '#']);
    let code: Vec<_> = header.lines().filter(is_text).map(str::trim).collect();
    let code = code.join(" ");
    let parts = code.split([';', '{', '}']).map(str::trim);
    parts.filter(|part| part.contains('(')).map(str::to_owned).collect()
}

#[test]
fn its_macros_give_no_warning_in_any_dialect() {
    let dir = TempDir::new().expect("a folder");
    let program = dir.path().join("macros");
    let source = root().join("tests/c_abi/macros.c");
    for_every_compiler(|compiler, language| {
        let compiler = compiler.args(["-Wconversion", "-Wsign-conversion", "-x", language]);
        run(compiler
            .arg(&source)
            .args(["-x", "none"])
            .arg(static_library())
            .arg("-o")
            .arg(&program));
        run(&mut Command::new(&program));
    });
}

/// Shows `visit` each compiler in each dialect, with the language's name.
fn for_every_compiler(mut visit: impl FnMut(&mut Command, &str)) {
    for dialect in DIALECTS {
        let language = if is_cpp(dialect) { "c++" } else { "c" };
        compilers(dialect).for_each(|mut compiler| visit(&mut compiler, language));
    }
}

#[test]
fn sizes_offsets_and_numbers_never_change() {
    let pinned = include_str!("abi.txt");
    let is_for_this_machine = |line: &&str| cfg!(target_pointer_width = "64") || is_number(line);
    let printed = facts().lines().take(pinned.lines().count()).filter(is_for_this_machine);
    assert!(printed.eq(pinned.lines().filter(is_for_this_machine)), "{}", facts());
    for (name, value) in statuses() {
        let line = format!("{name} {value}");
        assert!(pinned.lines().any(|pinned| pinned == line), "abi.txt lacks {line}");
    }
    let is_listed = |name: &str| pinned.lines().any(|line| line.split(' ').next() == Some(name));
    let mut count = 0;
    for (name, fields) in structs() {
        assert!(is_listed(&name), "abi.txt lacks {name}");
        for field in fields {
            assert!(is_listed(&format!("{name}.{field}")), "abi.txt lacks {name}.{field}");
            count += 1;
        }
    }
    assert!(count > 70);
}

/// Returns the structs of the header, and their fields.
pub(crate) fn structs() -> Vec<(String, Vec<String>)> {
    let mut structs: Vec<(String, Vec<String>)> = Vec::new();
    let mut is_inside = false;
    for line in committed().lines() {
        if let Some(name) = line.strip_prefix("typedef struct ") {
            structs.push((name.trim_end_matches(" {").to_owned(), Vec::new()));
            is_inside = true;
        } else if line.starts_with('}') {
            is_inside = false;
        } else if is_inside && line.starts_with("    ") && !line[4..].starts_with([' ', '*', '/']) {
            // `float origin[3]`, `const void *masks`, `bool (*progress)(void *context, uint32_t done)`
            let name = line.split_once("(*").map_or_else(
                || line.trim_end_matches(';').rsplit([' ', '*']).next().unwrap_or_default(),
                |(_, behind)| behind,
            );
            let name = name.split([')', '[']).next().unwrap_or_default();
            structs.last_mut().expect("a struct").1.push(name.to_owned());
        }
    }
    structs
}

/// Returns true if a line of the table is the same on machines with pointers of 32 bits.
fn is_number(line: &str) -> bool {
    line.starts_with("HGRID_")
}

#[test]
fn versions_are_those_of_the_package() {
    let package = env!("CARGO_PKG_VERSION");
    for name in ["macros", "text", "function_text"] {
        assert_eq!(fact(name), package, "{name}");
    }
    let number = package.split('.').fold(0u32, |number, part| {
        number << 8 | part.parse::<u32>().expect("a version without letters")
    });
    for name in ["macro", "function"] {
        assert_eq!(fact(name), number.to_string(), "{name}");
    }
    assert_eq!(fact("HGRID_BLOB_VERSION"), hgrid_core::BLOB_VERSION.to_string());
}

#[test]
fn initialisers_are_the_defaults() {
    // All other fields are 0 or NULL.
    for (name, fields) in [
        ("mesh", "0 0 0 0 0 0 0 0 0 0 0"),
        ("query_options", "0xffffffff 0 0xffffffff 0 0 0 0 0 0 0"),
        ("report", "0 0 0 0xffffffff 0 0 0 0 0 0 0"),
        ("blob_info", "0 0 0 0 0 0 0 0 0"),
        ("refit_report", "0xffffffff 0 0"),
        ("statistics", "0 0 0xffffffff 0 0 0 0 0"),
        ("allocator", "0 0 0 0"),
        ("boxes", "0 0 0 0 0 0 0 0"),
        ("scene_options", "0xffffffff 0 0 0 0 0 0 0"),
    ] {
        assert_eq!(fact(name), format!("{} {fields}", fact(&format!("hgrid_{name}"))), "{name}");
    }
    for parameters in Method::ALL.iter().copied().map(Parameters::new) {
        // Each macro also sets the paper's values for other methods.
        let (mut factor, mut above, mut levels) = (6, 16, 3);
        match parameters {
            Parameters::Fixed { macrocell_factor, .. } => factor = macrocell_factor,
            Parameters::Variable { subdivide_above, .. } => above = subdivide_above,
            Parameters::Recursive { depth, .. } => levels = depth,
            _ => {}
        }
        let (size, density) = (fact("hgrid_config"), parameters.density().unwrap_or(4.0));
        // One task, and no progress callback.
        let fields = format!("{size} {density} {factor} {above} {levels} 0 0 1 0 0 0 0");
        let method = parameters.method();
        assert_eq!(fact(&format!("config_{}", method as u32)), fields, "{method:?}");
    }
    assert_eq!(fact("HGRID_METHOD_BVH"), (Config::default().method() as u32).to_string());
}

#[test]
fn bounds_are_no_less_than_those_of_core() {
    let mut count = 0;
    for line in facts().lines().filter_map(|line| line.strip_prefix("bounds ")) {
        let numbers: Vec<usize> = line.split(' ').map(|word| word.parse().unwrap()).collect();
        let [triangles, proof, scene, all @ ..] = &numbers[..] else { panic!("{line}") };
        // The proof takes one bit for each triangle, in whole words.
        let least = triangles.div_ceil(32) * 4;
        assert!((least..=least + 4).contains(proof), "{line}");
        let triangles = u32::try_from(*triangles).unwrap();
        let tree = Config::default();
        if let Some(bound) = Scene::bound(triangles, &tree) {
            let is_close = *scene <= bound.index_bytes + bound.index_bytes / 16 + 1280;
            assert!(*scene >= bound.index_bytes && (triangles > 1_000_000 || is_close), "{line}");
        }
        let high = Config::from(Parameters::Bvh { quality: Quality::High });
        let configs = [tree, Config::new(Method::OneLevel), high];
        assert_eq!(all.len(), 2 * configs.len());
        for (config, macros) in configs.iter().zip(all.chunks(2)) {
            let is_too_many = config.method() == Method::Bvh && triangles > 1 << 31;
            let bound = Sizes::bound(triangles, config);
            assert_eq!(bound.is_none(), is_too_many, "{line}");
            let Some(bound) = bound else { continue };
            let bounds = [bound.index_bytes, bound.scratch_bytes];
            assert!(macros.iter().zip(bounds).all(|(&given, bound)| given >= bound), "{line}");
            // The macros ask for little more than the exact bound of core.
            let slack = bound.index_bytes / 16 + 1280;
            let is_close = macros[0] <= bound.index_bytes + slack;
            assert!(triangles > 1_000_000 || is_close, "{line}: {bound:?}");
        }
        count += 1;
    }
    assert!(count > 3000);
}

#[test]
fn every_function_says_what_callers_must_know() {
    for function in functions(Flavour::Malloc) {
        let text = documentation(&function);
        assert!(text.contains("Threads: "), "{function} says nothing about threads");
        let takes_pointers = parameters(&function).iter().any(|parameter| parameter.is_pointer);
        assert!(!takes_pointers || text.contains("NULL"), "{function} says nothing about NULL");
    }
}

#[test]
fn its_example_runs() {
    let header = committed();
    let lines = header.lines().filter_map(|line| line.strip_prefix(" *"));
    let lines = lines.skip_while(|line| !line.contains("#include")).map(str::trim_end);
    let program: Vec<_> = lines.take_while(|line| !line.contains("cargo build")).collect();
    let dir = TempDir::new().expect("a folder");
    let source = dir.path().join("example.c");
    fs::write(&source, program.join("\n")).expect("a file");
    let example = dir.path().join("example");
    run(compiler("c99").arg(source).arg(static_library()).arg("-o").arg(&example));
    let printed = run(&mut Command::new(example)).stdout;
    assert_eq!(String::from_utf8(printed).as_deref(), Ok("triangle 0 at t = 1\n"));
}

#[test]
fn its_functions_examples_run() {
    let examples = examples(&seen_by(Flavour::Bare));
    // A new example that the program does not call is an unused function: a warning, so an error.
    assert!(examples.len() >= 5);
    let source = include_str!("tile.c").replace("FUNCTIONS", &examples.join("\n"));

    let dir = TempDir::new().expect("a folder");
    let [path, program] = ["tile.c", "tile"].map(|name| dir.path().join(name));
    fs::write(&path, source).expect("a file");
    run(compiler("c99").arg("-pthread").arg(path).arg(static_library()).arg("-o").arg(&program));
    run(&mut Command::new(program));
}

#[test]
fn it_speaks_c() {
    let header = committed();
    for word in ["slice", "crate", "Option<", "Some(", "Result<", "`&", "[`", "usize", "trait"] {
        assert!(!header.contains(word), "`{word}` is no word for C readers");
    }
}
