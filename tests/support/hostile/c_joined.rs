//! Meshes joined through C calls: any meshes, in memory of exactly the size.

use std::ptr::{from_mut, null, null_mut};

use arbitrary::{Result, Unstructured};
use hgrid_capi::*;

use super::c_abi::{Caller, UNWRITTEN, known};
use super::memory::{Memory, rarely};

/// The largest index or scratch that is built.
const MOST_BYTES: u64 = 1 << 20;

/// A mesh without any fields set.
const EMPTY: hgrid_mesh = hgrid_mesh {
    struct_size: size_of::<hgrid_mesh>() as u32,
    index_type: HGRID_INDEX_U32,
    positions: null(),
    position_stride: 0,
    vertex_count: 0,
    indices: null(),
    index_stride: 0,
    triangle_count: 0,
    masks: null(),
    mask_stride: 0,
    parts: null(),
    part_count: 0,
};

impl Caller<'_> {
    /// Joins a few meshes and builds a grid of them, which must locate its triangles.
    pub(super) fn join(&mut self, u: &mut Unstructured<'_>) -> Result<()> {
        let mut meshes = Vec::new();
        for _ in 0..u.int_in_range(0..=4)? {
            let mut mesh = *self.mesh(u)?.value();
            // The struct size of the first mesh applies to all, so it may not cover bytes after the first struct.
            if meshes.is_empty() {
                mesh.struct_size = mesh.struct_size.min(EMPTY.struct_size);
            }
            meshes.push(if rarely(u, 4)? { EMPTY } else { mesh });
        }
        let parts = Memory::new(meshes.len() * size_of::<hgrid_part>());
        let mut joined = EMPTY;
        let to = if meshes.is_empty() { null_mut() } else { parts.at(0).cast() };
        // SAFETY: the counts of meshes and parts are right; the meshes stay within their arrays.
        let status =
            known(unsafe { hgrid_join(meshes.as_ptr(), meshes.len(), to, from_mut(&mut joined)) });
        if status != HGRID_OK {
            assert!(joined.parts.is_null() && joined.part_count == 0, "{status}");
            return Ok(());
        }
        let counts = meshes.iter().map(|mesh| mesh.triangle_count);
        assert_eq!(joined.triangle_count, counts.sum::<usize>());
        let mut report = hgrid_report {
            struct_size: size_of::<hgrid_report>() as u32,
            is_exact: 0,
            index_bytes: 0,
            scratch_bytes: 0,
            triangle: 0,
            skipped_count: 0,
            reference_count: 0,
            density: 0.0,
            resolution: [0; 3],
            reserved: 0,
        };
        // SAFETY: the mesh was just joined, and its parts and arrays still exist.
        let status = known(unsafe {
            hgrid_sizes(&raw const joined, null(), null_mut(), 0, &raw mut report)
        });
        if status != HGRID_OK || report.index_bytes.max(report.scratch_bytes) > MOST_BYTES {
            return Ok(());
        }
        let [index, scratch] = [report.index_bytes, report.scratch_bytes]
            .map(|bytes| Memory::new(usize::try_from(bytes).expect("not too large")));
        let mut grid = UNWRITTEN;
        let [index_bytes, scratch_bytes] = [&index, &scratch].map(|region| region.bytes().len());
        // SAFETY: as above, with regions of exactly that size.
        let status = known(unsafe {
            hgrid_build(
                &raw const joined,
                null(),
                index.at(0),
                index_bytes,
                scratch.at(0),
                scratch_bytes,
                &raw mut grid,
                &raw mut report,
            )
        });
        if status != HGRID_OK {
            assert_eq!(status, HGRID_ERROR_INDEX_OUT_OF_RANGE);
            assert!((report.triangle as usize) < joined.triangle_count);
            return Ok(());
        }
        let (mut geometry, mut triangle) = (7, 7);
        let mut at = 0;
        for (place, mesh) in (0_u32..).zip(&meshes) {
            for own in (0_u32..).take(mesh.triangle_count) {
                // SAFETY: the grid was just built.
                let is_there = unsafe {
                    hgrid_locate(&raw const grid, at, &raw mut geometry, &raw mut triangle)
                };
                assert!(is_there && (geometry, triangle) == (place, own), "{at}");
                at += 1;
            }
        }
        // SAFETY: as above.
        let bytes = unsafe { hgrid_validate_bytes(&raw const grid) };
        let proof = Memory::new(bytes);
        // SAFETY: the scratch has exactly that size.
        let status = known(unsafe { hgrid_validate(&raw const grid, proof.at(0), bytes) });
        assert_eq!(status, HGRID_OK);
        self.reached.joined += usize::from(meshes.len() > 1 && joined.triangle_count > 0);
        Ok(())
    }
}
