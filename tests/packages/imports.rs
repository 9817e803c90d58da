//! The modules of core import downwards only. With a cycle of imports, no module could be understood alone.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use hgrid_tests::artefact::root;

/// Modules, and the modules that each imports.
type Imports = BTreeMap<String, BTreeSet<String>>;

/// The names of a path in core, from the root on.
type Names = Vec<String>;

/// A source file: the path of its module, and the paths that it names.
struct Source {
    module: Names,
    named: Vec<Names>,
}

/// Returns all files in a folder.
fn files(dir: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(dir).expect("a folder").map(|entry| entry.expect("an entry").path());
    entries.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect()
}

/// Returns a source without comments and without the tests at its end.
fn code(source: &str) -> String {
    let source = source.split("#[cfg(test)]\nmod ").next().expect("the part before");
    let lines = source.lines().map(|line| line.split("//").next().expect("the part before"));
    lines.collect::<Vec<_>>().join("\n")
}

/// Returns the paths at the start of a text: one, or those of a list in braces. `prefix` stands before them.
fn paths_at<'c>(text: &'c str, prefix: &[&'c str], found: &mut Vec<Names>) {
    let is_in_name = |c: char| c.is_alphanumeric() || c == '_';
    let text = text.trim_start();
    let (name, behind) = text.split_at(text.find(|c| !is_in_name(c)).unwrap_or(text.len()));
    let path = [prefix, &[name]].concat();
    if name.is_empty()
        && let Some(list) = text.strip_prefix('{')
    {
        let (mut depth, mut start) = (0, 0);
        for (at, c) in list.char_indices() {
            if depth == 0 && matches!(c, ',' | '}') {
                paths_at(&list[start..at], prefix, found);
                start = at + 1;
            }
            match c {
                '{' => depth += 1,
                '}' if depth == 0 => return,
                '}' => depth -= 1,
                _ => {}
            }
        }
    } else if let Some(rest) = behind.strip_prefix("::") {
        paths_at(rest, &path, found);
    } else if !name.is_empty() {
        found.push(path.into_iter().map(str::to_owned).collect());
    }
}

/// Returns the paths in a module's code that begin with `crate` or `super`, from the root on.
fn paths(code: &str, module: &[String]) -> Vec<Names> {
    let mut found = Vec::new();
    for start in ["crate::", "super::"] {
        for (at, _) in code.match_indices(start) {
            if !code[..at].ends_with(|c: char| c.is_alphanumeric() || matches!(c, '_' | ':')) {
                paths_at(&code[at..], &[], &mut found);
            }
        }
    }
    let from_root = found.into_iter().map(|path| {
        let ups = path.iter().take_while(|name| *name == "super").count();
        let base = if ups == 0 { &[] } else { &module[..module.len() - ups] };
        [base, &path[ups.max(1)..]].concat()
    });
    from_root.collect()
}

/// Returns the names that lib.rs exports, each with its module.
fn exports(lib: &str) -> BTreeMap<String, String> {
    let lines = lib.split("\npub use ").skip(1).map(|line| line.split(';').next().expect("a line"));
    let pairs = lines.flat_map(|line| {
        let (module, items) = line.split_once("::").expect("a path");
        let items = items.trim_matches(['{', '}']).split(',').map(|item| item.trim().to_owned());
        // A list of several lines has a comma behind its last item, too.
        items.filter(|item| !item.is_empty()).map(move |item| (item, module.to_owned()))
    });
    pairs.collect()
}

/// Reads all sources of core but lib.rs.
fn sources() -> Vec<Source> {
    let root = root().join("core/src");
    let exports = exports(&fs::read_to_string(root.join("lib.rs")).expect("lib.rs"));
    let all = files(&root).into_iter().map(|path| {
        let inside = path.strip_prefix(&root).expect("a path in it").with_extension("");
        let names = inside.iter().map(|name| name.to_str().expect("a name").to_owned());
        let module: Names = names.filter(|name| name != "mod").collect();
        let mut named = paths(&code(&fs::read_to_string(&path).expect("a source")), &module);
        for path in &mut named {
            if let Some(module) = path.first().and_then(|name| exports.get(name)) {
                path.insert(0, module.clone());
            }
        }
        Source { module, named }
    });
    all.filter(|source| source.module != ["lib"]).collect()
}

