//! A scene and all that it shows in one blob, which opens without anything else.
//!
//! ```text
//! 0        128                                                              blob_bytes
//! | header | references     | member 0 | member 1 | ...        | the scene |
//!            4 each           a packed grid, or a nested scene
//! ```
//!
//! A member is stored once, however many scenes show it. Members stand in front of the scenes that show them, so
//! there are no cycles. The references are the members' numbers for the objects of each scene, scene after scene.
//! Blobs are those that were built: [`Grid::pack`] and [`Scene::blob`] write them.
//!
//! There is no allocation: to open one, the caller lends room for the views of the members and for the arrays of
//! objects that scenes refer to.

use core::mem::{offset_of, take};
use core::ops::ControlFlow;

use super::{BlobInfo, Out};
use crate::arena::{check_alignment, first_mut, section_bytes, split};
use crate::blob::{HEADER_BYTES, Header, corrupt};
use crate::error::{Error, Region};
use crate::grid::Grid;
use crate::invariant::OrBug;
use crate::limits::MAX_NESTING;
use crate::method::Content;
use crate::ray::INVALID_ID;
use crate::scene::{Object, Scene};

/// Room for the view of a grid or scene that a packed scene holds: [`Scene::open_packed`] fills it.
#[derive(Debug, Clone, Copy, Default)]
pub struct Member<'a>(MemberView<'a>);

#[derive(Debug, Clone, Copy, Default)]
enum MemberView<'a> {
    #[default]
    Nothing,
    Grid(Grid<'a>),
    Scene(Scene<'a>),
}

impl Member<'_> {
    /// Room that nothing is in yet.
    pub const EMPTY: Self = Self(MemberView::Nothing);
}

impl<'a> Member<'a> {
    const fn object(&'a self) -> Object<'a> {
        match &self.0 {
            MemberView::Nothing => Object::Nothing,
            MemberView::Grid(grid) => Object::Grid(grid),
            MemberView::Scene(scene) => Object::Scene(scene),
        }
    }
}

/// The counts and bytes of a packed scene.
struct PackedSizes {
    members: u32,
    references: u64,
    /// Start of the members, in bytes.
    start: u64,
    end: u64,
}

/// The address of an object's view, which identifies a member.
fn key(object: &Object<'_>) -> Option<u64> {
    match object {
        Object::Grid(grid) => Some(core::ptr::from_ref(*grid).addr() as u64),
        Object::Scene(scene) => Some(core::ptr::from_ref(*scene).addr() as u64),
        Object::Shapes(..) | Object::Nothing => None,
    }
}

impl<'a> Scene<'a> {
    /// The objects that instances may name.
    fn named(&self) -> &'a [Object<'a>] {
        self.objects().get(..self.object_count as usize).unwrap_or(self.objects())
    }

