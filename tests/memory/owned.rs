//! Grids that own their memory: the heap they take during a build and afterwards, how they allocate it, and
//! how they fail without it. Their answers are those of other grids.

#![expect(unsafe_code, reason = "an allocator is unsafe to implement")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::mem::offset_of;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use hgrid_core::{
    ALIGNMENT, Config, Error, Grid, IndexType, Method, OwnedGrid, OwnedMesh, OwnedStrided, Ray,
    Region, Strided, sizes,
};
use hgrid_tests::meshes::{Mesh, ball, soup};
use hgrid_tests::owned::{Owned, prove};
use hgrid_tests::random::Random;
use hgrid_tests::{methods, oracle};

/// The heap use of a thread, in bytes.
#[derive(Debug, Clone, Copy)]
struct Heap {
    current: usize,
    peak: usize,
    /// Bytes that were allocated uncleared, or cleared by hand because of their alignment, or moved.
    written: usize,
    /// Allocations that still succeed.
    left: usize,
}

const UNLIMITED: Heap = Heap { current: 0, peak: 0, written: 0, left: usize::MAX };

thread_local! {
    static HEAP: Cell<Heap> = const { Cell::new(UNLIMITED) };
}

thread_local! {
    /// True if `realloc` moves the bytes to an address that is elsewhere between two multiples of [`ALIGNMENT`].
    static MOVES: Cell<bool> = const { Cell::new(false) };
}

/// The alignment up to which `calloc` and `realloc` need not touch the bytes.
const USUAL_ALIGNMENT: usize = 16;

/// Counts an allocation, or returns false if none are left.
fn take(bytes: usize, is_written: bool) -> bool {
    let heap = HEAP.get();
    let Some(left) = heap.left.checked_sub(1) else { return false };
    HEAP.set(Heap { left, ..heap });
    add(bytes, is_written);
    true
}

fn add(bytes: usize, is_written: bool) {
    let heap = HEAP.get();
    let current = heap.current.wrapping_add(bytes);
    let written = heap.written + if is_written { bytes } else { 0 };
    HEAP.set(Heap { current, peak: heap.peak.max(current), written, ..heap });
}

fn give(bytes: usize) {
    let heap = HEAP.get();
    HEAP.set(Heap { current: heap.current.wrapping_sub(bytes), ..heap });
}

struct Counting;

#[global_allocator]
static ALLOCATOR: Counting = Counting;

// SAFETY: every call is passed on unchanged to the system's allocator; counting does not allocate.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        if !take(layout.size(), true) {
            return std::ptr::null_mut();
        }
        // SAFETY: the caller promises a valid layout.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        if !take(layout.size(), layout.align() > USUAL_ALIGNMENT) {
            return std::ptr::null_mut();
        }
        // SAFETY: as above.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, start: *mut u8, layout: Layout, bytes: usize) -> *mut u8 {
        give(layout.size());
        add(bytes, layout.align() > USUAL_ALIGNMENT);
        if MOVES.get() {
            // SAFETY: as above, for a block of this allocator.
            return unsafe { move_elsewhere(start, layout, bytes, 64) };
        }
        // SAFETY: as above, for a block of this allocator.
        unsafe { System.realloc(start, layout, bytes) }
    }

    unsafe fn dealloc(&self, start: *mut u8, layout: Layout) {
        give(layout.size());
        // SAFETY: as above, for a block of this allocator.
        unsafe { System.dealloc(start, layout) }
    }
}

