//! The same mesh in every form that a caller may bring gives the same blob and the same hits.

use hgrid_core::{Config, IndexType, Method, Strided, TriangleMesh};
use hgrid_tests::meshes::{ball, soup};
use hgrid_tests::owned::Owned;
use hgrid_tests::random::Random;
use hgrid_tests::{methods, oracle};

/// Returns elements as bytes, one every `stride` bytes from an odd address, with junk between them and
/// nothing after the last.
fn scatter<const N: usize>(elements: &[[u8; N]], stride: usize) -> Vec<u8> {
    let mut bytes = vec![0xa5];
    for (i, element) in elements.iter().enumerate() {
        bytes.resize(1 + i * stride, 0xa5);
        bytes.extend(element);
    }
    bytes
}

#[test]
fn strides_types_and_alignment_do_not_matter() {
    let mesh = ball(12, 0.7);
    let tight = mesh.view();
    let config = Config::new(Method::Fixed);
    let expected = Owned::build(&tight, &config).unwrap();

    let positions: Vec<[u8; 12]> =
        mesh.positions.iter().map(|p| flat(p.map(f32::to_ne_bytes))).collect();
    let wide: Vec<[u8; 12]> = mesh.indices.iter().map(|t| flat(t.map(u32::to_ne_bytes))).collect();
    let narrow: Vec<[u8; 6]> = mesh
        .indices
        .iter()
        .map(|t| flat(t.map(|i| u16::try_from(i).unwrap().to_ne_bytes())))
        .collect();

    let mut hits = 0;
    for position_stride in [12, 13, 16, 32] {
        let position_bytes = scatter(&positions, position_stride);
        let positions = Strided {
            bytes: &position_bytes[1..],
            stride: position_stride,
            count: positions.len(),
        };
        for (index_stride, index_type) in
            [(12, IndexType::U32), (15, IndexType::U32), (6, IndexType::U16), (11, IndexType::U16)]
        {
            let index_bytes = match index_type {
                IndexType::U32 => scatter(&wide, index_stride),
                IndexType::U16 => scatter(&narrow, index_stride),
            };
            let indices =
                Strided { bytes: &index_bytes[1..], stride: index_stride, count: wide.len() };
            let view = TriangleMesh::strided(positions, indices, index_type).unwrap();
            let owned = Owned::build(&view, &config).unwrap();
            assert_eq!(owned.bytes(), expected.bytes(), "{position_stride} {index_stride}");
            let (grid, reference) = (owned.open(&view).unwrap(), expected.open(&tight).unwrap());
            let mut random = Random(3);
            for _ in 0..200 {
                let ray = hgrid_core::Ray::new(random.point().map(|c| c * 3.0), random.point());
                assert_eq!(grid.intersect(&ray), reference.intersect(&ray));
                if position_stride == 13 {
                    hits += usize::from(oracle::check(&grid, &ray));
                }
            }
        }
    }
    assert!(hits > 20, "{hits}");
}

fn flat<const N: usize, const W: usize>(words: [[u8; W]; 3]) -> [u8; N] {
    words.concat().try_into().expect("three words")
}

#[test]
fn the_same_input_gives_the_same_bits_whatever_the_memory_held() {
    let mesh = soup(500, 0.2, 7);
    let view = mesh.view();
    let junk = [0x00, 0xff, 0xa5];
    for (config, junk) in methods::configs().flat_map(|config| junk.map(|junk| (config, junk))) {
        let expected = Owned::build(&view, &config).unwrap();
        let bytes = expected.bytes().len();
        let blocks = |bytes: usize| {
            let mut blocks = vec![hgrid_core::Block::ZERO; hgrid_core::Block::count_for(bytes)];
            hgrid_core::Block::bytes_mut(&mut blocks).fill(junk);
            blocks
        };
        let (mut index, mut scratch) = (blocks(bytes + 4096), blocks(1 << 20));
        let grid = hgrid_core::Grid::build(
            view,
            &config,
            hgrid_core::Block::bytes_mut(&mut index),
            hgrid_core::Block::bytes_mut(&mut scratch),
        )
        .unwrap();
        assert_eq!(grid.blob(), expected.bytes());
    }
}
