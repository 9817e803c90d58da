//! Proof that a foreign blob is a grid of its mesh, in O(n) and without memory.
//!
//! The pairs of a cell and a triangle that the lists hold must be those of the triangles' cell ranges. First, each
//! listed triangle covers its list's cell, so every listed pair is a right one. Second, ids ascend strictly in each
//! list, so no pair is listed twice. So all pairs are there if and only if there are as many as the ranges have cells.
//! This takes no bitmap and no sorting: it compares one sum with another.
//!
//! Two cells with equal lists could still share a slot while another slot stays orphaned. A sum of scrambled slot
//! numbers over the cells and one over the slots with lists tell accidents of that kind. An attacker can make the two
//! sums equal, so nothing rests on them: the answers are right either way, and as the lists of all cells have as many
//! ids as the blob, no query is shown more. Where among the free slots a row came to lie is not checked, either.

use super::spread::count_references;
use super::triangles::MeshSpread;
use super::{OneLevel, slot};
use crate::aabb::Aabb;
use crate::bits::{WORD_BITS, each_one, extent};
use crate::blob::{Header, corrupt};
use crate::cell::{Lattice, row, woo};
use crate::control::Watch;
use crate::error::Error;
use crate::lists::{ascends, pairs};
use crate::mesh::TriangleMesh;

/// Checks that the header says what the mesh and the resolution rule ([`cell`](crate::cell)) say.
pub(crate) fn check_header(
    header: &Header,
    lattice: &Lattice,
    mesh: &TriangleMesh<'_>,
) -> Result<(), Error> {
    header.check(lattice, mesh, |size, count| woo(size, f64::from(header.density), count))
}

impl OneLevel<'_> {
    /// Proves that this is what a build makes of the mesh; the error names the first byte that is not.
    pub(crate) fn validate(
        &self,
        header: &Header,
        lattice: &Lattice,
        blob: &[u8],
        mesh: &TriangleMesh<'_>,
    ) -> Result<(), Error> {
        let at = |section: usize, index: usize| corrupt(section - blob.as_ptr().addr() + index);
        let sections = &self.sections;

        check_header(header, lattice, mesh)?;
        let expected = count_references(
            &MeshSpread::new(mesh, lattice),
            header.reference_count,
            &Watch::none(),
            |_, _| {},
        )?;
        if expected != Some(header.reference_count) {
            return Err(corrupt(core::mem::offset_of!(Header, reference_count)));
        }

        // The hash table cuts the references into lists.
        let hash = sections.hash;
        let hash_at = hash.as_ptr().addr();
        if hash.first() != Some(&0) {
            return Err(at(hash_at, 0));
        }
        if let Some(slot) = pairs(hash).position(|(start, end)| start > end) {
            return Err(at(hash_at, (slot + 1) * size_of::<u32>()));
        }
        if hash.last() != Some(&header.reference_count) {
            return Err(at(hash_at, header.hash_count as usize * size_of::<u32>()));
        }
        // The table ends with the last list.
        if matches!(hash, [.., start, end] if start == end) {
            return Err(corrupt(core::mem::offset_of!(Header, hash_count)));
        }

        // Every marked cell lists triangles that cover it, each once; an empty row has offset 0.
        let [width, height, _] = lattice.resolution;
        let width = width as usize;
        let domain_at = sections.domain_bits.as_ptr().addr();
        let mut listed = 0;
        let mut slots = pairs(hash)
            .zip(0..)
            .filter(|((start, end), _)| start < end)
            .fold(0_u64, |sum, (_, slot)| sum.wrapping_add(scramble(slot)));
        for (row, &offset) in sections.row_offsets.iter().enumerate() {
            if offset != 0 && extent(sections.domain_bits, row * width, width).is_none() {
                return Err(at(sections.row_offsets.as_ptr().addr(), row * size_of::<i32>()));
            }
            let mut damage = None;
            each_one(sections.domain_bits, row * width, width, |x| {
                match self.list(lattice, mesh, cell_of(row, x, height)) {
                    Ok(list) => {
                        listed += list.len() as u64;
                        let slot = u32::try_from(x).ok().and_then(|x| slot(offset, x));
                        slots = slots.wrapping_sub(scramble(slot.unwrap_or(0) as u64));
                    }
                    Err(Some(list)) => damage = Some(at(list.as_ptr().addr(), 0)),
                    Err(None) => damage = Some(at(domain_at, (row * width + x) / 8)),
                }
                damage.is_none()
            });
            damage.map_or(Ok(()), Err)?;
        }

        // No bit is set behind the last cell.
        let cells = sections.row_offsets.len() * width;
        if let Some((first, _)) = extent(sections.domain_bits, cells, WORD_BITS) {
            return Err(at(domain_at, (cells + first) / 8));
        }
        if listed != u64::from(header.reference_count) {
            return Err(at(sections.references.as_ptr().addr(), 0));
        }
        if slots != 0 {
            return Err(at(sections.row_offsets.as_ptr().addr(), 0));
        }
        Ok(())
    }

    /// The list of a cell if it is right: not empty, ascending, each primitive covering the cell. Else the wrong
    /// list, if there is one.
    fn list(
        &self,
        lattice: &Lattice,
        mesh: &TriangleMesh<'_>,
        cell: Option<[u32; 3]>,
    ) -> Result<&[u32], Option<&[u32]>> {
        let cell = cell.ok_or(None)?;
        let list = self.references(cell).filter(|list| !list.is_empty()).ok_or(None)?;
        if is_list_of(list, cell, lattice, mesh) { Ok(list) } else { Err(Some(list)) }
    }
}