/// Moves a block to an address that is elsewhere between two multiples of [`ALIGNMENT`], or after so many tries to any.
///
/// # Safety
/// As for [`GlobalAlloc::realloc`].
unsafe fn move_elsewhere(start: *mut u8, layout: Layout, bytes: usize, tries: u32) -> *mut u8 {
    let new = Layout::from_size_align(bytes, layout.align()).unwrap();
    // SAFETY: the caller promises that the size is not zero.
    let block = unsafe { System.alloc(new) };
    if block.is_null() {
        return block;
    }
    if block.addr() % ALIGNMENT != start.addr() % ALIGNMENT || tries == 0 {
        // SAFETY: both blocks have so many bytes, and one of them is new.
        unsafe { block.copy_from_nonoverlapping(start, bytes.min(layout.size())) };
        // SAFETY: the caller gives this block away.
        unsafe { System.dealloc(start, layout) };
        return block;
    }
    // Keep the block while others are tried, and a small one before them.
    let small = Layout::new::<u64>();
    // SAFETY: the size is not zero.
    let between = unsafe { System.alloc(small) };
    // SAFETY: as this call.
    let moved = unsafe { move_elsewhere(start, layout, bytes, tries - 1) };
    // SAFETY: allocated above.
    unsafe { System.dealloc(block, new) };
    if !between.is_null() {
        // SAFETY: allocated above.
        unsafe { System.dealloc(between, small) };
    }
    moved
}

fn scene() -> Mesh {
    let mut mesh = ball(24, 1.0);
    mesh.append(&soup(2000, 0.1, 5));
    mesh
}

fn owned(mesh: &Mesh) -> OwnedMesh {
    OwnedMesh::new(mesh.positions.clone(), mesh.indices.clone()).unwrap()
}

fn check(grid: &Grid<'_>) {
    let mut random = Random(3);
    prove(grid).unwrap();
    let ray = |_| Ray::new(random.point().map(|c| 2.0 * c), random.point());
    let hits = (0..20).map(ray).filter(|ray| oracle::check(grid, ray)).count();
    assert!(hits > 3 || grid.mesh().triangle_count() == 0, "{hits}");
}

/// Bytes that an owned grid takes besides its blob: for an aligned address, and for the boxes around the
/// caller's containers.
const LITTLE: usize = ALIGNMENT + 256;

#[test]
fn a_grid_keeps_what_it_takes_and_nothing_is_written_but_by_the_build() {
    let mesh = scene();
    for config in methods::configs() {
        let plain = Owned::build(&mesh.view(), &config).unwrap();
        let bound = sizes(&mesh.view(), &config, &mut []).unwrap();
        let input = owned(&mesh);
        let before = HEAP.get();
        HEAP.set(Heap { peak: before.current, written: 0, ..before });
        let grid = OwnedGrid::build(input, &config).unwrap();
        let after = HEAP.get();
        assert_eq!(grid.grid().blob(), plain.bytes(), "{:?}", config.method());
        let kept = after.current.wrapping_sub(before.current);
        let exact = plain.bytes().len();
        assert!((exact..exact + LITTLE).contains(&kept), "{:?} {kept} {exact}", config.method());
        assert!(after.written < LITTLE, "{:?} {}", config.method(), after.written);
        let most = after.peak.wrapping_sub(before.current);
        let index = if config.method() == Method::Bvh { bound.index_bytes } else { exact };
        assert!(most <= index + bound.scratch_bytes + 2 * LITTLE, "{:?} {most}", config.method());
        check(&grid.grid());
        drop(grid);
        let left = HEAP.get().current.wrapping_sub(before.current).cast_signed();
        assert!(left < 0, "the grid and its mesh were not freed: {left} bytes");
    }
}

/// An allocator may move what shrinks, to an address that is aligned otherwise.
#[test]
fn a_grid_that_moves_while_it_shrinks_is_whole() {
    let mesh = ball(6, 1.0);
    for config in methods::configs() {
        let plain = Owned::build(&mesh.view(), &config).unwrap();
        MOVES.set(true);
        let built = OwnedGrid::build(owned(&mesh), &config).unwrap();
        // Bytes behind the blob are given back.
        let opened = OwnedGrid::open(&[plain.bytes(), &[7; 500]].concat(), owned(&mesh)).unwrap();
        MOVES.set(false);
        for grid in [built, opened] {
            assert!(grid.grid().blob() == plain.bytes(), "{:?}", config.method());
            prove(&grid.grid()).unwrap();
        }
    }
}

