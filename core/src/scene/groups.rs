//! Batches of rays in a scene, in groups.
//!
//! ```text
//! take up to 64 rays through the tree of the scene together
//! an instance whose box some of them meet: drop it by its mask; else
//!     a tree:             move each of them into its space, as a single query does
//!                         take them through it together, each up to its closest hit so far
//!                         move the `t` of what they hit back, and end them there
//!     other objects, or few rays: ask it for each of them alone
//! ```

use core::marker::PhantomData;

use super::instance::{ObjectRay, StoredInstance};
use super::query::{
    InstanceSearch, QueryParameters, SceneAnswer, SceneHit, SceneOptions, ask_object, scene_hit,
};
use super::{Object, Scene};
use crate::approach::LineF64;
use crate::batch::groups::in_groups;
use crate::batch::{Batch, Coherence};
use crate::bvh::{Bvh, GROUP, Group, GroupStack, Rays, Scope, Together, lanes};
use crate::grid::Grid;
use crate::options::{QueryOptions, Selection};
use crate::ray::{Hit, INVALID_ID, Ray, RayF64};
use crate::shapes::groups::offer_shapes;
use crate::simd::SimdLevel;

/// The most rays that are asked for one by one.
const FEW: u32 = 2;

/// Answers all rays of a batch.
pub(super) fn trace<A: SceneAnswer, B: Batch<A, RayF64>>(
    scene: &Scene<'_>,
    tree: &Bvh<'_>,
    batch: &mut B,
    coherence: Coherence,
    options: &mut SceneOptions<'_>,
) {
    let lent = core::mem::take(&mut options.scratch);
    let rays = &mut SceneRays::new(scene, QueryParameters::new(options, A::IS_ANY));
    // All instances: `shown` leaves out those that the mask does not see.
    let asked = (QueryOptions::default().choice(), false);
    let batch = &mut SceneBatch { scene, batch, options, answers: PhantomData::<A>, rays };
    in_groups(&scene.tree, tree, asked, coherence, lent, batch);
    options.scratch = lent;
}

/// A batch with its scene and its options.
struct SceneBatch<'r, 's, 'q, B, A> {
    scene: &'r Scene<'s>,
    batch: &'r mut B,
    options: &'r mut SceneOptions<'q>,
    answers: PhantomData<A>,
    rays: &'r mut SceneRays<'s>,
}

impl<A: SceneAnswer, B: Batch<A, RayF64>> Together for SceneBatch<'_, '_, '_, B, A> {
    fn count(&self) -> usize {
        self.batch.count()
    }

    fn ray(&self, place: usize) -> Ray {
        self.batch.ray(place).rounded()
    }

    fn load(&mut self, lane: usize, place: usize) -> Ray {
        self.rays.load(lane, self.batch.ray(place))
    }

    fn trace(&mut self, group: &mut Group<'_>, level: SimdLevel, _: bool) -> u64 {
        self.rays.trace(group, level)
    }

    fn found(&mut self, place: usize, lane: usize, _: &Hit) {
        let hit = &self.rays.best[lane % GROUP];
        let hit = (hit.path[0] != INVALID_ID).then_some(*hit);
        self.batch.answer(place, A::of(hit));
    }

    fn alone(&mut self, place: usize) {
        self.scene.answer(self.batch, place, self.options);
    }
}

/// The rays of a group in a scene and their closest hits. Not generic over the batch: all batches share its code.
struct SceneRays<'r> {
    scene: &'r Scene<'r>,
    parameters: QueryParameters,
    given: [RayF64; GROUP],
    /// The largest coordinate of an origin that was rounded, or 0.
    largest: f32,
    best: [SceneHit; GROUP],
    /// The rays that enter an object, as it sees them, and their lanes in the group.
    object_rays: [ObjectRay; GROUP],
    lanes: [u32; GROUP],
    /// The `t` up to which hits of each matter.
    until: [f32; GROUP],
    inside: Rays,
    stack: GroupStack,
}

impl<'r> SceneRays<'r> {
    fn new(scene: &'r Scene<'r>, parameters: QueryParameters) -> Self {
        let mut inside = Rays::new(parameters.options().choice());
        inside.starts_at_box = true;
        Self {
            scene,
            parameters,
            given: [RayF64::new([0.0; 3], [0.0; 3]); GROUP],
            largest: 0.0,
            best: [SceneHit::MISS; GROUP],
            object_rays: [ObjectRay::NONE; GROUP],
            lanes: [0; GROUP],
            until: [0.0; GROUP],
            inside,
            stack: GroupStack::new(),
        }
    }

