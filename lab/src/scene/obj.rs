//! OBJ files: all objects and groups of the file as one mesh.
//!
//! The reader takes the lines that start with `v` and `f`, and ignores materials, normals and texture
//! coordinates. It counts elements other than faces, of which the model tells. Its errors name the line, which
//! the crates for this format do not.

use anyhow::{Context as _, Result, bail, ensure};

use super::{Mesh, Model, quoted};
use crate::plural::counted;

/// Reads a file.
///
/// # Errors
/// If a line does not match its first word, or a face names a vertex that the file does not have.
pub(super) fn read(bytes: &[u8]) -> Result<Model> {
    let mut mesh = Mesh::default();
    let mut others = 0;
    // The largest index so far and its line: a face may come before its vertices.
    let mut largest = (0, 0);
    let mut corners = Vec::new();
    let mut joined = Vec::new();
    // Some editors write a mark of the encoding first.
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut lines = Lines { rest: bytes, number: 0 };
    while let Some(line) = lines.next() {
        let number = lines.number;
        let line = if is_element(line) { lines.join(line, &mut joined) } else { line };
        // Names and comments may be in any encoding.
        let line = String::from_utf8_lossy(line);
        let line = line.trim_ascii();
        let (keyword, words) = line.split_once([' ', '\t']).unwrap_or((line, ""));
        let words = words.split('#').next().unwrap_or_default();
        let result = match keyword {
            "v" => vertex(words).map(|vertex| mesh.positions.push(vertex)),
            "f" => face(words, mesh.positions.len(), &mut corners).map(|()| {
                let most = corners.iter().copied().max().unwrap_or(0);
                largest = largest.max((most, number));
                let [first, rest @ ..] = &*corners else { return };
                let fan = rest.windows(2).map(|side| [*first, side[0], side[1]]);
                mesh.indices.extend(fan);
            }),
            "p" | "l" | "curv" | "curv2" | "surf" => {
                others += 1;
                Ok(())
            }
            _ if keyword.contains(|c: char| c.is_ascii_control()) => {
                Err(anyhow::anyhow!("it is not text"))
            }
            _ => Ok(()),
        };
        result.with_context(|| format!("line {number}"))?;
    }
    let (most, number) = largest;
    let count = mesh.positions.len();
    ensure!(
        mesh.indices.is_empty() || (most as usize) < count,
        "line {number}: there is no vertex {}, the file has {count}",
        u64::from(most) + 1
    );
    ensure!(
        count > 0 || bytes.trim_ascii().is_empty(),
        "it has no line that starts with `v`: it is not an OBJ file, or has no vertices"
    );
    let mut model = Model::from(mesh);
    if others > 0 {
        let elements = counted(others, "element", "elements");
        model.hidden.push(format!("{elements} of points, lines, curves or surfaces"));
    }
    Ok(model)
}

/// Returns true for a line with a vertex or a face, which may go on in the next line. Names and comments may end in a
/// backslash, too.
fn is_element(line: &[u8]) -> bool {
    matches!(line.trim_ascii_start(), [b'v' | b'f', b' ' | b'\t' | b'\\', ..])
}

/// Reads the coordinates of a vertex. A weight or a colour may follow.
fn vertex(words: &str) -> Result<[f32; 3]> {
    let mut words = words.split_ascii_whitespace();
    let mut vertex = [0.0; 3];
    for (coordinate, axis) in vertex.iter_mut().zip(["x", "y", "z"]) {
        let word = words.next().with_context(|| format!("the vertex has no {axis}"))?;
        *coordinate =
            word.parse().ok().with_context(|| format!("{} is no number", quoted(word)))?;
    }
    Ok(vertex)
}

/// Reads the corners of a face, each like `7`, `7/1`, `7//3` or, from the last vertex, `-1`.
fn face(words: &str, vertices: usize, corners: &mut Vec<u32>) -> Result<()> {
    corners.clear();
    for word in words.split_ascii_whitespace() {
        let index = word.split('/').next().unwrap_or(word);
        let index: i64 =
            index.parse().ok().with_context(|| format!("{} is no corner", quoted(word)))?;
        let from_zero = match index {
            1.. => index - 1,
            0 => bail!("there is no vertex 0: vertices count from 1"),
            _ => i64::try_from(vertices)? + index,
        };
        let corner = u32::try_from(from_zero).ok().filter(|&corner| corner < u32::MAX);
        corners.push(corner.with_context(|| format!("there is no vertex {index}"))?);
    }
    ensure!(corners.len() >= 3, "a face has three corners or more, this one has {}", corners.len());
    Ok(())
}

/// The lines of a file, which end as those of Unix, Windows or old Macs do, and the number of the last one.
struct Lines<'a> {
    rest: &'a [u8],
    number: usize,
}

impl<'a> Iterator for Lines<'a> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        if self.rest.is_empty() {
            return None;
        }
        self.number += 1;
        let is_end = |byte: &u8| matches!(byte, b'\n' | b'\r');
        let end = self.rest.iter().position(is_end).unwrap_or(self.rest.len());
        let (line, rest) = self.rest.split_at(end);
        let behind = if rest.starts_with(b"\r\n") { 2 } else { 1 };
        self.rest = rest.get(behind..).unwrap_or_default();
        Some(line)
    }
}

