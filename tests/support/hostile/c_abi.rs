//! Any sequence of C calls with any numbers in their structs, as far as the header's rules on pointers allow:
//! every call returns a known status, an error leaves the outputs unchanged, and a success has the answer of
//! the same call in Rust. This file has the builds; `c_stored`, `c_queries` and `c_joined` have the rest.

use std::cell::Cell;
use std::ffi::{CStr, c_void};
use std::mem::MaybeUninit;
use std::ptr::{from_mut, null, null_mut};

use arbitrary::{Arbitrary, Result, Unstructured};
use hgrid_capi::*;
use hgrid_core::IndexType;

use super::caller::Loop;
use super::memory::{Lent, Memory, Struct, array, rarely};
use super::shape::{self, Shape};

/// The largest index or scratch that is built.
const MOST_BYTES: u64 = 1 << 20;

/// Runs the target; see the head of this file. Returns true if the last grid of the calls was queried.
pub fn run(data: &[u8]) -> bool {
    reach(data).is_settled
}

/// Runs the target, and returns how far its calls got.
pub fn reach(data: &[u8]) -> Reached {
    let mut u = Unstructured::new(data);
    let Ok(shape) = Shape::new(&mut u) else { return Reached::default() };
    let mut caller = Caller {
        shape: &shape,
        grid: hgrid_grid::NONE,
        opened: None,
        memory: Vec::new(),
        reached: Reached::default(),
    };
    let _ = caller.calls(&mut u);
    // This comes last, so that bytes kept before it was added keep their meaning.
    let _ = caller.join(&mut u);
    Reached { is_settled: caller.settle(), ..caller.reached }
}

/// The numbers of calls that succeeded. Those of empty meshes do not count.
#[derive(Debug, Clone, Copy, Default)]
pub struct Reached {
    /// Grids that were built.
    pub built: usize,
    /// Grids that the library allocated.
    pub created: usize,
    /// Blobs that were opened, damaged or not.
    pub opened: usize,
    /// Blobs that were packed.
    pub packed: usize,
    /// Grids of several meshes.
    pub joined: usize,
    /// Queries of one ray that a grid answered.
    pub asked: usize,
    /// Batches that a grid answered.
    pub batches: usize,
    /// True if the last grid was queried.
    pub is_settled: bool,
}

impl Reached {
    /// Adds the numbers of another program.
    pub fn add(&mut self, other: &Self) {
        self.built += other.built;
        self.created += other.created;
        self.opened += other.opened;
        self.packed += other.packed;
        self.joined += other.joined;
        self.asked += other.asked;
        self.batches += other.batches;
    }
}

/// A view that no call has written.
pub(super) const UNWRITTEN: hgrid_grid =
    hgrid_grid { opaque: [MaybeUninit::new(0xc7c7_c7c7_c7c7_c7c7); 64] };

/// Returns true if the view is still unwritten.
pub(super) fn is_unwritten(grid: &hgrid_grid) -> bool {
    // SAFETY: the view was made of numbers, and a library that keeps its promise wrote only numbers.
    let words = grid.opaque.map(|word| unsafe { word.assume_init() });
    words == [0xc7c7_c7c7_c7c7_c7c7; 64]
}

/// A program that uses the library.
pub(super) struct Caller<'s> {
    pub(super) shape: &'s Shape,
    pub(super) grid: hgrid_grid,
    pub(super) opened: Option<Opened>,
    /// All memory lent to the library: a view stays valid while others are built.
    pub(super) memory: Vec<Memory>,
    pub(super) reached: Reached,
}

/// The blob and the mesh of the program's grid.
pub(super) struct Opened {
    /// The index of its memory, and the offset at which the blob starts.
    pub(super) blob: usize,
    pub(super) from: usize,
    /// `None` for the mesh in the blob.
    pub(super) mesh: Option<hgrid_mesh>,
    /// True if the library built the blob from this mesh.
    pub(super) is_right: bool,
}

/// The program's next call.
#[derive(Debug, Clone, Copy, Arbitrary)]
enum Call {
    Build,
    Ask,
    Batch,
    Sizes,
    Open,
    Validate,
    All,
    Closest,
    Fit,
    Bound,
    Create,
    Pack,
    Peek,
    Words(i32),
}

impl Call {
    /// Returns true if the call does little without a grid.
    const fn needs_grid(self) -> bool {
        matches!(
            self,
            Self::Ask
                | Self::Batch
                | Self::Open
                | Self::Validate
                | Self::All
                | Self::Closest
                | Self::Pack
                | Self::Peek
        )
    }
}

/// The structs of a call that asks for sizes or builds.
pub(super) struct Input {
    pub(super) mesh: Struct<hgrid_mesh>,
    pub(super) config: Struct<hgrid_config>,
    pub(super) report: Struct<hgrid_report>,
    pub(super) control: Lent<Control>,
}