    /// Takes the ray of a lane; returns it as the tree of the scene sees it, with its origin rounded.
    fn load(&mut self, lane: usize, ray: RayF64) -> Ray {
        if lane == 0 {
            self.largest = 0.0;
        }
        let rounded = ray.rounded();
        if !ray.is_exact() {
            let coordinates = rounded.origin.map(f32::abs).into_iter();
            self.largest = coordinates.filter(|c| c.is_finite()).fold(self.largest, f32::max);
        }
        self.given[lane % GROUP] = ray;
        rounded
    }

    /// Finds a hit of each ray of a group. Returns a mask of those that must be traced alone instead.
    fn trace(&mut self, group: &mut Group<'_>, level: SimdLevel) -> u64 {
        self.best = [SceneHit::MISS; GROUP];
        group.rays.origin_error = self.largest * f32::EPSILON;
        let is_any = self.parameters.is_any;
        group.offer(level, is_any, &mut |number, mask, outer| self.offer(number, mask, outer))
    }

    /// Asks an instance for some rays.
    fn offer(&mut self, number: u32, mask: u64, outer: &mut Rays) {
        let Some((stored, object)) = self.scene.shown(number, &self.parameters) else { return };
        let grid = match object {
            Object::Grid(grid) => Some(*grid),
            Object::Shapes(shapes, _) => Some(shapes.grid()),
            Object::Scene(_) | Object::Nothing => None,
        };
        if let Some(grid) = grid
            && let Some(tree) = grid.tree()
            && mask.count_ones() > FEW
        {
            self.together(number, stored, object, (grid, tree), mask, outer);
            return;
        }
        for lane in lanes(mask) {
            self.alone(number, lane, outer);
        }
    }

    /// Asks an instance for one ray.
    #[inline(never)]
    fn alone(&mut self, number: u32, lane: u32, outer: &mut Rays) {
        let (at, parameters) = (lane as usize % GROUP, self.parameters);
        let ray = &self.given[at];
        let mut search = InstanceSearch {
            scene: self.scene,
            line: &ray.into(),
            ray,
            level: 0,
            parameters: &parameters,
            best: None,
            limit: self.best[at].t,
            filter: None,
            counters: None,
        };
        if let Some(hit) = search.ask(number) {
            self.keep(lane, &hit, outer);
        }
    }

    /// Takes some rays through the tree of an instance's object together.
    fn together(
        &mut self,
        number: u32,
        stored: &StoredInstance,
        object: &Object<'_>,
        (grid, bvh): (&Grid<'_>, &Bvh<'_>),
        mask: u64,
        outer: &mut Rays,
    ) {
        let Scope { mesh, bounds, simd } = grid.scope();
        let corners = grid.bounds();
        let mut count = 0;
        for lane in lanes(mask) {
            let ray = &self.given[lane as usize % GROUP];
            let Some(mut object_ray) = ObjectRay::new(&stored.line(&LineF64::from(ray))) else {
                continue;
            };
            let limit = self.best[lane as usize % GROUP].t;
            let Some(inside) = object_ray.narrow(ray, &corners) else { continue };
            // A group takes no hits behind the origin.
            if object_ray.is_from_afar(&corners) {
                self.alone(number, lane, outer);
                continue;
            }
            self.until[count % GROUP] = object_ray.until(limit, &inside);
            self.inside.slots()[count % GROUP] = inside;
            self.object_rays[count % GROUP] = object_ray;
            self.lanes[count % GROUP] = lane;
            count += 1;
        }
        if count == 0 {
            return;
        }
        let is_any = self.parameters.is_any;
        let options = &mut self.parameters.options();
        let (rays, stack) = (&mut self.inside, &mut self.stack);
        let until = Some(&self.until);
        let mut group = Group { bvh, mesh, bounds: &bounds, rays, stack, count, until };
        let alone = match object {
            Object::Shapes(_, test) => {
                let test = &mut |id: u32, ray: &Ray| test.test(id, ray);
                offer_shapes(&mut group, simd, is_any, &Selection::new(mesh, options), test)
            }
            _ => group.trace(simd, is_any),
        };
        for at in 0..count.min(GROUP) {
            let hit = if alone >> at & 1 == 0 {
                let hit = self.inside.hits[at];
                (hit.primitive != INVALID_ID).then_some(hit)
            } else {
                ask_object(object, &self.inside.slots()[at], self.until[at], is_any, options)
            };
            let Some(hit) = hit else { continue };
            let lane = self.lanes[at];
            let ray = &self.given[lane as usize % GROUP];
            self.keep(lane, &scene_hit(&self.object_rays[at], ray, 0, number, &hit), outer);
        }
    }

    /// Keeps a hit of a ray if it is the closest so far, and ends the ray there.
    fn keep(&mut self, lane: u32, hit: &SceneHit, outer: &mut Rays) {
        let best = &mut self.best[lane as usize % GROUP];
        if !hit.is_closer(best) {
            return;
        }
        *best = *hit;
        if self.parameters.is_any {
            outer.finish(lane);
        } else {
            outer.end_at(lane, hit.t);
        }
    }
}