impl Lines<'_> {
    /// Joins a line with the next one as long as it ends in a backslash that belongs to no comment.
    fn join<'j>(&mut self, line: &[u8], joined: &'j mut Vec<u8>) -> &'j [u8] {
        joined.clear();
        joined.extend_from_slice(line.trim_ascii_end());
        while joined.last() == Some(&b'\\') && !joined.contains(&b'#') {
            joined.pop();
            joined.push(b' ');
            joined.extend_from_slice(self.next().unwrap_or_default().trim_ascii_end());
        }
        joined
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(text: &[u8]) -> String {
        format!("{:#}", read(text).unwrap_err())
    }

    fn mesh(text: &[u8]) -> Mesh {
        read(text).unwrap().meshes.remove(0)
    }

    #[test]
    fn objects_become_one_mesh_and_quads_two_triangles() {
        let text = "mtllib none.mtl\no a\nv 0 0 0\nv 1 0 0\r\nv 1 1 0 0.5 0.5 0.5\nv\t0 1 0\nvn 0 0 1\n\
                    f 1//1 2//1 \\\n 3//1 4//1\no b\nv 0 0 1\nusemtl x\nf -1 1 2\np 1\nl 1 2\n#\n\n";
        let mesh = mesh(text.as_bytes());
        assert_eq!(mesh.positions.len(), 5);
        assert_eq!(mesh.indices, [[0, 1, 2], [0, 2, 3], [4, 0, 1]]);
        assert_eq!(read(b"\n").unwrap(), Mesh::default().into());
        let hidden = read(text.as_bytes()).unwrap().hidden;
        assert_eq!(hidden, ["2 elements of points, lines, curves or surfaces"]);
        let one = read(b"v 0 0 0\nv 1 0 0\nl 1 2\n").unwrap().hidden;
        assert_eq!(one, ["1 element of points, lines, curves or surfaces"]);
    }

    #[test]
    fn backslashes_and_comments_end_where_they_should() {
        let text = b"# C:\\models\\\nv 0 0 0 # a\\\nv 1 0 0\nv\\\n0 1 0\nusemtl a\\\nf 1 2 3#b\nf 1 2 \\ \n 3\n";
        let mesh = mesh(text);
        assert_eq!((mesh.positions.len(), &*mesh.indices), (3, &[[0, 1, 2]; 2][..]));
    }

    #[test]
    fn marks_and_letters_of_encodings_are_no_part_of_a_mesh() {
        let text = b"v 0 0 0\n# Gr\xf6\xdfe\nv 1 0 0\no W\xfcrfel\nv 0 1 0\nf 1 2 3\n";
        let mesh = mesh(text);
        assert_eq!((mesh.positions.len(), &*mesh.indices), (3, &[[0, 1, 2]][..]));
        assert_eq!(read(&[b"\xef\xbb\xbf", &text[..]].concat()).unwrap(), mesh.into());
    }

    #[test]
    fn lines_may_end_as_on_any_system() {
        let text = "v 0 0 0\nv 1 0 0\n\nv 0 1 0\nf 1 \\\n2 3\n";
        let mesh = mesh(text.as_bytes());
        assert_eq!(mesh.indices, [[0, 1, 2]]);
        let model = Model::from(mesh);
        for end in ["\r", "\r\n"] {
            assert_eq!(read(text.replace('\n', end).as_bytes()).unwrap(), model, "{end:?}");
            let wrong = format!("{text}f 1 2 4\n").replace('\n', end);
            assert_eq!(message(wrong.as_bytes()), "line 7: there is no vertex 4, the file has 3");
        }
    }

    #[test]
    fn errors_name_the_line() {
        for (text, expected) in [
            (
                &b"v 0 0 0\nv 1 0 0\nf 1 2 3\nv 2 0 0\nf 1 2 4"[..],
                "line 5: there is no vertex 4, the file has 3",
            ),
            (b"# a\nv 0 zero 0\n", "line 2: `zero` is no number"),
            (b"v 0 0\n", "line 1: the vertex has no z"),
            (b"v 0 0 \\\n\nv 0 x 0", "line 1: the vertex has no z"),
            (b"v 0 0 0\nf 1 0 1\n", "line 2: there is no vertex 0: vertices count from 1"),
            (b"v 0 0 0\nf 1 -2 1\n", "line 2: there is no vertex -2"),
            (b"v 0 0 0\nf 1 a 1\n", "line 2: `a` is no corner"),
            (b"v 0 0 0\nf 1 1\n", "line 2: a face has three corners or more, this one has 2"),
            (b"v 0 0 0\nf 1 1 9999999999\n", "line 2: there is no vertex 9999999999"),
            (b"\xff\xfe\x00\x01\n", "line 1: it is not text"),
            (
                b"hello\n",
                "it has no line that starts with `v`: it is not an OBJ file, or has no vertices",
            ),
        ] {
            assert_eq!(message(text), expected);
        }
    }
}
