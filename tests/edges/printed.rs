//! Debug output is one line, however large the value is.

use std::fmt::Debug;

use hgrid_core::*;
use hgrid_tests::meshes::ball;
use hgrid_tests::methods;
use hgrid_tests::owned::Owned;

fn line(value: impl Debug) -> String {
    let line = format!("{value:?}");
    assert!(line.len() < 500, "{} bytes: {}", line.len(), &line[..200]);
    line
}

#[test]
fn everything_prints_a_line() {
    let mesh = ball(30, 1.0);
    let masks = vec![1_u32; mesh.indices.len()];
    let view = mesh.view().with_masks(Strided::new(&masks)).unwrap();
    let (vertices, triangles) = (view.vertex_count(), view.triangle_count());
    assert_eq!(
        line(view),
        format!(
            "TriangleMesh {{ vertices: {vertices}, triangles: {triangles}, indices: U32, \
             has_masks: true }}"
        )
    );
    for config in methods::configs() {
        let owned = Owned::build(&view, &config).unwrap();
        let grid = owned.open(&view).unwrap();
        let (method, bytes) = (config.method(), grid.blob_bytes());
        let expected =
            format!("Grid {{ method: {method:?}, triangles: {triangles}, bytes: {bytes} }}");
        assert_eq!(line(grid), expected);
        line(config);
        line(grid.inspect());
        line(sizes(&view, &config, &mut []));
        line(BlobInfo::peek(owned.bytes()));
    }

    let mut blocks = vec![Block::ZERO; 1000];
    assert_eq!(line(blocks[0]), "Block");
    let all = "bytes: 64000, stride: 64, count: 1000 }";
    assert_eq!(line(Strided::new(&blocks)), format!("Strided {{ {all}"));
    assert_eq!(line(StridedMut::new(&mut blocks)), format!("StridedMut {{ {all}"));

    let ray = Ray::new([1.0 / 3.0; 3], [-1.0 / 3.0; 3]);
    let test = TriangleTest::new(&ray).unwrap();
    let mut counters = Counters::default();
    let mut filter = |_: usize, _: &Hit| Verdict::Accept;
    let options = QueryOptions {
        filter: Some(&mut filter),
        scratch: Block::bytes_mut(&mut blocks),
        ..QueryOptions::counting(&mut counters)
    };
    line(options);
    line((ray, Hit::MISS, test.test(&mesh.view().triangle(0).unwrap()), Coherence::Coherent));
    line(test);
    line(view.surface(&ray, &Hit { primitive: 0, ..Hit::MISS }));
    line(ClosestPoint::on_triangle(&view.triangle(0).unwrap(), 0, [0.0; 3]));
    line((Control::default(), Cull::Back, SimdLevel::detect(), Quality::High));
    line((Refit { cost_before: 1.0 / 3.0, cost_after: 1e300 }, BuildFlags::all()));
    line(Error::OutOfMemory { region: Region::Index, needed_bytes: 1, available_bytes: u64::MAX });
}
