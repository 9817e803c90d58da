//! Scenes that need no file: the same vertices, bit for bit, on every platform.
//!
//! | name | what | what it tests in a grid |
//! |---|---|---|
//! | `knot` | a closed, finely bumped surface | the usual: a scanned object |
//! | `stage` | a knot on a floor eighty times its size | one cell size cannot fit both |
//! | `soup` | a cube full of small triangles | density without surfaces: rows without gaps |
//!
//! On the stage, a grid of one level has all of the knot in one or two cells, so that rays test most of its
//! triangles. The time grows with the triangle count, so the default is small.

use anyhow::{Result, bail};

use super::noise::SplitMix64;
use super::{Scene, knot};
use crate::progress::Progress;
use crate::vector::round;

/// The names that [`make`] knows.
pub const NAMES: [&str; 3] = ["knot", "stage", "soup"];

/// The default triangle counts of scenes.
const DEFAULT_KNOT: u32 = 500_000;
const DEFAULT_STAGE: u32 = 2000;
const DEFAULT_SOUP: u32 = 100_000;

/// The largest triangle count: two gigabytes of mesh.
const MAX_TRIANGLES: u32 = 100_000_000;

/// Squares along each side of the stage's floor, and its size as a multiple of the knot's.
const FLOOR_SQUARES: u32 = 10;
const FLOOR_SCALE: f64 = 80.0;

/// A function that makes a scene of so many triangles.
type Formula = fn(u32) -> Scene;

/// Makes the scene of `NAME` or `NAME:TRIANGLES`, with `TRIANGLES` like 5000, 20K or 3M.
///
/// # Errors
/// If there is no such scene or the count is not in range.
pub fn make(words: &str) -> Result<Scene> {
    let (name, generate, triangles) = parse(words)?;
    let scene = generate(triangles);
    Ok(Scene { name: format!("procedural:{name}:{}", scene.indices.len()), ..scene })
}

/// Looks whether [`make`] would make a scene.
///
/// # Errors
/// The errors of [`make`].
pub(crate) fn check(words: &str) -> Result<()> {
    parse(words).map(|_| ())
}

/// Returns the name of a scene, the function that makes it, and its number of triangles.
fn parse(words: &str) -> Result<(&str, Formula, u32)> {
    let (name, count) = match words.split_once(':') {
        Some((name, count)) => (name, Some(count)),
        None => (words, None),
    };
    let (generate, default): (Formula, _) = match name {
        "knot" => (knot, DEFAULT_KNOT),
        "stage" => (stage, DEFAULT_STAGE),
        "soup" => (soup, DEFAULT_SOUP),
        _ => bail!("NAME in procedural:NAME is {}", NAMES.join(", ")),
    };
    let triangles = count.map_or(Some(default), parse_count);
    let Some(triangles) = triangles.filter(|count| (1..=MAX_TRIANGLES).contains(count)) else {
        bail!("TRIANGLES in procedural:{name}:TRIANGLES is a number from 1 to 100M");
    };
    Ok((name, generate, triangles))
}

/// Parses a whole number, with `K` for thousands or `M` for millions.
fn parse_count(word: &str) -> Option<u32> {
    let (digits, unit) = match word.char_indices().last()? {
        (end, 'k' | 'K') => (&word[..end], 1000),
        (end, 'm' | 'M') => (&word[..end], 1_000_000),
        _ => (word, 1),
    };
    digits.parse::<u32>().ok()?.checked_mul(unit)
}

fn knot(triangles: u32) -> Scene {
    let (rows, columns) = knot::size(triangles);
    knot::make(rows, columns)
}

/// Makes the stage. The knot gets the triangles that the floor leaves, and pictures show the knot.
fn stage(triangles: u32) -> Scene {
    let floor_triangles = 2 * FLOOR_SQUARES * FLOOR_SQUARES;
    let mut scene = knot(triangles.saturating_sub(floor_triangles));
    let (min, max) = scene.bounds().unwrap_or_default();
    scene.focus = Some((min, max));

    let base = u32::try_from(scene.positions.len()).unwrap_or(u32::MAX);
    let side = FLOOR_SCALE * (f64::from(max[0]) - f64::from(min[0]));
    let across = FLOOR_SQUARES + 1;
    for z in 0..across {
        for x in 0..across {
            let [x, z] = [x, z].map(|i| side * (f64::from(i) / f64::from(FLOOR_SQUARES) - 0.5));
            scene.positions.push(round([x, f64::from(min[1]), z]));
        }
    }
    for z in 0..FLOOR_SQUARES {
        for x in 0..FLOOR_SQUARES {
            let a = base + z * across + x;
            let [b, c, d] = [a + across, a + across + 1, a + 1];
            scene.indices.extend([[a, b, c], [a, c, d]]);
        }
    }
    scene
}

