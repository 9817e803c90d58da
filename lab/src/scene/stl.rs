//! STL files, binary and ASCII: three vertices for each triangle, as in the file.
//!
//! The length of a binary file follows from the triangle count after its header, and identifies it: many
//! binary files start with `solid`, as ASCII files do. An ASCII file may have several solids.

use anyhow::{Context as _, Result, bail, ensure};

use super::{Mesh, Model, quoted};
use crate::plural::{counted, triangles};

/// Bytes before the first triangle of a binary file: a comment and the triangle count.
const HEADER_BYTES: usize = 84;

/// Bytes of a triangle: its normal, three corners, and two bytes without a fixed use.
const TRIANGLE_BYTES: usize = 50;

/// Reads a file.
///
/// # Errors
/// If the file is cut off, or a line of an ASCII file is malformed.
pub(super) fn read(bytes: &[u8]) -> Result<Model> {
    let count = count_of(bytes);
    let rest = bytes.get(HEADER_BYTES..).unwrap_or_default();
    // The header or the count of a binary file nearly always has a zero somewhere, and text has none.
    let head = bytes.get(..HEADER_BYTES).unwrap_or(bytes);
    let is_text = starts_with_solid(bytes) && !head.contains(&0);
    match count {
        _ if is_binary(bytes, bytes.len() as u64) => Ok(binary(rest).into()),
        // The names of solids may be in any encoding.
        _ if is_text => Ok(ascii(&String::from_utf8_lossy(bytes))?.into()),
        // Some programs write more bytes after the last triangle.
        Some(count) => {
            let present = rest.len() / TRIANGLE_BYTES;
            ensure!(
                count <= present,
                "it is cut off after {present} of {}, or it is not an STL file",
                triangles(count)
            );
            let (counted_bytes, behind) = rest.split_at(count * TRIANGLE_BYTES);
            let mut model = Model::from(binary(counted_bytes));
            if behind.len() >= TRIANGLE_BYTES {
                let bytes = counted(behind.len(), "byte", "bytes");
                let triangles = triangles(count);
                model.hidden.push(format!("{bytes} behind the {triangles} of its header"));
            }
            Ok(model)
        }
        None => bail!("it is not an STL file: it is too short, and does not start with `solid`"),
    }
}

/// Returns the number of triangles that the header of a binary file tells; none if there is no room for it.
fn count_of(start: &[u8]) -> Option<usize> {
    let count = start.get(..HEADER_BYTES)?.last_chunk()?;
    Some(u32::from_le_bytes(*count) as usize)
}

/// Returns true if a file that starts so is exactly as long as a binary file with its number of triangles.
pub(super) fn is_binary(start: &[u8], length: u64) -> bool {
    let expected = |count| HEADER_BYTES as u64 + TRIANGLE_BYTES as u64 * count as u64;
    count_of(start).is_some_and(|count| expected(count) == length)
}

fn binary(triangles: &[u8]) -> Mesh {
    let (triangles, _) = triangles.as_chunks::<TRIANGLE_BYTES>();
    let mut positions = Vec::with_capacity(3 * triangles.len());
    for triangle in triangles {
        let (floats, _) = triangle[12..48].as_chunks::<4>();
        let (corners, _) = floats.as_chunks::<3>();
        positions.extend(corners.iter().map(|corner| corner.map(f32::from_le_bytes)));
    }
    with_positions(positions)
}

/// Returns true if the first word is `solid`, in small or in capital letters.
pub(super) fn starts_with_solid(bytes: &[u8]) -> bool {
    let first = bytes.trim_ascii_start().first_chunk();
    first.is_some_and(|word: &[u8; 5]| word.eq_ignore_ascii_case(b"solid"))
}

fn ascii(text: &str) -> Result<Mesh> {
    let mut positions = Vec::new();
    let mut is_complete = true;
    // Lines may end as those of Windows or old Macs do.
    let text = text.replace("\r\n", "\n").replace('\r', "\n");
    let mut lines = (1..).zip(text.lines()).peekable();
    let mut facet = 0;
    while let Some((number, line)) = lines.next() {
        let result = read_line(line, &mut positions, &mut facet, &mut is_complete);
        // An incomplete file is cut off: say that, not what its last line lacks.
        let is_end = lines.peek().is_none();
        ensure!(
            !is_end || (is_complete && positions.len().is_multiple_of(3)),
            "it is cut off in line {number}: it does not end with `endsolid`"
        );
        result.with_context(|| format!("line {number}"))?;
    }
    Ok(with_positions(positions))
}

