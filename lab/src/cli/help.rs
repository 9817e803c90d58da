//! The help texts of the command: examples, scenes and views.

use crate::camera::named;

pub(super) const EXAMPLES: &str = "\
Examples:
  hgrid                                      the built-in scene, to hgrid.png
  hgrid bunny.ply                            a mesh of yours, to hgrid.png; the same as hgrid render
  hgrid bunny.ply --shading heat             what each ray costs, from blue to red
  hgrid info bunny.ply                       what is in a file
  hgrid pack bunny.ply -o bunny.hgrid        grid and mesh in one file that programs map and trace
  hgrid validate bunny.hgrid                 proves that its answers are right
  hgrid table bunny.ply dragon.ply           all methods side by side, as in the paper
  hgrid figures buddha.ply -o pictures       the paper's charts, as SVG and PNG
  hgrid animate bunny.ply --threads 4        a moving mesh, built again for every frame
  hgrid compare bunny.ply dragon.ply         hgrid and other ray tracers, over the same rays
  hgrid help render                          all about one command";

pub(super) const RENDER_EXAMPLES: &str = "\
Examples:
  hgrid bunny.ply -o bunny.png               with shadows and ambient occlusion, on all cores
  hgrid bunny.ply --samples 64 --ao 2        smooth, in a few times as long
  hgrid bunny.ply --samples 1 --ao 0 --no-shadows       as fast as it gets
  hgrid bunny.ply+stadium.ply                the first in the middle of the second
  hgrid render stadium.ply --view 40,15      from the front right, a little above
  hgrid render sponza.ply --eye 0,3,0 --target 10,3,0 --fov 60
  hgrid render bunny.ply --quality high      a longer build, most rays are faster
  hgrid render bunny.ply --method fixed --macrocell-factor 4
  hgrid render bunny.ply --shading heat --counter primitive-tests --heat-top 50
  hgrid render bunny.ply --json              the numbers, for programs

Without a view, the camera stands in front of things, above flat scenes and within rooms, and sees three sides of a box.
A face of more than three corners becomes a fan of triangles around the first one, as if it were convex.
A mesh that a glTF file shows more than once is built once and shown by instances. It becomes triangles with
--shading heat or normals, with methods other than bvh, and if an instance flattens it.";

pub(super) const INFO_EXAMPLES: &str = "\
Examples:
  hgrid info bunny.ply                       triangles, size, what is wrong with it
  hgrid info scene.glb                       meshes and instances, too
  hgrid info bunny.hgrid                     the grid and its mesh
  hgrid info bunny.hgrid --json              the same, for programs";

pub(super) const PACK_EXAMPLES: &str = "\
Examples:
  hgrid pack bunny.ply -o bunny.hgrid
  hgrid pack bunny.ply -o bunny.hgrid --quality high       for scenes that are traced for long
  hgrid pack bunny.ply -o bunny.c --c-array bunny          to compile into a program, for flash
  hgrid pack bunny.ply -o bunny.hgrid --method one-level

Programs open it by hgrid_open without a mesh, or Grid::open_packed, at a multiple of 64 bytes and
on machines of the same byte order. Instances of a glTF file are written as triangles. To store
instances, call hgrid_pack_scene.";

pub(super) const VALIDATE_EXAMPLES: &str = "\
Examples:
  hgrid validate bunny.hgrid
  hgrid validate grid.bin --mesh bunny.ply   a grid that was written without its mesh

The exit status is 0 if the blob is a grid of its mesh. Its answers are then those of a loop over all
triangles.";

pub(super) const TABLE_EXAMPLES: &str = "\
Examples:
  hgrid table bunny.ply dragon.ply buddha.ply
  hgrid table procedural:knot:100K --size 512 --repeat 9
  hgrid table sponza.ply --eye 0,3,0 --target 10,3,0 --fov 60
  hgrid table dragon.ply --methods one-level,fixed --macrocell-factor 4
  hgrid table dragon.ply --markdown > table.md
  hgrid table dragon.ply --json > table.json     every single time, and the machine

Close other programs: times are wall-clock times. One thread does all work; with --threads, several
build.";

pub(super) const FIGURES_EXAMPLES: &str = "\
Examples:
  hgrid figures bunny.ply dragon.ply buddha.ply -o pictures
  hgrid figures bunny.ply buddha.ply --figure1 buddha.ply --densities 1,4,16,64
  hgrid figures procedural:knot:100K --size 512 --repeat 1     a first impression

The folder then holds figure1 (times against density, one scene) and figure2 (memory and times of
every scene and method) as .svg, as .png and, the numbers alone, as .json.";

pub(super) const COMPARE_EXAMPLES: &str = "\
Examples:
  hgrid compare bunny.ply dragon.ply buddha.ply
  hgrid compare dragon.ply --peers embree-low,embree-medium --workloads primary,ao,bounce
  hgrid compare sponza.ply --view inside
  hgrid compare bunny.ply --instances 10000  scenes over a field of instances
  hgrid compare bunny.ply --spheres          trees over a sphere in place of each triangle
  hgrid compare bunny.ply dragon.ply --markdown --json compare.json -o pictures

This needs a program with the peers in it; docs/performance.md tells how they are set up and measured:
  apt-get install libembree-dev g++
  RUSTFLAGS='-C target-cpu=native' cargo run --release -p hgrid-lab --features peers -- compare ...
With --features embree instead it has Embree alone.";

pub(super) const ANIMATE_EXAMPLES: &str = "\
Examples:
  hgrid animate dragon.ply                   30 frames, built and rendered with one thread
  hgrid animate dragon.ply --frames 100 --threads 4
  hgrid animate bunny.ply --method one-level --size 512
  hgrid animate bunny.ply --instances 10000  a field of moving ones, in a scene of instances
  hgrid animate bunny.ply --instances 10000 --refit
  hgrid animate bunny.ply -o frames          every frame as a picture, too";

pub(super) const REPORT_EXAMPLES: &str = "\
Examples:
  hgrid report                               writes the pages of the checkout that one is in
  hgrid report --check                       fails if a page is not what the results say";

pub(super) const SCENES: &str = "\
Scenes:
  FILE.ply, .obj, .stl, .gltf, .glb, or .hgrid with a mesh in it
                                  (of a .hgrid file only the mesh is read: its grid is built again)
  procedural:knot[:TRIANGLES]     a closed, finely bumped surface, like a scan
  procedural:stage[:TRIANGLES]    the same on a floor eighty times its size
  procedural:soup[:TRIANGLES]     a cube full of small triangles
  A+B                             A in the middle of B, each in its colour: bunny.ply+stadium.ply;
                                  both keep their axes, and without --up that of A is up
  TRIANGLES is a number like 5000, 20K or 3M, up to 100M";

const VIEWS: &str = "\
Views:
  front, back, left, right, top, bottom, three-quarter,
  or AZIMUTH,ELEVATION in degrees: 0,0 is the front, 90,0 the right, 0,90 the top.
  Without a view, measurements see a scene from the front, and a flat one from three-quarter.
  Instead of a view, --eye X,Y,Z is the point to look from, and --target X,Y,Z the point to look at.
Named views:
";

/// Returns the help about views, and the named ones.
pub(super) fn views() -> String {
    VIEWS.to_owned() + &named::list()
}
