//! Builds, opens, proves and refits scenes.
//!
//! ```text
//! build   index | room for the tree ... | table | boxes | instances |
//!         compute boxes and instances at the end of the index, build the tree over the boxes at its start
//!         | tree | table | boxes | instances |        close the gap
//! refit   compute the boxes again, then those of the tree's nodes
//! ```

use core::mem::offset_of;

use zerocopy::IntoBytes;

use super::instance::{Instance, StoredInstance};
use super::{Object, Scene, Table};
use crate::arena::{
    Sizes, align_up, check_alignment, first_mut, move_down, section_bytes, split, split_mut,
};
use crate::blob::{Header, corrupt};
use crate::config::Config;
use crate::control::Control;
use crate::error::{Error, Region};
use crate::grid::Grid;
use crate::invariant::OrBug;
use crate::limits::{ALIGNMENT, MAX_NESTING};
use crate::mesh::{BOX_BYTES, Strided, TriangleMesh};
use crate::method::Content;
use crate::refit::{Refit, refit};

type BoxSides = [f32; 6];

/// Bytes behind the tree: table, boxes and instances.
const fn behind_bytes(instances: u64) -> u64 {
    section_bytes::<Table>(1)
        + section_bytes::<BoxSides>(instances)
        + section_bytes::<StoredInstance>(instances)
}

/// Returns the place at which the tree of a scene ends and its table starts, and the bytes of all of it.
pub(crate) fn ends_of(header: &Header) -> (u64, u64) {
    let start = align_up(header.blob_bytes);
    (start, start.saturating_add(behind_bytes(header.triangle_count.into())))
}

/// The boxes of instances as the tree sees them.
fn boxes_of<'a>(
    sides: &'a [BoxSides],
    stored: &'a [StoredInstance],
) -> Result<TriangleMesh<'a>, Error> {
    let bytes = sides.as_bytes();
    let boxes = Strided { bytes, stride: BOX_BYTES, count: sides.len() };
    // Without instances there are no masks.
    let bytes = stored.as_bytes().get(offset_of!(Instance, mask)..).unwrap_or_default();
    let masks = Strided { bytes, stride: size_of::<StoredInstance>(), count: stored.len() };
    TriangleMesh::of_boxes(boxes, Content::Instances)?.with_masks(masks)
}

/// Writes what stands behind the tree, each instance with its inverse and its box, and returns the boxes. `short` is
/// the error if it has no room.
fn fill<'t>(
    tail: &'t mut [u8],
    instances: &[Instance],
    objects: &[Object<'_>],
    short: Error,
) -> Result<TriangleMesh<'t>, Error> {
    let count = instances.len() as u64;
    let sections = split_mut::<Table>(tail, 1).and_then(|(table, rest)| {
        let (sides, rest) = split_mut::<BoxSides>(rest, count)?;
        Some((table, sides, split_mut::<StoredInstance>(rest, count)?.0))
    });
    let (table, sides, slots) = sections.ok_or(short)?;
    let to = sides.iter_mut().zip(&mut *slots);
    for (number, (instance, to)) in (0_u32..).zip(instances.iter().zip(to)) {
        let Some(object) = objects.get(instance.object as usize) else {
            return Err(Error::InstanceWithoutObject { instance: number });
        };
        let stored = StoredInstance::new(instance);
        let bounds = stored.and_then(|stored| stored.bounds(&object.bounds()));
        let (Some(stored), Some(bounds)) = (stored, bounds) else {
            return Err(Error::InstanceWithoutInverse { instance: number });
        };
        (*to.0, *to.1) = (bounds, stored);
    }
    let object_count = instances.iter().map(|instance| instance.object.saturating_add(1)).max();
    if let Some(table) = table.first_mut().or_bug("a scene without a table") {
        *table = Table { object_count: object_count.unwrap_or(0), unused: [0; 15] };
    }
    boxes_of(sides, slots)
}

