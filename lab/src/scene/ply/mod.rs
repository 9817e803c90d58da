//! PLY files: ASCII and binary, any number type, faces with any number of corners.
//!
//! Elements are read one at a time, directly into the arrays that the scene keeps, so a file of ten million
//! triangles needs no second copy. Everything but coordinates and lists of corners is skipped. The elements
//! that nearly every binary file has are decoded a buffer at a time ([`fast`]), all others number by number.

mod ascii;
mod fast;

use std::fs::File;
use std::io::{BufRead, BufReader, ErrorKind};
use std::path::Path;

use anyhow::{Context as _, Error, Result, anyhow, bail, ensure};
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{
    BeginList, ElementDef, Encoding, Property, PropertyAccess, PropertyAccessResult, PropertyType,
};

use self::fast::{FaceLayout, VertexLayout};
use super::{Mesh, Model};
use crate::plural::counted;
use crate::progress::Progress;

/// Bytes per read: enough that system calls cost next to nothing.
const BUFFER_BYTES: usize = 1 << 20;

/// Reads a file.
///
/// # Errors
/// If the file cannot be opened, is not PLY, ends too early, or declares no vertices.
pub(super) fn load(path: &Path) -> Result<Model> {
    let file = File::open(path).context("cannot open it")?;
    let byte_count = file.metadata().context("cannot read its size")?.len();
    let reader = Progress::new("loading", byte_count).reader(file);
    read(BufReader::with_capacity(BUFFER_BYTES, reader), byte_count)
}

/// Reads a PLY of at most `byte_count` bytes, a number that only limits the memory reserved in advance.
fn read(mut source: impl BufRead, byte_count: u64) -> Result<Model> {
    let is_ply = source.fill_buf()?.starts_with(b"ply");
    ensure!(is_ply, "it is not a PLY file: it does not start with `ply`");
    let is_old = matches!(source.fill_buf()?, [_, _, _, b'\r', next, ..] if *next != b'\n');
    ensure!(!is_old, "its lines end in CR alone: save the file with LF or CR LF");
    let mut reader = Reader::new(source);
    // After its first line, the parser's error describes its own state.
    let header = match Parser::<Skipped>::new().read_header(&mut reader) {
        Ok(header) => header,
        Err(error) => {
            let text = error.to_string();
            let reason = text.lines().next().unwrap_or_default();
            if reader.into_inner().fill_buf()?.is_empty() {
                bail!("it is cut off within its header, or the last line is damaged: {reason}")
            }
            bail!("its header is damaged: {reason}")
        }
    };
    let vertices = header.elements.get("vertex").map(|vertex| vertex.count);
    let vertex_count = vertices.context("its header declares no `vertex` element")?;
    ensure!(
        !header.elements.contains_key("tristrips"),
        "it has triangle strips; convert them to faces first"
    );

    let is_little = header.encoding == Encoding::BinaryLittleEndian;
    // The reader counts the line that it would read next.
    let line = reader.line().saturating_sub(1);
    let mut place = Place { encoding: header.encoding, line };
    let mut source = reader.into_inner();
    let mut mesh = Mesh::default();
    // Faces that give no triangle.
    let mut without_triangle = 0;
    for element in header.elements.values() {
        // Elements without bytes would let a header promise endless work.
        ensure!(!element.properties.is_empty(), "its `{}` elements are empty", element.name);
        // Every element takes at least a byte, so a wrong header cannot reserve more memory than this.
        let count = element.count.min(usize::try_from(byte_count).unwrap_or(usize::MAX));
        match element.name.as_str() {
            "vertex" => {
                check_vertex(element)?;
                mesh.positions.reserve_exact(count);
                match VertexLayout::of(element).filter(|_| is_little) {
                    Some(layout) => layout.read(&mut source, element, &mut mesh.positions)?,
                    None => each(&mut source, &mut place, element, |vertex: Vertex| {
                        mesh.positions.push(vertex.0);
                        Ok(())
                    })?,
                }
            }
            "face" => {
                check_face(element)?;
                mesh.indices.reserve_exact(count);
                match FaceLayout::of(element, vertex_count).filter(|_| is_little) {
                    Some(layout) => {
                        without_triangle += layout.read(&mut source, element, &mut mesh.indices)?;
                    }
                    None => each(&mut source, &mut place, element, |face: Face| {
                        without_triangle += usize::from(face.0.len() < 3);
                        face.fan(vertex_count, &mut mesh.indices)
                    })?,
                }
            }
            _ => each(&mut source, &mut place, element, |_: Skipped| Ok(()))?,
        }
    }
    let mut model = Model::from(mesh);
    if without_triangle > 0 {
        let faces = counted(without_triangle, "face", "faces");
        model.hidden.push(format!("{faces} of fewer than three corners"));
    }
    Ok(model)
}

