//! The methods of the library. Sizes, builds, opens and proofs are dispatched here, and the traversals of the four
//! grids; `by_kind!` starts those of a tree. The header ([`blob`](crate::blob)) and parameters
//! ([`config`](crate::config)) have matches of their own.
//!
//! A method is a folder with a cargo feature of its name. Without the feature the folder is not compiled, and calls
//! with the method return [`Error::MethodLeftOut`]. Each folder has the functions `bound`, `sizes`, `build` and
//! `scratch_bytes`, which take the method's own parameters, and a type that reads what was built; [`Structure`] is an
//! enum of these types. CONTRIBUTING.md lists what a new method needs beside its line of the list at the end.

use crate::aabb::Aabb;
use crate::arena::Sizes;
use crate::blob::Header;
use crate::cell::Lattice;
use crate::config::{Config, Parameters};
use crate::control::{Control, Watch};
use crate::counters::Tally;
use crate::dda::Line;
use crate::error::Error;
use crate::mesh::TriangleMesh;
use crate::method::Method;
use crate::visit::Visitor;

/// Evaluates the first expression for a tree, the second for a grid of cells.
macro_rules! by_kind {
    ($structure:expr, $tree:pat => $with_tree:expr, $with_cells:expr) => {
        match $structure {
            #[cfg(feature = "bvh")]
            $crate::structure::Structure::Bvh($tree) => $with_tree,
            #[cfg(any(feature = "one-level", feature = "recursive"))]
            _ => $with_cells,
        }
    };
}
pub(crate) use by_kind;

/// Fits the boxes of a tree to a mesh that moved, and returns the SAH costs before and after.
pub(crate) fn refit(blob: &mut [u8], mesh: &TriangleMesh<'_>) -> Result<[f64; 2], Error> {
    #[cfg(feature = "bvh")]
    return crate::bvh::refit(blob, mesh);
    #[cfg(not(feature = "bvh"))]
    return Err(Error::CannotRefit);
}

