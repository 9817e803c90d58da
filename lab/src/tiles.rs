//! A square picture in tiles of 16 x 16 pixels, as in all renderings of the lab.
//!
//! ```text
//! +-------------+---   Tiles come row by row from the upper left. The rays of one are in Morton
//! |  0  1  4 .. |      order: each sixteen of a whole tile are a square of 4 x 4 pixels, each 64
//! |  2  3  6 .. |      one of 8 x 8.
//! |  8  9 12 .. |
//! ```
//!
//! This order suits the packets of other structures and [`Grid::intersect_n`]: a tree traces a whole
//! tile as four groups of 64 rays. The rays of a tile are made just before it is traced, as in a renderer.

use hgrid_core::{Coherence, Grid, Hit, Ray, Strided, StridedMut};

use crate::camera::Camera;

/// Pixels on each side of a tile.
const TILE: u16 = 16;

/// The numbers of a tile's columns, and of its rows.
const ALONG: [u16; TILE as usize] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15];

/// Rays in a tile.
pub const TILE_RAYS: usize = TILE as usize * TILE as usize;

/// Column and row of each ray of a tile.
static MORTON: [[u16; 2]; TILE_RAYS] = {
    let mut places = [[0; 2]; TILE_RAYS];
    let mut at = 0;
    while at < TILE * TILE {
        places[at as usize] = [even_bits(at), even_bits(at >> 1)];
        at += 1;
    }
    places
};

/// Moves bits 0, 2, 4 and 6 to bits 0 to 3.
const fn even_bits(at: u16) -> u16 {
    at & 1 | at >> 1 & 2 | at >> 2 & 4 | at >> 3 & 8
}

/// A picture and the camera that takes it.
#[derive(Debug, Clone, Copy)]
pub struct Tiles {
    /// The camera that takes it.
    pub camera: Camera,
    /// Pixels on each side.
    pub size: u16,
}

/// The pixels of a row of tiles.
#[derive(Debug)]
pub struct Band<'p, T> {
    tiles: Tiles,
    row: u16,
    pixels: &'p mut [T],
}

impl Tiles {
    /// Returns the number of pixels of the picture.
    #[must_use]
    pub const fn pixels(&self) -> usize {
        self.size as usize * self.size as usize
    }

    /// Returns the bands of a picture's pixels, which lie row by row.
    pub fn bands<'p, T>(&self, pixels: &'p mut [T]) -> impl Iterator<Item = Band<'p, T>> {
        debug_assert_eq!(pixels.len(), self.pixels(), "another picture");
        let tiles = *self;
        let bands =
            (0..self.size).step_by(TILE.into()).zip(pixels.chunks_mut(self.band_pixels().max(1)));
        bands.map(move |(row, pixels)| Band { tiles, row, pixels })
    }

    /// Fills a picture, tile by tile; see [`Band::fill`].
    pub fn fill<T: Copy>(&self, pixels: &mut [T], mut tile: impl FnMut(&[Ray], &mut [T])) {
        self.bands(pixels).for_each(|mut band| band.fill(&mut tile));
    }

    /// Calls `tile` for each tile, with its rays and the places of their pixels.
    pub fn each(&self, mut tile: impl FnMut(&[Ray], &[usize])) {
        (0..self.size).step_by(TILE.into()).for_each(|row| self.each_in(row, &mut tile));
    }

    /// Does the same for the row of tiles that starts at a row of pixels.
    fn each_in(&self, top: u16, mut tile: impl FnMut(&[Ray], &[usize])) {
        let Self { camera, size } = *self;
        let in_row = usize::from(size);
        // The same offsets for all tiles of a band.
        let offsets = MORTON.map(|[column, row]| usize::from(row) * in_row + usize::from(column));
        let down = ALONG.map(|row| camera.down(top + row, size));
        let mut rays = [Ray::new([0.0; 3], [0.0; 3]); TILE_RAYS];
        let mut places = [0; TILE_RAYS];
        for left in (0..size).step_by(TILE.into()) {
            let across = ALONG.map(|column| camera.across(left + column, size));
            for (ray, [column, row]) in rays.iter_mut().zip(&MORTON) {
                // Always less than a tile; the remainder tells the compiler, which then drops bounds checks.
                let [column, row] = [column, row].map(|at| usize::from(at % TILE));
                *ray = camera.ray_at(across[column], down[row]);
            }
            let first = usize::from(top) * in_row + usize::from(left);
            for (place, offset) in places.iter_mut().zip(&offsets) {
                *place = first + offset;
            }
            // In a tile at an edge, drop the pixels outside.
            let (width, height) = (size - left, size - top);
            let mut count = TILE_RAYS;
            if width.min(height) < TILE {
                count = 0;
                for (at, [column, row]) in MORTON.iter().enumerate() {
                    (rays[count], places[count]) = (rays[at], places[at]);
                    count += usize::from(*column < width && *row < height);
                }
            }
            tile(&rays[..count], &places[..count]);
        }
    }

    /// Returns the number of pixels of a whole band.
    const fn band_pixels(&self) -> usize {
        self.size as usize * TILE as usize
    }
}