/// Reads a line: a corner, or the start or the end of a solid or a facet. `facet` is the number of corners before the
/// last facet.
fn read_line(
    line: &str,
    positions: &mut Vec<[f32; 3]>,
    facet: &mut usize,
    is_complete: &mut bool,
) -> Result<()> {
    let mut words = line.split_ascii_whitespace();
    let Some(first) = words.next() else { return Ok(()) };
    match &*first.to_ascii_lowercase() {
        "vertex" => {
            let corner: Option<Vec<f32>> = words.map(|word| word.parse().ok()).collect();
            let corner = corner.and_then(|corner| <[f32; 3]>::try_from(corner).ok());
            positions.push(corner.context("`vertex` should have three numbers behind it")?);
        }
        "facet" | "endfacet" => {
            let count = positions.len() - *facet;
            // A facet may have no end of its own.
            let is_start = count == 0 && first.eq_ignore_ascii_case("facet");
            ensure!(is_start || count == 3, "a facet has three vertices, this one has {count}");
            *facet = positions.len();
        }
        "solid" => *is_complete = false,
        "endsolid" => *is_complete = true,
        "outer" | "endloop" | "color" => {}
        _ => bail!("{} is no word of an STL file", quoted(first)),
    }
    Ok(())
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "a file of 2^32 vertices does not fit in memory"
)]
fn with_positions(positions: Vec<[f32; 3]>) -> Mesh {
    let indices = (0..positions.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    Mesh { positions, indices }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [[f32; 3]; 3] = [[0.0, 0.0, 0.5], [1.0, 0.0, 0.0], [0.0, 1e-3, 0.0]];

    fn file(start: &[u8], count: u32) -> Vec<u8> {
        let mut bytes = vec![b' '; 80];
        bytes[..start.len()].copy_from_slice(start);
        bytes.extend(count.to_le_bytes());
        for _ in 0..count {
            bytes.extend([0; 12]);
            bytes.extend(CORNERS.as_flattened().iter().flat_map(|c| c.to_le_bytes()));
            bytes.extend([7; 2]);
        }
        bytes
    }

    const TEXT: &str = "solid\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 0.5\n   vertex 1 0 0\n\
        vertex 0 1e-3 0\n  endloop\n endfacet\nendsolid\n";

    fn mesh(bytes: &[u8]) -> Mesh {
        read(bytes).unwrap().meshes.remove(0)
    }

    #[test]
    fn both_encodings_give_one_mesh() {
        for bytes in [
            TEXT.as_bytes(),
            TEXT.to_uppercase().as_bytes(),
            &[b"solid W\xfcrfel", &TEXT.as_bytes()[5..]].concat(),
            &file(b"solid but binary", 1),
            &[file(b"", 1), vec![1; 9]].concat(),
            &[file(b"solid", 1), vec![1; 9]].concat(),
        ] {
            let mesh = mesh(bytes);
            assert_eq!((&*mesh.positions, &*mesh.indices), (&CORNERS[..], &[[0, 1, 2]][..]));
        }
        assert_eq!(mesh(TEXT.repeat(3).as_bytes()).indices.len(), 3);
        assert_eq!(mesh(TEXT.replace('\n', "\r").as_bytes()), mesh(TEXT.as_bytes()));
        assert_eq!(mesh(TEXT.replace('\n', "\r\n").as_bytes()), mesh(TEXT.as_bytes()));
        let mixed = TEXT.replace('\n', "\r").replace("endsolid\r", "endsolid\n");
        assert_eq!(mesh(mixed.as_bytes()), mesh(TEXT.as_bytes()));
        let open = TEXT.repeat(2).replace(" endfacet\nendsolid\nsolid\n", "");
        assert_eq!(mesh(open.as_bytes()).indices.len(), 2);
        assert_eq!(mesh(&file(b"", 0)), Mesh::default());
    }

    /// Some programs that write as they go leave the number of triangles zero.
    #[test]
    fn triangles_that_are_not_counted_are_told_of() {
        for (count, expected) in [
            (0, "150 bytes behind the 0 triangles of its header"),
            (1, "100 bytes behind the 1 triangle of its header"),
        ] {
            let mut bytes = file(b"", 3);
            bytes[80] = count;
            let model = read(&bytes).unwrap();
            assert_eq!(model.meshes[0].indices.len(), usize::from(count));
            assert_eq!(model.hidden, [expected]);
        }
        assert!(read(&file(b"", 3)).unwrap().hidden.is_empty());
    }

    #[test]
    fn damage_is_reported() {
        let message = |bytes: &[u8]| format!("{:#}", read(bytes).unwrap_err());
        assert!(message(&file(b"", 2)[..183]).starts_with("it is cut off after 1 of 2 triangles"));
        // A binary file that is cut off is not text, whatever its first word is.
        assert!(message(&file(b"solid", 2)[..183]).starts_with("it is cut off after 1 of 2"));
        assert!(message(b"hello").contains("not an STL file"));
        for length in TEXT.find("facet").unwrap()..TEXT.find("endsolid").unwrap() {
            let lines = TEXT[..length].lines().count();
            let expected = format!("it is cut off in line {lines}: it does not end with");
            let message = message(&TEXT.as_bytes()[..length]);
            assert!(message.starts_with(&expected), "{length}: {message}");
        }
        for (from, to, expected) in [
            ("1e-3", "one", "line 6: `vertex` should have three numbers"),
            ("vertex 1 0 0\n", "", "line 7: a facet has three vertices, this one has 2"),
            ("vertex 1 0 0\n", "vertex 1 0 0\n  vertex 1 0 0\n", "this one has 4"),
            ("vertex 1 0 0\n", "vertex 1 zero 0 0\n", "line 5: `vertex` should have three numbers"),
            ("outer loop", "inner loop", "line 3: `inner` is no word"),
            ("endsolid", "", "cut off"),
        ] {
            let message = message(TEXT.replacen(from, to, 1).as_bytes());
            assert!(message.contains(expected), "{message}");
        }
    }
}
