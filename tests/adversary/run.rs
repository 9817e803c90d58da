//! Puts rays to all methods through every entry point, and compares with the reference.

use hgrid_core::{
    Coherence, Config, Cull, Grid, Hit, INVALID_ID, Method, QueryOptions, Ray, SimdLevel, Strided,
    StridedMut, Verdict,
};
use hgrid_tests::meshes::Mesh;
use hgrid_tests::methods::{configs, configs_with};
use hgrid_tests::owned::{Owned, prove};
use hgrid_tests::random::Random;
use hgrid_tests::reference::{Answer, Line};

use super::meshes;
use super::rays::Aims;

/// Rays in a batch: a few more than are traversed together.
const BATCH: usize = 72;

/// Differences after which a run stops.
const MOST: usize = 20;

/// The record of a run: the counts of its queries and the differences it found.
#[derive(Debug, Default)]
pub(crate) struct Done {
    pub(crate) meshes: u64,
    pub(crate) rays: u64,
    pub(crate) pairs: u64,
    /// Pairs of a ray and a triangle that the reference decided.
    pub(crate) ray_triangles: u64,
    pub(crate) hits: u64,
    /// Pairs among them that the rule leaves open.
    pub(crate) open: u64,
    pub(crate) levels: Vec<&'static str>,
    pub(crate) differences: Vec<String>,
}

/// A ray with the answers of the reference.
struct Asked {
    ray: Ray,
    /// All hits, the nearest first.
    hits: Vec<Hit>,
    /// For each hit, true if the ray meets the triangle's front.
    fronts: Vec<bool>,
}

/// A mesh with its triangles in the form that the reference reads.
struct Scene<'m> {
    name: String,
    triangles: Vec<[[f32; 3]; 3]>,
    masks: &'m [u32],
}

