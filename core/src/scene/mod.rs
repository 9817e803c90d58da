//! Scenes: a tree over instances of grids, of trees of shapes, and of other scenes.
//!
//! ```text
//! blob    | tree over the boxes of all instances | table 64 B | boxes, 24 B each | instances, 72 B each |
//! query   walk the tree; an instance whose box the ray meets: move the ray into its object, ask the object,
//!         and move the `t` of what is hit back
//! ```
//!
//! The tree is that of [`Shapes`]: to it, instances are shapes. Objects are named by number and bound
//! when a scene is opened, so the blob can be moved like any other. An instance keeps the inverse of its matrix
//! ([`instance`]).

mod batch;
#[cfg(feature = "bvh")]
mod groups;
mod instance;
mod query;
mod store;
mod surface;

use core::fmt;

use glam::DVec3;
use zerocopy::{FromBytes, Immutable, IntoBytes};

use crate::grid::Grid;
use crate::limits::MAX_NESTING;
use crate::ray::{INVALID_ID, Ray, round};
use crate::shapes::{ShapeHit, Shapes};
use crate::simd::SimdLevel;
pub use instance::Instance;
use instance::StoredInstance;
pub use query::{SceneFilter, SceneHit, SceneOptions};
pub(crate) use store::ends_of;
pub use surface::SceneSurface;

/// Tests the shapes of an object in a scene, from any number of threads at once. Every function like a
/// [`ShapeTest`](crate::ShapeTest) that needs no `&mut` is one.
pub trait ObjectTest: Sync {
    /// Returns the hit of a ray on a shape, if there is one. The ray is in the object's space, with a direction and a
    /// range of its own. The `t` of the hit is along this ray.
    fn test(&self, shape: u32, ray: &Ray) -> Option<ShapeHit>;
}

impl<F: Fn(u32, &Ray) -> Option<ShapeHit> + Sync> ObjectTest for F {
    fn test(&self, shape: u32, ray: &Ray) -> Option<ShapeHit> {
        self(shape, ray)
    }
}

/// An object that instances show.
// The C library lends these as `hgrid_object`. Zeros must be `Nothing`.
#[repr(usize)]
#[derive(Clone, Copy, Default)]
pub enum Object<'a> {
    /// Nothing that a ray could hit: an object that is not there yet.
    #[default]
    Nothing = 0,
    /// A grid of triangles, by any method.
    Grid(&'a Grid<'a>),
    /// Shapes, and the test for them.
    Shapes(&'a Shapes<'a>, &'a dyn ObjectTest),
    /// A scene.
    Scene(&'a Scene<'a>),
}

impl fmt::Debug for Object<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Grid(grid) => f.debug_tuple("Grid").field(&grid.method()).finish_non_exhaustive(),
            Self::Shapes(shapes, _) => {
                f.debug_tuple("Shapes").field(shapes).finish_non_exhaustive()
            }
            Self::Scene(scene) => scene.fmt(f),
            Self::Nothing => f.write_str("Nothing"),
        }
    }
}

impl Object<'_> {
    /// The least and the greatest corner of its box.
    fn bounds(&self) -> ([f32; 3], [f32; 3]) {
        match self {
            Self::Grid(grid) => grid.bounds(),
            Self::Shapes(shapes, _) => shapes.bounds(),
            Self::Scene(scene) => scene.bounds(),
            Self::Nothing => ([0.0; 3], [0.0; 3]),
        }
    }

    /// The number of scenes inside one another, the outermost included; 0 for other objects.
    const fn levels(&self) -> usize {
        match self {
            Self::Scene(scene) => scene.levels,
            _ => 0,
        }
    }
}

/// A built scene and the objects that it was opened with, ready for queries.
///
/// The view is small and can be copied; it borrows the blob and the objects, and any number of threads may
/// query it at once. A query takes 8 KiB of stack for the scene and for each scene inside it,
/// and what the query of the object takes. A batch takes 80 KiB, 8 KiB for each scene inside the scene, and what the
/// tests of shapes take.
///
/// ```
/// use hgrid_core::{Block, Config, Grid, Instance, Object, RayF64, Scene, TriangleMesh, sizes};
/// # let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// # let mesh = TriangleMesh::new(&positions, &[[0, 1, 2]])?;
/// # let config = Config::default();
/// # let needed = sizes(&mesh, &config, &mut [])?;
/// # let mut index = vec![Block::ZERO; Block::count_for(needed.index_bytes)];
/// # let mut scratch = vec![Block::ZERO; Block::count_for(needed.scratch_bytes)];
/// # let grid = Grid::build(mesh, &config, Block::bytes_mut(&mut index), Block::bytes_mut(&mut scratch))?;
/// let objects = [Object::Grid(&grid)];
/// // Twice the same triangle: where it is, and ten units along x, twice as large.
/// let matrix = [[2.0, 0.0, 0.0, 10.0], [0.0, 2.0, 0.0, 0.0], [0.0, 0.0, 2.0, 0.0]];
/// let instances = [Instance::new(0), Instance::with_transform(0, matrix)];
///
/// let needed = Scene::bound(2, &config).expect("two are not too many");
/// let mut index = vec![Block::ZERO; Block::count_for(needed.index_bytes)];
/// let mut scratch = vec![Block::ZERO; Block::count_for(needed.scratch_bytes)];
/// let (index, scratch) = (Block::bytes_mut(&mut index), Block::bytes_mut(&mut scratch));
/// let scene = Scene::build(&instances, &objects, &config, index, scratch)?;
///
/// let hit = scene.intersect(&RayF64::new([10.5, 0.5, 3.0], [0.0, 0.0, -1.0])).expect("a hit");
/// assert_eq!((hit.t, hit.u, hit.path[0], hit.primitive), (3.0, 0.25, 1, 0));
/// # Ok::<(), hgrid_core::Error>(())
/// ```
#[derive(Clone, Copy)]
pub struct Scene<'a> {
    blob: &'a [u8],
    tree: Grid<'a>,
    instances: &'a [StoredInstance],
    objects: &'a [Object<'a>],
    /// Scenes inside one another, this one included.
    levels: usize,
    /// One more than the largest number of an object that an instance has.
    pub(crate) object_count: u32,
}