/// The levels of a scene over these objects.
fn levels_over(objects: &[Object<'_>]) -> Result<usize, Error> {
    let levels = 1 + objects.iter().map(Object::levels).max().unwrap_or(0);
    if levels > MAX_NESTING { Err(Error::TooDeep) } else { Ok(levels) }
}

impl<'a> Scene<'a> {
    /// Enough memory for any scene of so many instances: O(1), usable in a constant. `None` as for
    /// [`Sizes::bound`], and for a method that is not [`Method::Bvh`](crate::Method::Bvh).
    #[must_use]
    pub const fn bound(instances: u32, config: &Config) -> Option<Sizes> {
        Self::bound_parallel(instances, config, 1)
    }

    /// Enough memory for a build with so many tasks.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "compared before")]
    pub const fn bound_parallel(instances: u32, config: &Config, tasks: u32) -> Option<Sizes> {
        if config.check_tree().is_err() {
            return None;
        }
        let Some(sizes) = Sizes::bound_parallel(instances, config, tasks) else { return None };
        let index =
            align_up(sizes.index_bytes as u64).saturating_add(behind_bytes(instances as u64));
        if index > usize::MAX as u64 {
            return None;
        }
        Some(Sizes { index_bytes: index as usize, ..sizes })
    }

    /// Builds a scene in memory that the caller brings, as [`Grid::build`] does, in O(n).
    ///
    /// The instances are copied; the objects are not, and are read at every query.
    ///
    /// # Errors
    /// [`Error::InstanceWithoutObject`] and [`Error::InstanceWithoutInverse`] name the instance; [`Error::TooDeep`]
    /// for more than [`MAX_NESTING`] scenes inside one another; [`Error::OutOfMemory`], [`Error::Misaligned`],
    /// [`Error::TooManyTriangles`] for more instances than a tree takes, and [`Error::InvalidConfig`] if the method is
    /// not [`Method::Bvh`](crate::Method::Bvh). After an error the index holds nothing of use.
    pub fn build(
        instances: &[Instance],
        objects: &'a [Object<'a>],
        config: &Config,
        index: &'a mut [u8],
        scratch: &mut [u8],
    ) -> Result<Self, Error> {
        Self::build_with(instances, objects, config, index, scratch, &Control::SERIAL)
    }

    /// Builds a scene with its tree made on the caller's threads: bit by bit the same scene.
    ///
    /// # Errors
    /// The errors of [`build`](Self::build) and of [`Grid::build_with`].
    pub fn build_with(
        instances: &[Instance],
        objects: &'a [Object<'a>],
        config: &Config,
        index: &'a mut [u8],
        scratch: &mut [u8],
        control: &Control<'_>,
    ) -> Result<Self, Error> {
        config.check_tree()?;
        config.check()?;
        check_alignment(index, Region::Index)?;
        levels_over(objects)?;
        let count = u32::try_from(instances.len()).map_err(|_| Error::TooManyTriangles)?;
        let (behind, available_bytes) = (behind_bytes(count.into()), index.len() as u64);
        let needed = |tree: u64| align_up(tree).saturating_add(behind);
        let short = |tree| Error::out_of_memory(Region::Index, needed(tree), available_bytes);
        // Pages behind the bound stay untouched, as those behind the grid of a mesh do.
        let enough =
            Self::bound_parallel(count, config, control.tasks).map(|sizes| sizes.index_bytes);
        let used = index.len().min(enough.unwrap_or(usize::MAX));
        let index = first_mut(index, used as u64, Region::Index)?;

        // Put boxes and instances at the end of the index, and the tree at its start.
        let space = usize::try_from(behind).ok();
        let room = (index.len() & !(ALIGNMENT - 1)).checked_sub(space.unwrap_or(usize::MAX));
        // The size of the tree is known only once it is built: ask for the bound.
        let most = Self::bound(count, config).ok_or(Error::TooManyTriangles)?.index_bytes as u64;
        let room = room.ok_or(short(most.saturating_sub(behind)))?;
        let (head, tail) = index.split_at_mut_checked(room).ok_or(short(0))?;
        let boxes = fill(tail, instances, objects, short(0))?;
        let tree = Grid::build_with(boxes, config, head, scratch, control);
        let tree_bytes = match tree {
            Ok(tree) => tree.blob_bytes(),
            Err(Error::OutOfMemory { region: Region::Index, needed_bytes, .. }) => {
                return Err(short(needed_bytes));
            }
            Err(error) => return Err(error),
        };

        // Close the gap. Blocks move sooner than bytes.
        let block_of = |byte: usize| byte / ALIGNMENT;
        let (blocks, _) = index.as_chunks_mut::<ALIGNMENT>();
        let from = block_of(room)..blocks.len();
        move_down(blocks, from, block_of(tree_bytes));
        Self::open(index, objects)
    }

    /// Opens a scene that was built earlier or elsewhere; bytes behind it are ignored. O(1), but for a look at each
    /// object.
    ///
    /// The objects must be those that it was built with, in their order. On damaged bytes, or with other objects,
    /// queries may answer wrongly, but they stay inside the blob and end.
    ///
    /// # Errors
    /// [`Error::MissingObjects`] if instances name more objects than there are; [`Error::TooDeep`];
    /// [`Error::OtherContent`] for a blob that is no scene; those of [`Grid::open`].
    ///
    /// ```
    #[doc = include_str!("../../doc/scene.txt")]
    /// let mut copy = vec![Block::ZERO; Block::count_for(scene.blob().len())];
    /// Block::bytes_mut(&mut copy)[..scene.blob().len()].copy_from_slice(scene.blob());
    ///
    /// let scene = Scene::open(Block::bytes(&copy), &objects)?;
    /// assert_eq!(scene.instance_count(), 1);
    /// # Ok::<(), Error>(())
    /// ```
    pub fn open(blob: &'a [u8], objects: &'a [Object<'a>]) -> Result<Self, Error> {
        check_alignment(blob, Region::Index)?;
        let header = Header::peek(blob)?;
        let content = header.content()?;
        if content != Content::Instances {
            return Err(Error::OtherContent(content));
        }
        let (start, end) = ends_of(&header);
        let available_bytes = blob.len() as u64;
        let bytes = usize::try_from(end).ok().and_then(|end| blob.get(..end));
        let blob = bytes.ok_or(Error::Truncated { needed_bytes: end, available_bytes })?;
        let behind = usize::try_from(start).ok().and_then(|start| blob.get(start..));
        let count = u64::from(header.triangle_count);
        let sections = behind.and_then(|behind| {
            let (table, behind) = split::<Table>(behind, 1)?;
            let (sides, behind) = split::<BoxSides>(behind, count)?;
            Some((*table.first()?, sides, split::<StoredInstance>(behind, count)?.0))
        });
        let (table, sides, instances) =
            sections.ok_or(corrupt(offset_of!(Header, triangle_count)))?;
        let tree = Grid::open(blob, boxes_of(sides, instances)?)?;
        if table.object_count as usize > objects.len() {
            return Err(Error::MissingObjects {
                needed: table.object_count,
                available: u32::try_from(objects.len()).unwrap_or(u32::MAX),
            });
        }
        let levels = levels_over(objects)?;
        let object_count = table.object_count;
        Ok(Self { blob, tree, instances, objects, levels, object_count })
    }

    /// Reads from a scene's bytes the number of objects that it takes.
    pub(crate) fn named_in(blob: &[u8]) -> Result<usize, Error> {
        let (start, _) = ends_of(&Header::peek(blob)?);
        let table = usize::try_from(start).ok().and_then(|start| blob.get(start..)?.first_chunk());
        let count = table.map(|bytes: &[u8; 4]| u32::from_ne_bytes(*bytes));
        Ok(count.ok_or(corrupt(offset_of!(Header, triangle_count)))? as usize)
    }

    /// Proves that the blob is a scene over the objects that it was opened with: checks the tree, the box of every
    /// instance and the table, in O(instances). The objects have proofs of their own. `scratch` has
    /// [`validate_bytes`](Self::validate_bytes) bytes or more.
    ///
    /// # Errors
    /// The errors of [`Grid::validate`].
    pub fn validate(&self, scratch: &mut [u8]) -> Result<(), Error> {
        let header = Header::peek(self.blob)?;
        let (start, _) = ends_of(&header);
        self.tree.validate(scratch)?;
        let table_bytes = section_bytes::<Table>(1);
        let instances_at =
            start + table_bytes + section_bytes::<BoxSides>(header.triangle_count.into());
        let mut object_count = 0;
        for (number, stored) in (0_u32..).zip(self.instances) {
            let offset = instances_at + u64::from(number) * size_of::<StoredInstance>() as u64;
            let object = self.objects.get(stored.object() as usize);
            let bounds = object.and_then(|object| stored.bounds(&object.bounds()));
            let bounds = bounds.ok_or(Error::Corrupt { offset })?;
            object_count = object_count.max(stored.object().saturating_add(1));
            let stored = self.tree.mesh().box_bytes(number);
            if stored.is_none_or(|stored| stored != bounds.as_bytes()) {
                let offset = start + table_bytes + u64::from(number) * BOX_BYTES as u64;
                return Err(Error::Corrupt { offset });
            }
        }
        let table = Table { object_count, unused: [0; 15] };
        let stored = usize::try_from(start).ok().and_then(|at| self.blob.get(at..)?.first_chunk());
        if stored.is_none_or(|stored: &[u8; 64]| stored != table.as_bytes()) {
            return Err(Error::Corrupt { offset: start });
        }
        Ok(())
    }

    /// Bytes of scratch that [`validate`](Self::validate) takes.
    #[must_use]
    pub const fn validate_bytes(&self) -> usize {
        self.tree.validate_bytes()
    }

    /// Gives a built scene instances that moved: in place, O(n), without scratch. `index` holds the scene's blob, and
    /// there are as many instances as in the build. Call it also if an object changed and no instance moved: a scene
    /// keeps the boxes that its objects had. [`refit`](crate::refit()) says when to build anew; [`open`](Self::open)
    /// the scene again afterwards.
    ///
    /// # Errors
    /// [`Error::MeshMismatch`] for another number of instances, and those of [`open`](Self::open). After
    /// [`Error::InstanceWithoutObject`], [`Error::InstanceWithoutInverse`] and [`Error::Corrupt`] the blob may hold
    /// nothing of use; after all others it is as it was.
    ///
    /// ```
    #[doc = include_str!("../../doc/scene.txt")]
    /// let blob = scene.blob();
    /// # let mut copy = vec![Block::ZERO; Block::count_for(blob.len())];
    /// # Block::bytes_mut(&mut copy)[..blob.len()].copy_from_slice(blob);
    /// # let index = Block::bytes_mut(&mut copy);
    /// // The instance moves up, and rays find it there.
    /// let moved = [Instance { translation: [0.0, 0.0, 5.0], ..Instance::new(0) }];
    /// Scene::refit(index, &moved, &objects)?;
    /// let scene = Scene::open(index, &objects)?;
    /// let hit = scene.intersect(&RayF64::new([0.25, 0.25, 6.0], [0.0, 0.0, -1.0]));
    /// assert_eq!(hit.map(|hit| hit.t), Some(1.0));
    /// # Ok::<(), Error>(())
    /// ```
    pub fn refit(
        index: &mut [u8],
        instances: &[Instance],
        objects: &[Object<'_>],
    ) -> Result<Refit, Error> {
        let scene = Scene::open(index, objects)?;
        if scene.instance_count() as usize != instances.len() {
            return Err(Error::MeshMismatch);
        }
        let header = Header::peek(index)?;
        // The refit below would refuse such a header, too, but after the bytes changed.
        header.check_scene()?;
        let start = usize::try_from(ends_of(&header).0).unwrap_or(usize::MAX);
        let damaged = corrupt(offset_of!(Header, triangle_count));
        let (head, tail) = index.split_at_mut_checked(start).ok_or(damaged)?;
        refit(head, &fill(tail, instances, objects, damaged)?)
    }
}