/// The part of a file that was read: its encoding, and the lines of text so far.
struct Place {
    encoding: Encoding,
    line: usize,
}

/// Reads all elements of one kind and hands each to `take`.
fn each<E: PropertyAccess>(
    source: &mut impl BufRead,
    place: &mut Place,
    element: &ElementDef,
    mut take: impl FnMut(E) -> Result<()>,
) -> Result<()> {
    let parser = Parser::<E>::new();
    let mut line = String::new();
    for number in 0..element.count {
        let value = match place.encoding {
            Encoding::Ascii => {
                place.line += 1;
                line.clear();
                match source.read_line(&mut line) {
                    Ok(0) => return Err(cut_off(number, element)),
                    Ok(_) => ascii::read(&line, element),
                    Err(error) => Err(error.into()),
                }
            }
            Encoding::BinaryLittleEndian | Encoding::BinaryBigEndian => {
                let value = match place.encoding {
                    Encoding::BinaryLittleEndian => {
                        parser.read_little_endian_element(source, element)
                    }
                    _ => parser.read_big_endian_element(source, element),
                };
                if let Err(error) = value.as_ref()
                    && error.kind() == ErrorKind::UnexpectedEof
                {
                    return Err(cut_off(number, element));
                }
                value.map_err(Into::into)
            }
        };
        value.and_then(&mut take).with_context(|| {
            let element = format!("`{}` element {number}", element.name);
            match place.encoding {
                Encoding::Ascii => format!("line {}, {element}", place.line),
                _ => element,
            }
        })?;
    }
    Ok(())
}

/// Returns the error of a file that ends within its elements.
fn cut_off(number: usize, element: &ElementDef) -> Error {
    let (count, name) = (element.count, &element.name);
    anyhow!("it is cut off after {number} of {count} `{name}` elements: fetch or export it again")
}

/// Returns the error of a corner that is none of so many vertices.
fn no_vertex(corner: i64, vertex_count: usize) -> Error {
    anyhow!("there is no vertex {corner}, the file has {vertex_count}, which count from 0")
}

fn check_vertex(element: &ElementDef) -> Result<()> {
    for axis in ["x", "y", "z"] {
        ensure!(element.properties.contains_key(axis), "its vertices have no `{axis}`");
    }
    Ok(())
}

fn check_face(element: &ElementDef) -> Result<()> {
    ensure!(
        element.properties.iter().any(|(name, property)| {
            is_corner_list(name) && matches!(property.data_type, PropertyType::List(..))
        }),
        "its faces have no list `vertex_indices`"
    );
    Ok(())
}

/// Returns true for either name of the list; the format's own paper has the first.
fn is_corner_list(name: &str) -> bool {
    name == "vertex_indices" || name == "vertex_index"
}

/// An element that the loader skips.
struct Skipped;

impl PropertyAccess for Skipped {
    fn new() -> Self {
        Self
    }
}

/// The coordinates of a vertex.
struct Vertex([f32; 3]);

