//! glTF files, as JSON or binary (GLB): the triangles of the default scene's meshes, placed by its nodes.
//!
//! A primitive is a mesh here, because it has its own vertices; a node with a glTF mesh is an instance of
//! each of its primitives. Materials and lights are ignored. So are skins, morph targets, animations and cameras, of
//! which the model tells: the scene is at rest.

mod accessor;
mod hidden;

use core::ops::Range;
use std::fs;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Error, Result, anyhow, bail, ensure};
use base64::Engine as _;
use gltf::accessor::{DataType, Dimensions};
use gltf::buffer::Source;
use gltf::mesh::Mode;
use gltf::{Document, Gltf, Primitive, Semantic};

use self::accessor::{check_sparse, is_inside, positions};
use self::hidden::{hidden, is_known};
use super::format::Format;
use super::model::{IDENTITY, Mesh, Model, Transform};
use crate::file;
use crate::vector::round;

/// A matrix in `f64`, so that the product of a chain of nodes is rounded once.
type Matrix = [[f64; 4]; 3];

/// The start of the message for a file that the crate refuses, mostly because it breaks a rule of the format.
const INVALID: &str = "it is not valid glTF, or of a kind that hgrid does not read";

/// Reads the bytes of a file, and the files that it names beside it.
///
/// # Errors
/// If it is not valid glTF, requires an unsupported extension, or names missing data.
pub(super) fn read(bytes: &[u8], path: &Path) -> Result<Model> {
    let (document, blob) = parse(bytes)?;
    let buffers = buffers(&document, blob, path.parent().unwrap_or(Path::new("")))?;
    let mut model = Model::default();
    // Each glTF mesh has a range of primitives in `model.meshes`.
    let mut places = Vec::new();
    for mesh in document.meshes() {
        let first = model.meshes.len();
        for primitive in mesh.primitives() {
            let triangles = triangles(&primitive, &buffers).with_context(|| {
                format!("mesh {}, primitive {}", mesh.index(), primitive.index())
            })?;
            model.meshes.extend(triangles);
        }
        places.push(first..model.meshes.len());
    }
    model.instances = instances(&document, &places)?;
    model.hidden = hidden(&document);
    Ok(model)
}

/// Returns the files that a file names beside it, if its content is glTF; none if it cannot be read, which loading it
/// reports.
pub(crate) fn files_of(path: &Path) -> Vec<PathBuf> {
    let is_gltf = Format::of(path).is_ok_and(|format| format == Format::Gltf);
    let document =
        if is_gltf { fs::read(path).ok().and_then(|bytes| parse(&bytes).ok()) } else { None };
    let folder = path.parent().unwrap_or(Path::new(""));
    let file = |buffer: gltf::Buffer<'_>| match buffer.source() {
        Source::Uri(uri) if !uri.contains(':') => {
            Some(folder.join(&*urlencoding::decode(uri).ok()?))
        }
        _ => None,
    };
    document.iter().flat_map(|(document, _)| document.buffers().filter_map(file)).collect()
}

/// Refuses versions of glTF other than 2: their files have the same endings.
fn check_version(version: &str) -> Result<()> {
    let is_read = version == "2" || version.starts_with("2.");
    ensure!(is_read, "it is of glTF {version}, and hgrid reads glTF 2: export it as that");
    Ok(())
}

/// Returns the error of a file that the crate refuses, in one sentence.
fn invalid(error: &gltf::Error) -> Error {
    // The crate ends each of several reasons with a semicolon.
    let text = error.to_string();
    let reason = text.trim_start_matches("invalid glTF:").trim_end_matches(';').trim();
    anyhow!("{INVALID}: {reason}")
}

