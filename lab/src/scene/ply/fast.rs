//! Binary PLY as nearly every program writes it, decoded a buffer at a time.
//!
//! ```text
//! vertex:  ... x .. y .. z ...     floats at fixed offsets of a record of fixed size
//! face:    ... 3 a b c ...         one list, a byte and 32-bit corners; the rest has fixed sizes
//! ```
//!
//! Little-endian only. The general parser reads all other files, and handles every number separately.

use std::io::{self, BufRead, ErrorKind};

use anyhow::{Error, Result};
use ply_rs_bw::ply::{ElementDef, PropertyType, ScalarType};

use super::{cut_off, is_corner_list, no_vertex};

/// The largest record that is decoded here.
const MAX_BYTES: usize = 512;

/// The offsets of a vertex's coordinates in its record, and the bytes of the record.
pub(super) struct VertexLayout {
    at: [usize; 3],
    bytes: usize,
}

/// The bytes before and after the list of a face.
pub(super) struct FaceLayout {
    before: usize,
    behind: usize,
    is_signed: bool,
    vertex_count: usize,
}

const fn bytes_of(scalar: &ScalarType) -> usize {
    match scalar {
        ScalarType::Char | ScalarType::UChar => 1,
        ScalarType::Short | ScalarType::UShort => 2,
        ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
        ScalarType::Double => 8,
    }
}

impl VertexLayout {
    /// Returns the layout of an element if this decoder can read its records.
    pub(super) fn of(element: &ElementDef) -> Option<Self> {
        let (mut at, mut bytes) = ([None; 3], 0);
        for (name, property) in &element.properties {
            let PropertyType::Scalar(scalar) = &property.data_type else { return None };
            if let Some(axis) = ["x", "y", "z"].iter().position(|axis| axis == name) {
                at[axis] = matches!(scalar, ScalarType::Float).then_some(bytes);
            }
            bytes += bytes_of(scalar);
        }
        let [x, y, z] = at;
        (bytes <= MAX_BYTES).then_some(Self { at: [x?, y?, z?], bytes })
    }

    /// Reads all vertices.
    pub(super) fn read(
        &self,
        source: &mut impl BufRead,
        element: &ElementDef,
        positions: &mut Vec<[f32; 3]>,
    ) -> Result<()> {
        let coordinate = |record: &[u8], at: usize| {
            record[at..].first_chunk().map_or(f32::NAN, |bytes| f32::from_le_bytes(*bytes))
        };
        let decode = |record: &[u8]| self.at.map(|at| coordinate(record, at));
        let mut done = 0;
        while done < element.count {
            let buffer = source.fill_buf()?;
            let whole = (buffer.len() / self.bytes).min(element.count - done);
            if whole > 0 {
                let records = &buffer[..whole * self.bytes];
                if self.bytes == 12 && self.at == [0, 4, 8] {
                    let (floats, _) = records.as_chunks::<4>();
                    let (vertices, _) = floats.as_chunks::<3>();
                    positions.extend(vertices.iter().map(|vertex| vertex.map(f32::from_le_bytes)));
                } else {
                    positions.extend(records.chunks_exact(self.bytes).map(decode));
                }
                source.consume(whole * self.bytes);
                done += whole;
            } else {
                // The record starts in this buffer and ends in the next one.
                let mut record = [0; MAX_BYTES];
                let record = &mut record[..self.bytes];
                source.read_exact(record).map_err(|error| ended(error, done, element))?;
                positions.push(decode(record));
                done += 1;
            }
        }
        Ok(())
    }
}

impl FaceLayout {
    /// Returns the layout of an element, whose corners are of so many vertices, if this decoder can read its records.
    pub(super) fn of(element: &ElementDef, vertex_count: usize) -> Option<Self> {
        let (mut before, mut behind, mut list) = (0, 0, None);
        for (name, property) in &element.properties {
            match &property.data_type {
                PropertyType::Scalar(scalar) if list.is_none() => before += bytes_of(scalar),
                PropertyType::Scalar(scalar) => behind += bytes_of(scalar),
                PropertyType::List(ScalarType::UChar, ScalarType::Int | ScalarType::UInt)
                    if list.is_none() && is_corner_list(name) =>
                {
                    list = Some(&property.data_type);
                }
                PropertyType::List(..) => return None,
            }
        }
        let PropertyType::List(_, scalar) = list? else { return None };
        let is_signed = matches!(scalar, ScalarType::Int);
        (before + behind <= MAX_BYTES).then_some(Self { before, behind, is_signed, vertex_count })
    }

    /// Reads all faces, as triangle fans around their first corners, and returns the number of those that give no
    /// triangle.
    pub(super) fn read(
        &self,
        source: &mut impl BufRead,
        element: &ElementDef,
        triangles: &mut Vec<[u32; 3]>,
    ) -> Result<usize> {
        let triangle_bytes = self.before + 1 + 12 + self.behind;
        let (mut done, mut without_triangle) = (0, 0);
        let mut face = Vec::new();
        while done < element.count {
            // Take successive triangles from the buffer.
            let mut rest = source.fill_buf()?;
            let start = rest.len();
            while done < element.count
                && let Some((record, next)) = rest.split_at_checked(triangle_bytes)
                && record[self.before] == 3
            {
                triangles.push(self.corners(&record[self.before + 1..], done)?);
                rest = next;
                done += 1;
            }
            let taken = start - rest.len();
            source.consume(taken);
            if done == element.count {
                break;
            }

            // Read one face of any kind, which may continue in the next buffer.
            let mut read = |bytes: usize, face: &mut Vec<u8>| {
                face.resize(bytes, 0);
                source.read_exact(face).map_err(|error| ended(error, done, element))
            };
            read(self.before + 1, &mut face)?;
            let count = usize::from(face.last().copied().unwrap_or(0));
            read(4 * count + self.behind, &mut face)?;
            without_triangle += usize::from(count < 3);
            if let Some(corners) = face.get(..4 * count) {
                for at in 2..count {
                    let fan = [0, at - 1, at].map(|at| &corners[4 * at..4 * at + 4]);
                    triangles.push(self.corners(fan.concat().as_slice(), done)?);
                }
            }
            done += 1;
        }
        Ok(without_triangle)
    }

    /// Decodes three corners.
    #[inline]
    fn corners(&self, bytes: &[u8], face: usize) -> Result<[u32; 3]> {
        let (words, _) = bytes[..12].as_chunks::<4>();
        let corners = [words[0], words[1], words[2]].map(u32::from_le_bytes);
        let [a, b, c] = corners;
        if a.max(b).max(c) as usize >= self.vertex_count {
            return Err(self.no_vertex(corners, face));
        }
        Ok(corners)
    }

    /// Returns the error of the first corner of a face that is no vertex.
    #[cold]
    fn no_vertex(&self, corners: [u32; 3], face: usize) -> Error {
        let missing = corners.into_iter().find(|&corner| corner as usize >= self.vertex_count);
        let missing = missing.unwrap_or_default();
        let corner = if self.is_signed { missing.cast_signed().into() } else { i64::from(missing) };
        no_vertex(corner, self.vertex_count).context(format!("`face` element {face}"))
    }
}

/// Returns the error of an incomplete or failed read.
fn ended(error: io::Error, done: usize, element: &ElementDef) -> Error {
    let is_end = error.kind() == ErrorKind::UnexpectedEof;
    if is_end { cut_off(done, element) } else { error.into() }
}
