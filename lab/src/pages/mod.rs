//! The `report` command: writes the tables and charts of pages from results in JSON.
//!
//! ```text
//! <!-- hgrid report KIND FILE... -->     FILE: what a command wrote with --json
//! (a table, or the line that shows a chart)
//! <!-- end of report -->
//! ```
//!
//! So every number in a page comes from a file, and a new measurement is a new file and one command. Paths
//! are relative to the root of a checkout. Charts are written beside the page. A result that was measured with
//! uncommitted changes is refused: it cannot be measured again.

mod compared;
mod paper;

use core::fmt::Write as _;
use std::fs;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail, ensure};
use serde::de::DeserializeOwned;

use crate::cli::ReportArgs;
use crate::machine::Machine;
use crate::table::Results;
use crate::{figures, file};
use paper::Paper;

/// The pages with tables of results.
const PAGES: [&str; 3] = ["README.md", "docs/performance.md", "docs/paper.md"];

const BEGIN: &str = "<!-- hgrid report ";
const END: &str = "<!-- end of report -->";

/// Writes the tables of all pages, or lists the files that differ from the results.
///
/// # Errors
/// If a page or a result cannot be read, a marker is wrong, or a check finds files that differ.
pub fn run(args: &ReportArgs) -> Result<()> {
    let stale = stale(&args.root)?;
    let mut out = io::stdout();
    if args.check {
        let names: Vec<_> = stale.iter().map(|file| file.name.clone()).collect();
        ensure!(
            names.is_empty(),
            "not what the results say: {}; run `hgrid report`",
            names.join(", ")
        );
        return Ok(writeln!(out, "all pages say what the results say")?);
    }
    for File { name, text } in &stale {
        let path = args.root.join(name);
        file::write(&path, |file| file.write_all(text.as_bytes()))?;
        writeln!(out, "wrote {name}")?;
    }
    Ok(())
}

/// A file with the text that it should have.
#[derive(Debug, Clone, PartialEq, Eq)]
struct File {
    /// The path below the root.
    name: String,
    text: String,
}

/// Returns the files whose text is not up to date.
fn stale(root: &Path) -> Result<Vec<File>> {
    let mut files = Vec::new();
    ensure!(
        root.join("README.md").exists(),
        "`{}` is no checkout of hgrid: it has no README.md",
        root.display()
    );
    for page in PAGES {
        let path = root.join(page);
        let text = fs::read_to_string(&path)
            .with_context(|| format!("cannot read `{}`", path.display()))?;
        let text = fill(root, page, &text, &mut files).with_context(|| page.to_owned())?;
        files.push(File { name: page.to_owned(), text });
    }
    files
        .retain(|file| fs::read_to_string(root.join(&file.name)).ok().as_ref() != Some(&file.text));
    Ok(files)
}

/// Returns a page with new text between its markers; the charts go to `files`.
fn fill(root: &Path, page: &str, text: &str, files: &mut Vec<File>) -> Result<String> {
    ensure!(!text.contains("\r\n"), "its lines end as on Windows: write it with `\\n` alone");
    let (mut filled, mut rest) = (String::new(), text);
    while let Some((before, behind)) = rest.split_once(BEGIN) {
        let (words, behind) = behind.split_once(" -->\n").context("a marker does not end")?;
        let (old, behind) =
            behind.split_once(END).with_context(|| format!("no end of `{words}`"))?;
        // The text up to the end of another block is not old: people wrote it.
        ensure!(!old.contains(BEGIN), "no end of `{words}`: write `{END}` below its table");
        let block = Block { root, page, words: words.split_whitespace().collect() };
        let made = block.make(files).with_context(|| format!("`{words}`"))?;
        write!(filled, "{before}{BEGIN}{words} -->\n{made}\n{END}")?;
        rest = behind;
    }
    Ok(filled + rest)
}