/// Makes triangles of random shape in random places: the corners of each lie in a small cube.
fn soup(triangles: u32) -> Scene {
    let mut progress = Progress::new("generating", u64::from(triangles));
    let mut random = SplitMix64::new(1);
    // The small cubes together have three times the volume of the large one.
    let size = side_of(3.0 / f64::from(triangles));
    let mut scene = Scene::default();
    scene.positions.reserve_exact(3 * triangles as usize);
    scene.indices.reserve_exact(triangles as usize);
    for triangle in 0..triangles {
        let corner = [(); 3].map(|()| random.next_unit() * (1.0 - size) - 0.5);
        for _ in 0..3 {
            scene.positions.push(round(corner.map(|c| c + size * random.next_unit())));
        }
        scene.indices.push([3 * triangle, 3 * triangle + 1, 3 * triangle + 2]);
        if triangle % 65_536 == 65_535 {
            progress.advance(65_536);
        }
    }
    scene
}

/// Returns the side of a cube of a volume up to 1, by bisection: a cube root would need a library.
fn side_of(volume: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if middle * middle * middle < volume {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

#[cfg(test)]
mod tests {
    use super::*;

    /// FNV-1a over the bits of the mesh.
    fn checksum(scene: &Scene) -> u64 {
        let floats = scene.positions.iter().flatten().map(|c| c.to_bits());
        let words = floats.chain(scene.indices.iter().flatten().copied());
        words.flat_map(u32::to_le_bytes).fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        })
    }

    #[test]
    fn scenes_have_the_same_bits_everywhere() {
        let bits = ["knot:10000", "stage:10000", "soup:10000"].map(|words| {
            let scene = make(words).unwrap();
            assert!((9990..=10_010).contains(&scene.indices.len()), "{}", scene.name);
            checksum(&scene)
        });
        let expected = [0xd89f_84b7_5ffa_31eb, 0x2ffc_8065_d3b5_9d18, 0x59d2_36b9_b48b_c98c];
        assert_eq!(bits, expected, "{bits:#x?}");
    }

    #[test]
    fn indices_are_in_range_and_the_smallest_scenes_exist() {
        for words in ["knot:1", "stage:1", "soup:1", "soup:2", "stage:1K", "knot:997"] {
            let scene = make(words).unwrap();
            let count = scene.positions.len();
            assert!(scene.indices.iter().flatten().all(|&i| (i as usize) < count), "{words}");
        }
    }

    #[test]
    fn counts_have_units_and_limits() {
        assert_eq!(parse_count("20K"), Some(20_000));
        assert_eq!(parse_count("3m"), Some(3_000_000));
        for word in ["", "K", "-1", "1.5M", "5G", "4295M", "1e3"] {
            assert_eq!(parse_count(word), None, "{word}");
        }
        for words in ["knot:", "knot:0", "knot:101M", "soup:x", "soup:1:2"] {
            let message = make(words).unwrap_err().to_string();
            assert!(message.contains("TRIANGLES is a number"), "{message}");
        }
    }

    #[test]
    fn the_stage_is_much_larger_than_what_stands_on_it() {
        let scene = make("stage:5000").unwrap();
        let ((min, max), (near, far)) = (scene.bounds().unwrap(), scene.focus.unwrap());
        assert!(max[0] - min[0] > 75.0 * (far[0] - near[0]));
        assert!(min[1].to_bits() == near[1].to_bits());
    }

    #[test]
    fn soup_fills_the_unit_cube() {
        let (min, max) = make("soup:20000").unwrap().bounds().unwrap();
        assert!(min.iter().all(|&c| (-0.5..-0.49).contains(&c)), "{min:?}");
        assert!(max.iter().all(|&c| (0.49..=0.5).contains(&c)), "{max:?}");
    }
}
