//! Accessors of glTF: the bounds of their bytes, and positions of every type.

use anyhow::{Context as _, Result, bail, ensure};
use gltf::Accessor;
use gltf::accessor::{DataType, Item, Iter};
use gltf::buffer::View;

/// Returns true if all elements of an accessor lie in their buffers, none in the next one. The crate panics where they
/// overlap or their places overflow, and reserves memory for as many as a sparse accessor claims.
pub(super) fn is_inside(accessor: &Accessor<'_>, buffers: &[Vec<u8>]) -> bool {
    let holds = |view: View<'_>, offset: usize, count: usize, size: usize| {
        let stride = view.stride().unwrap_or(size);
        let last =
            count.checked_sub(1).and_then(|last| last.checked_mul(stride)?.checked_add(offset));
        let end = last.and_then(|last| last.checked_add(size)).filter(|&end| end <= view.length());
        let end_of_view = view.offset().checked_add(view.length());
        let bytes = buffers.get(view.buffer().index()).map_or(0, Vec::len);
        stride >= size && end.is_some() && end_of_view.is_some_and(|end| end <= bytes)
    };
    let (count, size) = (accessor.count(), accessor.size());
    let are_own = match accessor.view() {
        Some(view) => holds(view, accessor.offset(), count, size),
        // Zeros, but for those that a sparse accessor names.
        None => count <= buffers.iter().map(Vec::len).sum(),
    };
    are_own
        && accessor.sparse().is_none_or(|sparse| {
            let (indices, values, count) = (sparse.indices(), sparse.values(), sparse.count());
            holds(indices.view(), indices.offset(), count, indices.index_type().size())
                && holds(values.view(), values.offset(), count, size)
        })
}

/// Refuses a sparse accessor that replaces elements which are not there. It lies in its buffers.
pub(super) fn check_sparse(accessor: &Accessor<'_>, buffers: &[Vec<u8>]) -> Result<()> {
    let Some(sparse) = accessor.sparse() else { return Ok(()) };
    let (indices, count) = (sparse.indices(), accessor.count());
    let (view, size) = (indices.view(), indices.index_type().size());
    let bytes = buffers.get(view.buffer().index()).map_or(&[][..], |bytes| bytes);
    let bytes = bytes.get(view.offset() + indices.offset()..).unwrap_or_default();
    let elements = bytes.chunks(view.stride().unwrap_or(size)).take(sparse.count());
    for element in elements.filter_map(|element| element.get(..size)) {
        let mut index = [0; 4];
        index[..size].copy_from_slice(element);
        let index = u32::from_le_bytes(index);
        ensure!(
            (index as usize) < count,
            "its sparse accessor replaces element {index}, and it has {count}"
        );
    }
    Ok(())
}

/// Reads positions: floats or, as `KHR_mesh_quantization` has them, small whole numbers, which stand for parts of the
/// largest one if they are normalized.
pub(super) fn positions(accessor: &Accessor<'_>, buffers: &[Vec<u8>]) -> Result<Vec<[f32; 3]>> {
    let largest = |most: f32| if accessor.normalized() { most } else { 1.0 };
    let positions = match accessor.data_type() {
        DataType::F32 => numbers::<f32>(accessor, buffers, 1.0),
        DataType::I8 => numbers::<i8>(accessor, buffers, largest(127.0)),
        DataType::U8 => numbers::<u8>(accessor, buffers, largest(255.0)),
        DataType::I16 => numbers::<i16>(accessor, buffers, largest(32_767.0)),
        DataType::U16 => numbers::<u16>(accessor, buffers, largest(65_535.0)),
        DataType::U32 => bail!("its positions are neither floats nor of 8 or 16 bits"),
    };
    positions.context("its positions are outside their buffer")
}

/// Reads positions of one type as parts of the largest number. The least one of a signed type would be less than -1,
/// and means -1.
fn numbers<T: Item + Copy + Into<f32>>(
    accessor: &Accessor<'_>,
    buffers: &[Vec<u8>],
    largest: f32,
) -> Option<Vec<[f32; 3]>> {
    let bytes = |buffer: gltf::Buffer<'_>| buffers.get(buffer.index()).map(|bytes| &**bytes);
    let points = Iter::<[T; 3]>::new(accessor.clone(), bytes)?;
    let part = |number: T| {
        let part = number.into() / largest;
        if largest > 1.0 { part.max(-1.0) } else { part }
    };
    Some(points.map(|point| point.map(part)).collect())
}