/// Parses and checks a file. Extensions [that are known](is_known) are allowed even if the file requires them.
fn parse(bytes: &[u8]) -> Result<(Document, Option<Vec<u8>>)> {
    // Some editors write a mark of the encoding first.
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    // Bytes 8 to 11 of a binary file are its length.
    if let Some([b'g', b'l', b'T', b'F', _, _, _, _, a, b, c, d]) = bytes.first_chunk() {
        let (needed, there) = (u32::from_le_bytes([*a, *b, *c, *d]), bytes.len());
        let is_whole = there as u64 >= u64::from(needed);
        ensure!(is_whole, "it is cut off: it has {there} bytes of {needed}");
        ensure!(needed >= 12, "{INVALID}: its header takes more than its {needed} bytes");
    }
    let parsed = Gltf::from_slice_without_validation(bytes);
    // Files of glTF 1 are objects where those of glTF 2 are arrays.
    if parsed.is_err()
        && let Ok(json) = serde_json::from_slice::<serde_json::Value>(bytes)
        && let Some(version) = json["asset"]["version"].as_str()
    {
        check_version(version)?;
    }
    let Gltf { document, blob } = parsed.map_err(|error| invalid(&error))?;
    let mut root = document.into_json();
    check_version(root.asset.min_version.as_ref().unwrap_or(&root.asset.version))?;
    root.extensions_required.retain(|name| !is_known(name));
    if let Some(name) = root.extensions_required.first() {
        bail!(
            "it requires the extension {name}, which hgrid does not read: export it without that"
        );
    }
    // The crate looks for positions before it looks whether they are there, and panics.
    let primitives = root.meshes.iter().flat_map(|mesh| &mesh.primitives);
    let mut named = primitives.flat_map(|primitive| primitive.attributes.values());
    ensure!(
        named.all(|accessor| accessor.value() < root.accessors.len()),
        "{INVALID}: a mesh names an accessor that is not there"
    );
    Ok((Document::from_json(root).map_err(|error| invalid(&error))?, blob))
}

/// Reads all buffers: the binary part of the file, files beside it, or text in it.
fn buffers(document: &Document, mut blob: Option<Vec<u8>>, folder: &Path) -> Result<Vec<Vec<u8>>> {
    let mut read = |buffer: gltf::Buffer<'_>| {
        let length = buffer.length();
        let bytes = match buffer.source() {
            Source::Bin => blob.take().context("the file has no binary part")?,
            Source::Uri(uri) => match uri.strip_prefix("data:") {
                Some(data) => {
                    let (_, text) =
                        data.split_once(";base64,").context("its text is not base64")?;
                    base64::prelude::BASE64_STANDARD
                        .decode(text)
                        .context("its text is not base64")?
                }
                None if uri.contains(':') => {
                    bail!(
                        "`{uri}` is an address: put that file beside this one, and name it in place of the address"
                    )
                }
                None => {
                    let path =
                        folder.join(&*urlencoding::decode(uri).context("its name is not text")?);
                    let cannot = || format!("cannot read `{}`", path.display());
                    let mut bytes = Vec::new();
                    // No more than the buffer needs: the file may be larger than memory.
                    let file = file::open(&path).with_context(cannot)?;
                    file.take(length as u64).read_to_end(&mut bytes).with_context(cannot)?;
                    bytes
                }
            },
        };
        let there = bytes.len();
        ensure!(there >= length, "it has {there} bytes of {length}");
        Ok(bytes)
    };
    let buffers = document.buffers();
    buffers
        .map(|buffer| {
            let index = buffer.index();
            read(buffer).with_context(|| format!("buffer {index}"))
        })
        .collect()
}

/// Returns true for primitives of triangles, false for points and lines.
const fn has_triangles(mode: Mode) -> bool {
    matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)
}

