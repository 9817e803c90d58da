//! The content of a scene: a mesh, instances of it, or spheres in place of its triangles.

use serde::ser::SerializeStruct as _;
use serde::{Serialize, Serializer};

/// The things that the systems build over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shown {
    /// The triangles of the mesh as it is.
    Mesh,
    /// So many instances of the mesh on a field.
    Instances(u32),
    /// A sphere in place of each triangle.
    Spheres,
}

impl Shown {
    /// Returns the content for two options; 0 instances mean the mesh itself.
    #[must_use]
    pub const fn of(instances: u32, is_of_spheres: bool) -> Self {
        match instances {
            _ if is_of_spheres => Self::Spheres,
            0 => Self::Mesh,
            instances => Self::Instances(instances),
        }
    }

    /// Returns the number of instances; 0 if the content is not instances.
    #[must_use]
    pub const fn instances(self) -> u32 {
        match self {
            Self::Instances(count) => count,
            Self::Mesh | Self::Spheres => 0,
        }
    }

    /// Returns the number of items that a structure is built over, for a mesh of so many triangles.
    #[must_use]
    pub const fn items(self, triangles: u64) -> u64 {
        match self {
            Self::Mesh | Self::Spheres => triangles,
            Self::Instances(count) => count as u64,
        }
    }

    /// Returns the word for one item.
    #[must_use]
    pub const fn item(self) -> &'static str {
        match self {
            Self::Mesh => "triangle",
            Self::Instances(_) => "instance",
            Self::Spheres => "sphere",
        }
    }

    /// Returns its short form for the heads of columns.
    #[must_use]
    pub const fn short_item(self) -> &'static str {
        match self {
            Self::Mesh => "tri",
            Self::Instances(_) => "inst",
            Self::Spheres => "sph",
        }
    }

    /// Returns the command's option for it, and the word for many items; none for the mesh.
    #[must_use]
    pub const fn option(self) -> Option<(&'static str, &'static str)> {
        match self {
            Self::Mesh => None,
            Self::Instances(_) => Some(("--instances", "instances")),
            Self::Spheres => Some(("--spheres", "spheres")),
        }
    }

    /// Returns the words of the command line for it.
    #[must_use]
    pub fn words(self) -> Vec<String> {
        match self {
            Self::Mesh => Vec::new(),
            Self::Instances(count) => vec!["--instances".to_owned(), count.to_string()],
            Self::Spheres => vec!["--spheres".to_owned()],
        }
    }
}

/// Writes two fields of results: `instances`, 0 without instances, and `spheres`.
impl Serialize for Shown {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut fields = serializer.serialize_struct("Shown", 2)?;
        fields.serialize_field("instances", &self.instances())?;
        fields.serialize_field("spheres", &(*self == Self::Spheres))?;
        fields.end()
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser as _;

    use super::*;
    use crate::cli::FirstBuildArgs;

    #[test]
    fn options_say_what_is_shown_and_results_keep_it() {
        for (options, shown, items, json) in [
            ((0, false), Shown::Mesh, 70, r#"{"instances":0,"spheres":false}"#),
            ((9, false), Shown::Instances(9), 9, r#"{"instances":9,"spheres":false}"#),
            ((0, true), Shown::Spheres, 70, r#"{"instances":0,"spheres":true}"#),
        ] {
            assert_eq!((Shown::of(options.0, options.1), shown.items(70)), (shown, items));
            assert_eq!(serde_json::to_string(&shown).unwrap(), json);
            let words = ["hgrid", "a.ply", "bvh"].map(str::to_owned).into_iter();
            let args = FirstBuildArgs::parse_from(words.chain(shown.words()));
            assert_eq!(args.shown(), shown);
        }
    }
}
