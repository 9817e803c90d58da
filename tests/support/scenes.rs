//! Scenes and trees of shapes with their memory, and instances to put into them.

use hgrid_core::{
    BlobInfo, Block, Boxes, Config, Error, Instance, Member, Object, Scene, Shapes, Sizes,
};

use crate::random::Random;

/// Memory with a built scene, or a tree of shapes, in it.
#[derive(Debug)]
pub struct Built {
    index: Vec<Block>,
}

fn memory(sizes: Option<Sizes>) -> Result<(Vec<Block>, Vec<Block>), Error> {
    let sizes = sizes.ok_or(Error::TooManyTriangles)?;
    let blocks = |bytes| vec![Block::ZERO; Block::count_for(bytes)];
    Ok((blocks(sizes.index_bytes), blocks(sizes.scratch_bytes)))
}

impl Built {
    /// Builds a scene in the memory of the bound, and validates it.
    ///
    /// # Errors
    /// The errors of the build and of the validation.
    pub fn scene(
        instances: &[Instance],
        objects: &[Object<'_>],
        config: &Config,
    ) -> Result<Self, Error> {
        let count = u32::try_from(instances.len()).expect("a count that fits");
        let (mut index, mut scratch) = memory(Scene::bound(count, config))?;
        let scratch = Block::bytes_mut(&mut scratch);
        let scene =
            Scene::build(instances, objects, config, Block::bytes_mut(&mut index), scratch)?;
        scene.validate(&mut vec![0xa5; scene.validate_bytes()])?;
        Ok(Self { index })
    }

    /// Builds a tree of shapes, and validates it.
    ///
    /// # Errors
    /// The errors of the build and of the validation.
    pub fn shapes(boxes: Boxes<'_>, config: &Config) -> Result<Self, Error> {
        let (mut index, mut scratch) = memory(Sizes::bound(boxes.count(), config))?;
        let scratch = Block::bytes_mut(&mut scratch);
        let shapes = Shapes::build(boxes, config, Block::bytes_mut(&mut index), scratch)?;
        shapes.validate(&mut vec![0xa5; shapes.validate_bytes()])?;
        Ok(Self { index })
    }

    /// Returns the view for queries.
    ///
    /// # Errors
    /// The errors of opening.
    pub fn open<'a>(&'a self, objects: &'a [Object<'a>]) -> Result<Scene<'a>, Error> {
        Scene::open(self.bytes(), objects)
    }

    /// Returns all bytes.
    pub fn bytes(&self) -> &[u8] {
        Block::bytes(&self.index)
    }

    /// Returns all bytes for changes.
    pub fn bytes_mut(&mut self) -> &mut [u8] {
        Block::bytes_mut(&mut self.index)
    }
}

/// Packs a scene with all that it shows, in memory of exactly the size.
///
/// # Errors
/// The errors of packing.
pub fn packed(scene: &Scene<'_>) -> Result<Vec<Block>, Error> {
    let bytes = usize::try_from(scene.packed_bytes()).expect("a count that fits");
    let mut blocks = vec![Block::ZERO; Block::count_for(bytes)];
    let length = scene.pack(Block::bytes_mut(&mut blocks))?.len();
    assert_eq!(length, bytes);
    Ok(blocks)
}

/// Returns the room that a packed scene needs by its header, limited to what tests use.
fn room<'a>(blob: &[u8]) -> (Vec<Member<'a>>, Vec<Object<'a>>) {
    let (members, objects) = BlobInfo::peek(blob)
        .map_or((0, 0), |info| (info.triangle_count as usize, info.vertex_count as usize));
    (vec![Member::EMPTY; members.min(1000)], vec![Object::Nothing; objects.min(1000)])
}

/// Opens a packed scene in exactly the room that it needs.
pub fn with_packed<T>(blob: &[u8], run: impl FnOnce(Result<Scene<'_>, Error>) -> T) -> T {
    let (mut members, mut objects) = room(blob);
    run(Scene::open_packed(blob, &mut members, &mut objects))
}

/// Opens and validates a packed scene, in enough scratch.
///
/// # Errors
/// The errors of opening and of validation.
pub fn prove_packed(blob: &[u8]) -> Result<(), Error> {
    let (mut members, mut objects) = room(blob);
    let mut scratch = vec![0xa5; blob.len() / 64];
    Scene::open_packed_proven(blob, &mut members, &mut objects, &mut scratch).map(|_| ())
}

/// Returns a random matrix: a rotation, a mirror, a scale that differs between the axes, or a shear.
pub fn matrix(random: &mut Random) -> [[f32; 3]; 3] {
    let size = 0.2 + 2.0 * random.unit();
    let [x, y, z] = random.point();
    match random.below(5) {
        0 => [[size, 0.0, 0.0], [0.0, size, 0.0], [0.0, 0.0, size]],
        // A rotation from a quaternion, with a scale.
        1 => {
            let length = (x * x + y * y + z * z + 1.0).sqrt();
            let [w, x, y, z] = [1.0, x, y, z].map(|c| c / length);
            [
                [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
                [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
                [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
            ]
            .map(|row| row.map(|c| c * size))
        }
        2 => [[-size, 0.0, 0.0], [0.0, size, 0.0], [0.0, 0.0, size]],
        3 => [[size, 0.0, 0.0], [0.0, 0.05 * size, 0.0], [0.0, 0.0, 3.0 * size]],
        _ => [[size, x, y], [0.0, size, z], [0.0, 0.0, size]],
    }
}

/// Returns instances of the first `objects` objects all over a cube.
pub fn scattered(count: usize, objects: u32, width: f64, seed: u64) -> Vec<Instance> {
    let mut random = Random(seed);
    (0..count)
        .map(|number| Instance {
            linear: matrix(&mut random),
            translation: random.point().map(|c| f64::from(c) * width),
            id: u32::try_from(number).expect("a count that fits"),
            ..Instance::new(u32::try_from(random.below(objects as usize)).expect("an object"))
        })
        .collect()
}
