//! Sizes in docs/embedded.md that tests measure, so that the library does not grow too large for small
//! machines without notice.

use std::fs;
use std::sync::{Mutex, PoisonError};

use hgrid_tests::artefact::root;

const PAGE: &str = "docs/embedded.md";

/// Checks each size on the page, to a tenth; each follows its words in the text, in this order. With
/// `HGRID_BLESS` it writes the sizes there.
///
/// # Panics
/// If the page has another size, or lacks the words.
pub fn check_sizes<const N: usize>(words: [&str; N], sizes: [u64; N]) {
    // One test at a time, so that none overwrites what another wrote.
    static WRITES: Mutex<()> = Mutex::new(());
    let _alone = WRITES.lock().unwrap_or_else(PoisonError::into_inner);
    let path = root().join(PAGE);
    let readme = fs::read_to_string(&path).expect(PAGE);
    let is_blessed = std::env::var_os("HGRID_BLESS").is_some();
    let (mut blessed, mut rest) = (String::new(), readme.as_str());
    for (words, is) in words.into_iter().zip(sizes) {
        let (before, behind) = rest.split_once(words).expect(words);
        let end = behind.find(' ').expect("an end");
        let said: u64 = behind[..end].parse().expect("a number");
        assert!(
            is_blessed || is.abs_diff(said) <= said / 10,
            "{words}{said} in {PAGE}, now {is}: HGRID_BLESS=1 writes it anew"
        );
        blessed = format!("{blessed}{before}{words}{is}");
        rest = &behind[end..];
    }
    if is_blessed {
        fs::write(path, blessed + rest).expect("a page that can be written");
    }
}
