//! The numbers of a picture: as lines for people and as JSON for programs.

use core::fmt;

use indicatif::HumanCount;
use serde::Serialize;

use crate::measure::{SceneFacts, ratio};
use crate::notices::left_out;
use crate::plural::{counted, triangles};

/// A picture, and the time and work that it took.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// The scene.
    #[serde(flatten)]
    pub scene: SceneFacts,
    /// Geometries: the meshes of `A+B`, each in its own colour; 1 for any other scene.
    pub geometries: usize,
    /// Instances that show its meshes; 0 for a mesh without instances.
    pub instances: usize,
    /// The time of reading or generating the scene.
    pub load_seconds: f64,
    /// The structure.
    pub method: &'static str,
    /// Threads that built, if the method is built in parallel, and rendered.
    pub threads: u32,
    /// The time of computing the sizes, allocating and building.
    pub build_seconds: f64,
    /// Bytes of the grid, or of the grids and the scene of instances, without meshes.
    pub index_bytes: usize,
    /// Triangles without finite coordinates, which the grid leaves out.
    pub skipped_triangles: u64,
    /// Pixels on each side of the picture.
    pub size: u16,
    /// Rays from the eye through each pixel.
    pub samples: u16,
    /// True if the lamp casts shadows.
    pub shadows: bool,
    /// Rays of ambient occlusion from each sample.
    pub ao: u16,
    /// Rays from the eye, to the lamp and to the sky.
    pub rays: u64,
    /// Rays from the eye that hit something.
    pub hits: u64,
    /// The time of tracing and shading every pixel.
    pub render_seconds: f64,
    /// The work of rays from the eye, if it was counted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub work: Option<Work>,
}

/// The work of rays from the eye.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Work {
    /// Triangles tested for each ray.
    pub primitive_tests_per_ray: f64,
    /// Cells or leaves entered for each ray.
    pub cell_steps_per_ray: f64,
    /// Subgrids, levels or nodes entered for each ray.
    pub grid_steps_per_ray: f64,
    /// The most tests and steps that one ray took.
    pub largest_ray_cost: u64,
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { scene, method, threads, size, samples, .. } = self;
        let (triangles, vertices) =
            (triangles(scene.triangles), counted(scene.vertices, "vertex", "vertices"));
        let loaded = duration(self.load_seconds);
        write!(f, "{}: {triangles}, {vertices}", scene.scene)?;
        match self.geometries {
            1 => {}
            geometries => write!(f, " in {geometries} geometries")?,
        }
        match self.instances {
            0 => {}
            instances => write!(f, " in {} instances", HumanCount(instances as u64))?,
        }
        writeln!(f, ", loaded in {loaded}")?;

        let threads = counted(*threads, "thread", "threads");
        let bytes = HumanCount(self.index_bytes as u64);
        let each = ratio(self.index_bytes as u64, scene.triangles as u64);
        let built = duration(self.build_seconds);
        write!(f, "{method}: built in {built}, {bytes} bytes, {each:.1} a triangle")?;
        match left_out(self.skipped_triangles) {
            None => writeln!(f)?,
            Some(left_out) => writeln!(f, "; {left_out}")?,
        }

        write!(f, "picture: {size} x {size} pixels")?;
        match samples {
            1 => {}
            samples => write!(f, ", {samples} samples each")?,
        }
        match (self.shadows, self.ao) {
            (true, 0) => f.write_str(", shadows")?,
            (true, _) => f.write_str(", shadows and ambient occlusion")?,
            (false, 0) => {}
            (false, _) => f.write_str(", ambient occlusion")?,
        }
        let (rays, rendered) = (counted(self.rays, "ray", "rays"), duration(self.render_seconds));
        write!(f, "; {rays} in {rendered} on {threads}")?;
        if let Some(Work {
            primitive_tests_per_ray: tests,
            cell_steps_per_ray: cells,
            grid_steps_per_ray: grids,
            largest_ray_cost: most,
        }) = self.work
        {
            write!(
                f,
                "\nwork of a ray: {tests:.2} primitive tests, {cells:.2} cell steps, {grids:.2} grid \
                 steps; {} at most",
                HumanCount(most)
            )?;
        }
        Ok(())
    }
}

/// Formats a time with three significant digits.
pub(crate) fn duration(seconds: f64) -> String {
    match seconds {
        s if s >= 100.0 => format!("{s:.0} s"),
        s if s >= 10.0 => format!("{s:.1} s"),
        s if s >= 1.0 => format!("{s:.2} s"),
        s if s >= 0.1 => format!("{:.0} ms", s * 1e3),
        s if s >= 0.01 => format!("{:.1} ms", s * 1e3),
        s => format!("{:.2} ms", s * 1e3),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_read_well() {
        let times = [123.4, 12.34, 1.234, 0.1234, 0.012_34, 0.000_123].map(duration);
        assert_eq!(times, ["123 s", "12.3 s", "1.23 s", "123 ms", "12.3 ms", "0.12 ms"]);
    }
}
