//! Filters are asked only about the triangles that `filter_mask` selects, alone and in batches, in the
//! documented order; and each reported occluder does block its ray. The reference is a loop over all hits of
//! each ray.

use hgrid_core::{
    Coherence, Config, Counters, Cull, Grid, Hit, INVALID_ID, Method, QueryOptions, Ray, Strided,
    StridedMut, TriangleMesh, Verdict,
};
use hgrid_tests::owned::Owned;
use hgrid_tests::{methods, oracle};

use crate::batches::{CLOSE, COHERENCES, levels_of, rays, scattered, scene};

/// Returns the filter's verdict about a hit, whatever the mask of the triangle is.
fn verdict(hit: &Hit) -> Verdict {
    match hit.primitive / 7 % 3 {
        0 => Verdict::Accept,
        1 => Verdict::Reject,
        _ => Verdict::AcceptAndStop,
    }
}

/// Options that select triangles, and those among them that the filter is asked about.
#[derive(Debug, Clone, Copy)]
struct Asked {
    mask: u32,
    cull: Cull,
    skip: u32,
    filter_mask: u32,
}

impl Asked {
    fn options<'q>(self) -> QueryOptions<'q> {
        let Self { mask, cull, skip, filter_mask } = self;
        QueryOptions { mask, cull, skip, filter_mask, ..QueryOptions::default() }
    }

    /// Returns true if the filter is asked about a triangle: they share a bit, or the filter mask has all bits.
    fn is_asked(self, mesh: &TriangleMesh<'_>, id: u32) -> bool {
        self.filter_mask == u32::MAX || mesh.mask(id) & self.filter_mask != 0
    }

    fn counts(self, mesh: &TriangleMesh<'_>, hit: &Hit) -> bool {
        !self.is_asked(mesh, hit.primitive) || verdict(hit) != Verdict::Reject
    }
}

/// The hits of each ray by brute force, for each way to cull.
struct Truth(Vec<[Vec<Hit>; 3]>);

impl Truth {
    fn of(grid: &Grid<'_>, rays: &[Ray]) -> Self {
        Self(rays.iter().map(|ray| oracle::hits_by_cull(grid.mesh(), ray)).collect())
    }

    fn culling(&self, cull: Cull) -> Vec<&Vec<Hit>> {
        let hits = self.0.iter().map(|[none, back, front]| match cull {
            Cull::None => none,
            Cull::Back => back,
            Cull::Front => front,
        });
        hits.collect()
    }

    /// Returns the hits of each ray that mask, culling and `skip` leave, whatever the filter says.
    fn there(&self, mesh: &TriangleMesh<'_>, asked: Asked) -> Vec<Vec<Hit>> {
        let is_seen = |id| asked.mask == u32::MAX || mesh.mask(id) & asked.mask != 0;
        let is_there = |hit: &&Hit| hit.primitive != asked.skip && is_seen(hit.primitive);
        let there = |hits: &Vec<Hit>| hits.iter().filter(is_there).copied().collect();
        self.culling(asked.cull).into_iter().map(there).collect()
    }
}

/// Returns the hits that a filter is shown until one counts, and the hit that counts.
fn walk(grid: &Grid<'_>, hits: &[Hit], asked: Asked) -> (Vec<Hit>, Hit) {
    let mesh = grid.mesh();
    let first = hits.iter().position(|hit| asked.counts(mesh, hit));
    let until = first.map_or(hits.len(), |at| at + 1);
    let shown = hits[..until].iter().filter(|hit| asked.is_asked(mesh, hit.primitive));
    (shown.copied().collect(), first.map_or(Hit::MISS, |at| hits[at]))
}

/// Returns the hits of one ray among those that a filter was shown, in the order of rays.
fn of(shown: &[(usize, Hit)], place: usize) -> Vec<Hit> {
    let start = shown.partition_point(|(at, _)| *at < place);
    shown[start..].iter().take_while(|(at, _)| *at == place).map(|(_, hit)| *hit).collect()
}

