//! Statistics of a grid and its mesh, for reports and for comparing grids, in one visit of all lists and one of all
//! triangles.

use crate::aabb::Aabb;
use crate::fnv::Fnv;
use crate::grid::Grid;
use crate::ray::INVALID_ID;
use crate::visit::EVERYWHERE;

/// The statistics of a grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Statistics {
    /// Triangles left out because a coordinate is not finite.
    pub skipped_count: u32,
    /// Triangles of which two corners are the same point. They are in the grid, and no ray hits them.
    pub degenerate_count: u32,
    /// The first skipped or degenerate triangle, or [`INVALID_ID`].
    pub first_bad: u32,
    /// Lists of primitives: one for each cell or leaf that has any.
    pub list_count: u64,
    /// Primitive ids in all lists together.
    pub reference_count: u64,
    /// Ids in the longest list.
    pub longest_list: u32,
    /// A hash of the method, the box, the resolution and all lists in order, but not of the cells that have them. It
    /// is the same for the same grid on every platform, whatever its byte order. Not a defence against forgery.
    pub content_hash: u64,
}

impl Grid<'_> {
    /// Looks at all lists and all triangles: O(cells + references + triangles), no memory.
    ///
    /// ```
    #[doc = include_str!("../doc/grid.txt")]
    /// let statistics = grid.inspect();
    /// assert_eq!((statistics.longest_list, statistics.first_bad), (1, INVALID_ID));
    /// # Ok::<(), Error>(())
    /// ```
    #[must_use]
    pub fn inspect(&self) -> Statistics {
        let mut found = Statistics {
            skipped_count: 0,
            degenerate_count: 0,
            first_bad: INVALID_ID,
            list_count: 0,
            reference_count: 0,
            longest_list: 0,
            content_hash: 0,
        };
        for id in 0..self.mesh().triangle_count() {
            let Some([a, b, c]) = self.mesh().corners(id) else { continue };
            if Aabb::of([a, b, c]).is_none() {
                found.skipped_count += 1;
            } else if a == b || b == c || c == a {
                found.degenerate_count += 1;
            } else {
                continue;
            }
            found.first_bad = found.first_bad.min(id);
        }

        let mut hash = Fnv::new();
        let (min, max) = self.bounds();
        hash.add(self.method() as u32);
        self.resolution().into_iter().for_each(|cells| hash.add(cells));
        min.into_iter().chain(max).for_each(|corner| hash.add(corner.to_bits()));
        self.visit(&EVERYWHERE, &mut |ids| {
            let length = u32::try_from(ids.len()).unwrap_or(u32::MAX);
            found.list_count += u64::from(length > 0);
            found.reference_count += u64::from(length);
            found.longest_list = found.longest_list.max(length);
            hash.add(length);
            for &id in ids {
                hash.add(id);
            }
        });
        found.content_hash = hash.finish();
        found
    }
}