/// Returns the triangles of a primitive, or `None` if it has points or lines.
fn triangles(primitive: &Primitive<'_>, buffers: &[Vec<u8>]) -> Result<Option<Mesh>> {
    let mode = primitive.mode();
    if !has_triangles(mode) {
        return Ok(None);
    }
    let accessor = primitive.get(&Semantic::Positions).context("it has no positions")?;
    if accessor.count() == 0 {
        return Ok(Some(Mesh::default()));
    }
    ensure!(accessor.dimensions() == Dimensions::Vec3, "its positions are not three numbers each");
    ensure!(is_inside(&accessor, buffers), "its positions are outside their buffer");
    check_sparse(&accessor, buffers)?;
    let reader = primitive.reader(|buffer| buffers.get(buffer.index()).map(|bytes| &**bytes));
    let positions = positions(&accessor, buffers)?;
    let corners: Vec<u32> = match primitive.indices() {
        None => (0..u32::try_from(positions.len())?).collect(),
        Some(indices) => {
            let kind = (indices.data_type(), indices.dimensions());
            ensure!(
                matches!(kind, (DataType::U8 | DataType::U16 | DataType::U32, Dimensions::Scalar)),
                "its indices are not unsigned whole numbers"
            );
            ensure!(indices.count() > 0, "it has no indices");
            let outside = "its indices are outside their buffer";
            ensure!(is_inside(&indices, buffers), outside);
            check_sparse(&indices, buffers)?;
            reader.read_indices().context(outside)?.into_u32().collect()
        }
    };
    if let Some(corner) = corners.iter().find(|&&corner| corner as usize >= positions.len()) {
        bail!("there is no vertex {corner}, it has {}", positions.len());
    }
    let indices = match mode {
        Mode::TriangleStrip => {
            let turned = |(at, c): (usize, &[u32])| match at % 2 {
                0 => [c[0], c[1], c[2]],
                _ => [c[1], c[0], c[2]],
            };
            corners.windows(3).enumerate().map(turned).collect()
        }
        Mode::TriangleFan => {
            let rest = corners.get(1..).unwrap_or_default();
            rest.windows(2).map(|side| [corners[0], side[0], side[1]]).collect()
        }
        _ => corners.as_chunks::<3>().0.to_vec(),
    };
    Ok(Some(Mesh { positions, indices }))
}

/// Walks the nodes of the default scene, or of the first one; without scenes, all nodes.
fn instances(document: &Document, places: &[Range<usize>]) -> Result<Vec<(usize, Transform)>> {
    let scene = document.default_scene().or_else(|| document.scenes().next());
    let roots: Vec<_> = if let Some(scene) = scene {
        scene.nodes().collect()
    } else {
        let mut is_child = vec![false; document.nodes().len()];
        for child in document.nodes().flat_map(|node| node.children()) {
            is_child[child.index()] = true;
        }
        document.nodes().filter(|node| !is_child[node.index()]).collect()
    };
    let mut instances = Vec::new();
    let mut is_seen = vec![false; document.nodes().len()];
    let mut waiting: Vec<_> = roots.into_iter().map(|node| (node, wide(&IDENTITY))).collect();
    waiting.reverse();
    while let Some((node, parent)) = waiting.pop() {
        let index = node.index();
        ensure!(!is_seen[index], "node {index} has two parents, or is below itself");
        is_seen[index] = true;
        let world = product(&parent, &rows(node.transform().matrix()));
        if let Some(place) = node.mesh().and_then(|mesh| places.get(mesh.index())) {
            instances.extend(place.clone().map(|mesh| (mesh, world.map(narrow))));
        }
        let children: Vec<_> = node.children().map(|child| (child, world)).collect();
        waiting.extend(children.into_iter().rev());
    }
    Ok(instances)
}

fn narrow([x, y, z, offset]: [f64; 4]) -> [f32; 4] {
    let ([x, y, z], [offset, ..]) = (round([x, y, z]), round([offset, 0.0, 0.0]));
    [x, y, z, offset]
}

fn wide(transform: &Transform) -> Matrix {
    transform.map(|row| row.map(f64::from))
}

/// Returns the rows of a matrix, which glTF stores as four columns.
fn rows(columns: [[f32; 4]; 4]) -> Matrix {
    [0, 1, 2].map(|row| columns.map(|column| f64::from(column[row])))
}

/// Returns the transform that applies `b` and then `a`.
fn product(a: &Matrix, b: &Matrix) -> Matrix {
    a.map(|row| {
        let column = |at: usize| row[0] * b[0][at] + row[1] * b[1][at] + row[2] * b[2][at];
        [column(0), column(1), column(2), column(3) + row[3]]
    })
}

#[cfg(test)]
mod tests {
    use base64::prelude::BASE64_STANDARD;

    use super::*;

