//! A square picture in tiles of 8 x 8 pixels: every rendering goes through it.
//!
//! ```text
//! +------------+---   Tiles come row by row. The rays of one are in Morton order, so that any
//! |  0  1  4 .. |     sixteen in a row are a square of 4 x 4 pixels, as
//! |  2  3  6 .. |     [`Grid::intersect_n`](hgrid_core::Grid::intersect_n) and the packets of
//! |  8  9 12 .. |     other structures like them best.
//! ```
//!
//! The rays of a tile are made when it is its turn, as a renderer does.

use core::slice::ChunksMut;

use hgrid_core::Ray;

use crate::camera::Camera;

/// Pixels on each side of a tile.
pub const TILE: u16 = 8;

/// Rays in a tile.
pub const TILE_RAYS: usize = TILE as usize * TILE as usize;

/// Column and row of each ray of a tile.
const MORTON: [[u16; 2]; TILE_RAYS] = {
    let mut places = [[0; 2]; TILE_RAYS];
    let mut at = 0;
    while at < TILE * TILE {
        places[at as usize] = [even_bits(at), even_bits(at >> 1)];
        at += 1;
    }
    places
};

/// The three lowest bits in even places, side by side.
const fn even_bits(at: u16) -> u16 {
    at & 1 | at >> 1 & 2 | at >> 2 & 4
}

/// A picture in tiles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tiles {
    /// From where it is seen.
    pub camera: Camera,
    /// Pixels on each side.
    pub size: u16,
}

impl Tiles {
    /// Pixels of the picture.
    #[must_use]
    pub const fn pixels(&self) -> usize {
        self.size as usize * self.size as usize
    }

    /// How many rows of tiles there are.
    #[must_use]
    pub const fn rows(&self) -> u16 {
        self.size.div_ceil(TILE)
    }

    /// The pixels of a picture, as many as [`fill_row`](Self::fill_row) takes at a time.
    pub fn rows_of<'p, T>(&self, pixels: &'p mut [T]) -> ChunksMut<'p, T> {
        pixels.chunks_mut(self.row_pixels().max(1))
    }

    /// Pixels from the upper to the lower edge of a row of tiles.
    #[must_use]
    pub fn height(&self, row: u16) -> u16 {
        self.size.saturating_sub(row.saturating_mul(TILE)).min(TILE)
    }

    /// Gives every pixel a value, row by row from the upper left: `tile` gets the rays of one tile
    /// after the other, and writes what becomes of each.
    pub fn fill<T: Copy>(&self, pixels: &mut [T], mut tile: impl FnMut(&[Ray], &mut [T])) {
        for (row, pixels) in (0..).zip(self.rows_of(pixels)) {
            self.fill_row(row, pixels, &mut tile);
        }
    }

    /// The same for the pixels of one row of tiles.
    pub fn fill_row<T: Copy>(
        &self,
        row: u16,
        pixels: &mut [T],
        mut tile: impl FnMut(&[Ray], &mut [T]),
    ) {
        let Some(&any) = pixels.first() else { return };
        let mut values = [any; TILE_RAYS];
        let before = usize::from(row) * self.row_pixels();
        self.each_in(row, |rays, places| {
            let values = &mut values[..rays.len()];
            tile(rays, values);
            for (&place, &value) in places.iter().zip(&*values) {
                pixels[place - before] = value;
            }
        });
    }

    /// Shows the rays of tile after tile and the places of their pixels.
    pub fn each(&self, mut tile: impl FnMut(&[Ray], &[usize])) {
        (0..self.rows()).for_each(|row| self.each_in(row, &mut tile));
    }

    /// The same for one row of tiles.
    fn each_in(&self, row: u16, mut tile: impl FnMut(&[Ray], &[usize])) {
        let Self { camera, size } = *self;
        let top = row.saturating_mul(TILE);
        let mut rays = [Ray::new([0.0; 3], [0.0; 3]); TILE_RAYS];
        let mut places = [0; TILE_RAYS];
        for left in (0..size).step_by(TILE.into()) {
            let mut count = 0;
            for [column, row] in MORTON {
                let (column, row) = (left + column, top + row);
                // Some pixels of a tile at an edge are outside.
                if column < size && row < size {
                    rays[count] = camera.ray(column, row, size);
                    places[count] = usize::from(row) * usize::from(size) + usize::from(column);
                    count += 1;
                }
            }
            tile(&rays[..count], &places[..count]);
        }
    }

    /// Pixels of a row of tiles.
    const fn row_pixels(&self) -> usize {
        self.size as usize * TILE as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Up, View};

    #[test]
    fn every_pixel_has_its_own_ray_once() {
        let camera = Camera::framing(([0.0; 3], [1.0; 3]), View::ThreeQuarter, Up::Y);
        for size in [1, 7, 8, 20] {
            let tiles = Tiles { camera, size };
            let mut seen = vec![0; tiles.pixels()];
            tiles.each(|rays, places| {
                for (ray, &place) in rays.iter().zip(places) {
                    let at = |place: usize| u16::try_from(place).unwrap();
                    let (column, row) = (place % usize::from(size), place / usize::from(size));
                    assert_eq!(*ray, camera.ray(at(column), at(row), size));
                    seen[place] += 1;
                }
            });
            assert!(seen.iter().all(|&count| count == 1), "{size}");
            let heights: Vec<_> = (0..tiles.rows()).map(|row| tiles.height(row)).collect();
            assert_eq!(heights.iter().sum::<u16>(), size);
        }
    }

    #[test]
    fn sixteen_rays_in_a_row_are_a_square() {
        for sixteen in MORTON.chunks(16) {
            let square = sixteen[0].map(|at| at / 4);
            assert!(sixteen.iter().all(|place| place.map(|at| at / 4) == square));
        }
        assert_eq!((MORTON[0], MORTON[63]), ([0, 0], [7, 7]));
    }
}