impl Vertex {
    fn set(&mut self, name: &str, value: f32) -> PropertyAccessResult {
        let [x, y, z] = &mut self.0;
        match name {
            "x" => *x = value,
            "y" => *y = value,
            "z" => *z = value,
            _ => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self([f32::NAN; 3])
    }

    fn set_float(&mut self, name: &str, value: f32) -> PropertyAccessResult {
        self.set(name, value)
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        match property.to_f32_lossy() {
            Some(value) => self.set(name, value),
            None => PropertyAccessResult::Ignored,
        }
    }
}

/// The corners of a face.
struct Face(Vec<i32>);

impl Face {
    /// Appends the triangle fan around the first corner; fewer than three corners give no triangle.
    fn fan(&self, vertex_count: usize, triangles: &mut Vec<[u32; 3]>) -> Result<()> {
        let mut corners = self.0.iter().map(|&corner| {
            let vertex = u32::try_from(corner).ok().filter(|&it| (it as usize) < vertex_count);
            vertex.ok_or_else(|| no_vertex(corner.into(), vertex_count))
        });
        let (Some(first), Some(second)) = (corners.next(), corners.next()) else { return Ok(()) };
        let (first, mut previous) = (first?, second?);
        for corner in corners {
            let corner = corner?;
            triangles.push([first, previous, corner]);
            previous = corner;
        }
        Ok(())
    }
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Self(Vec::new())
    }

    fn begin_list_int(&mut self, name: &str, _: usize) -> BeginList<'_, i32> {
        if !is_corner_list(name) {
            return BeginList::UseSetter;
        }
        // A face may have lists of both names: the last one counts, in any encoding.
        self.0.clear();
        BeginList::Fill(&mut self.0)
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if !is_corner_list(name) {
            return PropertyAccessResult::Ignored;
        }
        let Some(corners) = property.to_u32_list() else {
            return PropertyAccessResult::UnsupportedType;
        };
        let corners = corners.into_iter().map(i32::try_from).collect::<Result<Vec<i32>, _>>();
        match corners {
            Ok(corners) => {
                self.0 = corners;
                PropertyAccessResult::Set
            }
            Err(_) => PropertyAccessResult::UnsupportedType,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const VERTICES: [[f32; 3]; 4] = [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.5]];

    const HEADER: &str = "1.0\ncomment a quad and a triangle, with extras\n\
        element vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
        property uchar red\nelement other 1\nproperty list uchar float weights\n\
        element face 2\nproperty list uchar int vertex_indices\nproperty uchar flags\nend_header\n";

    fn ascii() -> Vec<u8> {
        let payload =
            "0 0 0 1\n1 0 0 2\n1 1.0 0 3\n0 1 5e-1 4\n2 0.5 0.5\n4 0 1 2 3 9\n3 3 2 1 9\n";
        format!("ply\nformat ascii {HEADER}{payload}").into_bytes()
    }

    fn binary(format: &str, float: fn(f32) -> [u8; 4], int: fn(i32) -> [u8; 4]) -> Vec<u8> {
        let mut bytes = format!("ply\nformat {format} {HEADER}").into_bytes();
        for vertex in VERTICES {
            bytes.extend(vertex.into_iter().flat_map(float));
            bytes.push(1);
        }
        bytes.push(2);
        bytes.extend([0.5, 0.5].into_iter().flat_map(float));
        for (count, face) in [(4, &[0, 1, 2, 3][..]), (3, &[3, 2, 1])] {
            bytes.push(count);
            bytes.extend(face.iter().copied().flat_map(int));
            bytes.push(9);
        }
        bytes
    }

    fn read_all(bytes: &[u8]) -> Result<Mesh> {
        let mut model = read(bytes, bytes.len() as u64)?;
        assert_eq!((model.meshes.len(), model.instances.len()), (1, 1));
        Ok(model.meshes.remove(0))
    }

    fn message(bytes: &[u8]) -> String {
        format!("{:#}", read_all(bytes).unwrap_err())
    }

    #[test]
    fn three_encodings_give_one_mesh() {
        let files = [
            ascii(),
            binary("binary_little_endian", f32::to_le_bytes, i32::to_le_bytes),
            binary("binary_big_endian", f32::to_be_bytes, i32::to_be_bytes),
        ];
        for file in files {
            let mesh = read_all(&file).unwrap();
            assert_eq!(mesh.positions, VERTICES);
            assert_eq!(mesh.indices, [[0, 1, 2], [0, 2, 3], [3, 2, 1]]);
        }
    }