/// Takes meshes from number `first` on until `pairs` pairs are done.
pub(crate) fn run(seed: u64, first: u64, pairs: u64) -> Done {
    let levels: Vec<SimdLevel> = SimdLevel::available().collect();
    let mut done =
        Done { levels: levels.iter().map(|level| level.name()).collect(), ..Done::default() };
    for number in first.. {
        if done.pairs >= pairs || done.differences.len() >= MOST {
            break;
        }
        let mut random = Random(Random(seed).bits() ^ number.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let (name, mesh) = meshes::any(&mut random);
        let name = format!("HGRID_SEED={seed} HGRID_FIRST={number}: {name}");
        one_mesh(&mut random, name, &mesh, &levels, &mut done);
        done.meshes += 1;
    }
    done
}

fn one_mesh(random: &mut Random, name: String, mesh: &Mesh, levels: &[SimdLevel], done: &mut Done) {
    let masks: Vec<u32> = mesh.indices.iter().map(|_| 1 << random.below(4)).collect();
    let view = mesh.view().with_masks(Strided::new(&masks)).expect("a mask for each triangle");
    let corners = |t: &[u32; 3]| t.map(|v| mesh.positions[v as usize]);
    let triangles: Vec<_> = mesh.indices.iter().map(corners).collect();
    let scene = Scene { name, triangles, masks: &masks };

    // Build grids of all methods, with default settings or with many levels.
    let configs: Vec<Config> = match random.below(3) {
        0 => Method::ALL.iter().map(|&method| Config::new(method)).collect(),
        1 => configs().collect(),
        _ => configs_with([0.5, 2.0, 40.0][random.below(3)]).collect(),
    };
    let owned: Vec<Owned> = configs
        .iter()
        .map(|config| Owned::build(&view, config).unwrap_or_else(|e| panic!("{}: {e}", scene.name)))
        .collect();
    let grids: Vec<Grid<'_>> =
        owned.iter().map(|owned| owned.open(&view).expect("its own mesh")).collect();
    for grid in &grids {
        if let Err(error) = prove(grid) {
            done.differences.push(format!("{}: {:?}: {error}", scene.name, grid.method()));
        }
    }

    let aims = Aims::new(mesh);
    let mut last = None;
    // Send few rays where each one tests many triangles.
    let batches = if mesh.indices.len() > 500 { 1 } else { 4 + random.below(20) };
    for _ in 0..batches {
        let mut asked: Vec<Asked> = Vec::with_capacity(BATCH);
        // Let some batches start at one point, so that their rays are traversed together.
        let start = (random.below(3) == 0).then(|| aims.ray(random, None).origin);
        for _ in 0..BATCH {
            let mut ray = aims.ray(random, last.as_ref());
            ray.origin = start.unwrap_or(ray.origin);
            let one = ask(random, &scene, &grids[0], ray, done);
            if let Some(hit) = one.hits.first() {
                last = Some((ray, *hit));
            }
            asked.push(one);
        }
        for grid in &grids {
            let grid = grid.with_simd(levels[random.below(levels.len())]);
            let mut compare = Compare { scene: &scene, grid: &grid, done };
            let asked: Vec<&Asked> = asked.iter().collect();
            compare.one_by_one(random, &asked);
            compare.batches(&asked);
            done.pairs += asked.len() as u64;
        }
        done.rays += asked.len() as u64;
    }
}

/// Returns all hits of one method after comparing them with the reference: the answer that all others must give.
fn ask(
    random: &mut Random,
    scene: &Scene<'_>,
    grid: &Grid<'_>,
    ray: Ray,
    done: &mut Done,
) -> Asked {
    let mut hits = all_hits(grid, &ray, scene.triangles.len());
    let mut differ = |what: &str, id: u32| {
        let triangle = scene.triangles.get(id as usize);
        done.differences.push(format!("{}: {what} {id} {triangle:?} {ray:?}", scene.name));
    };
    let line = Line::new(&ray);
    let mut fronts = Vec::new();
    if line.is_none() && !hits.is_empty() {
        differ("no ray, but a hit", hits[0].primitive);
    }
    if let Some(line) = line {
        let mut is_hit = vec![false; scene.triangles.len()];
        for hit in &hits {
            is_hit[hit.primitive as usize] = true;
        }
        for ((id, triangle), &is_hit) in (0..).zip(&scene.triangles).zip(&is_hit) {
            match line.answer(triangle) {
                Answer::Miss if is_hit => differ("a hit, not a miss", id),
                Answer::Hit if !is_hit => differ("a miss, not a hit", id),
                Answer::Either => done.open += 1,
                Answer::Hit | Answer::Miss => {}
            }
        }
        done.ray_triangles += scene.triangles.len() as u64;
        for hit in &hits {
            let triangle = &scene.triangles[hit.primitive as usize];
            if !line.holds_numbers(triangle, hit) {
                differ(&format!("numbers {hit:?}"), hit.primitive);
            }
            if random.below(64) == 0 && !line.holds_places(triangle) {
                differ("places", hit.primitive);
            }
            fronts.push(line.sees_front(triangle));
        }
    }
    if hits.windows(2).any(|pair| (pair[0].t, pair[0].primitive) >= (pair[1].t, pair[1].primitive))
    {
        differ("order", hits[0].primitive);
        hits.dedup_by_key(|hit| hit.primitive);
    }
    done.hits += hits.len() as u64;
    Asked { ray, hits, fronts }
}

/// Returns all hits of a ray, in the order in which the library reports them.
fn all_hits(grid: &Grid<'_>, ray: &Ray, most: usize) -> Vec<Hit> {
    let mut hits = vec![Hit::MISS; most.min(100)];
    let count = grid.intersect_all(ray, &mut QueryOptions::default(), &mut hits);
    if count > hits.len() {
        hits.resize(count, Hit::MISS);
        grid.intersect_all(ray, &mut QueryOptions::default(), &mut hits);
    }
    hits.truncate(count);
    hits
}

/// Returns the bits of a hit, which tell -0.0 from 0.0.
fn bits(hit: &Hit) -> [u32; 4] {
    [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.primitive]
}

fn are_same<'h>(
    one: impl IntoIterator<Item = &'h Hit>,
    other: impl IntoIterator<Item = &'h Hit>,
) -> bool {
    one.into_iter().map(bits).eq(other.into_iter().map(bits))
}

/// Compares one grid at one SIMD level with the known hits.
struct Compare<'c> {
    scene: &'c Scene<'c>,
    grid: &'c Grid<'c>,
    done: &'c mut Done,
}

