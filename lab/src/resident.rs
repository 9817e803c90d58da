//! The used part of a memory region: its pages that the system has provided.
//!
//! Linux reports it in /proc/self/pagemap, eight bytes for each page of the address space. Builders that
//! cannot know their needs request much more scratch than they write, and the system never provides pages
//! that are not written.

use std::fs::{self, File};
use std::io::{BufReader, Read as _, Seek as _, SeekFrom};

/// The bits of a page in memory or in swap.
const PRESENT_OR_SWAPPED: u64 = 0b11 << 62;

/// Returns the bytes of the region's pages that hold something, if the system tells.
///
/// The region must start at a page, as a memory map does.
#[must_use]
pub fn resident_bytes(region: &[u8]) -> Option<usize> {
    let page = page_bytes(&fs::read_to_string("/proc/self/smaps").ok()?)?;
    let mut pages = File::open("/proc/self/pagemap").ok()?;
    let first = (region.as_ptr().addr() / page) as u64;
    pages.seek(SeekFrom::Start(8 * first)).ok()?;

    let mut pages = BufReader::with_capacity(1 << 16, pages);
    let mut resident = 0;
    for _ in 0..region.len().div_ceil(page) {
        let mut entry = [0; 8];
        pages.read_exact(&mut entry).ok()?;
        resident += usize::from(u64::from_ne_bytes(entry) & PRESENT_OR_SWAPPED != 0);
    }
    Some((resident * page).min(region.len()))
}

/// Returns the size of a page from the text of /proc/self/smaps.
fn page_bytes(text: &str) -> Option<usize> {
    let line = text.lines().find_map(|line| line.strip_prefix("KernelPageSize:"))?;
    let kibibytes = line.trim().strip_suffix("kB")?.trim().parse::<usize>().ok()?;
    kibibytes.checked_mul(1024).filter(|&bytes| bytes > 0)
}

#[cfg(test)]
mod tests {
    use memmap2::MmapMut;

    use super::*;

    #[test]
    fn only_written_pages_count() {
        let mut region = MmapMut::map_anon(1 << 24).unwrap();
        let Some(before) = resident_bytes(&region) else { return };
        region[5 << 20..6 << 20].fill(1);
        let after = resident_bytes(&region).unwrap();
        assert_eq!(before, 0);
        assert!(((1 << 20)..(4 << 20)).contains(&after), "{after}");
    }

    #[test]
    fn the_page_size_is_found() {
        let text = "55d0-55d1 r--p 0000\nSize:  4 kB\nKernelPageSize:       16 kB\nRss: 1 kB\n";
        assert_eq!(page_bytes(text), Some(16_384));
        assert_eq!(page_bytes("Size: 4 kB\n"), None);
    }
}