    /// Shows all objects of this scene and of scenes inside it; the objects of a scene come before the scene.
    fn each_object(&self, show: &mut dyn FnMut(&Object<'a>) -> ControlFlow<()>) -> ControlFlow<()> {
        for object in self.named() {
            if let Object::Scene(inner) = object {
                inner.each_object(show)?;
            }
            show(object)?;
        }
        ControlFlow::Continue(())
    }

    /// Shows each grid and scene among the objects once, in the order of [`each_object`](Self::each_object).
    fn each_member(
        &self,
        show: &mut dyn FnMut(&Object<'a>) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let (mut place, mut result) = (0_u64, Ok(()));
        // An error ends the loop and is in `result`.
        let _ = self.each_object(&mut |object| {
            let mut before = place;
            place += 1;
            let Some(wanted) = key(object) else {
                return match object {
                    Object::Shapes(..) => {
                        result = Err(Error::OtherContent(Content::Shapes));
                        ControlFlow::Break(())
                    }
                    _ => ControlFlow::Continue(()),
                };
            };
            let mut is_known = false;
            // Breaks at the object itself, or at an earlier one that is the same.
            let _ = self.each_object(&mut |earlier| {
                let is_left = before > 0;
                before = before.saturating_sub(1);
                is_known = is_left && key(earlier) == Some(wanted);
                let ends = is_known || !is_left;
                if ends { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            });
            if !is_known {
                result = show(object);
            }
            if result.is_ok() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
        result
    }

    /// Proves that no more than so many scenes stand inside one another as their views are now. What they noted when
    /// they were built may be wrong: a view may have been overwritten since, even by one that shows itself.
    fn check_depth(&self, most: usize) -> Result<(), Error> {
        let most = most.checked_sub(1).ok_or(Error::TooDeep)?;
        for object in self.named() {
            if let Object::Scene(inner) = object {
                inner.check_depth(most)?;
            }
        }
        Ok(())
    }

    /// Proves that the blob is still the one that this view was made of, as far as its length and its objects tell.
    fn check_blob(&self) -> Result<(), Error> {
        let now = Self::open(self.blob(), self.objects())?;
        let is_same =
            now.object_count == self.object_count && now.blob().len() == self.blob().len();
        if is_same { Ok(()) } else { Err(corrupt(offset_of!(Header, blob_bytes))) }
    }

    fn plan(&self) -> Result<PackedSizes, Error> {
        // Before anything is written: views and blobs may have been overwritten since the scene was built.
        self.check_depth(MAX_NESTING)?;
        self.check_blob()?;
        let (mut members, mut references) = (0_u32, u64::from(self.object_count));
        let mut bytes = self.blob().len() as u64;
        self.each_member(&mut |object| {
            members = members.checked_add(1).ok_or(Error::TooManyTriangles)?;
            match object {
                Object::Grid(grid) => bytes = bytes.saturating_add(grid.packed_sections()?.end),
                Object::Scene(scene) => {
                    scene.check_blob()?;
                    references = references.saturating_add(scene.object_count.into());
                    bytes = bytes.saturating_add(scene.blob().len() as u64);
                }
                Object::Shapes(..) | Object::Nothing => {}
            }
            Ok(())
        })?;
        let start = (HEADER_BYTES as u64).saturating_add(section_bytes::<u32>(references));
        Ok(PackedSizes { members, references, start, end: start.saturating_add(bytes) })
    }

    /// Bytes that [`pack`](Self::pack) writes; 0 if it cannot. Both take O(n^2) time in the objects of all scenes. The
    /// objects of a nested scene count once for each way that leads to it: 100 scenes that each name the same 100
    /// scenes of 100 objects make a million.
    #[must_use]
    pub fn packed_bytes(&self) -> u64 {
        self.plan().map_or(0, |plan| plan.end)
    }

    /// Writes the scene and all grids, meshes and scenes that it shows as one blob for
    /// [`open_packed`](Self::open_packed), and returns the bytes of `to` that it takes.
    ///
    /// A grid or scene is stored once, however often it is shown: the same address is the same grid.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`] names the need, [`Error::Misaligned`] an address that is no multiple of
    /// [`ALIGNMENT`](crate::ALIGNMENT), [`Error::OtherContent`] an object that is shapes, which are the
    /// caller's. If the blob of a grid or a scene is damaged, the error is one of [`Grid::open`] or
    /// [`open`](Self::open). In all these cases nothing is written. After an error of [`Grid::pack`] `to` holds
    /// nothing of use.
    ///
    /// ```
    /// # use hgrid_core::*;
    /// # let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    /// # let mesh = TriangleMesh::new(&positions, &[[0, 1, 2]])?;
    /// # let config = Config::default();
    /// # let needed = Scene::bound(2, &config).expect("two are not too many");
    /// # let mut memory = [(); 2].map(|()| vec![Block::ZERO; Block::count_for(needed.index_bytes)]);
    /// # let mut scratch = vec![Block::ZERO; Block::count_for(needed.scratch_bytes)];
    /// # let scratch = Block::bytes_mut(&mut scratch);
    /// # let [index, scene_index] = memory.each_mut().map(|blocks| Block::bytes_mut(blocks));
    /// # let grid = Grid::build(mesh, &config, index, scratch)?;
    /// # let objects = [Object::Grid(&grid)];
    /// # let instances = [Instance::new(0), Instance::new(0)];
    /// # let scene = Scene::build(&instances, &objects, &config, scene_index, scratch)?;
    /// let mut file = vec![Block::ZERO; Block::count_for(scene.packed_bytes() as usize)];
    /// let packed = scene.pack(Block::bytes_mut(&mut file))?;
    ///
    /// // Store it, map it in another process, and there:
    /// let info = BlobInfo::peek(packed)?;
    /// let mut members = vec![Member::EMPTY; info.triangle_count as usize];
    /// let mut objects = vec![Object::Nothing; info.vertex_count as usize];
    /// let scene = Scene::open_packed(packed, &mut members, &mut objects)?;
    /// assert!(scene.occluded(&RayF64::new([0.25, 0.25, 1.0], [0.0, 0.0, -1.0])));
    /// # Ok::<(), Error>(())
    /// ```
    pub fn pack<'t>(&self, to: &'t mut [u8]) -> Result<&'t mut [u8], Error> {
        check_alignment(to, Region::Index)?;
        let PackedSizes { members, references, start, end } = self.plan()?;
        let too_small = Error::out_of_memory(Region::Index, end, to.len() as u64);
        let to = first_mut(to, end, Region::Index)?;
        let start = usize::try_from(start).unwrap_or(usize::MAX);
        let (head, mut rest) = to.split_at_mut_checked(start).ok_or(too_small)?;

        // List the keys in the place of the members first: the number of a member is the place of its key.
        let (keys, _) = rest.as_chunks_mut::<8>();
        let mut free = keys.iter_mut();
        self.each_member(&mut |object| {
            if let (Some(to), Some(key)) = (free.next().or_bug("no room for a key"), key(object)) {
                *to = key.to_ne_bytes();
            }
            Ok(())
        })?;
        let keys = keys.get(..members as usize).or_bug("a key is missing").unwrap_or_default();
        let number_of = |object: &Object<'_>| {
            let wanted = key(object)?.to_ne_bytes();
            u32::try_from(keys.iter().position(|key| *key == wanted)?).ok()
        };

        // Write header and references.
        let header = Header::peek(self.blob())?.holding(members, references, end);
        let mut out = Out { bytes: head };
        out.put(&header.to_bytes());
        let mut refer = |scene: &Scene<'_>| {
            for object in scene.named() {
                let number = number_of(object);
                let is_there = number.is_some() || matches!(object, Object::Nothing);
                debug_assert!(is_there, "a member without a key");
                out.put(&number.unwrap_or(INVALID_ID).to_ne_bytes());
            }
        };
        self.each_member(&mut |object| {
            if let Object::Scene(scene) = object {
                refer(scene);
            }
            Ok(())
        })?;
        refer(self);
        out.pad();

        // Write the members over their keys, and the scene behind them.
        let copy = |blob: &[u8], to: &mut [u8]| {
            if let Some(to) = to.get_mut(..blob.len()).or_bug("more bytes than were planned") {
                to.copy_from_slice(blob);
            }
            blob.len()
        };
        self.each_member(&mut |object| {
            let bytes = match object {
                Object::Grid(grid) => grid.pack(rest)?.len(),
                Object::Scene(scene) => copy(scene.blob(), rest),
                Object::Shapes(..) | Object::Nothing => 0,
            };
            let behind = take(&mut rest).get_mut(bytes..);
            rest = behind.or_bug("more bytes than were planned").unwrap_or_default();
            Ok(())
        })?;
        copy(self.blob(), rest);
        Ok(to)
    }

    /// Opens a blob that [`pack`](Self::pack) wrote where it lies, in O(members): no copy and no allocation.
    ///
    /// `members` and `objects` are room for views of what is in it: as many as
    /// [`BlobInfo::triangle_count`] and [`BlobInfo::vertex_count`] say; more is not used. The remarks of
    /// [`open`](Self::open) on damaged bytes hold here, too.
    ///
    /// # Errors
    /// [`Error::MissingObjects`] if there is less room; [`Error::OtherContent`] for a blob that is no packed scene;
    /// [`Error::TooDeep`]; those of [`Grid::open_packed`].
    pub fn open_packed(
        blob: &'a [u8],
        members: &'a mut [Member<'a>],
        objects: &'a mut [Object<'a>],
    ) -> Result<Self, Error> {
        Self::unpack(blob, members, objects, None)
    }

    /// [`open_packed`](Self::open_packed) with the proof that all grids and scenes in the blob are right:
    /// [`Grid::validate`] and [`validate`](Self::validate) of each.
    ///
    /// Scratch of a 64th of the blob's bytes is enough; it need not be aligned.
    ///
    /// # Errors
    /// The errors of [`open_packed`](Self::open_packed) and of the proofs.
    pub fn open_packed_proven(
        blob: &'a [u8],
        members: &'a mut [Member<'a>],
        objects: &'a mut [Object<'a>],
        scratch: &mut [u8],
    ) -> Result<Self, Error> {
        Self::unpack(blob, members, objects, Some(scratch))
    }

    fn unpack(
        blob: &'a [u8],
        mut members: &'a mut [Member<'a>],
        objects: &'a mut [Object<'a>],
        mut proof: Option<&mut [u8]>,
    ) -> Result<Self, Error> {
        check_alignment(blob, Region::Index)?;
        let header = Header::peek(blob)?;
        if header.content()? != Content::Packed {
            return Err(Error::OtherContent(header.content()?));
        }
        let (needed_bytes, available_bytes) = (header.blob_bytes, blob.len() as u64);
        let bytes = usize::try_from(needed_bytes).ok().and_then(|bytes| blob.get(..bytes));
        let blob = bytes.ok_or(Error::Truncated { needed_bytes, available_bytes })?;
        let damaged = corrupt(offset_of!(Header, triangle_count));
        let missing = |needed: u64, available: usize| Error::MissingObjects {
            needed: u32::try_from(needed).unwrap_or(u32::MAX),
            available: u32::try_from(available).unwrap_or(u32::MAX),
        };
        let (count, object_count) = (header.triangle_count, header.vertex_count);
        if (members.len() as u64) < count.into() {
            return Err(missing(count.into(), members.len()));
        }
        if (objects.len() as u64) < object_count {
            return Err(missing(object_count, objects.len()));
        }
        let references = object_count.checked_sub(count.into()).ok_or(damaged)?;

        // First come the members, in the order of their numbers, then the arrays of the scenes.
        let split_objects = objects.split_at_mut_checked(count as usize);
        let (table, mut free) = split_objects.ok_or(damaged)?;
        let behind = blob.get(HEADER_BYTES..).unwrap_or_default();
        let (mut numbers, mut rest) = split::<u32>(behind, references).ok_or(damaged)?;
        for number in 0..=count {
            let at = blob.len().saturating_sub(rest.len()) as u64;
            let inside = |error| moved(error, at);
            let info = BlobInfo::peek(rest).map_err(inside)?;
            let bytes = usize::try_from(info.total_bytes).ok();
            let own = bytes.and_then(|bytes| rest.split_at_checked(bytes)).ok_or(damaged)?;
            rest = own.1;
            let view = match info.content {
                Content::Triangles => {
                    let grid = Grid::open_packed(own.0).map_err(inside)?;
                    if let Some(scratch) = &mut proof {
                        grid.validate(scratch).map_err(inside)?;
                    }
                    MemberView::Grid(grid)
                }
                Content::Instances => {
                    let shown = Self::named_in(own.0).map_err(inside)?;
                    let (own_numbers, others) = numbers.split_at_checked(shown).ok_or(damaged)?;
                    numbers = others;
                    let own_objects = take(&mut free).split_at_mut_checked(shown);
                    let (own_objects, others) = own_objects.ok_or(damaged)?;
                    free = others;
                    for (to, &shown) in own_objects.iter_mut().zip(own_numbers) {
                        let known = table.get(..number as usize).unwrap_or_default();
                        let object = known.get(shown as usize).copied();
                        let is_nothing = shown == INVALID_ID;
                        let nothing = is_nothing.then_some(Object::Nothing);
                        *to = object.or(nothing).ok_or(damaged)?;
                    }
                    let scene = Scene::open(own.0, own_objects).map_err(inside)?;
                    if let Some(scratch) = &mut proof {
                        scene.validate(scratch).map_err(inside)?;
                    }
                    MemberView::Scene(scene)
                }
                content => return Err(Error::OtherContent(content)),
            };
            if number < count {
                let (to, others) = take(&mut members).split_first_mut().ok_or(damaged)?;
                members = others;
                *to = Member(view);
                if let Some(entry) = table.get_mut(number as usize) {
                    *entry = to.object();
                }
            } else if let MemberView::Scene(scene) = view {
                let whole = Header::peek(scene.blob())?.holding(count, references, needed_bytes);
                let is_all = rest.is_empty() && numbers.is_empty();
                return if is_all && whole.to_bytes() == header.to_bytes() {
                    Ok(scene)
                } else {
                    Err(damaged)
                };
            }
        }
        Err(damaged)
    }
}

/// The error, found in a part of a blob, as one of the whole.
fn moved(error: Error, by: u64) -> Error {
    match error {
        Error::Corrupt { offset } => Error::Corrupt { offset: offset.saturating_add(by) },
        error => error,
    }
}