impl Compare<'_> {
    fn differ(&mut self, what: &str, asked: &Asked) {
        let method = self.grid.method();
        let Asked { ray, hits, .. } = asked;
        self.done.differences.push(format!(
            "{}: {method:?}: {what}: {ray:?}, not the first of {} hits {:?}",
            self.scene.name,
            hits.len(),
            hits.first()
        ));
    }

    fn one_by_one(&mut self, random: &mut Random, asked: &[&Asked]) {
        for one in asked {
            let Asked { ray, hits, .. } = one;
            let grid = self.grid;
            let found = grid.intersect(ray);
            if !are_same(&found, hits.first()) {
                self.differ(&format!("intersect {found:?}"), one);
            }
            if grid.occluded(ray) == hits.is_empty() {
                self.differ("occluded", one);
            }
            if !are_same(&all_hits(grid, ray, self.scene.triangles.len()), hits) {
                self.differ("all hits", one);
            }
            match random.below(4) {
                0 => self.selected(random, one),
                1 => self.filtered(random, one),
                2 => self.with_room(random, one),
                _ => {}
            }
        }
    }

    /// Checks queries with a mask, culling and a triangle to skip.
    fn selected(&mut self, random: &mut Random, asked: &Asked) {
        let Asked { ray, hits, fronts } = asked;
        let mask = [u32::MAX, 1, 6, 0][random.below(4)];
        let cull = [Cull::None, Cull::Back, Cull::Front][random.below(3)];
        let skip = match hits.len() {
            0 => INVALID_ID,
            count => hits[random.below(count)].primitive,
        };
        let skip = [skip, INVALID_ID][random.below(2)];
        let is_seen = |id: u32| mask == u32::MAX || self.scene.masks[id as usize] & mask != 0;
        let is_shown = |is_front: bool| match cull {
            Cull::None => true,
            Cull::Back => is_front,
            Cull::Front => !is_front,
        };
        let left = hits.iter().zip(fronts).filter(|&(hit, &is_front)| {
            hit.primitive != skip && is_seen(hit.primitive) && is_shown(is_front)
        });
        let left: Vec<Hit> = left.map(|(hit, _)| *hit).collect();
        let mut options = QueryOptions { mask, cull, skip, ..QueryOptions::default() };
        let found = self.grid.intersect_with(ray, &mut options);
        let is_hit = self.grid.occluded_with(ray, &mut options);
        let mut all = [Hit::MISS; 8];
        let count = self.grid.intersect_all(ray, &mut options, &mut all);
        let known = count.min(all.len());
        let is_right = are_same(&found, left.first())
            && is_hit != left.is_empty()
            && count == left.len()
            && are_same(&all[..known], &left[..known.min(left.len())]);
        if !is_right {
            self.differ(&format!("mask {mask} {cull:?} skip {skip}: {found:?} {count}"), asked);
        }
    }

    /// Checks filters that reject the first hits, and filters that stop the query.
    fn filtered(&mut self, random: &mut Random, asked: &Asked) {
        let Asked { ray, hits, .. } = asked;
        let passed = random.below(hits.len() + 2);
        let is_stopped = random.below(2) == 0;
        let mut shown = Vec::new();
        let mut filter = |_: usize, hit: &Hit| {
            shown.push(*hit);
            match () {
                () if shown.len() <= passed => Verdict::Reject,
                () if is_stopped => Verdict::AcceptAndStop,
                () => Verdict::Accept,
            }
        };
        let mut options = QueryOptions { filter: Some(&mut filter), ..QueryOptions::default() };
        let found = self.grid.intersect_with(ray, &mut options);
        let mut is_right = are_same(&found, hits.get(passed));
        is_right &= are_same(&shown, &hits[..(passed + 1).min(hits.len())]);

        let mut count = 0;
        let mut filter = |_: usize, _: &Hit| {
            count += 1;
            let is_last = is_stopped && count > passed;
            if is_last { Verdict::AcceptAndStop } else { Verdict::Accept }
        };
        let mut options = QueryOptions { filter: Some(&mut filter), ..QueryOptions::default() };
        let accepted = self.grid.intersect_all(ray, &mut options, &mut []);
        let expected = if is_stopped { hits.len().min(passed + 1) } else { hits.len() };
        if !is_right || accepted != expected || count != expected {
            self.differ(
                &format!("filter, {passed} rejected: {found:?} {shown:?} {accepted}"),
                asked,
            );
        }
    }

    /// Checks a query for all hits with room for only some of them.
    fn with_room(&mut self, random: &mut Random, asked: &Asked) {
        let Asked { ray, hits, .. } = asked;
        let room = random.below(hits.len() + 3);
        let mut found = vec![Hit::MISS; room];
        let count = self.grid.intersect_all(ray, &mut QueryOptions::default(), &mut found);
        let known = room.min(hits.len());
        let is_right = count == hits.len()
            && are_same(&found[..known], &hits[..known])
            && found[known..].iter().all(|hit| bits(hit) == bits(&Hit::MISS));
        if !is_right {
            self.differ(&format!("room for {room}: {count} {found:?}"), asked);
        }
    }

    /// Checks both batch queries, coherent and incoherent.
    fn batches(&mut self, asked: &[&Asked]) {
        let rays: Vec<Ray> = asked.iter().map(|one| one.ray).collect();
        let rays = Strided::new(&rays);
        for coherence in [Coherence::Coherent, Coherence::Incoherent] {
            let mut hits = vec![Hit { primitive: 7, ..Hit::MISS }; asked.len()];
            let mut occluded = vec![7_u8; asked.len()];
            let mut into = StridedMut::new(&mut hits);
            self.grid.intersect_n(&rays, &mut into, coherence).expect("sound arrays");
            let mut into = StridedMut::new(&mut occluded);
            self.grid.occluded_n(&rays, &mut into, coherence).expect("sound arrays");
            for (one, (hit, occluded)) in asked.iter().zip(hits.iter().zip(occluded)) {
                let expected = one.hits.first().copied().unwrap_or(Hit::MISS);
                if bits(hit) != bits(&expected) {
                    self.differ(&format!("batch {coherence:?} {hit:?}"), one);
                }
                if occluded != u8::from(!one.hits.is_empty()) {
                    self.differ(&format!("batch occluded {coherence:?} {occluded}"), one);
                }
            }
        }
    }
}