    /// Records that cross the end of a buffer are decoded like those within one.
    #[test]
    fn buffers_of_any_size_give_one_mesh() {
        let file = binary("binary_little_endian", f32::to_le_bytes, i32::to_le_bytes);
        let expected = read(&*file, file.len() as u64).unwrap();
        for capacity in 3..60 {
            let source = BufReader::with_capacity(capacity, &*file);
            assert_eq!(read(source, file.len() as u64).unwrap(), expected);
        }
    }

    #[test]
    fn plain_files_are_decoded_at_once() {
        let header = "ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\n\
            property float y\nproperty float z\nelement face 3\n\
            property list uchar int vertex_indices\nend_header\n";
        let file = |faces: &[&[i32]]| {
            let mut bytes = header.as_bytes().to_vec();
            bytes.extend(VERTICES.as_flattened().iter().flat_map(|c| c.to_le_bytes()));
            for face in faces {
                bytes.push(u8::try_from(face.len()).unwrap());
                bytes.extend(face.iter().flat_map(|corner| corner.to_le_bytes()));
            }
            bytes
        };
        let bytes = file(&[&[0, 1, 2], &[3, 2], &[1, 3, 0]]);
        let hidden = read(&*bytes, bytes.len() as u64).unwrap().hidden;
        assert_eq!(hidden, ["1 face of fewer than three corners"]);
        let mesh = read_all(&bytes).unwrap();
        assert_eq!(mesh.positions, VERTICES);
        assert_eq!(mesh.indices, [[0, 1, 2], [1, 3, 0]]);
        let far = message(&file(&[&[0, 1, 2], &[3, 2], &[1, 3, 0, 4]]));
        let expected = "`face` element 2: there is no vertex 4, the file has 4, which count from 0";
        assert_eq!(far, expected);
        let message = message(&file(&[&[0, 1, 2], &[3, 2, -2], &[1, 3, 0]]));
        let expected =
            "`face` element 1: there is no vertex -2, the file has 4, which count from 0";
        assert_eq!(message, expected);
    }

    #[test]
    fn faces_without_a_triangle_are_told_of_in_any_encoding() {
        let all = |bytes: &[u8]| read(bytes, bytes.len() as u64).unwrap();
        assert!(all(&ascii()).hidden.is_empty());
        let text = String::from_utf8(ascii()).unwrap();
        let text = text.replacen("4 0 1 2 3 9\n3 3 2 1 9\n", "2 0 1 9\n0 9\n", 1);
        let cut = |mut bytes: Vec<u8>, first: u8| {
            // The faces are the last 17 + 1 and 13 + 1 bytes.
            bytes.truncate(bytes.len() - 32);
            bytes.extend([2, 0, 0, 0, 0, first, 0, 0, 1 - first, 9, 0, 9]);
            bytes
        };
        for bytes in [
            text.into_bytes(),
            cut(binary("binary_little_endian", f32::to_le_bytes, i32::to_le_bytes), 1),
            cut(binary("binary_big_endian", f32::to_be_bytes, i32::to_be_bytes), 0),
        ] {
            let model = all(&bytes);
            assert!(model.meshes[0].indices.is_empty());
            assert_eq!(model.hidden, ["2 faces of fewer than three corners"]);
        }
    }

    #[test]
    fn of_two_lists_of_corners_the_last_counts() {
        let header = HEADER.replace(
            "property uchar flags",
            "property list uchar int vertex_index\nproperty uchar flags",
        );
        let text = format!(
            "ply\nformat ascii {header}0 0 0 1\n1 0 0 2\n1 1 0 3\n0 1 1 4\n0\n3 0 1 2 3 1 2 3 9\n3 0 1 2 3 2 3 0 9\n"
        );
        assert_eq!(read_all(text.as_bytes()).unwrap().indices, [[1, 2, 3], [2, 3, 0]]);
        let header = "element vertex 3\nproperty char x\nproperty char y\nproperty char z\nelement face 1\n\
            property list uchar uchar vertex_indices\nproperty list uchar uchar vertex_index\nend_header\n";
        for order in ["little", "big"] {
            let mut bytes = format!("ply\nformat binary_{order}_endian 1.0\n{header}").into_bytes();
            bytes.extend([0, 0, 0, 1, 0, 0, 0, 1, 0, 3, 0, 1, 2, 3, 2, 1, 0]);
            assert_eq!(read_all(&bytes).unwrap().indices, [[2, 1, 0]], "{order}");
        }
    }