/// Checks all queries of one ray; the filter sees hits from near to far.
fn check_single(grid: &Grid<'_>, ray: &Ray, hits: &[Hit], asked: Asked) {
    let (expected_shown, expected) = walk(grid, hits, asked);
    let expected = (expected != Hit::MISS).then_some(expected);
    let mut shown = Vec::new();
    let mut filter = |place: usize, hit: &Hit| {
        assert_eq!(place, 0);
        shown.push(*hit);
        verdict(hit)
    };
    let mut options = QueryOptions { filter: Some(&mut filter), ..asked.options() };
    let found = grid.intersect_with(ray, &mut options);
    let is_occluded = grid.occluded_with(ray, &mut options);
    let occluder = grid.occluder(ray, &mut options);
    let mut all = vec![Hit::MISS; hits.len() + 1];
    let count = grid.intersect_all(ray, &mut options, &mut all);
    assert_eq!((found, is_occluded), (expected, expected.is_some()), "{asked:?} {ray:?}");
    check_occluder(grid, hits, asked, occluder.unwrap_or(INVALID_ID), "alone");
    assert_eq!(shown[..expected_shown.len()], expected_shown, "{asked:?} {ray:?}");

    // All hits: those that count, up to one that stops the query.
    let is_last = |hit: &Hit| {
        asked.is_asked(grid.mesh(), hit.primitive) && verdict(hit) == Verdict::AcceptAndStop
    };
    let until = hits.iter().position(is_last).map_or(hits.len(), |at| at + 1);
    let counts = hits[..until].iter().filter(|hit| asked.counts(grid.mesh(), hit));
    assert!(all[..count].iter().eq(counts), "{asked:?} {ray:?}");
}

/// Fails unless the named triangle blocks the ray, or no triangle is named and none blocks.
fn check_occluder(grid: &Grid<'_>, hits: &[Hit], asked: Asked, named: u32, what: &str) {
    let mut blocking = hits.iter().filter(|hit| asked.counts(grid.mesh(), hit)).peekable();
    if named == INVALID_ID {
        assert!(blocking.peek().is_none(), "{what} {asked:?}: {:?} blocks", blocking.peek());
    } else {
        assert!(
            blocking.any(|hit| hit.primitive == named),
            "{what} {asked:?}: {named} does not block"
        );
    }
}

/// Checks a batch of each query, with scratch to sort in.
fn check_batches(
    grid: &Grid<'_>,
    rays: &[Ray],
    hits: &[Vec<Hit>],
    asked: Asked,
    coherence: Coherence,
    scratch: usize,
) {
    let what = format!("{:?} {coherence:?} {scratch} {asked:?}", grid.method());
    let walks: Vec<_> = hits.iter().map(|hits| walk(grid, hits, asked)).collect();
    let mut memory = vec![0xa5; scratch];
    let mut shown = Vec::new();
    let mut filter = |place: usize, hit: &Hit| {
        shown.push((place, *hit));
        verdict(hit)
    };
    let strided = Strided::new(rays);

    let mut found = vec![Hit { primitive: 7, ..Hit::MISS }; rays.len()];
    let mut options =
        QueryOptions { filter: Some(&mut filter), scratch: &mut memory, ..asked.options() };
    let answers = &mut StridedMut::new(&mut found);
    grid.intersect_n_with(&strided, answers, coherence, &mut options).unwrap();
    assert!(found.iter().eq(walks.iter().map(|(_, first)| first)), "{what}");
    let in_order = walks
        .iter()
        .enumerate()
        .flat_map(|(at, (shown, _))| shown.iter().map(move |hit| (at, *hit)));
    assert!(shown.iter().copied().eq(in_order), "{what}: the filter saw something else");

    // For the occlusion queries, the filter is asked everything about one ray before the next. It may be
    // shown fewer hits of a ray that an opaque triangle blocks.
    for names in [false, true] {
        shown.clear();
        let mut filter = |place: usize, hit: &Hit| {
            shown.push((place, *hit));
            verdict(hit)
        };
        let mut options =
            QueryOptions { filter: Some(&mut filter), scratch: &mut memory, ..asked.options() };
        if names {
            let mut named = vec![7; rays.len()];
            let answers = &mut StridedMut::new(&mut named);
            grid.occluder_n_with(&strided, answers, coherence, &mut options).unwrap();
            for (hits, named) in hits.iter().zip(named) {
                check_occluder(grid, hits, asked, named, &what);
            }
        } else {
            let mut occluded = vec![7_u8; rays.len()];
            let answers = &mut StridedMut::new(&mut occluded);
            grid.occluded_n_with(&strided, answers, coherence, &mut options).unwrap();
            let expected = walks.iter().map(|(_, first)| u8::from(*first != Hit::MISS));
            assert!(occluded.into_iter().eq(expected), "{what}");
        }
        assert!(shown.is_sorted_by_key(|(place, _)| *place), "{what}: not in the order of rays");
        let opaque = |hit: &&Hit| !asked.is_asked(grid.mesh(), hit.primitive);
        for (place, (expected, _)) in walks.iter().enumerate() {
            let seen = of(&shown, place);
            let is_blocked = hits[place].iter().any(|hit| opaque(&hit));
            let is_right = *expected == seen || (is_blocked && expected.starts_with(&seen));
            assert!(is_right, "{what}: ray {place} {expected:?} {seen:?}");
        }
    }
}