/// Returns true if the ids in a list ascend and each covers the list's cell.
pub(crate) fn is_list_of(
    list: &[u32],
    cell: [u32; 3],
    lattice: &Lattice,
    mesh: &TriangleMesh<'_>,
) -> bool {
    let covers = |&id: &u32| {
        let bounds = mesh.corners(id).and_then(Aabb::of);
        bounds.is_some_and(|bounds| lattice.range(&bounds).contains(cell))
    };
    ascends(list) && list.iter().all(covers)
}

/// Returns true if a table is as displaced rows leave it: a row without marked cells has offset 0, every
/// marked cell has a slot of its own, and exactly these slots are full.
///
/// It detects accidents, not attacks: slot numbers can be chosen so that their scrambled sums agree. So a proof also
/// counts the lists that cells name.
pub(crate) fn slots_are_sound(
    [width, height, depth]: [u32; 3],
    offset: impl Fn(usize) -> Option<i32>,
    is_marked: impl Fn([u32; 3]) -> bool,
    is_full: impl Iterator<Item = bool>,
) -> bool {
    let full = is_full.zip(0..).filter(|(is_full, _)| *is_full);
    let mut sum = full.fold(0_u64, |sum, (_, slot)| sum.wrapping_add(scramble(slot)));
    for (z, y) in (0..depth).flat_map(|z| (0..height).map(move |y| (z, y))) {
        let Some(offset) = offset(row(height, y, z)) else { return false };
        let mut is_empty = true;
        for x in (0..width).filter(|&x| is_marked([x, y, z])) {
            let Some(slot) = slot(offset, x) else { return false };
            sum = sum.wrapping_sub(scramble(slot as u64));
            is_empty = false;
        }
        if is_empty && offset != 0 {
            return false;
        }
    }
    sum == 0
}

/// Scrambles a number so that sums do not agree by chance (the finisher of `SplitMix`).
const fn scramble(slot: u64) -> u64 {
    let z = (slot ^ (slot >> 30)).wrapping_add(1).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// The cell at bit `x` of a row.
fn cell_of(row: usize, x: usize, height: u32) -> Option<[u32; 3]> {
    let row = u32::try_from(row).ok()?;
    Some([u32::try_from(x).ok()?, row.checked_rem(height)?, row.checked_div(height)?])
}
