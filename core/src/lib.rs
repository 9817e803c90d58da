//! A ray-tracing acceleration structure that a renderer links and a microcontroller can carry.
//!
//! hgrid builds an acceleration structure over a triangle mesh, in memory that the caller brings, and answers ray
//! queries on it. The default structure is a bounding volume hierarchy ([`Method::Bvh`]), a tree; the others are the
//! four grids of the paper *Multi-Level Hashed Grid Construction Methods* (Costa, Pereira, Jorge, 2010). The API calls
//! a tree a grid, too. It allocates nothing without the feature `alloc`, starts no thread, does no I/O and never
//! panics. Only `simd` contains `unsafe` code: it asks the processor for its vector instructions, makes the tokens that
//! stand for them, and prefetches.
//!
//! ```
//! use hgrid_core::{Block, Config, Grid, Ray, TriangleMesh, sizes};
//!
//! let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
//! let mesh = TriangleMesh::new(&positions, &[[0, 1, 2]])?;
//! let config = Config::default();
//!
//! // Ask the size, bring the memory, build. There is nothing to free.
//! let sizes = sizes(&mesh, &config, &mut [])?;
//! let mut index = vec![Block::ZERO; Block::count_for(sizes.index_bytes)];
//! let mut scratch = vec![Block::ZERO; Block::count_for(sizes.scratch_bytes)];
//! let grid =
//!     Grid::build(mesh, &config, Block::bytes_mut(&mut index), Block::bytes_mut(&mut scratch))?;
//!
//! let hit = grid.intersect(&Ray::new([0.25, 0.25, 1.0], [0.0, 0.0, -1.0]));
//! assert_eq!(hit.map(|hit| hit.primitive), Some(0));
//! # Ok::<(), hgrid_core::Error>(())
//! ```
//!
//! The modules in layers, lowest first. A module imports modules of its layer and of lower ones, in no cycle; a test
//! checks this.
//!
//! | layer | modules |
//! |---|---|
//! | the machine | `simd` |
//! | plain types | `limits`, `method`, `error`, `config`, `control`, `counters`, `ray`, `aabb`, `mesh`, `options` |
//! | helpers | `invariant`, `budget`, `extremes`, `tasks`; `random` and `samples` for tests |
//! | memory | `arena`, `bits`, `lists`, `fnv`, `survey`, `cell`, `blob`, `bump` |
//! | rays and triangles | `lanes`, `filter`, `range`, `approach`, `exact`, `eight`, `triangle`, `pairs`, `surface` |
//! | cells | `spans`, `dda` |
//! | receivers of a traversal: of hits, of id lists | `search`, `visit` |
//! | structures, a folder each | `one_level`; `fixed` and `variable` on top of it; `recursive`; `bvh` |
//! | the list of structures, and the view that queries run on | `structure`, `grid` |
//! | operations: sizes, queries, statistics, refit | `sizes`, `query`, `batch`, `closest`, `inspect`, `refit` |
//! | on top of grids | `owned`, `shapes`, `scene`, `packed` |
//!
//! core/DESIGN.md tells how it all works, core/REJECTED.md what was left out, and CONTRIBUTING.md how to add a query or
//! a method.
//!
//! Each structure has a feature of the package (`one-level`, `fixed`, `variable`, `recursive` and `bvh`, all on by
//! default), so that a program with little flash takes the ones it needs: [`Method::is_available`] tells which methods
//! there are, and a call with another method returns [`Error::MethodLeftOut`].
//!
//! The feature `alloc`, off by default, adds `OwnedGrid`, which owns its memory and its mesh and has no lifetime
//! parameter. It changes nothing else.
//!
//! Papers that these pages name: **CP10** Costa, Pereira, Jorge 2010; **LD08** Lagae and Dutré,
//! *Compact, Fast and Robust Grids for Ray Tracing*, 2008.
#![no_std]
#![deny(unsafe_code)]
// Methods share helpers: with some methods left out, some helpers are unused.
#![cfg_attr(
    not(all(feature = "fixed", feature = "variable", feature = "recursive", feature = "bvh")),
    allow(unused, reason = "the build with all methods reports unused code")
)]

#[cfg(any(test, feature = "alloc"))]
extern crate alloc;

/// The example in this package's README runs as a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

const _: () = assert!(usize::BITS >= 32, "hgrid needs pointers of 32 bits or more");

#[cfg(all(any(target_arch = "x86", target_arch = "x86_64"), not(target_feature = "sse2")))]
compile_error!(
    "hgrid needs SSE2 on x86: the x87 registers round otherwise, so hits and grids would have other \
     bits than everywhere else. Build for i686 or x86_64, or with `-C target-feature=+sse2`"
);

#[cfg(not(any(feature = "one-level", feature = "recursive", feature = "bvh")))]
compile_error!(
    "hgrid has no method to build grids with: turn on at least one of the features one-level, fixed, \
     variable, recursive and bvh"
);

mod aabb;
mod approach;
mod arena;
mod batch;
mod bits;
mod blob;
mod budget;
mod bump;
#[cfg(feature = "bvh")]
mod bvh;
mod cell;
mod closest;
mod config;
mod control;
mod counters;
mod dda;
mod eight;
mod error;
mod exact;
mod extremes;
mod filter;
#[cfg(feature = "fixed")]
mod fixed;
mod fnv;
mod grid;
mod inspect;
mod invariant;
mod lanes;
mod limits;
mod lists;
mod mesh;
mod method;
#[cfg(feature = "one-level")]
mod one_level;
mod options;
#[cfg(feature = "alloc")]
mod owned;
mod packed;
mod pairs;
mod query;
#[cfg(test)]
mod random;
mod range;
mod ray;
#[cfg(feature = "recursive")]
mod recursive;
mod refit;
#[cfg(test)]
mod samples;
mod scene;
mod search;
mod shapes;
mod simd;
mod sizes;
mod spans;
mod structure;
mod surface;
mod survey;
mod tasks;
mod triangle;
#[cfg(feature = "variable")]
mod variable;
mod visit;

pub use arena::{Block, Sizes};
pub use batch::{Batch, Coherence, StridedMut};
pub use blob::BLOB_VERSION;
pub use closest::ClosestPoint;
pub use config::{BuildFlags, Config, Parameters};
pub use control::{Control, Task};
pub use counters::Counters;
pub use error::{BatchField, ConfigField, Error, MeshField, Region};
pub use grid::Grid;
pub use inspect::Statistics;
pub use limits::{
    ALIGNMENT, MAX_COORDINATE, MAX_DEPTH, MAX_NESTING, MAX_RESOLUTION, MAX_TRIANGLES,
};
pub use mesh::{IndexType, MeshPart, Strided, Triangle, TriangleMesh};
pub use method::{Content, Method, Quality};
pub use options::{Cull, Filter, QueryOptions, Verdict};
#[cfg(feature = "alloc")]
pub use owned::{OwnedGrid, OwnedMesh, OwnedStrided};
pub use packed::{BlobInfo, Member};
pub use ray::{Hit, INVALID_ID, Ray, RayF64};
pub use refit::{Refit, refit};
pub use scene::{
    Instance, Object, ObjectTest, Scene, SceneFilter, SceneHit, SceneOptions, SceneSurface,
};
pub use shapes::{Boxes, ShapeHit, ShapeTest, Shapes};
pub use simd::SimdLevel;
pub use sizes::{fit, sizes, sizes_with};
pub use surface::Surface;
pub use triangle::{TriangleHit, TriangleTest};
