//! hgrid.hpp does what it says, in every dialect, and refuses what it cannot do.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use hgrid_tests::artefact::{compilers, cpp_compiler, output, root, run, static_library};
use tempfile::TempDir;

use crate::programs::{example, printed};

/// The flags of an engine without exceptions, and more warnings than the project's own.
const STRICT: [&str; 5] =
    ["-fno-exceptions", "-fno-rtti", "-Wconversion", "-Wold-style-cast", "-Wsign-conversion"];

/// A program of several files that include the header.
const PROGRAM: [&str; 5] =
    ["hpp_types.cpp", "hpp_builds.cpp", "hpp_queries.cpp", "hpp_scenes.cpp", "cost.cpp"];

fn header(name: &str) -> String {
    fs::read_to_string(root().join("include").join(name)).expect("a header")
}

/// Compiles and links a program.
fn build(mut compiler: Command, sources: &[PathBuf], flags: &[&str], dir: &Path) -> PathBuf {
    let program = dir.join("program");
    compiler.args(["-O1", "-pthread"]).args(flags).args(sources).arg(static_library());
    run(compiler.arg("-o").arg(&program));
    program
}

fn driver(name: &str) -> PathBuf {
    root().join("tests/examples").join(name)
}

fn it_does_what_it_says(compilers: impl Iterator<Item = Command>, flags: &[&str]) {
    let dir = TempDir::new().expect("a folder");
    for compiler in compilers {
        let program = build(compiler, &PROGRAM.map(driver), &[&STRICT, flags].concat(), dir.path());
        assert_eq!(printed(&mut Command::new(program)), "all is well\n");
    }
}

#[test]
fn it_does_what_it_says_in_the_oldest_dialect() {
    it_does_what_it_says(compilers("c++14").take(1), &["-O0"]);
}

#[test]
#[ignore = "slow: optimises much C++ six times"]
fn it_does_what_it_says_in_every_dialect() {
    it_does_what_it_says(["c++14", "c++17", "c++20"].into_iter().flat_map(compilers), &[]);
}