    /// Returns a file that shows a mesh twice: in place, and mirrored and moved below a parent. The mesh has
    /// a triangle, a strip of two and points.
    fn json(buffer: &str) -> String {
        format!(
            r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0, 1]}}],
            "nodes": [
                {{"mesh": 0}},
                {{"translation": [10, 0, 0], "rotation": [0, 0, 1, 0], "children": [2]}},
                {{"mesh": 0, "scale": [1, 2, -1], "translation": [1, 0, 0]}},
                {{"mesh": 0}}],
            "meshes": [{{"primitives": [
                {{"attributes": {{"POSITION": 0}}, "indices": 1}},
                {{"attributes": {{"POSITION": 0}}, "mode": 5}},
                {{"attributes": {{"POSITION": 0}}, "mode": 0}}]}}],
            "buffers": [{{"byteLength": 54, {buffer}}}],
            "bufferViews": [{{"buffer": 0, "byteLength": 48}},
                {{"buffer": 0, "byteOffset": 48, "byteLength": 6}}],
            "accessors": [
                {{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 4,
                  "min": [0, 0, 0], "max": [1, 1, 0]}},
                {{"bufferView": 1, "componentType": 5123, "type": "SCALAR", "count": 3}}]}}"#
        )
    }

    fn bytes() -> Vec<u8> {
        let corners = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
        let floats = corners.as_flattened().iter().flat_map(|c| c.to_le_bytes());
        floats.chain([2u16, 0, 1].into_iter().flat_map(u16::to_le_bytes)).collect()
    }

    pub(super) fn as_text() -> String {
        let text = BASE64_STANDARD.encode(bytes());
        json(&format!(r#""uri": "data:application/octet-stream;base64,{text}""#))
    }

    pub(super) fn read_text(text: &str) -> Result<Model> {
        read(text.as_bytes(), Path::new("no/such/scene.gltf"))
    }

    #[test]
    fn meshes_stand_where_their_nodes_put_them() {
        let model = read_text(&as_text()).unwrap();
        let [one, strip] = &*model.meshes else { panic!("{:?}", model.meshes) };
        assert_eq!(one.indices, [[2, 0, 1]]);
        assert_eq!(strip.indices, [[0, 1, 2], [2, 1, 3]]);
        let numbers: Vec<_> = model.instances.iter().map(|&(mesh, _)| mesh).collect();
        assert_eq!(numbers, [0, 1, 0, 1]);
        assert_eq!(model.instances[1].1, IDENTITY);
        // Half a turn about z negates x and y, after the child's own transform.
        let mesh = model.flatten().unwrap();
        assert_eq!(
            mesh.positions[8..12],
            [[9., 0., 0.], [8., 0., 0.], [9., -2., 0.], [8., -2., 0.]]
        );
        assert_eq!(mesh.indices[3], [10, 9, 8]);
    }

    #[test]
    fn binary_files_have_their_buffer_in_them() {
        let mut json = json(r#""extras": 1"#).into_bytes();
        json.resize(json.len().next_multiple_of(4), b' ');
        let mut bin = bytes();
        bin.resize(bin.len().next_multiple_of(4), 0);
        let length = |bytes: &[u8]| u32::try_from(bytes.len()).unwrap().to_le_bytes();
        let all = u32::try_from(28 + json.len() + bin.len()).unwrap().to_le_bytes();
        let file = [
            &b"glTF\x02\0\0\0"[..],
            &all,
            &length(&json),
            b"JSON",
            &json,
            &length(&bin),
            b"BIN\0",
            &bin,
        ];
        let model = read(&file.concat(), Path::new("scene.glb")).unwrap();
        assert_eq!(model, read_text(&as_text()).unwrap());
        let file = file.concat();
        let (cut, length) = (&file[..file.len() - 9], file.len());
        let message = read(cut, Path::new("scene.glb")).unwrap_err().to_string();
        assert_eq!(message, format!("it is cut off: it has {} bytes of {length}", length - 9));
        let message =
            read(b"glTF\x02\0\0\0\x0b\0\0\0", Path::new("a.glb")).unwrap_err().to_string();
        assert!(message.ends_with("its header takes more than its 11 bytes"), "{message}");
    }

    /// Sparse accessors replace single vertices of others, or of zeros.
    #[test]
    fn sparse_vertices_are_read_where_there_are_as_many() {
        let file = |view: &str, vertices: &str, count: u32| {
            let views = r#"{"buffer": 0, "byteOffset": 48, "byteLength": 6}"#;
            let more = format!(
                r#"{views}, {{"buffer": 0, "byteOffset": 48, "byteLength": 2}},
                {{"buffer": 0, "byteOffset": 12, "byteLength": 12}}"#
            );
            let sparse = format!(
                r#""sparse": {{"count": {count}, "indices": {{"bufferView": 2, "componentType": 5123}},
                "values": {{"bufferView": 3}}}}, "min""#
            );
            let text = as_text().replacen(views, &more, 1).replacen(r#""min""#, &sparse, 1);
            let text = text.replacen(r#""bufferView": 0, "#, view, 1);
            read_text(&text.replacen(r#""count": 4"#, &format!(r#""count": {vertices}"#), 1))
        };
        let base = r#""bufferView": 0, "#;
        let corners = |model: Model| model.meshes[0].positions.clone();
        let read = corners(file(base, "4", 1).unwrap());
        assert_eq!(read, [[0., 0., 0.], [1., 0., 0.], [1., 0., 0.], [1., 1., 0.]]);
        assert_eq!(corners(file("", "3", 1).unwrap()), [[0.; 3], [0.; 3], [1., 0., 0.]]);
        // The index of the replaced vertex is 2.
        let message = format!("{:#}", file("", "2", 1).unwrap_err());
        assert!(message.ends_with("sparse accessor replaces element 2, and it has 2"), "{message}");
        for (view, vertices, count) in [
            (base, "4", 0),
            (base, "4", 2),
            ("", "4611686018427387904", 1),
            ("", "18446744073709551615", 1),
        ] {
            let message = format!("{:#}", file(view, vertices, count).unwrap_err());
            assert!(message.ends_with("its positions are outside their buffer"), "{message}");
        }
    }

    /// Only the bytes of a buffer are read from the file that it names, and only from a file.
    #[test]
    fn buffers_are_read_as_far_as_they_go() {
        let folder = std::env::temp_dir().join(format!("hgrid-gltf-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let path = folder.join("scene.gltf");
        let of = |name: &str| read(json(&format!(r#""uri": "{name}""#)).as_bytes(), &path);
        fs::write(folder.join("long.bin"), [bytes(), vec![7; 99]].concat()).unwrap();
        assert_eq!(of("long.bin").unwrap(), read_text(&as_text()).unwrap());
        let (document, _) = parse(json(r#""uri": "long.bin""#).as_bytes()).unwrap();
        assert_eq!(buffers(&document, None, &folder).unwrap(), [bytes()]);
        let message = format!("{:#}", of("..").unwrap_err());
        assert!(message.ends_with("it is a folder: name a file in it"), "{message}");
        if cfg!(unix) {
            let message = format!("{:#}", of("/dev/zero").unwrap_err());
            assert!(message.contains("it is a pipe or a device"), "{message}");
        }
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn whole_numbers_are_positions() {
        let quantized = |bytes: &[u8], kind: &str, stride: usize| {
            let data = BASE64_STANDARD.encode(bytes);
            read_text(&format!(
                r#"{{"asset": {{"version": "2.0"}}, "extensionsRequired": ["KHR_mesh_quantization"],
                "extensionsUsed": ["KHR_mesh_quantization"],
                "nodes": [{{"mesh": 0, "scale": [2, 2, 2], "translation": [1, 0, 0]}}],
                "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}}}]}}],
                "buffers": [{{"byteLength": {0}, "uri": "data:;base64,{data}"}}],
                "bufferViews": [{{"buffer": 0, "byteLength": {0}, "byteStride": {stride}}}],
                "accessors": [{{"bufferView": 0, "componentType": {kind}, "type": "VEC3", "count": 3,
                    "min": [0, 0, 0], "max": [1, 1, 1]}}]}}"#,
                bytes.len()
            ))
        };
        let small = [0, 0, 0, 0, 127, 0, 0, 0, 0, 255, 128, 0];
        let wide = [-32_768, 0, 0, 0, 32_767, 0, 0, 0, 0, -300, 0, 0];
        let wide: Vec<u8> = wide.into_iter().flat_map(i16::to_le_bytes).collect();
        let normalized = |kind: &str| format!(r#"{kind}, "normalized": true"#);
        for (kind, [x, y, z]) in [
            ("5120".to_owned(), [127.0, -1.0, -128.0]),
            (normalized("5120"), [1.0, -1.0 / 127.0, -1.0]),
            ("5121".to_owned(), [127.0, 255.0, 128.0]),
            (normalized("5121"), [127.0 / 255.0, 1.0, 128.0 / 255.0]),
        ] {
            let model = quantized(&small, &kind, 4).unwrap();
            assert_eq!(model.meshes[0].positions, [[0.0; 3], [x, 0.0, 0.0], [0.0, y, z]], "{kind}");
            let moved = [[1.0, 0.0, 0.0], [2.0 * x + 1.0, 0.0, 0.0], [1.0, 2.0 * y, 2.0 * z]];
            assert_eq!(model.flatten().unwrap().positions, moved, "{kind}");
        }
        for (kind, [x, y, z]) in [
            ("5122".to_owned(), [-32_768.0, 32_767.0, -300.0]),
            (normalized("5122"), [-1.0, 1.0, -300.0 / 32_767.0]),
            ("5123".to_owned(), [32_768.0, 32_767.0, 65_236.0]),
            (normalized("5123"), [32_768.0 / 65_535.0, 32_767.0 / 65_535.0, 65_236.0 / 65_535.0]),
        ] {
            let model = quantized(&wide, &kind, 8).unwrap();
            let expected = [[x, 0.0, 0.0], [y, 0.0, 0.0], [0.0, z, 0.0]];
            assert_eq!(model.meshes[0].positions, expected, "{kind}");
        }
        let message = format!("{:#}", quantized(&[0; 36], "5125", 12).unwrap_err());
        assert!(message.contains("neither floats nor of 8 or 16 bits"), "{message}");
    }

    #[test]
    fn damage_is_reported() {
        let text = as_text();
        for (from, to, expected) in [
            ("data:application", "mesh.bin?", "buffer 0: cannot read `no/such/mesh.bin"),
            ("data:", "https:", "is an address: put that file beside this one"),
            (";base64,", ";base64,!", "buffer 0: its text is not base64"),
            (r#""byteLength": 54"#, r#""byteLength": 99"#, "buffer 0: it has 54 bytes of 99"),
            (
                r#""count": 4"#,
                r#""count": 2"#,
                "mesh 0, primitive 0: there is no vertex 2, it has 2",
            ),
            (r#""count": 4"#, r#""count": 5"#, "mesh 0, primitive 0: its positions are outside"),
            (r#""count": 4"#, r#""count": 4611686018427387904"#, "its positions are outside"),
            (
                r#""count": 4,"#,
                r#""count": 4, "byteOffset": 18446744073709551608,"#,
                "positions are",
            ),
            (
                r#""byteLength": 48"#,
                r#""byteLength": 48, "byteStride": 8"#,
                "positions are outside",
            ),
            (
                r#""byteLength": 48"#,
                r#""byteLength": 18446744073709551615"#,
                "positions are outside",
            ),
            (r#""byteOffset": 48"#, r#""byteOffset": 18446744073709551614"#, "indices are outside"),
            ("5123", "5126", "mesh 0, primitive 0: its indices are not unsigned whole numbers"),
            ("5123", "5122", "its indices are not unsigned whole numbers"),
            (r#""SCALAR", "count": 3"#, r#""VEC3", "count": 1"#, "are not unsigned whole numbers"),
            (r#""children": [2]"#, r#""children": [0]"#, "two parents"),
            (
                r#""asset""#,
                r#""extensionsRequired": ["KHR_draco_mesh_compression"], "asset""#,
                "requires the extension KHR_draco_mesh_compression, which hgrid does not read",
            ),
            (
                r#""mesh": 0"#,
                r#""mesh": 8"#,
                "hgrid does not read: nodes[0].mesh: Index out of bounds",
            ),
            (
                r#""2.0""#,
                r#""1.0""#,
                "it is of glTF 1.0, and hgrid reads glTF 2: export it as that",
            ),
            (r#""2.0""#, r#""2.0", "minVersion": "3.0""#, "it is of glTF 3.0"),
            (r#""2.0"}, "scene": 0"#, r#""1.0"}, "scene": "a""#, "it is of glTF 1.0"),
            (r#""POSITION": 0"#, r#""POSITION": 2"#, "a mesh names an accessor that is not there"),
            ("{", "[", "it is not valid glTF, or of a kind that hgrid does not read: "),
        ] {
            let message = format!("{:#}", read_text(&text.replacen(from, to, 1)).unwrap_err());
            assert!(message.contains(expected), "{message}");
        }
    }
}
