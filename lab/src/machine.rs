//! The origin of numbers: the facts that a reader needs to measure them again.

use std::env;
use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::SystemTime;

use serde::{Deserialize, Serialize};

/// The environment variable by which a program's heap asks for large pages, which change times.
const TUNABLES: &str = "GLIBC_TUNABLES";

/// The machine, the compiler, the day and the command line of a measurement.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Machine {
    /// The processor's name, if known, and on x86 its family and model: a virtual machine may tell only the vendor.
    pub cpu: Option<String>,
    /// Operating system and architecture.
    pub system: String,
    /// The system's setting for large pages, if known: large builds request them.
    pub large_pages: Option<String>,
    /// The compiler that this program was built with.
    pub rustc: String,
    /// The commit of the checkout that the command ran in, `-dirty` if files outside of lab/results differ from it.
    #[serde(default)]
    pub commit: Option<String>,
    /// The day, in UTC, as YYYY-MM-DD.
    pub date: String,
    /// The command line, with only the file name of the program, behind the variable `GLIBC_TUNABLES` if it is set.
    pub command: String,
}

impl Machine {
    /// Returns the facts of this machine and process.
    #[must_use]
    pub fn here() -> Self {
        let cpu = fs::read_to_string("/proc/cpuinfo").ok();
        let mut now = humantime::format_rfc3339_seconds(SystemTime::now()).to_string();
        now.truncate("YYYY-MM-DD".len());
        Self {
            cpu: cpu.as_deref().and_then(cpu_name),
            system: format!("{}, {}", env::consts::OS, env::consts::ARCH),
            large_pages: fs::read_to_string("/sys/kernel/mm/transparent_hugepage/enabled")
                .ok()
                .and_then(|text| chosen(&text)),
            rustc: rustc_version_runtime::version().to_string(),
            commit: commit(),
            date: now,
            command: command(
                env::var(TUNABLES).ok().as_deref(),
                env::args_os().map(|word| word.to_string_lossy().into_owned()),
            ),
        }
    }

    /// Formats everything but the command and the commit, as one line. `threads` is the number that built
    /// trees; one did everything else.
    #[must_use]
    pub fn summary(&self, threads: u32) -> String {
        let threads = match threads {
            0 | 1 => "one thread".to_owned(),
            threads => format!("trees built by {threads} threads, all else by one"),
        };
        let cpu = self.cpu.as_deref().unwrap_or("unknown processor");
        let pages = self.large_pages.as_ref().map(|when| format!(", large pages: {when}"));
        let pages = pages.unwrap_or_default();
        let Self { system, rustc, date, .. } = self;
        format!("{cpu} ({threads}), {system}{pages}, rustc {rustc}, {date}")
    }
}

/// Returns the commit of the checkout around the current folder, if it is one of hgrid.
fn commit() -> Option<String> {
    let git = |arguments: &[&str]| {
        let output = Command::new("git").args(arguments).output().ok()?;
        let text = String::from_utf8(output.stdout).ok().filter(|_| output.status.success())?;
        Some(text.trim().to_owned())
    };
    let root = git(&["rev-parse", "--show-toplevel"])?;
    let is_hgrid = Path::new(&root).join("include/hgrid.h").is_file();
    let commit =
        is_hgrid.then(|| git(&["describe", "--always", "--abbrev=12", "--exclude=*"]))??;
    // A measurement may follow another one, whose result lies there already.
    let changes = git(&[
        "status",
        "--porcelain",
        "--untracked-files=no",
        "--",
        ":/",
        ":(top,exclude)lab/results",
    ]);
    Some(if changes?.is_empty() { commit } else { commit + "-dirty" })
}

/// Returns the word in brackets, which is the chosen one, in the text of a kernel's setting.
fn chosen(text: &str) -> Option<String> {
    let (_, rest) = text.split_once('[')?;
    rest.split_once(']').map(|(word, _)| word.to_owned())
}

/// Returns the processor's name in the text of /proc/cpuinfo.
fn cpu_name(text: &str) -> Option<String> {
    let value = |keys: &[&str]| {
        let mut lines = text.lines().filter_map(|line| line.split_once(':'));
        lines.find(|(key, _)| keys.contains(&key.trim())).map(|(_, value)| value.trim())
    };
    let name = value(&["model name", "Model", "cpu model"])?;
    let Some((family, model)) = value(&["cpu family"]).zip(value(&["model"])) else {
        return Some(name.to_owned());
    };
    Some(format!("{name}, family {family}, model {model}"))
}

/// Returns the words of a command line, quoted for a shell where necessary, behind the value of [`TUNABLES`].
fn command(tunables: Option<&str>, mut words: impl Iterator<Item = String>) -> String {
    let quoted = |word: &str| {
        let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./,:=+@%".contains(c);
        let is_plain = !word.is_empty() && word.chars().all(is_plain);
        if is_plain { word.to_owned() } else { format!("'{}'", word.replace('\'', r"'\''")) }
    };
    let program = words.next().unwrap_or_default();
    let name = Path::new(&program).file_stem().unwrap_or_default().to_string_lossy();
    let setting = tunables.map(|value| format!("{TUNABLES}={}", quoted(value)));
    let words = words.map(|word| quoted(&word));
    setting.into_iter().chain([name.into_owned()]).chain(words).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_facts_of_here_are_complete() {
        let machine = Machine::here();
        assert!(machine.rustc.starts_with("1.") && machine.date.starts_with("20"), "{machine:?}");
        assert_eq!(machine.date.len(), 10);
        assert!(machine.summary(1).contains("(one thread)"));
        assert!(machine.summary(2).contains("(trees built by 2 threads, all else by one)"));
        let machine = Machine { large_pages: Some("never".to_owned()), ..machine };
        assert!(machine.summary(1).contains(", large pages: never, rustc"));
        let machine = Machine { large_pages: None, ..machine };
        assert!(!machine.summary(1).contains("large pages"));
    }

    #[test]
    fn the_processor_is_found() {
        let text =
            "processor\t: 0\nvendor_id\t: X\nmodel name\t: Some CPU @ 3: GHz \nflags\t: a b\n";
        assert_eq!(cpu_name(text).as_deref(), Some("Some CPU @ 3: GHz"));
        let text = "cpu family\t: 25\nmodel\t\t: 1\nmodel name\t: AMD EPYC\n";
        assert_eq!(cpu_name(text).as_deref(), Some("AMD EPYC, family 25, model 1"));
        assert_eq!(cpu_name("processor: 0\n"), None);
    }

    #[test]
    fn the_setting_is_the_word_in_brackets() {
        assert_eq!(chosen("always [madvise] never\n").as_deref(), Some("madvise"));
        assert_eq!((chosen("always"), chosen("[always")), (None, None));
    }

    #[test]
    fn commands_can_be_pasted() {
        let words = ["/some/where/hgrid", "table", "my bunny.ply", "--view", "-3,4", "it's", ""];
        let expected = r"hgrid table 'my bunny.ply' --view -3,4 'it'\''s' ''";
        assert_eq!(command(None, words.into_iter().map(str::to_owned)), expected);
        assert_eq!(command(None, core::iter::empty()), "");
        let words = ["hgrid", "compare"].map(str::to_owned).into_iter();
        let expected = "GLIBC_TUNABLES=glibc.malloc.hugetlb=1 hgrid compare";
        assert_eq!(command(Some("glibc.malloc.hugetlb=1"), words), expected);
    }
}
