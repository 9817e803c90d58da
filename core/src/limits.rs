//! The limits of meshes, grids and scenes, and the alignment of memory.

/// The most triangles a mesh may have: ids are 32 bits and one of them means "none". A tree takes half as many.
pub const MAX_TRIANGLES: usize = u32::MAX as usize - 1;

/// Coordinates beyond this magnitude count as non-finite: the largest power of two for which the
/// extent of a box, its cells and the distances along a ray all stay far from overflow.
pub const MAX_COORDINATE: f32 = f32::from_bits(0x7b80_0000); // 2^120, about 1.3e36

/// The most cells on an axis. f32 positions keep 12 bits for the place inside a cell.
pub const MAX_RESOLUTION: u32 = 4096;

/// The most cells of a recursive grid on an axis: three such numbers share a word.
pub(crate) const MAX_RESOLUTION_OF_RECURSIVE: u32 = (1 << 10) - 1;

/// The deepest that grids may be nested: a query keeps one walk for each level.
pub const MAX_DEPTH: u32 = 4;

/// Scenes inside one another, at most, the outermost included.
pub const MAX_NESTING: usize = 4;

/// Regions start at a multiple of this many bytes, and so does every section in them.
pub const ALIGNMENT: usize = 64;