    #[test]
    fn every_number_type_is_understood() {
        let text = "ply\nformat ascii 1.0\nelement vertex 3\nproperty double x\nproperty short y\n\
            property float32 z\nelement face 1\nproperty list int ushort vertex_index\nend_header\n\
            0.25 -1 0\n1 2 0\n0 1 0\n3 0 1 2\n";
        let mesh = read_all(text.as_bytes()).unwrap();
        assert_eq!(mesh.positions, [[0.25, -1.0, 0.0], [1.0, 2.0, 0.0], [0.0, 1.0, 0.0]]);
        assert_eq!(mesh.indices, [[0, 1, 2]]);
    }

    #[test]
    fn text_has_the_numbers_that_programs_write() {
        let text = String::from_utf8(ascii()).unwrap();
        let text = text.replace("\n1 0 0 2", "\n1. -.0 +0 2").replace("0 1 5e-1 4", "nan -inf 0 4");
        let mesh = read_all(text.as_bytes()).unwrap();
        assert_eq!(mesh.positions[..2], VERTICES[..2]);
        assert!(mesh.positions[3][0].is_nan() && mesh.positions[3][1].is_infinite());
    }

    #[test]
    fn every_cut_is_reported() {
        let file = binary("binary_little_endian", f32::to_le_bytes, i32::to_le_bytes);
        for length in 0..file.len() - 1 {
            let message = message(&file[..length]);
            assert!(!message.is_empty());
        }
        for length in 4..file.windows(10).position(|it| it == b"end_header").unwrap() {
            let expected = "it is cut off within its header, or the last line is damaged: ";
            assert!(message(&file[..length]).starts_with(expected), "{length}");
        }
        let cut = message(&file[..file.len() - 8]);
        assert_eq!(cut, "it is cut off after 1 of 2 `face` elements: fetch or export it again");
    }

    #[test]
    fn damage_is_reported() {
        assert!(message(b"hello\n").contains("not a PLY file"));
        assert!(message(b"").contains("not a PLY file"));
        assert_eq!(
            message(b"ply\rformat"),
            "its lines end in CR alone: save the file with LF or CR LF"
        );
        let text = String::from_utf8(ascii()).unwrap();
        let broken = [
            (
                "1 0 0 2",
                "1 zero 0 2",
                "line 16, `vertex` element 1: `zero` is no number that fits here",
            ),
            ("1 0 0 2", "1 0", "`vertex` element 1: the line ends before `z`"),
            ("3 3 2 1 9", "3 3 2.5 1 9", "`face` element 1: `2.5` is no number that fits here"),
            ("3 3 2 1 9", "3 3 2", "`face` element 1: the line ends before `vertex_indices`"),
            (
                "3 3 2 1 9",
                "3 3 -2 1 9",
                "line 21, `face` element 1: there is no vertex -2, the file",
            ),
            (
                "3 3 2 1 9",
                "3 3 4 1 9",
                "line 21, `face` element 1: there is no vertex 4, the file has 4",
            ),
            ("vertex_indices", "corners", "no list `vertex_indices`"),
            ("list uchar int vertex_indices", "int vertex_indices", "no list `vertex_indices`"),
            ("float z", "float w", "no `z`"),
            ("element vertex 4", "element point 4", "no `vertex` element"),
            ("format ascii 1.0", "format text 1.0", "header is damaged"),
            (
                "end_header",
                "element nothing 99999999999999\nend_header",
                "`nothing` elements are empty",
            ),
            ("element other", "element tristrips", "triangle strips"),
        ];
        for (from, to, expected) in broken {
            let message = message(text.replacen(from, to, 1).as_bytes());
            assert!(message.contains(expected), "{message}");
        }
    }

    #[test]
    fn a_header_that_promises_too_much_reserves_nothing() {
        let text = String::from_utf8(ascii()).unwrap();
        let huge = text.replace("element face 2", "element face 99999999999999");
        assert!(message(huge.as_bytes()).contains("cut off after 2 of 99999999999999"));
    }
}