/// A marker of a page.
struct Block<'a> {
    root: &'a Path,
    page: &'a str,
    /// The files, after the kind.
    words: Vec<&'a str>,
}

impl Block<'_> {
    fn make(&self, files: &mut Vec<File>) -> Result<String> {
        let (kind, names) = self.words.split_first().context("no kind")?;
        ensure!(!names.is_empty(), "no files");
        match *kind {
            "ratios" => compared::ratios(&self.read(names)?),
            "ratios-in-full" => compared::ratios_in_full(&self.read(names)?),
            "systems" => compared::systems(&self.read(names)?),
            "table1" => Ok(Results::merged(self.read(names)?)?.markdown_table()),
            "beside-the-paper" => {
                let [paper, names @ ..] = names else { bail!("no files") };
                let paper: Paper = self.read_one(paper)?;
                paper.beside(&Results::merged(self.read(names)?)?)
            }
            "figure1" => self.chart(&figures::figure1(&self.text(names)?)?, "figure1", files),
            "figure2" => {
                let results = Results::merged(self.read(names)?)?;
                self.chart(&figures::figure2(&results)?, "figure2", files)
            }
            "sources" => self.sources(names),
            _ => bail!("there is no such kind of table"),
        }
    }

    /// Adds a chart beside the page, and returns the line that shows it.
    fn chart(&self, svg: &str, name: &str, files: &mut Vec<File>) -> Result<String> {
        let folder = Path::new(self.page).parent().unwrap_or(Path::new(""));
        let path: PathBuf = folder.join(name).with_extension("svg");
        let path = path.to_str().context("a path that is no text")?;
        let file = File { name: path.to_owned(), text: svg.to_owned() };
        match files.iter().find(|other| other.name == file.name) {
            Some(other) => {
                ensure!(
                    *other == file,
                    "`{path}` would have to be two charts: leave one of them out"
                );
            }
            None => files.push(file),
        }
        Ok(format!("![{name}]({name}.svg)"))
    }

    /// Lists the origin of the numbers, a line for each file.
    fn sources(&self, names: &[&str]) -> Result<String> {
        #[derive(serde::Deserialize)]
        struct Source {
            machine: Machine,
            /// Missing where one thread builds.
            #[serde(default)]
            threads: u32,
            /// The architecture and the vectors that the program was compiled for, if the command tells.
            #[serde(default)]
            target: Option<String>,
        }
        let lines = names.iter().map(|name| {
            let Source { machine, threads, target } = self.read_one(name)?;
            let target = target.map(|target| format!(", compiled for {target}"));
            let commit = machine.commit.as_ref().map(|commit| format!(", commit {commit}"));
            let [target, commit] = [target, commit].map(Option::unwrap_or_default);
            let summary = machine.summary(threads);
            Ok(format!("- {name}: {summary}{target}{commit}. `{}`", machine.command))
        });
        Ok(lines.collect::<Result<Vec<_>>>()?.join("\n"))
    }

    fn read<T: DeserializeOwned>(&self, names: &[&str]) -> Result<Vec<T>> {
        names.iter().map(|name| self.read_one(name)).collect()
    }

    fn read_one<T: DeserializeOwned>(&self, name: &str) -> Result<T> {
        serde_json::from_str(&self.text(&[name])?).with_context(|| format!("cannot read `{name}`"))
    }

    fn text(&self, names: &[&str]) -> Result<String> {
        let [name] = names else { bail!("one file, not {}", names.len()) };
        let text = fs::read_to_string(self.root.join(name))
            .with_context(|| format!("cannot read `{name}`"))?;
        let commit = commit_of(&text).filter(|commit| commit.ends_with("-dirty"));
        if let Some(commit) = commit {
            bail!(
                "`{name}` was measured with changes that no commit has (`{commit}`): commit them and measure again"
            );
        }
        Ok(text)
    }
}

