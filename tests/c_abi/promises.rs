//! Every promise of the header is kept somewhere. The C programs print what they saw, as in `reached -2
//! hgrid_open`, `null hgrid_open.blob`, `sized hgrid_open.mesh` and `described -2`; the tests compare it with
//! the header's comments.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::OnceLock;

use hgrid_tests::artefact::Flavour;

use crate::header::{documentation, functions, parameters, statuses, structs};
use crate::left_out;
use crate::programs;

/// Returns the rest of each line that starts with a word, over the output of all programs.
fn printed(word: &str) -> BTreeSet<&'static str> {
    static PRINTED: OnceLock<String> = OnceLock::new();
    let all = PRINTED.get_or_init(|| programs::printed().to_owned() + left_out::printed());
    all.lines().filter_map(|line| line.strip_prefix(word)?.strip_prefix(' ')).collect()
}

/// Returns the statuses that each function returned.
fn reached() -> BTreeMap<&'static str, BTreeSet<i32>> {
    let mut reached = BTreeMap::<_, BTreeSet<_>>::new();
    for line in printed("reached") {
        let (status, function) = line.split_once(' ').expect("two words");
        reached.entry(function).or_default().insert(status.parse().expect("a number"));
    }
    reached
}

/// Returns the words of a text that start with a prefix.
fn words<'t>(text: &'t str, prefix: &str) -> BTreeSet<&'t str> {
    let words = text.split(|c: char| !c.is_ascii_alphanumeric() && c != '_');
    words.filter(|word| word.starts_with(prefix)).collect()
}

/// Returns the statuses that the text of a function names.
fn named(text: &str) -> BTreeSet<i32> {
    let all = statuses();
    let names = words(text, "HGRID_ERROR_").into_iter().chain(words(text, "HGRID_OK"));
    names.map(|name| *all.get(name).unwrap_or_else(|| panic!("no status {name}"))).collect()
}

/// Returns the statuses that the text names by reference: "what `hgrid_sizes` returns".
fn inherited(text: &str) -> BTreeSet<i32> {
    let mut all = BTreeSet::new();
    for behind in text.split("what `").skip(1) {
        if let Some((function, _)) = behind.split_once("` returns") {
            let text = documentation(function);
            all.extend(named(&text));
            all.extend(inherited(&text));
        }
    }
    all
}

#[test]
fn every_status_that_a_function_names_is_returned_by_it_and_no_other() {
    let reached = reached();
    let mut count = 0;
    for function in functions(Flavour::Malloc) {
        let text = documentation(&function);
        let named = named(&text);
        if named.is_empty() {
            continue;
        }
        let reached = reached.get(&*function).cloned().unwrap_or_default();
        assert!(reached.is_superset(&named), "{function} named {named:?}, reached {reached:?}");
        let known = &named | &inherited(&text);
        assert!(known.is_superset(&reached), "{function} named {known:?}, reached {reached:?}");
        count += 1;
    }
    let returns_status = |line: &&str| line.starts_with("hgrid_status hgrid_");
    assert_eq!(count, crate::header::committed().lines().filter(returns_status).count());
}

#[test]
fn every_status_is_reached_and_described() {
    let all: BTreeSet<_> = statuses().into_values().collect();
    let reached: BTreeSet<_> = reached()
        .into_iter()
        .filter(|(function, _)| function.starts_with("hgrid_"))
        .flat_map(|(_, statuses)| statuses)
        .collect();
    assert_eq!(reached, all);
    let described =
        printed("described").into_iter().map(|number| number.parse().expect("a number"));
    assert_eq!(described.collect::<BTreeSet<i32>>(), all);
}

#[test]
fn null_is_tried_in_every_pointer_argument() {
    let pointers = functions(Flavour::Malloc).into_iter().flat_map(|function| {
        let pointers = parameters(&function).into_iter().filter(|parameter| parameter.is_pointer);
        pointers.map(move |parameter| format!("{function}.{}", parameter.name)).collect::<Vec<_>>()
    });
    let expected: BTreeSet<_> = pointers.collect();
    assert!(expected.len() > 50, "{expected:?}");
    assert_eq!(printed("null"), expected.iter().map(String::as_str).collect());
}

#[test]
fn every_struct_is_tried_in_other_sizes() {
    // Structs whose first field is their size.
    let sized: Vec<_> =
        structs().into_iter().filter(|(_, fields)| fields[0] == "struct_size").collect();
    assert_eq!(sized.len(), 10);
    let is_sized = |kind: &str| sized.iter().any(|(name, _)| name == kind);
    let takes = functions(Flavour::Malloc).into_iter().flat_map(|function| {
        let structs =
            parameters(&function).into_iter().filter(|p| p.is_pointer && is_sized(&p.kind));
        structs.map(move |parameter| format!("{function}.{}", parameter.name)).collect::<Vec<_>>()
    });
    let expected: BTreeSet<_> = takes.collect();
    assert!(expected.len() > 20, "{expected:?}");
    assert_eq!(printed("sized"), expected.iter().map(String::as_str).collect());
}