macro_rules! methods {
    (
        cells: $($feature:literal $Cells:ident $cells:ident { $($field:ident),* },)*
        trees: $($of_tree:literal $Tree:ident $tree:ident { $($choice:ident),* },)*
    ) => {
        /// The result of a build, as its method reads it.
        #[derive(Debug, Clone, Copy)]
        pub(crate) enum Structure<'a> {
            $(#[cfg(feature = $feature)] $Cells(crate::$cells::$Cells<'a>),)*
            $(#[cfg(feature = $of_tree)] $Tree(crate::$tree::$Tree<'a>),)*
        }

        /// Enough bytes of index and scratch for any mesh of so many triangles.
        pub(crate) const fn bound(triangles: u32, config: &Config, tasks: u32) -> Option<(u64, u64)> {
            match config.parameters {
                $(#[cfg(feature = $feature)]
                Parameters::$Cells { $($field),* } => Some(crate::$cells::bound(triangles, $($field),*)),
                #[cfg(not(feature = $feature))]
                Parameters::$Cells { .. } => None,)*
                $(#[cfg(feature = $of_tree)]
                Parameters::$Tree { $($choice),* } => crate::$tree::bound(triangles, $($choice),*, tasks),
                #[cfg(not(feature = $of_tree))]
                Parameters::$Tree { .. } => None,)*
            }
        }

        /// Returns the memory that a build takes: the exact size if `scratch` is large enough, else a bound.
        pub(crate) fn sizes(
            mesh: &TriangleMesh<'_>,
            config: &Config,
            scratch: &mut [u8],
            control: &Control<'_>,
        ) -> Result<Sizes, Error> {
            match config.parameters {
                $(#[cfg(feature = $feature)]
                Parameters::$Cells { $($field),* } => crate::$cells::sizes(mesh, $($field),*, config.flags, scratch),)*
                $(#[cfg(feature = $of_tree)]
                Parameters::$Tree { $($choice),* } => {
                    crate::$tree::sizes(mesh, $($choice),*, config.flags, scratch, control)
                })*
                $(#[cfg(not(feature = $feature))]
                Parameters::$Cells { .. } => Err(Error::MethodLeftOut(Method::$Cells)),)*
                $(#[cfg(not(feature = $of_tree))]
                Parameters::$Tree { .. } => Err(Error::MethodLeftOut(Method::$Tree)),)*
            }
        }

        /// Builds, and returns the bytes of the index that are the blob.
        pub(crate) fn build<'a>(
            mesh: &TriangleMesh<'_>,
            config: &Config,
            index: &'a mut [u8],
            scratch: &mut [u8],
            control: &Control<'_>,
            watch: &Watch<'_>,
        ) -> Result<&'a [u8], Error> {
            match config.parameters {
                $(#[cfg(feature = $feature)]
                Parameters::$Cells { $($field),* } => {
                    crate::$cells::build(mesh, $($field),*, config.flags, index, scratch, watch)
                })*
                $(#[cfg(feature = $of_tree)]
                Parameters::$Tree { $($choice),* } => crate::$tree::build(
                    mesh, $($choice),*, config.flags, index, scratch, control, watch
                ),)*
                $(#[cfg(not(feature = $feature))]
                Parameters::$Cells { .. } => Err(Error::MethodLeftOut(Method::$Cells)),)*
                $(#[cfg(not(feature = $of_tree))]
                Parameters::$Tree { .. } => Err(Error::MethodLeftOut(Method::$Tree)),)*
            }
        }

        impl<'a> Structure<'a> {
            /// An empty structure, of any method that is compiled.
            #[cfg(feature = "alloc")]
            pub(crate) const NOTHING: Self = [
                $(#[cfg(feature = $feature)] Self::$Cells(crate::$cells::$Cells::NOTHING),)*
                $(#[cfg(feature = $of_tree)] Self::$Tree(crate::$tree::$Tree::NOTHING),)*
            ][0];

            /// Reads the sections of a blob; O(1).
            pub(crate) fn open(
                method: Method,
                header: &Header,
                lattice: &Lattice,
                blob: &'a [u8],
            ) -> Result<Self, Error> {
                match method {
                    $(#[cfg(feature = $feature)]
                    Method::$Cells => {
                        crate::$cells::$Cells::open(header, lattice, blob).map(Self::$Cells)
                    })*
                    $(#[cfg(feature = $of_tree)]
                    Method::$Tree => crate::$tree::$Tree::open(header, blob).map(Self::$Tree),)*
                    $(#[cfg(not(feature = $feature))]
                    Method::$Cells => Err(Error::MethodLeftOut(method)),)*
                    $(#[cfg(not(feature = $of_tree))]
                    Method::$Tree => Err(Error::MethodLeftOut(method)),)*
                }
            }

            /// The method that it was built with.
            pub(crate) const fn method(&self) -> Method {
                match self {
                    $(#[cfg(feature = $feature)] Self::$Cells(_) => Method::$Cells,)*
                    $(#[cfg(feature = $of_tree)] Self::$Tree(_) => Method::$Tree,)*
                }
            }

            /// Proves that a build wrote it. A tree needs scratch for that.
            pub(crate) fn validate(
                &self,
                header: &Header,
                lattice: &Lattice,
                blob: &[u8],
                mesh: &TriangleMesh<'_>,
                scratch: &mut [u8],
            ) -> Result<(), Error> {
                match self {
                    $(#[cfg(feature = $feature)]
                    Self::$Cells(cells) => cells.validate(header, lattice, blob, mesh),)*
                    $(#[cfg(feature = $of_tree)]
                    Self::$Tree(tree) => tree.validate(header, lattice, mesh, scratch),)*
                }
            }

            /// Walks along a ray through the cells, and calls `leaf` with each list that it meets.
            #[inline(always)]
            pub(crate) fn traverse<T: Tally>(
                &self,
                line: &Line,
                tally: &mut T,
                leaf: impl FnMut(&[u32], &mut T) -> f32,
            ) {
                match self {
                    $(#[cfg(feature = $feature)] Self::$Cells(cells) => cells.traverse(line, tally, leaf),)*
                    $(#[cfg(feature = $of_tree)] Self::$Tree(_) => {})*
                }
            }

            /// Visits the lists that a box meets, in a fixed order; a tree visits all. False if the budget ran out.
            pub(crate) fn visit(&self, reach: &Aabb, visitor: &mut Visitor<'_>) -> bool {
                match self {
                    $(#[cfg(feature = $feature)] Self::$Cells(cells) => cells.visit(reach, visitor),)*
                    $(#[cfg(feature = $of_tree)] Self::$Tree(tree) => tree.visit(visitor),)*
                }
            }

            /// Words of all lists. A ray that reads more has met damaged bytes.
            #[inline]
            pub(crate) const fn list_words(&self) -> usize {
                match self {
                    $(#[cfg(feature = $feature)] Self::$Cells(cells) => cells.list_words(),)*
                    $(#[cfg(feature = $of_tree)] Self::$Tree(tree) => tree.list_words(),)*
                }
            }

            /// Bytes of scratch that a build of this structure over its mesh takes.
            pub(crate) fn scratch_bytes(&self, header: &Header) -> u64 {
                match self {
                    $(#[cfg(feature = $feature)] Self::$Cells(_) => crate::$cells::scratch_bytes(header),)*
                    $(#[cfg(feature = $of_tree)] Self::$Tree(_) => crate::$tree::scratch_bytes(header),)*
                }
            }
        }
    };
}

methods! {
    cells:
        "one-level" OneLevel one_level { density },
        "fixed" Fixed fixed { density, macrocell_factor },
        "variable" Variable variable { density, subdivide_above },
        "recursive" Recursive recursive { density, depth },
    trees:
        "bvh" Bvh bvh { quality },
}