/// Returns combinations of options that select triangles and those that the filter is asked about.
fn choices(skip: u32) -> [Asked; 9] {
    let asked = |mask, cull, skip, filter_mask| Asked { mask, cull, skip, filter_mask };
    [
        asked(u32::MAX, Cull::None, INVALID_ID, u32::MAX),
        asked(u32::MAX, Cull::None, INVALID_ID, 1),
        asked(u32::MAX, Cull::None, INVALID_ID, 6),
        asked(u32::MAX, Cull::None, INVALID_ID, 0),
        asked(u32::MAX, Cull::None, INVALID_ID, 8),
        asked(u32::MAX, Cull::Back, skip, 2),
        asked(5, Cull::None, skip, 1),
        asked(3, Cull::Front, INVALID_ID, u32::MAX),
        asked(2, Cull::None, INVALID_ID, 1),
    ]
}

/// Returns masks with one of three bits in turn; some have none, so only a filter mask with all bits selects these.
fn masks(count: u32) -> Vec<u32> {
    (0..count).map(|id| if id % 20 == 19 { 0 } else { 1 << (id % 3) }).collect()
}

#[test]
fn a_filter_is_asked_about_the_triangles_of_its_mask_in_order() {
    a_filter_is_asked_in_order(3);
}

#[test]
#[ignore = "slow: all options with all methods"]
fn a_filter_is_asked_in_order_with_all_options() {
    a_filter_is_asked_in_order(1);
}

/// Takes every `share`th choice of options, others for the next method and the next rays.
fn a_filter_is_asked_in_order(share: usize) {
    let mesh = scene();
    let masks = masks(mesh.view().triangle_count());
    let with_masks = mesh.view().with_masks(Strided::new(&masks)).unwrap();
    // Without masks the filter is asked about every triangle or none, so trees are enough here.
    let trees = methods::configs().filter(|config| config.method() == Method::Bvh);
    let plain = trees.map(|config| (config, mesh.view()));
    let mut turns = (0..share).cycle();
    for (config, view) in methods::configs().map(|config| (config, with_masks)).chain(plain) {
        let owned = Owned::build(&view, &config).unwrap();
        let grid = owned.open(&view).unwrap();
        // Tiles, unrelated rays and odd rays; then rays without order, enough of them to be sorted.
        let tiles = rays(grid.bounds())[CLOSE - 64..].to_vec();
        for rays in [tiles, scattered(1200, 2)] {
            let truth = Truth::of(&grid, &rays);
            let first = truth.culling(Cull::None).into_iter().flatten().next().expect("some hit");
            let turn = turns.next().expect("it has no end");
            for asked in choices(first.primitive).into_iter().skip(turn).step_by(share) {
                let hits = truth.there(&view, asked);
                for (ray, hits) in rays.iter().zip(&hits).step_by(5) {
                    check_single(&grid, ray, hits, asked);
                }
                for level in levels_of(config.method()) {
                    let grid = grid.with_simd(level);
                    check_batches(&grid, &rays, &hits, asked, COHERENCES[0], 0);
                    for scratch in [0, 9000, 16 * rays.len()] {
                        check_batches(&grid, &rays, &hits, asked, COHERENCES[1], scratch);
                    }
                }
            }
        }
    }
}