/// The behaviour of a build's callbacks; the context of the configuration.
pub(super) struct Control {
    run: Loop,
    /// The number of calls after which progress says stop.
    patience: u32,
    done: Cell<u32>,
    calls: Cell<u32>,
}

/// Runs tasks.
unsafe extern "C" fn run_tasks(
    context: *mut c_void,
    count: u32,
    task: hgrid_task,
    task_context: *mut c_void,
) {
    // SAFETY: the library passes on the context of the configuration, a `Control`.
    let control = unsafe { &*context.cast::<Control>() };
    // SAFETY: the loop may pass any index to a task while this function runs.
    control.run.run(count, |index| unsafe { task(task_context, index) });
}

/// Checks the progress of a build.
unsafe extern "C" fn progress(context: *mut c_void, done: u32) -> bool {
    // SAFETY: the library passes on the context of the configuration, a `Control`.
    let control = unsafe { &*context.cast::<Control>() };
    let before = control.done.get();
    assert!(before <= done && done <= HGRID_PROGRESS_END, "{done} after {before}");
    control.done.set(done);
    control.calls.set(control.calls.get() + 1);
    control.calls.get() <= control.patience
}

/// Returns a status, after checking that it has a text.
pub(super) fn known(status: hgrid_status) -> hgrid_status {
    // SAFETY: the function returns a static text for any number.
    let text = unsafe { CStr::from_ptr(hgrid_status_string(status)) };
    assert_ne!(text, c"unknown status", "{status}");
    status
}

