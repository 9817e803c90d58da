//! The modules of core import downwards only. With a cycle of imports, no module could be understood alone.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use hgrid_tests::artefact::root;

/// Modules, and the modules that each imports.
type Imports = BTreeMap<String, BTreeSet<String>>;

/// Returns all sources in a folder.
fn sources(dir: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(dir).expect("a folder").map(|entry| entry.expect("an entry").path());
    entries.flat_map(|path| if path.is_dir() { sources(&path) } else { vec![path] }).collect()
}

/// Returns a source without comments and without the tests at its end.
fn code(source: &str) -> String {
    let source = source.split("#[cfg(test)]\nmod ").next().expect("the part before");
    let lines = source.lines().map(|line| line.split("//").next().expect("the part before"));
    lines.collect::<Vec<_>>().join("\n")
}

/// Returns the names that follow `crate::`, one or several in braces.
fn names(code: &str) -> Vec<&str> {
    let is_in_name = |c: char| c.is_alphanumeric() || c == '_';
    let name = |text: &str| text.len() - text.trim_start_matches(is_in_name).len();
    let mut found = Vec::new();
    for behind in code.split("crate::").skip(1) {
        match behind.strip_prefix('{') {
            None => found.push(&behind[..name(behind)]),
            Some(list) => {
                let list = list.split('}').next().expect("the part before");
                found.extend(list.split(',').map(str::trim).map(|item| &item[..name(item)]));
            }
        }
    }
    found
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

fn imports() -> Imports {
    let root = root().join("core/src");
    let exports = exports(&fs::read_to_string(root.join("lib.rs")).expect("lib.rs"));
    let mut imports = Imports::new();
    for path in sources(&root) {
        let inside = path.strip_prefix(&root).expect("a path in it");
        let module = inside.iter().next().and_then(|first| Path::new(first).file_stem());
        let module = module.and_then(|module| module.to_str()).expect("a name").to_owned();
        if module == "lib" {
            continue;
        }
        let source = code(&fs::read_to_string(&path).expect("a source"));
        let named = names(&source).into_iter().map(|name| exports.get(name).map_or(name, |m| m));
        let others = named.filter(|name| *name != module).map(str::to_owned).collect::<Vec<_>>();
        imports.entry(module).or_default().extend(others);
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
    let imports = imports();
    assert!(imports["grid"].contains("mesh") && imports.len() > 30, "{imports:?}");
    let way = cycle(imports);
    assert!(way.is_empty(), "modules of core import one another in a circle: {}", way.join(" -> "));
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
    for (module, named) in imports() {
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
    assert_eq!(names("use crate::{a, b::c}; crate::d::e()"), ["a", "b", "d"]);
}