/// A ray does as much work as without a filter if all triangles are opaque, and less if some are than if the filter is
/// asked about all. A batch with counters traces each ray alone, and counts the same.
#[test]
fn opaque_triangles_cost_no_walk() {
    let mesh = scene();
    let masks = masks(mesh.view().triangle_count());
    let view = mesh.view().with_masks(Strided::new(&masks)).unwrap();
    for config in methods::configs() {
        let owned = Owned::build(&view, &config).unwrap();
        let grid = owned.open(&view).unwrap();
        let rays = &rays(grid.bounds())[CLOSE..][..300];
        let tests = |filter_mask: u32| {
            let (mut alone, mut together) = (Counters::default(), Counters::default());
            let mut reject = |_: usize, _: &Hit| Verdict::Reject;
            for ray in rays {
                let options = QueryOptions::counting(&mut alone);
                let mut options =
                    QueryOptions { filter: Some(&mut reject), filter_mask, ..options };
                let _ = grid.intersect_with(ray, &mut options);
            }
            let mut hits = vec![Hit::MISS; rays.len()];
            let options = QueryOptions::counting(&mut together);
            let mut options = QueryOptions { filter: Some(&mut reject), filter_mask, ..options };
            let answers = &mut StridedMut::new(&mut hits);
            grid.intersect_n_with(&Strided::new(rays), answers, Coherence::Coherent, &mut options)
                .unwrap();
            assert_eq!(alone, together, "{:?}", config.method());
            alone.primitive_tests
        };
        let mut plain = Counters::default();
        for ray in rays {
            let _ = grid.intersect_with(ray, &mut QueryOptions::counting(&mut plain));
        }
        // No triangle has this mask: the work is that without a filter.
        assert_eq!(tests(8), plain.primitive_tests, "{:?}", config.method());
        assert!(tests(1) < tests(u32::MAX), "{:?}", config.method());
    }
}

/// Occluders without a filter, through every entry point.
#[test]
fn what_is_named_blocks_the_ray() {
    let mesh = scene();
    let view = mesh.view();
    for config in methods::configs() {
        let owned = Owned::build(&view, &config).unwrap();
        let grid = owned.open(&view).unwrap();
        let rays = [rays(grid.bounds())[CLOSE - 256..].to_vec(), scattered(1500, 2)].concat();
        let truth = Truth::of(&grid, &rays);
        for asked in [Cull::None, Cull::Back, Cull::Front].map(|cull| Asked {
            cull,
            filter_mask: 0,
            ..choices(INVALID_ID)[0]
        }) {
            let hits = truth.culling(asked.cull);
            let blocked = hits.iter().filter(|hits| !hits.is_empty()).count();
            assert!(blocked > 400 && blocked < rays.len() - 400, "{blocked} of {}", rays.len());
            for (ray, hits) in rays.iter().zip(&hits) {
                let named = grid.occluder(ray, &mut asked.options()).unwrap_or(INVALID_ID);
                check_occluder(&grid, hits, asked, named, "alone");
                let mut counters = Counters::default();
                let mut options = QueryOptions { counters: Some(&mut counters), ..asked.options() };
                let named = grid.occluder(ray, &mut options).unwrap_or(INVALID_ID);
                check_occluder(&grid, hits, asked, named, "counted");
            }
            for (level, coherence) in
                levels_of(config.method()).into_iter().flat_map(|l| COHERENCES.map(|c| (l, c)))
            {
                let mut named = vec![7; rays.len()];
                let mut scratch = vec![0; 16 * rays.len()];
                let mut options = QueryOptions { scratch: &mut scratch, ..asked.options() };
                let answers = &mut StridedMut::new(&mut named);
                grid.with_simd(level)
                    .occluder_n_with(&Strided::new(&rays), answers, coherence, &mut options)
                    .unwrap();
                for (hits, named) in hits.iter().zip(named) {
                    check_occluder(&grid, hits, asked, named, "in a batch");
                }
            }
        }
    }
}

/// Occluder answers take four bytes each: smaller strides and shorter arrays are refused.
#[test]
fn places_for_names_are_checked() {
    let mesh = scene();
    let view = mesh.view();
    let owned = Owned::build(&view, &Config::new(Method::Bvh)).unwrap();
    let grid = owned.open(&view).unwrap();
    let rays = [Ray::new([0.0, 0.0, 3.0], [0.0, 0.0, -1.0]); 2];
    for (bytes, stride, is_sound) in [(8, 4, true), (7, 4, false), (8, 3, false), (9, 5, true)] {
        let mut memory = vec![0xa5; bytes];
        let answers = &mut StridedMut { bytes: &mut memory, stride, count: 2 };
        let options = &mut QueryOptions::default();
        let rays = Strided::new(&rays);
        let result = grid.occluder_n_with(&rays, answers, Coherence::Coherent, options);
        assert_eq!(result.is_ok(), is_sound);
        assert_eq!(memory.iter().all(|&byte| byte == 0xa5), !is_sound);
    }
}