#[test]
#[ignore = "slow: compiles much C++ with sanitizers"]
fn it_does_what_it_says_under_sanitizers() {
    let dir = TempDir::new().expect("a folder");
    // Without optimisation it compiles in half the time.
    let flags = ["-O0", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"];
    let Some(compiler) = cpp_compiler("c++17") else { return };
    let program = build(compiler, &PROGRAM.map(driver), &flags, dir.path());
    assert_eq!(printed(&mut Command::new(program)), "all is well\n");
}

/// The output of hello.cpp.
pub(crate) const HELLO: &str = "\
triangle 2 at t = 2
through the hole: triangle 0 at t = 3
........................
..______#############_..
..______###########___..
..______#########_____..
..#############_______..
..###########_________..
..#########___________..
..#######_____________..
..#####_______________..
..###_________________..
..#___________________..
........................
";

#[test]
fn hello_prints_what_is_there() {
    prints_what_is_there(compilers("c++14").take(1));
}

#[test]
#[ignore = "slow: optimises C++ three times"]
fn hello_prints_what_is_there_in_other_dialects() {
    prints_what_is_there(compilers("c++14").chain(compilers("c++17")).skip(1));
}

fn prints_what_is_there(compilers: impl Iterator<Item = Command>) {
    let dir = TempDir::new().expect("a folder");
    for compiler in compilers {
        let program = build(compiler, &[example("hello.cpp")], &STRICT, dir.path());
        assert_eq!(printed(&mut Command::new(program)), HELLO);
    }
}

/// The program in the head comment of the header compiles and prints the hit.
#[test]
fn its_own_example_prints_the_hit() {
    let Some(compiler) = cpp_compiler("c++17") else { return };
    let header = header("hgrid.hpp");
    let lines = header.lines().skip_while(|line| !line.contains("#include <hgrid.hpp>"));
    let lines: Vec<_> = lines.take_while(|line| !line.contains("Exceptions:")).collect();
    let program: String =
        lines.iter().map(|line| line.trim_start_matches(" *").to_owned() + "\n").collect();
    let dir = TempDir::new().expect("a folder");
    let source = dir.path().join("program.cpp");
    fs::write(&source, program).expect("a file");
    let program = build(compiler, &[source], &[], dir.path());
    assert_eq!(printed(&mut Command::new(program)), "triangle 0 at t = 1\n");
}

/// The header compiles behind macros that windows.h defines.
#[test]
fn macros_of_windows_h_do_no_harm() {
    let hpp = header("hgrid.hpp");
    // The standard library of that system is written with such macros in mind; others are not.
    let standard =
        hpp.lines().filter(|line| line.starts_with("#include <") && !line.contains("optional"));
    let standard: Vec<_> = standard.collect();
    assert!(standard.len() > 5, "{standard:?}");
    let program = format!(
        "{}\n#define max(a, b) ((a) > (b) ? (a) : (b))\n#define min(a, b) ((a) < (b) ? (a) : (b))\n\
         #define near\n#define far\n#define small char\n#define interface struct\n#define ERROR 0\n\
         #include <hgrid.hpp>\nint main() {{ return hgrid::grid().blob().empty() ? 0 : 1; }}\n",
        standard.join("\n")
    );
    let dir = TempDir::new().expect("a folder");
    let source = dir.path().join("program.cpp");
    fs::write(&source, program).expect("a file");
    for mut compiler in compilers("c++14") {
        run(compiler.arg("-fsyntax-only").arg(&source));
    }
}

/// Returns the names in a text that begin with a prefix.
fn names(text: &str, prefix: &str) -> BTreeSet<String> {
    let words = text.split(|c: char| !c.is_ascii_alphanumeric() && c != '_');
    words.filter(|word| word.starts_with(prefix)).map(str::to_owned).collect()
}

#[test]
fn every_status_and_every_function_of_c_is_there() {
    let (c, cpp) = (header("hgrid.h"), header("hgrid.hpp"));
    let defined = c.lines().filter_map(|line| line.strip_prefix("#define HGRID_"));
    let defined: Vec<_> = defined.filter_map(|line| line.split([' ', '(']).next()).collect();
    for group in ["ERROR_", "METHOD_", "COHERENCE_", "CULL_", "CONTENT_", "QUALITY_"] {
        let of_group: Vec<_> = defined.iter().filter(|name| name.starts_with(group)).collect();
        assert!(of_group.len() > 1, "{group}");
        for name in of_group {
            let value = name.strip_prefix(group).expect("its group").to_lowercase();
            assert!(cpp.contains(&format!("    {value} = HGRID_{name},\n")), "{name}");
        }
    }

    // Declarations begin in the first column, followed by their arguments.
    let declared = c.lines().filter(|line| line.starts_with(|c: char| c.is_ascii_lowercase()));
    let functions = declared.filter_map(|line| line.split_once('(')).flat_map(|(start, _)| {
        let name = start.rsplit([' ', '*']).next().unwrap_or_default();
        name.starts_with("hgrid_").then(|| name.to_owned())
    });
    // A comment calls nothing.
    let code = cpp.lines().map(|line| line.split("//").next().unwrap_or_default());
    let called = names(&code.collect::<Vec<_>>().join("\n"), "hgrid_");
    // hgrid::memory replaces memory from a C callback. The version string has no counterpart.
    let without: BTreeSet<_> = ["hgrid_create", "hgrid_destroy", "hgrid_version_string"].into();
    for function in functions.filter(|name| !without.contains(name.as_str())) {
        assert!(called.contains(&function), "{function} is not called by hgrid.hpp");
    }
}

/// Lines that must not compile, each with a word of the compiler's message.
const REFUSED: [(&str, &str); 80] = [
    ("hgrid::options().filter([](const hgrid::hit &) { return true; });", "filter"),
    ("auto f = [](int *) { return true; }; hgrid::options().filter(f);", "called with a hit"),
    ("auto f = [](int *) { return true; }; hgrid::scene_options().filter(f);", "called with a hit"),
    (
        "auto f = [](const hgrid::hit &) { return HGRID_ACCEPT_AND_STOP; }; hgrid::options().filter(f);",
        "answers with a hgrid::verdict",
    ),
    (
        "auto f = [](std::size_t, const hgrid::hit &) -> hgrid_verdict { return HGRID_ACCEPT_AND_STOP; };\
         hgrid::options().filter(f);",
        "answers with a hgrid::verdict",
    ),
    (
        "auto f = [](const hgrid::scene_hit &hit) { return hit.t; }; hgrid::scene_options().filter(f);",
        "answers with a hgrid::verdict",
    ),
    ("hgrid::config().progress([](float) {});", "progress"),
    ("auto f = [](hgrid::task) {}; hgrid::config().parallel_for(2, f);", "std::uint32_t and a"),
    ("hgrid::mesh m(std::vector<float>(9), indices);", "give them a name"),
    ("std::vector<double> v(9); hgrid::mesh m(v, indices);", "must be float, not double"),
    ("std::vector<of<double>> v(3); hgrid::mesh m(v, indices);", "must be float, not double"),
    ("std::vector<wide> v(3); hgrid::mesh m(v, indices);", "must be float, not double"),
    ("std::vector<int> v(9); hgrid::mesh m(v, indices);", "coordinates of a vertex are floats"),
    ("std::vector<std::array<float, 2>> v(3); hgrid::mesh m(v, indices);", "three coordinates"),
    ("std::vector<of<int>> v(3); hgrid::mesh m(v, indices);", "name the field"),
    ("std::vector<late> v(3); hgrid::mesh m(v, indices);", "name the field"),
    ("std::vector<backwards> v(3); hgrid::mesh m(v, indices);", "name the field"),
    ("std::vector<face> v(3); hgrid::mesh m(v, indices);", "name the field"),
    ("std::vector<framed> v(3); hgrid::mesh m(v, indices);", "name the field"),
    ("std::vector<numbered> v(3); hgrid::mesh m(v, indices);", "name the field"),
    ("std::vector<slice> v(3); hgrid::mesh m(v, indices);", "name the field"),
    ("std::vector<float> v(9); hgrid::grid::keep(v, std::vector<int>(3));", "std::move them"),
    (
        "hgrid::memory m; hgrid::grid::keep(m, [](const hgrid::memory &) { return hgrid::mesh(hgrid_mesh{}); });",
        "std::move them",
    ),
    (
        "std::vector<face> f(1); hgrid::grid::keep(std::vector<float>(9), hgrid::field(f, &face::corners));",
        "a callable that makes the mesh",
    ),
    (
        "hgrid::grid::keep(hgrid::span<const float>(vertices), std::vector<unsigned>(indices));",
        "a callable that makes the mesh",
    ),
    ("std::vector<face> f(1); hgrid::mesh m(vertices, f);", "name the field"),
    ("std::vector<short> i(3); hgrid::mesh m(vertices, i);", "or unsigned ones of 16"),
    ("hgrid::grid a; hgrid::grid b = a;", "delete"),
    ("hgrid::mesh(vertices, indices).masks(std::vector<unsigned>(1));", "delete"),
    ("hgrid::view v = *hgrid::grid::build(hgrid::mesh(vertices, indices));", "delete"),
    ("hgrid::view v; v = *hgrid::grid::build(hgrid::mesh(vertices, indices));", "delete"),
    ("hgrid::view v; v = made<const hgrid::grid>();", "delete"),
    ("hgrid::grid g; auto v = hgrid::view::open(*g.pack());", "delete"),
    ("auto v = hgrid::view::open(std::vector<hgrid::byte>(64));", "delete"),
    (
        "hgrid::memory m; auto v = hgrid::view::open(std::move(m), hgrid::mesh(vertices, indices));",
        "delete",
    ),
    ("hgrid::memory m; auto g = hgrid::grid::open(m);", "delete"),
    (
        "std::vector<std::array<unsigned, 4>> q(1); hgrid::mesh m(vertices, q);",
        "two triangles of a quad",
    ),
    (
        "std::vector<std::array<unsigned short, 4>> q(1); hgrid::mesh m(vertices, q);",
        "two triangles of a quad",
    ),
    (
        "using row = unsigned[4]; row q[2] = {}; hgrid::mesh m(vertices, q);",
        "two triangles of a quad",
    ),
    (
        "std::vector<quad> q(1); hgrid::mesh m(vertices, hgrid::field(q, &quad::corners));",
        "two triangles of a quad",
    ),
    (
        "std::vector<std::vector<unsigned>> q(1); hgrid::mesh m(vertices, q);",
        "a triangle holds its indices",
    ),
    (
        "std::vector<std::vector<float>> v(3); hgrid::mesh m(v, indices);",
        "a vertex holds its floats",
    ),
    // Temporaries of what views refer to.
    ("hgrid::mesh m(std::array<float, 9>(), indices);", "give them a name"),
    (
        "hgrid::mesh m(vertices, hgrid::field(std::array<face, 1>(), &face::corners));",
        "give them a name",
    ),
    ("using row = float[9]; hgrid::mesh m(row{}, indices);", "give them a name"),
    ("hgrid::mesh(vertices, indices).masks(std::array<unsigned, 1>());", "delete"),
    (
        "std::vector<hgrid::mesh> m; auto j = hgrid::mesh::join(m, std::vector<hgrid::part>(1));",
        "conver",
    ),
    ("auto v = hgrid::view::open(hgrid::as_bytes(std::vector<int>(16)));", "delete"),
    ("hgrid::view v = made<const hgrid::grid>();", "delete"),
    ("hgrid::span<float> s = std::array<float, 9>();", "conver"),
    ("hgrid::as_writable_bytes(std::vector<float>(9));", "as_writable_bytes"),
    ("const std::vector<float> v(9); hgrid::as_writable_bytes(v);", "as_writable_bytes"),
    (
        "hgrid::view::build(hgrid::mesh(vertices, indices), {}, made<hgrid::memory>(), {});",
        "conver",
    ),
    ("hgrid::view::refit(hgrid::mesh(vertices, indices), made<hgrid::memory>());", "conver"),
    ("hgrid::options().sort_in(std::vector<hgrid::byte>(64));", "conver"),
    ("hgrid::scene_options().sort_in(std::vector<hgrid::byte>(64));", "conver"),
    ("hgrid::options().count({});", "lvalue reference"),
    ("hgrid::options().filter(made<const accepts>());", "delete"),
    ("hgrid::scene_options().filter(made<const accepts>());", "delete"),
    ("hgrid::config().progress(made<const accepts>());", "delete"),
    ("hgrid::config().parallel_for(2, made<const accepts>());", "delete"),
    ("hgrid::boxes b(std::vector<box>(1), meets);", "delete"),
    ("std::vector<box> v(1); hgrid::boxes b(v, accepts());", "delete"),
    ("std::vector<box> v(1); hgrid::boxes b(v, made<const accepts>());", "delete"),
    ("std::vector<box> v(1); hgrid::boxes(v, meets).masks(std::vector<unsigned>(1));", "delete"),
    ("std::vector<quad> v(1); hgrid::boxes b(v, meets);", "name the field of a struct"),
    ("std::vector<box> v(1); hgrid::boxes b(v, refused);", "put the function into a lambda"),
    (
        "std::vector<box> v(1); auto f = [](int) { return true; }; hgrid::boxes b(v, f);",
        "a test is called with",
    ),
    (
        "std::vector<box> v(1); auto f = [](unsigned, const hgrid::ray &, hgrid::shape_hit &) { return 0.5f; };\
         hgrid::boxes b(v, f);",
        "a test answers with a bool",
    ),
    ("hgrid::shapes::open(made<hgrid::memory>(), hgrid::boxes({}, meets));", "delete"),
    ("hgrid::scene::build({}, std::vector<hgrid::object>(1), {}, {}, {});", "delete"),
    ("hgrid::scene::build({}, std::array<hgrid::object, 1>(), {}, {}, {}, nullptr);", "delete"),
    ("hgrid::scene::open(made<hgrid::memory>(), {});", "delete"),
    ("hgrid::memory m; hgrid::scene::open(m, std::vector<hgrid::object>(1));", "delete"),
    ("hgrid::memory m; hgrid::scene::refit({}, std::vector<hgrid::object>(1), m);", "delete"),
    ("hgrid::memory m; hgrid::scene::open_packed(made<hgrid::memory>(), m);", "delete"),
    ("hgrid::memory m; hgrid::scene::open_packed(m, made<hgrid::memory>());", "conver"),
    ("hgrid::make_object(made<const hgrid::grid>());", "delete"),
    ("hgrid::make_object(hgrid::shapes());", "delete"),
    ("hgrid::make_object(hgrid::scene());", "delete"),
];

/// Lines like those of [`REFUSED`] that compile: what is referred to has a name, or is a span of what has one, or is
/// read during the call alone.
const ACCEPTED: [&str; 20] = [
    "hgrid::mesh m{hgrid::span<const float>(vertices), hgrid::span<const unsigned>(indices)}; m.masks(indices);",
    "hgrid::mesh m(vertices, indices); m.masks(hgrid::span<const unsigned>(indices));",
    "std::vector<hgrid::part> parts(1); static_cast<void>(hgrid::mesh::join(std::vector<hgrid::mesh>(), parts));",
    "std::vector<box> v(1); hgrid::boxes b(v, meets); b.masks(indices);",
    "std::vector<box> v(1); hgrid::boxes b(hgrid::span<const box>(v), meets); b.masks(hgrid::strided<unsigned>());",
    "accepts fixed; const accepts &same = fixed; hgrid::boxes b({}, same); static_cast<void>(b);",
    "std::vector<unions> a(3); hgrid::mesh m(a, indices); std::vector<aligned> b(3); m = hgrid::mesh(b, indices);\
     std::vector<unlisted> c(3); m = hgrid::mesh(c, indices); std::vector<closed> d(3); m = hgrid::mesh(d, indices);",
    "float v[3][3] = {}; hgrid::mesh m(v, indices);\
     std::vector<std::array<float, 7>> w(3); m = hgrid::mesh(w, indices);",
    "hgrid::memory m; static_cast<void>(hgrid::shapes::open(m, hgrid::boxes({}, meets)));",
    "hgrid::memory m; const hgrid::span<const hgrid::byte> all(m);\
     static_cast<void>(hgrid::shapes::open(all.subspan(0, 0), hgrid::boxes({}, meets)));",
    "std::vector<hgrid::object> o; hgrid::memory m;\
     static_cast<void>(hgrid::scene::build(std::vector<hgrid::instance>(1), o, hgrid::config(), m, m));\
     static_cast<void>(hgrid::scene::refit(std::vector<hgrid::instance>(1), o, m));\
     static_cast<void>(hgrid::scene::open(m, o));",
    "std::vector<hgrid::object> o; hgrid::memory m; const hgrid::span<const hgrid::byte> all(m);\
     static_cast<void>(hgrid::scene::build({}, hgrid::span<const hgrid::object>(o), {}, m, m));\
     static_cast<void>(hgrid::scene::refit({}, hgrid::span<hgrid::object>(o), m));\
     static_cast<void>(hgrid::scene::open(all.subspan(0, 0), hgrid::span<hgrid::object>(o)));",
    "hgrid::memory m; static_cast<void>(hgrid::scene::build({}, {}, {}, m, m));\
     static_cast<void>(hgrid::scene::refit({}, {}, m)); static_cast<void>(hgrid::scene::open(m, {}));",
    "hgrid::memory m; static_cast<void>(hgrid::scene::open_packed(m, m));\
     static_cast<void>(hgrid::scene::open_packed(hgrid::span<const hgrid::byte>(m), m, hgrid::span<hgrid::byte>(m)));",
    "static_cast<void>(hgrid::peek(made<hgrid::memory>()));\
     static_cast<void>(hgrid::scene::view_bytes(made<hgrid::memory>()));",
    "std::vector<float> v(9); static_cast<void>(hgrid::as_bytes(hgrid::span<const float>(v)));\
     static_cast<void>(hgrid::as_writable_bytes(hgrid::span<float>(v)));",
    "hgrid::view v; v = {}; hgrid::grid g; v = g; v = made<const hgrid::grid &>(); v = hgrid::view();",
    "const auto said = hgrid::verdict::accept; hgrid::options options;\
     auto f = [&](const hgrid::hit &) -> const hgrid::verdict & { return said; }; options.filter(f);",
    "static_cast<void>(hgrid::grid::keep(std::array<float, 9>(), made<const std::vector<unsigned>>()));",
    "std::vector<hgrid::hit> h(1); static_cast<void>(hgrid::view().intersect_n(std::vector<hgrid::ray>(1), h, {}));",
];

#[test]
fn what_cannot_work_does_not_compile() {
    is_refused(compilers("c++14").take(1));
}

#[test]
#[ignore = "slow: starts compilers hundreds of times"]
fn what_cannot_work_compiles_in_no_other_dialect() {
    is_refused(["c++14", "c++17", "c++20"].into_iter().flat_map(compilers).skip(1));
}

/// The header, and types for the lines of [`REFUSED`].
const PRELUDE: &str = "\
#include <hgrid.hpp>
#include <array>
#include <vector>
struct face { int material; unsigned corners[3]; };
struct quad { int material; unsigned corners[4]; };
template <class T> struct of { T x, y, z; };
struct wide { wide() : x(0), y(0), z(0) {} double x, y, z; };
struct late { int id; float x, y, z; };
struct backwards { backwards() : z(0), y(0), x(0) {} backwards(float, float, float); float z, y, x; };
struct framed { framed(); framed(float, float, float); int id; float at[3]; };
struct numbered { using value_type = float; int id; float at[3]; };
class slice {
public:
    using value_type = float;
    slice();
    slice(float *, std::size_t);
    float *data() const { return first_; }
    std::size_t size() const { return size_; }
    float &operator[](std::size_t i) const { return first_[i]; }
private:
    float *first_;
    std::size_t size_;
};
// Vectors as those of GLM, Eigen and Qt, and one that shows nothing of its floats.
struct unions {
    using value_type = float;
    unions();
    unions(float, float, float);
    explicit unions(float);
    float &operator[](int i);
    const float &operator[](int i) const;
    union { float x, r; };
    union { float y, g; };
    union { float z, b; };
};
class alignas(16) aligned {
public:
    using value_type = float;
    aligned();
    explicit aligned(int);
    template <class X, class Y> aligned(const X &x, const Y &y);
    aligned(const float &, const float &, const float &, const float &);
    float &operator[](std::ptrdiff_t i) { return all_[i]; }
    const float &operator[](std::ptrdiff_t i) const { return all_[i]; }
private:
    float all_[4];
};
class unlisted {
public:
    unlisted() : all_{0, 0, 0} {}
    float &operator[](int i) { return all_[i]; }
    float operator[](int i) const { return all_[i]; }
private:
    float all_[3];
};
class closed {
public:
    closed() : x_(0), y_(0), z_(0) {}
    closed(float x, float y, float z) : x_(x), y_(y), z_(z) {}
    float sum() const { return x_ + y_ + z_; }
private:
    float x_, y_, z_;
};
using box = std::array<float, 6>;
struct accepts {
    template <class... T> bool operator()(const T &...) const { return true; }
};
extern accepts meets;
template <class T> T made();
void refused(const std::vector<float> &vertices, const std::vector<unsigned> &indices);
";

fn is_refused(compilers: impl Iterator<Item = Command>) {
    let program = |line: &str| {
        format!(
            "void refused(const std::vector<float> &vertices, const std::vector<unsigned> &indices)\n\
             {{\n    static_cast<void>(vertices), static_cast<void>(indices);\n    {line}\n}}\n"
        )
    };
    for compiler in compilers {
        let dir = TempDir::new().expect("a folder");
        let run_on = |arguments: &[&str], source: &str, text: &str| {
            fs::write(dir.path().join(source), text).expect("a file");
            let mut again = Command::new(compiler.get_program());
            again.args(compiler.get_args()).args(arguments).arg(source).current_dir(dir.path());
            output(&mut again)
        };
        let succeeds = |output: Output| {
            assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        };
        // A precompiled header cuts the time for each line to a third.
        let to_header = ["-x", "c++-header", "-o", "prelude.hpp.gch"];
        succeeds(run_on(&to_header, "prelude.hpp", PRELUDE));
        let compile = |line: &str| {
            run_on(&["-include", "prelude.hpp", "-fsyntax-only"], "line.cpp", &program(line))
        };
        succeeds(compile("hgrid::mesh m(vertices, indices); static_cast<void>(m);"));
        for line in ACCEPTED {
            succeeds(compile(line));
        }
        for (line, message) in REFUSED {
            let output = compile(line);
            let said = String::from_utf8_lossy(&output.stderr);
            assert!(!output.status.success() && said.contains(message), "{line}\n{said}");
        }
    }
}

/// Each item that is visible from outside has a `///` comment. An item begins where the one before ended.
#[test]
fn every_public_item_is_documented() {
    let header = header("hgrid.hpp");
    // The enclosing blocks: the indentation of their items, and whether those are public.
    let mut blocks = vec![(0, true)];
    let mut ends_item = true;
    let mut items = 0;
    for line in header.lines().skip_while(|line| *line != "namespace hgrid {").skip(1) {
        let text = line.trim();
        let indent = line.len() - line.trim_start().len();
        let is_type = ["class ", "enum class "].iter().any(|kind| text.starts_with(kind));
        let is_code = !text.is_empty() && !text.starts_with("//") && !text.starts_with('#');
        let Some((inside, is_public)) = blocks.last_mut() else { break };
        let ends_type = text.starts_with('}') && indent + 4 == *inside;
        let is_dialect = text.contains("namespace cpp14");
        if is_dialect {
            // This namespace encloses everything in one dialect.
        } else if ends_type || text.starts_with("} // namespace") {
            blocks.pop();
        } else if text == "public:" || text == "private:" {
            *is_public = text == "public:";
        } else if text == "namespace detail {" {
            blocks.push((0, false));
        } else if is_code && indent == *inside && *is_public && !text.starts_with('}') {
            // A function defined outside its class is documented at its declaration.
            let is_definition = text.starts_with("inline ") && text.contains(" grid::");
            assert!(!ends_item || is_definition, "nothing is said about: {line}");
            items += 1;
        }
        if is_type && text.ends_with('{') {
            let is_public = blocks.iter().all(|(_, is_public)| *is_public);
            blocks.push((indent + 4, is_public && text.starts_with("enum")));
        }
        ends_item = !text.starts_with("///")
            && (text.is_empty()
                || text.starts_with("//")
                || text.ends_with([';', '}', '{', ':', ',']));
    }
    assert!(blocks.is_empty() && items > 150, "{blocks:?} {items}");
}