/// Returns what the modules of a folder import from one another. A folder in it counts as one module. What the folder
/// itself exports again, as in `super::NAME`, counts as the folder's own.
fn imports(sources: &[Source], folder: &[String]) -> Imports {
    let inside = |path: &[String]| path.strip_prefix(folder)?.first().cloned();
    let mut imports = Imports::new();
    for Source { module, named } in sources {
        if let Some(module) = inside(module) {
            let others = named.iter().filter_map(|path| inside(path));
            let others = others.filter(|other| *other != module).collect::<Vec<_>>();
            imports.entry(module).or_default().extend(others);
        }
    }
    imports
}

/// Returns a cycle of modules, if there is one: removes modules that import no remaining module, until none is.
fn cycle(mut imports: Imports) -> Vec<String> {
    loop {
        let left: BTreeSet<_> = imports.keys().cloned().collect();
        imports.retain(|_, named| named.iter().any(|name| left.contains(name)));
        if imports.len() == left.len() {
            break;
        }
    }
    // Each remaining module imports another remaining one, so this path reaches some module twice.
    let mut way: Vec<String> = Vec::new();
    let mut module = imports.keys().next().cloned();
    while let Some(at) = module {
        let first = way.iter().position(|name| *name == at);
        module = imports[&at].iter().find(|name| imports.contains_key(*name)).cloned();
        way.push(at);
        if let Some(first) = first {
            return way.split_off(first);
        }
    }
    way
}

#[test]
fn modules_of_core_import_downwards_only() {
    let sources = sources();
    let folders: BTreeSet<_> = sources.iter().map(|s| &s.module[..s.module.len() - 1]).collect();
    assert!(folders.len() > 10 && imports(&sources, &[])["grid"].contains("mesh"));
    let bvh = imports(&sources, &["bvh".to_owned()]);
    assert!(bvh["build"].contains("high") && bvh["high"].contains("index"), "{bvh:?}");
    for folder in folders {
        let way = cycle(imports(&sources, folder)).join(" -> ");
        assert!(
            way.is_empty(),
            "modules in core/src/{} import in a circle: {way}",
            folder.join("/")
        );
    }
}

/// Returns the modules of each layer, the lowest first, by the table in lib.rs.
fn layers(lib: &str) -> Vec<Vec<String>> {
    let rows = lib.lines().skip_while(|line| !line.starts_with("//! | layer | modules |")).skip(2);
    let rows = rows.map_while(|line| line.strip_prefix("//! | ")?.split(" | ").nth(1));
    rows.map(|row| row.split('`').skip(1).step_by(2).map(str::to_owned).collect()).collect()
}

#[test]
fn modules_import_those_of_their_layer_and_of_lower_ones() {
    let layers = layers(&fs::read_to_string(root().join("core/src/lib.rs")).expect("lib.rs"));
    let layer =
        |module: &str| layers.iter().position(|layer| layer.iter().any(|name| name == module));
    for (module, named) in imports(&sources(), &[]) {
        let own = layer(&module).unwrap_or_else(|| panic!("the table in lib.rs lacks {module}"));
        for name in named {
            let is_below = layer(&name).is_none_or(|other| other <= own);
            assert!(is_below, "the table in lib.rs has {module} below {name}, which it imports");
        }
    }
}

#[test]
fn circles_are_found() {
    let of = |pairs: &[(&str, &str)]| {
        let mut imports = Imports::new();
        for (module, named) in pairs {
            imports.entry((*module).to_owned()).or_default().insert((*named).to_owned());
        }
        cycle(imports).join(" ")
    };
    assert_eq!(of(&[("a", "b"), ("b", "c"), ("a", "c")]), "");
    assert_eq!(of(&[("a", "b"), ("b", "c"), ("c", "b"), ("c", "d")]), "b c b");
}

#[test]
fn paths_are_found_wherever_they_begin() {
    let module = ["bvh", "high", "grow"].map(str::to_owned);
    let code = "use crate::{a, b::{c, d::e}, f::{self, g}}; use super::cut; super::super::node::X.y; h::super_::i";
    let found = paths(code, &module).into_iter().map(|path| path.join("::"));
    let expected = ["a", "b::c", "b::d::e", "f::self", "f::g", "bvh::high::cut", "bvh::node::X"];
    assert_eq!(found.collect::<Vec<_>>(), expected);
}
