//! Heat maps show the library's counters, in colours that their legend explains.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use hgrid_core::{Config, Counters, Method, QueryOptions, TriangleMesh};
use hgrid_lab::camera::{Camera, Up, View};
use hgrid_lab::scene::Scene;
use hgrid_tests::artefact::run;
use hgrid_tests::owned::Owned;
use tempfile::TempDir;

use crate::knot::KNOT;
use crate::pictures::ascii;
use crate::ppm::Picture;
use crate::programs::{raytracer, watched_raytracer};

const SIZE: u16 = 96;

/// Returns the work of the camera's rays as the library counts it.
fn counted(scene: &Scene, config: &Config) -> Vec<Counters> {
    let mesh = TriangleMesh::new(&scene.positions, &scene.indices).expect("a sound mesh");
    let owned = Owned::build(&mesh, config).expect("a sound mesh");
    let grid = owned.open(&mesh).expect("its own mesh");
    let bounds = scene.framed_bounds();
    let camera = Camera::framing(bounds, View::of(bounds, Up::Y), Up::Y);
    let pixels = (0..SIZE).flat_map(|row| (0..SIZE).map(move |column| (row, column)));
    let work = pixels.map(|(row, column)| {
        let mut counters = Counters::default();
        let mut options = QueryOptions::counting(&mut counters);
        let _ = grid.intersect_with(&camera.ray(column, row, SIZE), &mut options);
        counters
    });
    work.collect()
}

fn drawn(dir: &Path, options: &[&str]) -> Picture {
    let path = dir.join("heat.ppm");
    let size = SIZE.to_string();
    run(raytracer().args(["--size", &size, "-o"]).arg(&path).args(options));
    Picture::load(&path)
}

/// Returns the colours of a picture's bar, from no work to much.
fn bar(picture: &Picture) -> Vec<[u8; 3]> {
    let row = usize::from(SIZE) + 12;
    let row = &picture.pixels[row * picture.width..][..picture.width];
    row.iter().copied().filter(|&pixel| pixel != [255; 3]).collect()
}

/// Returns the position of a colour on the bar, from 0 to 1.
fn place(bar: &[[u8; 3]], color: [u8; 3]) -> f64 {
    let distance = |other: &[u8; 3]| -> i32 {
        color.iter().zip(other).map(|(a, b)| (i32::from(*a) - i32::from(*b)).pow(2)).sum()
    };
    let nearest = (0..bar.len()).min_by_key(|&i| distance(&bar[i])).expect("a bar");
    assert!(distance(&bar[nearest]) < 50, "{color:?} is not on the bar");
    nearest as f64 / (bar.len() - 1) as f64
}

/// Returns the first of 2, 4, 6, 8, 10, 20, 40, ... that at most 1 of 100 pixels exceeds.
fn top_of(work: &[u64]) -> u64 {
    let powers = (0..).map(|power| 10u64.pow(power));
    let mut numbers = powers.flat_map(|power| [2, 4, 6, 8, 10].map(|digit| digit * power));
    let behind = |top: u64| work.iter().filter(|&&work| work > top).count();
    numbers.find(|&top| behind(top) * 100 <= work.len()).expect("an endless row")
}

#[test]
fn each_pixel_has_the_colour_of_its_work() {
    let dir = TempDir::new().expect("a folder");
    let scene = Scene::load(KNOT).expect("a scene");
    for (method, what) in
        [(Method::Fixed, "tests"), (Method::Fixed, "steps"), (Method::Bvh, "steps")]
    {
        let picture = drawn(dir.path(), &["--heat", what, "--method", method.name()]);
        let bar = bar(&picture);
        let work = counted(&scene, &Config::new(method)).into_iter().map(|work| match what {
            "tests" => work.primitive_tests,
            _ => work.cell_steps,
        });
        let work: Vec<u64> = work.collect();
        let top = top_of(&work);
        for (&work, &color) in work.iter().zip(&picture.pixels) {
            let expected = (work as f64 / top as f64).min(1.0);
            let drawn = place(&bar, color);
            assert!((drawn - expected).abs() < 0.02, "{work} {what} of {top}: {drawn}");
        }
    }
}

/// The work of shadow rays is part of the pixel's work.
#[test]
fn all_rays_of_a_pixel_count() {
    let dir = TempDir::new().expect("a folder");
    let plain = drawn(dir.path(), &["--heat", "tests"]);
    for more in [["--shadows", "--progress"], ["--ao", "4"]] {
        let picture = drawn(dir.path(), &[&["--heat", "tests"], &more[..]].concat());
        assert!(picture != plain, "{more:?}");
    }
}

const NAME: &str = "
  ### ### ### ### ###
  #    #  #   # # #
  ###  #  ### ### ###
    #  #  #   #     #
  ###  #  ### #   ###
";

const NUMBERS: &str = "
  ###                                       # # ###                                ### ###
  # #                                       # # # #                                # # # #  #
  # #                                       ### # #                                ### # # ###
  # #                                         # # #                                # # # #  #
  ###                                         # ###                                ### ###
";

/// Returns the legend as text, without the bar itself.
fn letters(picture: &Picture) -> String {
    let rows = picture.pixels.chunks(picture.width).skip(usize::from(SIZE));
    let mut text = String::new();
    for row in rows {
        let line: String =
            row.iter().map(|&pixel| if pixel == [0; 3] { '#' } else { ' ' }).collect();
        let _ = writeln!(text, "{}", line.trim_end());
    }
    text
}

#[test]
fn the_bar_says_what_its_colours_mean() {
    let dir = TempDir::new().expect("a folder");
    let picture = drawn(dir.path(), &["--heat", "steps", "--method", "fixed"]);
    assert_eq!((picture.width, picture.height), (96, 96 + 26));
    let text = letters(&picture);
    assert!(text.contains(NAME) && text.contains(NUMBERS), "{text}");
}

/// A picture too small for numbers has no bar.
#[test]
fn small_and_empty_pictures_have_heat_too() {
    let dir = TempDir::new().expect("a folder");
    let [scene, path] = ["house.ply", "heat.ppm"].map(|name| dir.path().join(name));
    fs::write(&scene, ascii()).expect("a file");
    for size in [1, 7, 95, 96] {
        let mut program = watched_raytracer();
        program.arg(&scene).args(["--heat", "tests", "--size", &size.to_string(), "-o"]).arg(&path);
        run(&mut program);
        let height = if size < 96 { size } else { size + 26 };
        assert_eq!(Picture::load(&path).height, height);
    }
    let empty = "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\n\
                 property float z\nelement face 0\nproperty list uchar int vertex_indices\n\
                 end_header\n";
    fs::write(&scene, empty).expect("a file");
    let mut program = watched_raytracer();
    run(program.arg(&scene).args(["--heat", "tests", "--size", "9", "-o"]).arg(&path));
    let picture = Picture::load(&path);
    assert!(picture.pixels.iter().all(|&pixel| pixel == picture.pixels[0]));
}