impl Caller<'_> {
    fn calls(&mut self, u: &mut Unstructured<'_>) -> Result<()> {
        for _ in 0..=u.int_in_range(0..=11)? {
            let call = Call::arbitrary(u)?;
            // Most programs build a grid before they ask it.
            if call.needs_grid() && self.opened.is_none() && !rarely(u, 8)? {
                self.build(u)?;
            }
            match call {
                Call::Build => self.build(u)?,
                Call::Ask => self.ask(u)?,
                Call::Batch => self.batch(u)?,
                Call::Sizes => self.sizes(u)?,
                Call::Open => self.open(u)?,
                Call::Validate => self.validate(u)?,
                Call::All => self.all(u)?,
                Call::Closest => self.closest(u)?,
                Call::Fit => self.fit(u)?,
                Call::Bound => self.bound(u)?,
                Call::Create => self.create(u)?,
                Call::Pack => self.pack(u)?,
                Call::Peek => self.peek(u)?,
                Call::Words(status) => assert!(!hgrid_status_string(status).is_null()),
            }
        }
        Ok(())
    }

    /// Returns the shape's mesh, or a changed one as far as its arrays allow.
    pub(super) fn mesh(&self, u: &mut Unstructured<'_>) -> Result<Struct<hgrid_mesh>> {
        let shape = self.shape;
        let is_short = shape.index_type == IndexType::U16;
        let mut mesh = hgrid_mesh {
            struct_size: 0,
            index_type: if is_short { HGRID_INDEX_U16 } else { HGRID_INDEX_U32 },
            positions: shape.positions.as_ptr().cast(),
            position_stride: shape.position_stride,
            vertex_count: shape.vertex_count,
            indices: shape.indices.as_ptr().cast(),
            index_stride: shape.index_stride,
            triangle_count: shape.triangle_count,
            masks: if shape.masks.is_empty() { null() } else { shape.masks.as_ptr().cast() },
            mask_stride: shape.mask_stride,
            parts: null(),
            part_count: 0,
        };
        if rarely(u, 16)? {
            mesh.index_type = u.int_in_range(0..=2)?;
            let size = if mesh.index_type == HGRID_INDEX_U16 { 6 } else { 12 };
            (mesh.position_stride, mesh.vertex_count) = array(u, shape.positions.len(), 12)?;
            (mesh.index_stride, mesh.triangle_count) = array(u, shape.indices.len(), size)?;
        }
        if rarely(u, 48)? {
            mesh.positions = null();
        }
        if rarely(u, 48)? {
            mesh.indices = null();
        }
        if rarely(u, 32)? {
            mesh.mask_stride = u.int_in_range(0..=8)?;
        }
        // No more masks than there are, unless their span exceeds any memory.
        let step = if mesh.mask_stride == 0 { 4 } else { mesh.mask_stride };
        let span = mesh.triangle_count.saturating_sub(1).checked_mul(step);
        let span = span.and_then(|span| span.checked_add(4));
        if span.is_some_and(|span| span > shape.masks.len() && isize::try_from(span).is_ok()) {
            mesh.masks = null();
        }
        Struct::new(u, mesh)
    }

    pub(super) fn input(&self, u: &mut Unstructured<'_>) -> Result<Input> {
        let mesh = self.mesh(u)?;
        let chosen = shape::chosen(u)?;
        let patience = if rarely(u, 4)? { u8::arbitrary(u)?.into() } else { u32::MAX };
        let run = Loop::arbitrary(u)?;
        let control = Control { run, patience, done: Cell::new(0), calls: Cell::new(0) };
        let control = Lent::new(control);
        let mut config = hgrid_config {
            struct_size: 0,
            method: chosen.method as u32,
            density: chosen.density,
            macrocell_factor: chosen.macrocell_factor,
            subdivide_above: chosen.subdivide_above,
            depth: chosen.depth,
            reserved: 0,
            flags: chosen.flags.bits(),
            tasks: u32::from(u8::arbitrary(u)? % 80),
            quality: chosen.quality as u32 + if rarely(u, 48)? { 7 } else { 0 },
            context: control.as_ptr().cast(),
            run: if rarely(u, 32)? { None } else { Some(run_tasks) },
            progress: if bool::arbitrary(u)? { Some(progress) } else { None },
        };
        if rarely(u, 32)? {
            config.method = u32::arbitrary(u)?;
        }
        let report = hgrid_report {
            struct_size: 0,
            is_exact: 7,
            index_bytes: 7,
            scratch_bytes: 7,
            triangle: 7,
            skipped_count: 7,
            reference_count: 7,
            density: 7.0,
            resolution: [7; 3],
            reserved: 7,
        };
        let (config, report) = (Struct::new(u, config)?, Struct::new(u, report)?);
        Ok(Input { mesh, config, report, control })
    }

    fn sizes(&mut self, u: &mut Unstructured<'_>) -> Result<()> {
        let mut input = self.input(u)?;
        let scratch = Memory::new(usize::from(u16::arbitrary(u)?));
        let start = u.int_in_range(0..=65)?.min(scratch.bytes().len());
        let length = scratch.bytes().len() - start;
        let is_sound = input.report.is_sound();
        let before = *input.report.value();
        let status = known(input.ask(scratch.at(start), length));
        let report = input.report.value();
        if is_sound {
            assert_eq!(report.struct_size, before.struct_size);
            assert_eq!((report.skipped_count, report.reserved), (0, 0));
        } else {
            assert_ne!(status, HGRID_OK);
            assert_eq!(report.index_bytes, 7);
        }
        Ok(())
    }

    fn build(&mut self, u: &mut Unstructured<'_>) -> Result<()> {
        let mut input = self.input(u)?;
        let [index_bytes, scratch_bytes] = input.need().unwrap_or([4096; 2]);
        let odd = |u: &mut Unstructured<'_>, bytes: usize| {
            Ok(if rarely(u, 16)? {
                match u.int_in_range(0..=2)? {
                    0 => bytes.saturating_sub(u8::arbitrary(u)?.into()),
                    1 => bytes + usize::from(u8::arbitrary(u)?),
                    _ => u16::arbitrary(u)?.into(),
                }
            } else {
                bytes
            })
        };
        let (index_bytes, scratch_bytes) = (odd(u, index_bytes)?, odd(u, scratch_bytes)?);
        let (index, scratch) = (Memory::new(index_bytes), Memory::new(scratch_bytes));
        let shift = |u: &mut Unstructured<'_>, memory: &Memory| {
            let shift = if rarely(u, 32)? { u.int_in_range(0..=64)? } else { 0 };
            Ok(shift.min(memory.bytes().len()))
        };
        let (index_at, scratch_at) = (shift(u, &index)?, shift(u, &scratch)?);
        let (mut index_start, mut scratch_start) = (index.at(index_at), scratch.at(scratch_at));
        let (index_bytes, scratch_bytes) = (index_bytes - index_at, scratch_bytes - scratch_at);
        let mut lengths = [index_bytes, scratch_bytes];
        match u.int_in_range(0..=63)? {
            61 => index_start = null_mut(),
            62 => scratch_start = null_mut(),
            63 => {
                // The same memory for both regions is refused, unless it has no bytes.
                (scratch_start, lengths[1]) = (index_start, lengths[0]);
            }
            _ => {}
        }
        let mut grid = UNWRITTEN;
        let to = if rarely(u, 48)? { null_mut() } else { from_mut(&mut grid) };
        let (mesh, config, report) =
            (input.mesh.as_ptr(), input.config.as_ptr(), input.report.as_mut_ptr());
        let [index_length, scratch_length] = lengths;
        // SAFETY: all pointers are NULL or valid for the given sizes.
        let status = known(unsafe {
            hgrid_build(
                mesh,
                config,
                index_start,
                index_length,
                scratch_start,
                scratch_length,
                to,
                report,
            )
        });
        if status != HGRID_OK {
            assert!(is_unwritten(&grid), "{status}");
            return Ok(());
        }
        assert!(input.mesh.is_sound() && !to.is_null() && index_at % 64 == 0);
        let Control { done, calls, patience, .. } = &*input.control;
        let is_watched = !input.config.is_null() && input.config.value().progress.is_some();
        assert!(!is_watched || done.get() == HGRID_PROGRESS_END);
        assert!(
            calls.get() <= patience.saturating_add(1),
            "the build went on after progress returned false"
        );
        self.grid = grid;
        self.opened = Some(Opened {
            blob: self.memory.len(),
            from: index_at,
            mesh: Some(*input.mesh.value()),
            is_right: true,
        });
        self.memory.push(index);
        self.reached.built += usize::from(self.has_triangles());
        Ok(())
    }

    /// Returns true if the program has a grid that is not empty.
    pub(super) fn has_triangles(&self) -> bool {
        self.core().is_some_and(|grid| grid.mesh().triangle_count() > 0)
    }

    fn fit(&mut self, u: &mut Unstructured<'_>) -> Result<()> {
        let mut input = self.input(u)?;
        let budget = usize::from(u16::arbitrary(u)?);
        let scratch = Memory::new(usize::from(u16::arbitrary(u)?));
        let mut fitted = Struct::new(u, *input.config.value())?;
        let (mesh, config, report) =
            (input.mesh.as_ptr(), input.config.as_ptr(), input.report.as_mut_ptr());
        let to = fitted.as_mut_ptr();
        // SAFETY: all pointers are NULL or valid for the given sizes.
        let status = known(unsafe {
            hgrid_fit(mesh, config, budget, scratch.at(0), scratch.bytes().len(), to, report)
        });
        if status == HGRID_OK {
            // Asking for sizes confirms that the fitted configuration fits.
            assert!(fitted.is_sound() && input.mesh.is_sound());
            let is_told = input.report.is_sound();
            assert!(!is_told || input.report.value().index_bytes <= budget as u64);
            // Without tasks, which take extra memory.
            input.config = Struct::right(hgrid_config { tasks: 1, ..*fitted.value() });
            let again = input.ask(scratch.at(0), scratch.bytes().len());
            assert!(again == HGRID_OK || !is_told, "{again}");
            assert!(!is_told || input.report.value().index_bytes <= budget as u64);
        }
        Ok(())
    }

    fn bound(&mut self, u: &mut Unstructured<'_>) -> Result<()> {
        let mut input = self.input(u)?;
        let count = if rarely(u, 4)? { usize::arbitrary(u)? } else { self.shape.triangle_count };
        // SAFETY: all pointers are NULL or valid for the given sizes.
        let status =
            known(unsafe { hgrid_bound(count, input.config.as_ptr(), input.report.as_mut_ptr()) });
        let is_mine = count == self.shape.triangle_count && input.report.is_sound();
        if status == HGRID_OK && is_mine && input.mesh.is_sound() {
            let bound = *input.report.value();
            let is_asked = input.ask(null_mut(), 0) == HGRID_OK;
            let report = input.report.value();
            let same = input.mesh.value().triangle_count == count;
            assert!(!is_asked || !same || report.index_bytes <= bound.index_bytes);
            assert!(!is_asked || !same || report.scratch_bytes <= bound.scratch_bytes);
        }
        Ok(())
    }
}

