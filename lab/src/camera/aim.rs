//! The views that `--view` accepts: a side of any scene, or a named view of one scene.

use core::str::FromStr;

use anyhow::{Error, Result, anyhow};

use super::{Camera, Lens, Up, View, named};
use crate::scene::Scene;

/// A view as the command line gives it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Aim {
    /// All of a scene from a side.
    Side(View),
    /// The view of a scene that has this name.
    Named(&'static str),
}

impl Aim {
    /// Returns the camera for a scene.
    ///
    /// # Errors
    /// If the scene has no view of that name.
    pub fn camera(self, scene: &Scene, up: Up, lens: Lens) -> Result<Camera> {
        match self {
            Self::Side(view) => Ok(Camera::framing_through(lens, scene.framed_bounds(), view, up)),
            Self::Named(name) => named::camera(scene, name, up, lens),
        }
    }
}

impl FromStr for Aim {
    type Err = Error;

    fn from_str(word: &str) -> Result<Self> {
        match named::name(word) {
            Some(name) => Ok(Self::Named(name)),
            None => word.parse().map(Self::Side).map_err(|error: Error| {
                if word.contains(',') {
                    return error;
                }
                anyhow!("{error}; some scenes have named views, too, which --help lists")
            }),
        }
    }
}