impl fmt::Debug for Scene<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Scene")
            .field("instances", &self.instance_count())
            .field("objects", &self.objects.len())
            .field("blob_bytes", &self.blob.len())
            .finish_non_exhaustive()
    }
}

/// The table behind the tree in the blob of a scene.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, FromBytes, Immutable, IntoBytes)]
struct Table {
    /// One more than the largest number of an object that an instance has.
    object_count: u32,
    /// Always 0.
    unused: [u32; 15],
}

const _: () = assert!(size_of::<Table>() == 64);

impl<'a> Scene<'a> {
    /// The same scene with queries of its tree limited to these instructions: the same hits, slower. Objects keep
    /// their own level.
    #[must_use]
    pub const fn with_simd(self, simd: SimdLevel) -> Self {
        Self { tree: self.tree.with_simd(simd), ..self }
    }

    /// Number of instances.
    #[must_use]
    pub const fn instance_count(&self) -> u32 {
        self.tree.mesh().triangle_count()
    }

    /// An instance, as the caller gave it but for the rounding of its matrix.
    #[must_use]
    pub fn instance(&self, number: u32) -> Option<Instance> {
        self.instances.get(number as usize)?.instance()
    }

    /// The objects that it was opened with.
    #[must_use]
    pub const fn objects(&self) -> &'a [Object<'a>] {
        self.objects
    }

    /// The least and the greatest corner of the box of all instances, and a little more.
    #[must_use]
    pub const fn bounds(&self) -> ([f32; 3], [f32; 3]) {
        self.tree.bounds()
    }

    /// The scene as bytes: what to copy, store or send in order to [`open`](Self::open) it again. The objects
    /// are not in it.
    #[must_use]
    pub const fn blob(&self) -> &'a [u8] {
        self.blob
    }

    /// The path to the object that a hit names.
    fn path(&self, hit: &SceneHit) -> Option<InstancePath<'a>> {
        let mut instances = [None; MAX_NESTING];
        let mut scene = *self;
        for (level, &number) in hit.path.iter().enumerate() {
            let stored = scene.instances.get(number as usize)?;
            *instances.get_mut(level)? = Some(stored);
            let object = scene.objects.get(stored.object() as usize)?;
            let count = match object {
                Object::Scene(inner) => {
                    scene = **inner;
                    continue;
                }
                Object::Grid(grid) => grid.mesh().triangle_count(),
                Object::Shapes(shapes, _) => shapes.count(),
                Object::Nothing => 0,
            };
            let is_end = hit.path.iter().skip(level + 1).all(|&number| number == INVALID_ID);
            return (is_end && hit.primitive < count).then_some(InstancePath { instances, object });
        }
        None
    }

    /// The instance that shows the object that a hit names, the innermost one, as [`instance`](Self::instance) gives
    /// it. `None` if the path of the hit does not end at an object that has this triangle or shape; its numbers behind
    /// the end must be [`INVALID_ID`].
    #[must_use]
    pub fn instance_of(&self, hit: &SceneHit) -> Option<Instance> {
        self.path(hit)?.instances().next_back()?.instance()
    }

    /// The instance at a level of the path of a hit: 0 is that of the outermost scene, and
    /// [`instance_of`](Self::instance_of) gives the last one. `None` if the hit names nothing, or its path has no such
    /// level.
    #[must_use]
    pub fn instance_at(&self, hit: &SceneHit, level: usize) -> Option<Instance> {
        self.path(hit)?.instances().nth(level)?.instance()
    }

    /// The object that a hit names: the grid or the shapes at the end of its path. `None` as for
    /// [`instance_of`](Self::instance_of).
    #[must_use]
    pub fn object_of(&self, hit: &SceneHit) -> Option<Object<'a>> {
        Some(*self.path(hit)?.object)
    }

    /// Takes a normal, of any length, from the space of the object that a hit names to the scene's; the result has
    /// length 1. `None` if the hit names no object, or the normal is zero or not finite.
    #[must_use]
    pub fn normal_of(&self, hit: &SceneHit, normal: [f32; 3]) -> Option<[f32; 3]> {
        let normal = DVec3::from_array(normal.map(f64::from));
        Some(self.path(hit)?.normal(normal)?.to_array().map(round))
    }

    /// The normal of the triangle that was hit, of length 1, in the scene's space, on the side that is the front in
    /// the triangle's mesh. `None` if the hit names no triangle or it has no area.
    #[must_use]
    pub fn triangle_normal(&self, hit: &SceneHit) -> Option<[f32; 3]> {
        let Object::Grid(grid) = self.object_of(hit)? else { return None };
        let [a, b, c] =
            grid.mesh().triangle(hit.primitive)?.map(|p| DVec3::from_array(p.map(f64::from)));
        let normal = (b - a).cross(c - a).try_normalize()?;
        self.normal_of(hit, normal.to_array().map(round))
    }
}

/// An object, and the instances on the way to it.
struct InstancePath<'a> {
    instances: [Option<&'a StoredInstance>; MAX_NESTING],
    object: &'a Object<'a>,
}

impl<'a> InstancePath<'a> {
    /// The instances from that of the outermost scene on.
    fn instances(&self) -> impl DoubleEndedIterator<Item = &'a StoredInstance> {
        self.instances.into_iter().flatten()
    }
}