/// If any allocation fails, the build returns an error.
#[test]
fn without_memory_there_is_an_error() {
    let mesh = scene();
    for config in methods::configs() {
        let mut refused = 0;
        for left in 0.. {
            let input = owned(&mesh);
            HEAP.set(Heap { left, ..HEAP.get() });
            let built = OwnedGrid::build(input, &config);
            HEAP.set(Heap { left: usize::MAX, ..HEAP.get() });
            match built {
                Ok(grid) => {
                    check(&grid.grid());
                    break;
                }
                Err(Error::OutOfMemory { available_bytes: 0, needed_bytes, region }) => {
                    let expected = [Region::Scratch, Region::Index][refused];
                    assert!(region == expected && needed_bytes > 1000, "{:?}", config.method());
                }
                Err(error) => panic!("{error}"),
            }
            refused += 1;
        }
        assert_eq!(refused, 2, "{:?}", config.method());
    }
}

/// A grid as a field of a struct, which goes to another thread, under a lock, into a list that moves.
struct Holder {
    grid: OwnedGrid,
    _name: String,
}

#[test]
fn it_fits_into_a_struct_and_moves_with_it() {
    let mesh = scene();
    let shared: Arc<[[f32; 3]]> = mesh.positions.clone().into();
    let mut holders = Vec::new();
    for config in methods::configs() {
        let input = OwnedMesh::new(Arc::clone(&shared), mesh.indices.clone()).unwrap();
        assert_eq!(input.view().positions().bytes.as_ptr(), shared.as_ptr().cast(), "copied");
        let grid = OwnedGrid::build(input, &config).unwrap();
        holders.push(Holder { grid, _name: format!("{:?}", config.method()) });
    }
    assert_eq!(Arc::strong_count(&shared), 1 + holders.len());
    let holders = Arc::new(std::sync::RwLock::new(holders));
    let threads: Vec<_> = (0..3)
        .map(|_| {
            let holders = Arc::clone(&holders);
            std::thread::spawn(move || {
                holders.read().unwrap().iter().for_each(|holder| check(&holder.grid.grid()));
            })
        })
        .collect();
    threads.into_iter().for_each(|thread| thread.join().unwrap());
    drop(holders);
    assert_eq!(Arc::strong_count(&shared), 1);
}

#[repr(C)]
#[derive(Debug, Clone, Copy, zerocopy::Immutable, zerocopy::IntoBytes)]
struct Vertex {
    color: u32,
    position: [f32; 3],
    normal: [f32; 2],
}

#[test]
fn vertices_in_structs_small_indices_and_masks() {
    static MASKS: [u32; 4] = [1, 2, 3, 4];
    let mesh = ball(1, 0.0);
    let vertex = |&position: &[f32; 3]| Vertex { color: 7, position, normal: [0.0; 2] };
    let vertices: Vec<_> = mesh.positions.iter().map(vertex).collect();
    let indices: Vec<u16> =
        mesh.indices.iter().flatten().map(|&at| u16::try_from(at).unwrap()).collect();
    let triples: Arc<[[u16; 3]]> = indices.as_chunks().0.to_vec().into();
    let strided = |at| {
        let positions = OwnedStrided::new(vertices.clone()).at(at);
        OwnedMesh::strided(positions, OwnedStrided::new(Arc::clone(&triples)), IndexType::U16)
    };
    let input = strided(offset_of!(Vertex, position)).unwrap();
    let grid = OwnedGrid::build(input.clone(), &Config::default()).unwrap();
    assert_eq!(grid.grid().blob(), Owned::build(&mesh.view(), &Config::default()).unwrap().bytes());
    check(&grid.grid());
    // A field of a field: offsets add up.
    let within = OwnedStrided::new(vertices.clone()).at(4).at(8);
    assert_eq!(within.view().bytes.len(), vertices.len() * size_of::<Vertex>() - 12);
    // A field offset past the end of the struct is refused.
    assert!(strided(12).is_ok() && strided(13).is_err() && strided(usize::MAX).is_err());

    assert!(input.clone().with_masks(OwnedStrided::new(MASKS.as_slice())).is_err());
    let masks: Vec<u32> = (0..12).map(|id| 1 << (id % 3)).collect();
    let input = input.with_masks(OwnedStrided::new(masks)).unwrap();
    let grid = OwnedGrid::build(input, &Config::default()).unwrap();
    assert_eq!((grid.grid().mesh().mask(4), grid.mesh().view().mask(5)), (2, 4));
    check(&grid.grid());
    let none = OwnedMesh::new(Vec::new(), Vec::new()).unwrap();
    check(&OwnedGrid::build(none, &Config::default()).unwrap().grid());
}

