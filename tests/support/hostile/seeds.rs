//! Grids to damage: small ones with every feature of a method's blob.

use std::sync::OnceLock;

use hgrid_core::{Config, Method, Strided};

use crate::copy::Copy;
use crate::meshes::{Mesh, ball, soup};
use crate::methods;
use crate::owned::{Owned, prove};

/// A grid as it was built.
#[derive(Debug)]
pub struct Seed {
    /// The mesh that it was built from.
    pub mesh: Mesh,
    /// The configuration that it was built with.
    pub config: Config,
    /// The blob.
    pub blob: Vec<u8>,
    /// The blob with the mesh after it, and a mask for each triangle.
    pub packed: Vec<u8>,
}

impl Seed {
    /// Builds the grid.
    ///
    /// # Panics
    /// If it cannot be built, or is not valid.
    #[must_use]
    pub fn new(mesh: Mesh, config: Config) -> Self {
        let view = mesh.view();
        let owned = Owned::build(&view, &config).expect("a sound mesh");
        let blob = owned.bytes().to_vec();
        let masks: Vec<u32> = (0..).take(mesh.indices.len()).collect();
        let masked = view.with_masks(Strided::new(&masks)).expect("a mask for each triangle");
        let grid = owned.open(&masked).expect("its own mesh");
        prove(&grid).expect("a grid is valid");
        let mut packed = Copy::of(&vec![0; usize::try_from(grid.packed_bytes()).expect("small")]);
        grid.pack(packed.bytes_mut()).expect("enough memory");
        let packed = packed.bytes().to_vec();
        Self { mesh, config, blob, packed }
    }
}

/// The meshes; each is built with every method.
const MESHES: [fn() -> Mesh; 6] = [small, odd, nested, || ball(3, 1.0), crowded, Mesh::default];
const COUNT: usize = MESHES.len() * Method::ALL.len();

/// Returns all seeds: some meshes with every method.
pub fn seeds() -> impl Iterator<Item = &'static Seed> {
    (0..COUNT).map(seed)
}

/// Returns the seed with a number, which wraps around; it is built when first needed.
pub(super) fn seed(which: usize) -> &'static Seed {
    static SEEDS: [OnceLock<Seed>; COUNT] = [const { OnceLock::new() }; COUNT];
    let which = which % COUNT;
    SEEDS[which].get_or_init(|| {
        let mesh = MESHES[which / Method::ALL.len()]();
        let config = methods::configs().nth(which % Method::ALL.len());
        Seed::new(mesh, config.expect("one for each method"))
    })
}

/// Returns a dozen triangles, some of them large.
fn small() -> Mesh {
    soup(12, 0.5, 51)
}

/// Returns equal triangles, triangles without area, and some that are not finite.
fn odd() -> Mesh {
    let mut mesh = soup(6, 0.4, 5);
    let triangle = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    for _ in 0..20 {
        mesh.push(triangle);
    }
    mesh.push([[0.5; 3]; 3]);
    mesh.push([[f32::NAN, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    mesh.push([[f32::INFINITY, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    mesh
}

/// Returns a few triangles, some in a tenth of the space and some in less than a hundredth: grids in grids of
/// few bytes.
pub fn nested() -> Mesh {
    let mut mesh = soup(10, 0.1, 3);
    for (count, size) in [(30, 0.1), (12, 0.004)] {
        mesh.append(&soup(count, 0.05, 5).map(|p| p.map(|c| 0.3 + size * c)));
    }
    mesh
}

/// Returns a crowd in a crowd, under larger triangles.
fn crowded() -> Mesh {
    let mut mesh = soup(40, 0.02, 3);
    for size in [0.05, 2e-3] {
        mesh.append(&soup(140, 0.05, 5).map(|p| p.map(|c| 0.3 + size * c)));
    }
    mesh.append(&soup(4, 0.1, 3));
    mesh.append(&soup(2, 2.0, 7));
    mesh
}
