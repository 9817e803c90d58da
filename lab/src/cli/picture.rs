//! The arguments for the size of a picture and its camera.

use anyhow::{Result, ensure};
use clap::Args;

use super::values::whole;
use crate::camera::{Aim, Camera, Lens, Point, Up, View, viewpoint};
use crate::scene::Scene;
use crate::tiles::Tiles;
use crate::world::World;

/// The size of a picture, and its camera.
#[derive(Debug, Clone, Copy, Args)]
pub struct Picture {
    /// Pixels on each side, 1 to 16384
    #[arg(long, value_name = "PIXELS", allow_negative_numbers = true, default_value_t = 1024,
          value_parser = whole(1..=16_384_u16))]
    pub size: u16,
    /// From which side to look, or a named view of the scene
    #[arg(long, allow_hyphen_values = true)]
    pub view: Option<Aim>,
    /// Look from this point instead, as X,Y,Z
    #[arg(long, value_name = "X,Y,Z", conflicts_with = "view", allow_hyphen_values = true)]
    pub eye: Option<Point>,
    /// Look at this point [default: the middle of the scene]
    #[arg(
        long,
        value_name = "X,Y,Z",
        requires = "eye",
        conflicts_with = "view",
        allow_hyphen_values = true
    )]
    pub target: Option<Point>,
    /// Degrees that the picture covers, from edge to edge, 1 to 120 [default: 40; 70 if `render` chooses a place in a
    /// room]
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true)]
    pub fov: Option<Lens>,
    /// Which axis of the scene is up [default: y, or z for STL and what lies flat on x and y]
    #[arg(long, value_enum)]
    pub up: Option<Up>,
}

impl Picture {
    /// Refuses a camera without a direction.
    ///
    /// # Errors
    /// If it has none.
    pub fn check(&self) -> Result<()> {
        ensure!(
            self.eye.is_none() || self.eye != self.target,
            "--eye and --target are the same point: there is no direction to look in"
        );
        Ok(())
    }

    /// Returns the picture of a scene for measurements; by default it shows all of the scene.
    ///
    /// # Errors
    /// If the scene has no view of that name, or the eye is where it looks.
    pub fn tiles(&self, scene: &Scene) -> Result<Tiles> {
        let (up, lens) = (self.up(scene), self.fov.unwrap_or_default());
        let bounds = scene.framed_bounds();
        let usual = || Camera::framing_through(lens, bounds, View::of(bounds, up), up);
        let camera = self.asked(scene)?.unwrap_or_else(usual);
        Ok(Tiles { camera, size: self.size })
    }

    /// Returns the picture of a scene for viewers; by default the camera stands at the best viewpoint.
    ///
    /// # Errors
    /// Those of [`tiles`](Self::tiles).
    pub fn shot(&self, scene: &Scene, world: World<'_>) -> Result<Tiles> {
        let (part, is_all) = (scene.framed_bounds(), scene.focus.is_none());
        let best = || viewpoint::choose(world, part, is_all, self.up(scene), self.fov);
        let camera = self.asked(scene)?.unwrap_or_else(best);
        Ok(Tiles { camera, size: self.size })
    }

    /// The axis that is up.
    #[must_use]
    pub fn up(&self, scene: &Scene) -> Up {
        self.up.unwrap_or_else(|| Up::of(scene))
    }

    /// Returns the camera of the arguments; none if they name none.
    fn asked(&self, scene: &Scene) -> Result<Option<Camera>> {
        let (up, lens) = (self.up(scene), self.fov.unwrap_or_default());
        if let Some(eye) = self.eye {
            let target = self.target.unwrap_or(Point::centre_of(scene.framed_bounds()));
            ensure!(
                eye != target,
                "--eye is in the middle of the scene, to which it looks: add --target X,Y,Z"
            );
            return Ok(Some(Camera::between(eye, target, up, lens)));
        }
        self.view.map(|aim| aim.camera(scene, up, lens)).transpose()
    }
}