impl Input {
    /// Asks for sizes.
    fn ask(&mut self, scratch: *mut c_void, scratch_bytes: usize) -> hgrid_status {
        let (mesh, config) = (self.mesh.as_ptr(), self.config.as_ptr());
        let report = self.report.as_mut_ptr();
        // SAFETY: all pointers are NULL or valid for the given sizes.
        unsafe { hgrid_sizes(mesh, config, scratch, scratch_bytes, report) }
    }

    /// Returns the sizes of a build, if they can be asked for and are not too large.
    pub(super) fn need(&mut self) -> Option<[usize; 2]> {
        if !self.report.is_sound() || self.ask(null_mut(), 0) != HGRID_OK {
            return None;
        }
        let enough = self.report.value().scratch_bytes;
        let scratch = Memory::new(usize::try_from(enough).ok().filter(|_| enough <= MOST_BYTES)?);
        if self.ask(scratch.at(0), scratch.bytes().len()) != HGRID_OK {
            return None;
        }
        let report = self.report.value();
        // With several tasks, a tree's sizes are a bound for any mesh.
        let config = self.config.value();
        let is_bound =
            !self.config.is_null() && config.method == HGRID_METHOD_BVH && config.tasks > 1;
        assert!((report.is_exact == 1) != is_bound && report.scratch_bytes <= enough);
        let index_bytes = usize::try_from(report.index_bytes).ok();
        Some([index_bytes.filter(|_| report.index_bytes <= MOST_BYTES)?, scratch.bytes().len()])
    }
}