impl<T: Copy> Band<'_, T> {
    /// Returns the number of pixel rows of the band.
    #[must_use]
    pub fn height(&self) -> u16 {
        (self.tiles.size - self.row).min(TILE)
    }

    /// Fills the band: for each tile, `tile` gets the rays and writes their values. It finds the values of
    /// the tile before, and overwrites them.
    pub fn fill(&mut self, mut tile: impl FnMut(&[Ray], &mut [T])) {
        let Some(&blank) = self.pixels.first() else { return };
        let mut values = [blank; TILE_RAYS];
        let above = usize::from(self.row) * usize::from(self.tiles.size);
        self.tiles.each_in(self.row, |rays, places| {
            let values = &mut values[..rays.len()];
            tile(rays, values);
            for (&place, &value) in places.iter().zip(&*values) {
                self.pixels[place - above] = value;
            }
        });
    }
}

/// Finds the closest hits of the rays of a tile, as many as there are rays: together if the grid can.
pub fn intersect(grid: &Grid<'_>, rays: &[Ray], hits: &mut [Hit]) {
    debug_assert_eq!(rays.len(), hits.len());
    let answers = &mut StridedMut::new(&mut *hits);
    if grid.intersect_n(&Strided::new(rays), answers, Coherence::Coherent).is_err() {
        hits.fill(Hit::MISS);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Up, View};

    #[test]
    fn every_pixel_has_its_own_ray_once() {
        let camera = Camera::framing(([0.0; 3], [1.0; 3]), View::ThreeQuarter, Up::Y);
        for size in [0, 1, 7, 15, 16, 17, 32, 40] {
            let tiles = Tiles { camera, size };
            let rays = |row| (0..size).map(move |column| camera.ray(column, row, size));
            let expected: Vec<_> = (0..size).flat_map(rays).collect();
            let none = Ray::new([0.0; 3], [0.0; 3]);

            let mut seen = vec![0; tiles.pixels()];
            tiles.each(|rays, places| {
                for (ray, &place) in rays.iter().zip(places) {
                    assert_eq!(*ray, expected[place]);
                    seen[place] += 1;
                }
            });
            assert!(seen.iter().all(|&count| count == 1), "{size}");

            let mut filled = vec![none; tiles.pixels()];
            tiles.fill(&mut filled, |rays, values| values.copy_from_slice(rays));
            assert_eq!(filled, expected);

            let mut filled = vec![none; tiles.pixels()];
            let mut bands: Vec<_> = tiles.bands(&mut filled).collect();
            assert_eq!(bands.iter().map(Band::height).sum::<u16>(), size);
            bands.iter_mut().rev().for_each(|band| band.fill(|rays, to| to.copy_from_slice(rays)));
            assert_eq!(filled, expected);
        }
    }

    #[test]
    fn the_last_tiles_of_the_largest_picture_are_cut() {
        let camera = Camera::framing(([0.0; 3], [1.0; 3]), View::Front, Up::Y);
        let tiles = Tiles { camera, size: u16::MAX };
        let (mut count, mut pixels, mut last) = (0, 0, (0, 0));
        tiles.each_in(u16::MAX - 15, |rays, places| {
            (count, pixels) = (count + 1, pixels + rays.len());
            last = (rays.len(), places[places.len() - 1]);
        });
        let size = usize::from(u16::MAX);
        assert_eq!((count, pixels), (4096, 15 * size));
        assert_eq!(last, (15 * 15, size * size - 1));
    }

    #[test]
    fn runs_of_rays_are_squares() {
        for (rays, side) in [(16, 4), (64, 8), (256, 16)] {
            for run in MORTON.chunks(rays) {
                let square = run[0].map(|at| at / side);
                assert!(run.iter().all(|place| place.map(|at| at / side) == square));
            }
        }
        assert_eq!((MORTON[0], MORTON[255]), ([0, 0], [15, 15]));
    }
}