#[test]
fn a_stored_grid_is_opened_from_any_address() {
    let mesh = scene();
    for config in methods::configs() {
        let plain = Owned::build(&mesh.view(), &config).unwrap();
        for shift in [0, 1, 63] {
            let bytes = [&vec![0xa5; shift], plain.bytes(), &[1, 2, 3]].concat();
            let grid = OwnedGrid::open(&bytes[shift..], owned(&mesh)).unwrap();
            assert_eq!(grid.grid().blob(), plain.bytes());
        }
        let cut = &plain.bytes()[..plain.bytes().len() - 1];
        assert!(matches!(OwnedGrid::open(cut, owned(&mesh)), Err(Error::Truncated { .. })));
        let other = owned(&ball(2, 1.0));
        assert!(matches!(OwnedGrid::open(plain.bytes(), other), Err(Error::MeshMismatch)));
    }
}

#[test]
fn a_refit_takes_the_mesh_that_moved() {
    let (mesh, moved) = (scene(), scene().map(|[x, y, z]| [1.5 * x, y + 0.2 * x, z]));
    let mut grid = OwnedGrid::build(owned(&mesh), &Config::new(Method::Bvh)).unwrap();
    let refitted = grid.refit(owned(&moved)).unwrap();
    assert!(refitted.cost_after > 0.0);
    let expected = &moved.positions;
    assert_eq!(grid.mesh().view().positions().bytes, Strided::new(expected).bytes);
    check(&grid.grid());
    // A mesh that does not fit the tree is refused.
    assert_eq!(grid.refit(owned(&ball(2, 1.0))), Err(Error::MeshMismatch));
    check(&grid.grid());
    let mut grid = OwnedGrid::build(owned(&mesh), &Config::new(Method::OneLevel)).unwrap();
    assert_eq!(grid.refit(owned(&moved)), Err(Error::CannotRefit));
    check(&grid.grid());
}

/// A container of vertices that shrinks after some calls.
struct Fickle(Vec<[f32; 3]>, AtomicUsize);

impl AsRef<[[f32; 3]]> for Fickle {
    fn as_ref(&self) -> &[[f32; 3]] {
        let look = self.1.fetch_add(1, Ordering::Relaxed);
        if look < 100 { &self.0 } else { &self.0[..5] }
    }
}

#[test]
fn containers_that_change_make_a_grid_that_hits_nothing() {
    let mesh = scene();
    let fickle = Fickle(mesh.positions.clone(), AtomicUsize::new(0));
    let input = OwnedMesh::new(fickle, mesh.indices.clone()).unwrap();
    let grid = OwnedGrid::build(input, &Config::default()).unwrap();
    let ray = Ray::new([0.1, 0.2, 3.0], [0.0, 0.0, -1.0]);
    let hits = (0..200).filter(|_| grid.grid().occluded(&ray)).count();
    assert!((50..100).contains(&hits), "{hits}");
    assert!(grid.grid().intersect(&ray).is_none() && grid.grid().blob().is_empty());
}

#[test]
fn what_is_printed_is_short() {
    let mesh = scene();
    let grid = OwnedGrid::build(owned(&mesh), &Config::default()).unwrap();
    let (bytes, triangles) = (grid.grid().blob_bytes(), mesh.indices.len());
    assert_eq!(
        format!("{grid:?}"),
        format!("OwnedGrid {{ method: Bvh, triangles: {triangles}, bytes: {bytes} }}")
    );
    let vertices = mesh.positions.len();
    assert_eq!(
        format!("{:?}", grid.mesh()),
        format!(
            "OwnedMesh {{ vertices: {vertices}, triangles: {triangles}, indices: U32, \
             has_masks: false }}"
        )
    );
    assert_eq!(
        format!("{:?}", OwnedStrided::new(vec![7_u32; 1000]).at(2)),
        "OwnedStrided { bytes: 3998, stride: 4, count: 1000 }"
    );
}