/// The commit that a result was measured at, if it has one.
fn commit_of(result: &str) -> Option<String> {
    #[derive(serde::Deserialize)]
    struct Origin {
        machine: Commit,
    }
    #[derive(serde::Deserialize)]
    struct Commit {
        commit: Option<String>,
    }
    serde_json::from_str::<Origin>(result).ok()?.machine.commit
}

#[cfg(test)]
mod tests {
    use super::*;

    fn root() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
    }

    #[test]
    fn the_pages_say_what_the_results_say() {
        let stale: Vec<_> = stale(&root()).unwrap().into_iter().map(|file| file.name).collect();
        assert!(stale.is_empty(), "`cargo run --release -- report` writes {stale:?}");
    }

    #[test]
    fn every_page_has_a_table() {
        for page in PAGES {
            assert!(fs::read_to_string(root().join(page)).unwrap().contains(BEGIN), "{page}");
        }
    }

    #[test]
    fn what_is_between_markers_is_replaced_and_nothing_else() {
        let name = "lab/results/paper.json";
        let page = |text: &str| format!("a\n{BEGIN}KIND {name} -->\n{text}{END}\nb\n");
        let fill = |text: &str| fill(&root(), "docs/page.md", text, &mut Vec::new());
        assert_eq!(fill("no markers\n").unwrap(), "no markers\n");
        let error = format!("{:#}", fill(&page("old\n")).unwrap_err());
        assert!(error.contains("no such kind"), "{error}");
        let sources = |text: &str| page(text).replace("KIND", "sources");
        let filled = fill(&sources("old\n")).unwrap();
        assert!(filled.starts_with("a\n") && filled.ends_with("\nb\n"), "{filled}");
        assert!(filled.contains(name) && !filled.contains("old"), "{filled}");
        assert_eq!(fill(&filled).unwrap(), filled);
    }

    /// The compiler may use wider vectors than those of a default build, and they change times.
    #[test]
    fn sources_tell_the_target_where_a_result_does() {
        let sources = |name: &str| {
            let page = format!("{BEGIN}sources lab/results/{name}.json -->\n{END}\n");
            fill(&root(), "docs/page.md", &page, &mut Vec::new()).unwrap()
        };
        let compared = sources("2026-11-28d_zen4_spheres");
        assert!(
            compared
                .contains(", compiled for x86_64, AVX-512, commit f0b0a394dc47. `hgrid compare "),
            "{compared}"
        );
        assert!(!sources("2026-11-25_zen5_table_bunny").contains("compiled for"));
    }

    #[test]
    fn results_of_no_commit_are_refused() {
        let root = std::env::temp_dir().join(format!("hgrid-pages-{}", std::process::id()));
        fs::create_dir_all(root.join("docs")).unwrap();
        let fill_with = |kind: &str, commit: &str| {
            let result = format!(r#"{{"machine": {{"commit": "{commit}"}}, "scenes": []}}"#);
            fs::write(root.join("a.json"), result).unwrap();
            let page = format!("{BEGIN}{kind} a.json -->\n{END}");
            for name in PAGES {
                fs::write(root.join(name), &page).unwrap();
            }
            format!("{:#}", stale(&root).unwrap_err())
        };
        for kind in
            ["ratios", "ratios-in-full", "systems", "table1", "figure1", "figure2", "sources"]
        {
            let refused = fill_with(kind, "0123456789ab-dirty");
            assert!(
                refused.contains("`a.json` was measured with changes that no commit has"),
                "{refused}"
            );
            // For the result of a commit, the error names something else that is missing.
            let other = fill_with(kind, "0123456789ab");
            assert!(!other.contains("no commit"), "{other}");
        }
        fs::remove_dir_all(root).unwrap();
    }

    /// A lost end must not take the prose before the next block along.
    #[test]
    fn every_block_has_its_own_end() {
        let block = format!("{BEGIN}sources lab/results/paper.json -->\nold\n{END}\n");
        let fill = |text: &str| fill(&root(), "docs/page.md", text, &mut Vec::new());
        let page = [&*block, "prose\n", &*block].concat();
        assert!(fill(&page).unwrap().contains("prose"));
        let error = format!("{:#}", fill(&page.replacen(END, "", 1)).unwrap_err());
        assert!(error.starts_with("no end of `sources lab/results/paper.json`: write"), "{error}");
    }

    /// Both charts would be one file, and every report would replace one by the other.
    #[test]
    fn a_folder_has_one_chart_of_a_kind() {
        let block = |kind: &str, file: &str| format!("{BEGIN}{kind} {file} -->\n{END}\n");
        let results = |name: &str| format!("lab/results/2026-11-25_zen5_table_{name}.json");
        let [bunny, dragon] = ["bunny", "dragon"].map(|name| block("figure2", &results(name)));
        let mut files = Vec::new();
        let mut fill = |page: &str, text: &str| fill(&root(), page, text, &mut files);
        fill("README.md", &bunny).unwrap();
        fill("docs/a.md", &[&*bunny, &*bunny].concat()).unwrap();
        let error = format!("{:#}", fill("docs/b.md", &dragon).unwrap_err());
        assert!(error.contains("`docs/figure2.svg` would have to be two charts"), "{error}");
        assert_eq!(files.len(), 2);
    }

    #[test]
    fn results_that_show_nothing_are_refused() {
        let folder = std::env::temp_dir().join(format!("hgrid-nothing-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let empty = |name: &str, list: &str| {
            let text = fs::read_to_string(root().join("lab/results").join(name)).unwrap();
            let mut result: serde_json::Value = serde_json::from_str(&text).unwrap();
            *result.pointer_mut(list).unwrap() = serde_json::Value::Array(Vec::new());
            fs::write(folder.join("a.json"), result.to_string()).unwrap();
        };
        let error = |kind: &str| {
            let page = format!("{BEGIN}{kind} a.json -->\n{END}\n");
            format!("{:#}", fill(&folder, "a.md", &page, &mut Vec::new()).unwrap_err())
        };
        let spheres = "2026-11-28d_zen4_spheres.json";
        for (kind, list, expected) in [
            ("ratios", "/scenes", "no ratios"),
            ("ratios-in-full", "/scenes", "no ratios"),
            ("ratios-in-full", "/scenes/0/ratios", "no ratios"),
            ("systems", "/scenes", "no structures"),
            ("systems", "/scenes/0/systems", "no structures"),
        ] {
            empty(spheres, list);
            assert!(error(kind).contains(expected), "{kind}: {}", error(kind));
        }
        empty("2026-11-25_zen5_table_bunny.json", "/scenes");
        for kind in ["table1", "figure2"] {
            assert!(error(kind).contains("results without a scene"), "{}", error(kind));
        }
        empty("2026-11-25_zen5_table_bunny.json", "/scenes/0/methods");
        assert!(error("table1").contains("results without a method"), "{}", error("table1"));
        empty("2026-11-25_zen5_figure1.json", "/methods");
        assert!(error("figure1").contains("figure 1 would show nothing"), "{}", error("figure1"));
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn wrong_markers_are_errors() {
        for (text, words) in [
            (format!("{BEGIN}ratios"), "does not end"),
            (format!("{BEGIN}ratios a.json -->\r\n{END}"), "lines end as on Windows"),
            (format!("{BEGIN}ratios a.json -->\n"), "no end"),
            (format!("{BEGIN}ratios a.json -->\n{END}"), "a.json"),
            (format!("{BEGIN}ratios -->\n{END}"), "no files"),
            (format!("{BEGIN}ratios  -->\n{END}"), "no files"),
            (format!("{BEGIN}ratios README.md -->\n{END}"), "README.md"),
        ] {
            let error = fill(&root(), "docs/page.md", &text, &mut Vec::new()).unwrap_err();
            assert!(format!("{error:#}").contains(words), "{error:#}");
        }
    }
}
