//! The parts of a glTF file that this reader ignores, in words.

use gltf::Document;

use super::has_triangles;
use crate::plural::{counted, noun};

/// The first words of extensions that change materials, textures and lights, and leave triangles alone.
const LOOKS: [&str; 6] = [
    "KHR_materials_",
    "KHR_texture_",
    "KHR_lights_",
    "EXT_texture_",
    "EXT_lights_",
    "MSFT_texture_",
];

/// The extension of positions that are whole numbers of 8 or 16 bits.
const QUANTIZED: &str = "KHR_mesh_quantization";

/// Counts what the file has and this reader ignores, in words: points and lines, animations, skins, morph targets,
/// cameras and extensions.
pub(super) fn hidden(document: &Document) -> Vec<String> {
    let has_targets =
        |mesh: &gltf::Mesh<'_>| mesh.primitives().any(|part| part.morph_targets().len() > 0);
    let targets = document.meshes().filter(has_targets).count();
    let parts = document.meshes().flat_map(|mesh| mesh.primitives());
    let without_triangles = parts.filter(|part| !has_triangles(part.mode())).count();
    [
        (without_triangles, "primitive of points or lines", "primitives of points or lines"),
        (document.animations().len(), "animation", "animations"),
        (document.skins().len(), "skin", "skins"),
        (targets, "mesh with morph targets", "meshes with morph targets"),
        (document.cameras().len(), "camera", "cameras"),
    ]
    .into_iter()
    .filter(|&(count, ..)| count > 0)
    .map(|(count, one, many)| counted(count, one, many))
    .chain(of_extensions(document))
    .collect()
}

/// Names the extensions that may add to what is shown, and are neither read nor required.
fn of_extensions(document: &Document) -> Option<String> {
    let unknown: Vec<_> = document.extensions_used().filter(|name| !is_known(name)).collect();
    let extensions = noun(unknown.len(), "extension", "extensions");
    (!unknown.is_empty()).then(|| format!("what the {extensions} {} may add", unknown.join(", ")))
}

/// Returns true for an extension that is read, or changes only how surfaces look.
pub(super) fn is_known(extension: &str) -> bool {
    extension == QUANTIZED || LOOKS.iter().any(|start| extension.starts_with(start))
}

#[cfg(test)]
mod tests {
    use super::super::tests::{as_text, read_text};

    #[test]
    fn extensions_that_are_not_read_are_told_of() {
        let used =
            r#""extensionsUsed": ["KHR_materials_unlit", "EXT_mesh_gpu_instancing"], "asset""#;
        let text = as_text().replacen(r#""mode": 0"#, r#""mode": 4"#, 1);
        let hidden = read_text(&text.replacen(r#""asset""#, used, 1)).unwrap().hidden;
        assert_eq!(hidden, ["what the extension EXT_mesh_gpu_instancing may add"]);
        let model = read_text(&format!("\u{feff}{text}")).unwrap();
        assert!(model.hidden.is_empty());
    }

    #[test]
    fn extensions_for_looks_are_no_hindrance() {
        let names =
            r#""extensionsRequired": ["KHR_materials_unlit", "KHR_texture_basisu"], "asset""#;
        let texture = r#""textures": [{"extensions": {"KHR_texture_basisu": {"source": 0}}}], "#;
        let text = as_text().replacen(r#""asset""#, &[texture, names].concat(), 1);
        assert_eq!(read_text(&text).unwrap(), read_text(&as_text()).unwrap());
    }

    #[test]
    fn what_is_not_shown_is_told() {
        let target = r#""targets": [{"POSITION": 0}], "attributes""#;
        let text = as_text().replacen(r#""attributes""#, target, 1);
        let more = r#""animations": [{"channels": [], "samplers": []}, {"channels": [], "samplers": []}],
            "skins": [{"joints": [0]}],
            "cameras": [{"type": "perspective", "perspective": {"yfov": 1, "znear": 1}}], "asset""#;
        let model = read_text(&text.replacen(r#""asset""#, more, 1)).unwrap();
        let expected = "1 primitive of points or lines, 2 animations, 1 skin, 1 mesh with morph targets, 1 camera";
        assert_eq!(model.hidden_in("a.glb"), [format!("a.glb: not shown: {expected}")]);
        let all_shown = as_text().replacen(r#""mode": 0"#, r#""mode": 4"#, 1);
        assert!(read_text(&all_shown).unwrap().hidden_in("a.glb").is_empty());
    }
}
