//! The queries of a scene: closest hit and any hit of a ray.
//!
//! ```text
//! walk the tree of the scene; for each instance whose box the ray meets, roughly front to back:
//!     drop it by its mask
//!     move the ray into the space of its object, in f64
//!     a grid or shapes:   round the ray to f32, ask the object up to the closest hit so far,
//!                         move the `t` of its hit back
//!     a scene:            do the same there, with the ray still in f64
//! ```

use core::fmt;

use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

use super::instance::{ObjectRay, StoredInstance};
use super::{Object, Scene};
use crate::approach::LineF64;
use crate::batch::{Answer, Batch};
use crate::counters::Counters;
use crate::limits::MAX_NESTING;
use crate::options::{Cull, QueryOptions, Verdict};
use crate::ray::{Hit, INVALID_ID, Ray, RayF64};
use crate::search::{BoxSearch, Outcome};

/// The hit of a ray in a scene: 32 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, FromBytes, Immutable, IntoBytes, KnownLayout)]
pub struct SceneHit {
    /// Distance in multiples of the ray's direction.
    pub t: f32,
    /// Weight of the triangle's second vertex, 0 to 1; of a shape what its test says.
    pub u: f32,
    /// Weight of the triangle's third vertex, 0 to 1; of a shape what its test says.
    pub v: f32,
    /// Id of the triangle or shape in its object.
    pub primitive: u32,
    /// The numbers of the instances on the way to the object, from the outermost scene on; the rest is
    /// [`INVALID_ID`].
    pub path: [u32; MAX_NESTING],
}

impl SceneHit {
    /// No hit.
    pub const MISS: Self = Self {
        t: f32::INFINITY,
        u: 0.0,
        v: 0.0,
        primitive: INVALID_ID,
        path: [INVALID_ID; MAX_NESTING],
    };

    /// Returns true if this hit is reported rather than the other: smaller `t`, then the smaller path, then the
    /// smaller id.
    #[must_use]
    pub fn is_closer(&self, other: &Self) -> bool {
        self.t < other.t
            || (self.t <= other.t && (self.path, self.primitive) < (other.path, other.primitive))
    }
}

/// The answer of a scene to a ray of a batch.
pub(super) trait SceneAnswer: Answer {
    fn of(hit: Option<SceneHit>) -> Self;
}

impl Answer for SceneHit {
    const IS_ANY: bool = false;
}

impl SceneAnswer for SceneHit {
    fn of(hit: Option<SceneHit>) -> Self {
        hit.unwrap_or(Self::MISS)
    }
}

impl SceneAnswer for bool {
    fn of(hit: Option<SceneHit>) -> Self {
        hit.is_some()
    }
}

/// Decides whether a hit counts. Gets the number of the ray in its batch, 0 for a single ray, and the hit.
pub type SceneFilter<'q> = dyn FnMut(usize, &SceneHit) -> Verdict + 'q;

/// The options of a query of a scene. `SceneOptions::default()` changes nothing.
pub struct SceneOptions<'q> {
    /// An instance is seen if its mask and this have a bit in common. In it, each triangle and shape is seen if its own
    /// mask has one. With all bits, the default, everything is seen, even with a mask of 0.
    pub mask: u32,
    /// The sides of triangles that are not hit. The front is decided in the space of the triangle's own mesh: an
    /// instance that mirrors does not turn it round.
    pub cull: Cull,
    /// Decides whether a hit counts. Within an instance it is asked from near to far and about each triangle that
    /// `filter_mask` selects at most once; instances come roughly front to back, so a hit that it accepts may still be
    /// replaced by a closer one of another instance. What lies behind a hit that it accepted is not shown to it.
    /// [`Verdict::AcceptAndStop`] is the same as [`Verdict::Accept`]. Shapes are not shown to it: their test decides.
    pub filter: Option<&'q mut SceneFilter<'q>>,
    /// The filter is asked about a triangle if a bit of this is set in the mask that the triangle has in its mesh, too.
    /// The others are opaque: their hits count without a call. The default is all bits: the filter is asked about every
    /// triangle, even one whose mask is 0. With 0 it is asked about none (in C, 0 stands for all bits).
    pub filter_mask: u32,
    /// Counters that add up the work: an instance that is offered is a primitive test. With counters or a filter, the
    /// rays of a batch are traced one by one.
    pub counters: Option<&'q mut Counters>,
    /// Memory to sort the rays of a batch in, as [`QueryOptions::scratch`].
    pub scratch: &'q mut [u8],
}

impl Default for SceneOptions<'_> {
    fn default() -> Self {
        Self {
            mask: u32::MAX,
            cull: Cull::None,
            filter: None,
            filter_mask: u32::MAX,
            counters: None,
            scratch: &mut [],
        }
    }
}

impl fmt::Debug for SceneOptions<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SceneOptions")
            .field("mask", &self.mask)
            .field("cull", &self.cull)
            .field("filter", &self.filter.is_some())
            .field("filter_mask", &self.filter_mask)
            .field("counters", &self.counters)
            .field("scratch", &self.scratch.len())
            .finish()
    }
}

impl Scene<'_> {
    /// The closest hit of a ray. Where several are equally close, that of the first instance; within an instance its
    /// object decides.
    ///
    /// ```
    #[doc = include_str!("../../doc/scene.txt")]
    /// let hit = scene.intersect(&RayF64::new([0.25, 0.5, 1.0], [0.0, 0.0, -1.0]));
    /// assert_eq!(hit.map(|hit| (hit.t, hit.path[0], hit.primitive)), Some((1.0, 0, 0)));
    /// # Ok::<(), Error>(())
    /// ```
    #[must_use]
    pub fn intersect(&self, ray: &RayF64) -> Option<SceneHit> {
        self.intersect_with(ray, &mut SceneOptions::default())
    }

    /// Returns true if anything is hit.
    ///
    /// ```
    #[doc = include_str!("../../doc/scene.txt")]
    /// assert!(scene.occluded(&RayF64::new([0.25, 0.5, 1.0], [0.0, 0.0, -1.0])));
    /// # Ok::<(), Error>(())
    /// ```
    #[must_use]
    pub fn occluded(&self, ray: &RayF64) -> bool {
        self.occluded_with(ray, &mut SceneOptions::default())
    }

    /// [`intersect`](Self::intersect) with options.
    ///
    /// ```
    #[doc = include_str!("../../doc/scene.txt")]
    /// let ray = RayF64::new([0.25, 0.5, 1.0], [0.0, 0.0, -1.0]);
    /// let mut options = SceneOptions { cull: Cull::Front, ..SceneOptions::default() };
    /// assert_eq!(scene.intersect_with(&ray, &mut options), None);
    /// # Ok::<(), Error>(())
    /// ```
    pub fn intersect_with(&self, ray: &RayF64, options: &mut SceneOptions<'_>) -> Option<SceneHit> {
        self.ask(0, ray, options, false)
    }

    /// [`occluded`](Self::occluded) with options.
    pub fn occluded_with(&self, ray: &RayF64, options: &mut SceneOptions<'_>) -> bool {
        self.ask(0, ray, options, true).is_some()
    }

    /// Answers one ray of a batch. Out of line, so that a program has its code once.
    #[inline(never)]
    pub(super) fn answer<A: SceneAnswer>(
        &self,
        batch: &mut impl Batch<A, RayF64>,
        place: usize,
        options: &mut SceneOptions<'_>,
    ) {
        let hit = self.ask(place, &batch.ray(place), options, A::IS_ANY);
        batch.answer(place, A::of(hit));
    }

    /// The answer for the ray at a place of a batch.
    pub(super) fn ask(
        &self,
        place: usize,
        ray: &RayF64,
        options: &mut SceneOptions<'_>,
        is_any: bool,
    ) -> Option<SceneHit> {
        let parameters = QueryParameters::new(options, is_any);
        let counters = options.counters.as_deref_mut();
        let mut show;
        let filter: Option<&mut HitFilter<'_>> = match &mut options.filter {
            Some(filter) => {
                show = |hit: &SceneHit| filter(place, hit);
                Some(&mut show)
            }
            None => None,
        };
        self.trace(&LineF64::from(ray), ray, f32::INFINITY, 0, &parameters, filter, counters)
    }

    /// An instance that a query sees, and its object.
    pub(super) fn shown(
        &self,
        number: u32,
        parameters: &QueryParameters,
    ) -> Option<(&StoredInstance, &Object<'_>)> {
        let mask = parameters.mask;
        if mask != u32::MAX && self.tree.mesh().mask(number) & mask == 0 {
            return None;
        }
        let stored = self.instances.get(number as usize)?;
        Some((stored, self.objects.get(stored.object() as usize)?))
    }

    /// The closest hit of a ray no farther than a limit, or any; at a level of nesting. `line` is the ray as this
    /// scene sees it, `ray` that of the outermost scene.
    #[expect(clippy::too_many_arguments, reason = "each is its own")]
    fn trace(
        &self,
        line: &LineF64,
        ray: &RayF64,
        limit: f32,
        level: usize,
        parameters: &QueryParameters,
        filter: Option<&mut HitFilter<'_>>,
        counters: Option<&mut Counters>,
    ) -> Option<SceneHit> {
        if level >= MAX_NESTING {
            return None;
        }
        let t_max = if limit < ray.t_max { limit } else { ray.t_max };
        let mut offered = InstanceSearch {
            scene: self,
            line,
            ray,
            level,
            parameters,
            best: None,
            limit,
            filter,
            counters,
        };
        let mut steps = Counters::default();
        let mut offer = BoxSearch(&mut |number| offered.offer(number));
        if level == 0 {
            let shortened = RayF64 { t_max, ..*ray };
            self.tree.search_boxes(&shortened, &mut offer, &mut steps);
        } else {
            let ObjectRay { line, scale, .. } = ObjectRay::new(line)?;
            let range = [ray.t_min, t_max];
            self.tree.search_boxes_along(&line, scale, range, &mut offer, &mut steps);
        }
        if let Some(counters) = offered.counters {
            counters.add(&steps);
        }
        offered.best
    }
}

/// The conditions that hold for all instances.
#[derive(Debug, Clone, Copy)]
pub(super) struct QueryParameters {
    mask: u32,
    cull: Cull,
    filter_mask: u32,
    pub(super) is_any: bool,
}

impl QueryParameters {
    pub(super) const fn new(options: &SceneOptions<'_>, is_any: bool) -> Self {
        let SceneOptions { mask, cull, filter_mask, .. } = *options;
        Self { mask, cull, filter_mask, is_any }
    }

    /// The options of queries of objects.
    pub(super) fn options<'q>(self) -> QueryOptions<'q> {
        let Self { mask, cull, filter_mask, .. } = self;
        QueryOptions { mask, cull, filter_mask, ..QueryOptions::default() }
    }
}

/// The filter of one ray: it gets no place in a batch.
type HitFilter<'f> = dyn FnMut(&SceneHit) -> Verdict + 'f;

/// The search over the instances whose boxes a ray meets.
pub(super) struct InstanceSearch<'q, 'f> {
    pub(super) scene: &'q Scene<'q>,
    pub(super) line: &'q LineF64,
    pub(super) ray: &'q RayF64,
    pub(super) level: usize,
    pub(super) parameters: &'q QueryParameters,
    pub(super) best: Option<SceneHit>,
    /// The `t` behind which nothing matters.
    pub(super) limit: f32,
    pub(super) filter: Option<&'q mut HitFilter<'f>>,
    pub(super) counters: Option<&'q mut Counters>,
}

impl InstanceSearch<'_, '_> {
    /// Asks an instance whose box the ray meets.
    fn offer(&mut self, number: u32) -> Outcome {
        let Some(hit) = self.ask(number) else { return Outcome::Unchanged };
        // The range in the object may end a step behind the limit.
        let is_behind = hit.t > self.limit;
        if is_behind || self.best.is_some_and(|best| !hit.is_closer(&best)) {
            return Outcome::Unchanged;
        }
        (self.best, self.limit) = (Some(hit), hit.t);
        if self.parameters.is_any { Outcome::Done } else { Outcome::EndsAt(hit.t) }
    }

    /// Finds the ray's hit in an instance, no farther than what was hit before.
    pub(super) fn ask(&mut self, number: u32) -> Option<SceneHit> {
        let Self { scene, line, ray, level, parameters, .. } = *self;
        let is_any = parameters.is_any;
        let (stored, object) = scene.shown(number, parameters)?;
        let line = stored.line(line);

        // Inside a scene the ray keeps its f64 and its `t`.
        if let Object::Scene(inner) = object {
            let named = |hit: &SceneHit| {
                let mut hit = *hit;
                if let Some(place) = hit.path.get_mut(level) {
                    *place = number;
                }
                hit
            };
            let mut show;
            let filter: Option<&mut HitFilter<'_>> = match &mut self.filter {
                Some(filter) => {
                    show = |hit: &SceneHit| filter(&named(hit));
                    Some(&mut show)
                }
                None => None,
            };
            let (limit, counters) = (self.limit, self.counters.as_deref_mut());
            let hit = inner.trace(&line, ray, limit, level + 1, parameters, filter, counters)?;
            return Some(named(&hit));
        }

        let mut object_ray = ObjectRay::new(&line)?;
        let inside = object_ray.narrow(ray, &object.bounds())?;
        let until = object_ray.until(self.limit, &inside);
        let to_scene = |hit: &Hit| scene_hit(&object_ray, ray, level, number, hit);
        let mut show;
        let mut options = parameters.options();
        options.counters = self.counters.as_deref_mut();
        if let (Object::Grid(_), Some(filter)) = (object, &mut self.filter) {
            let limit = self.limit;
            show = move |_: usize, hit: &Hit| {
                let hit = to_scene(hit);
                // Accept what lies behind the limit without asking: `offer` drops it.
                if hit.t > limit { Verdict::Accept } else { filter(&hit) }
            };
            options.filter = Some(&mut show);
        }
        let hit = ask_object(object, &inside, until, is_any, &mut options)?;
        Some(to_scene(&hit))
    }
}

/// Returns the closest hit of a ray in a grid or in shapes, if its `t` is no more than `until`. With `is_any`, any hit
/// will do.
pub(super) fn ask_object(
    object: &Object<'_>,
    ray: &Ray,
    until: f32,
    is_any: bool,
    options: &mut QueryOptions<'_>,
) -> Option<Hit> {
    let any = |is_hit: bool| is_hit.then_some(Hit { t: ray.t_min, ..Hit::MISS });
    match object {
        Object::Grid(grid) if is_any => any(grid.occluded_with(ray, options)),
        Object::Grid(grid) => grid.intersect_at((0, ray), until, options),
        Object::Shapes(shapes, test) => {
            let mut test = |id: u32, ray: &Ray| test.test(id, ray);
            // The test of a shape compares the `t` that it reports with the range.
            let ray = &Ray { t_max: until, ..*ray };
            if is_any {
                any(shapes.occluded_with(ray, options, &mut test))
            } else {
                shapes.intersect_with(ray, options, &mut test)
            }
        }
        Object::Scene(_) | Object::Nothing => None,
    }
}

/// A hit of an object as one of the scene at a level.
pub(super) fn scene_hit(
    object_ray: &ObjectRay,
    ray: &RayF64,
    level: usize,
    number: u32,
    hit: &Hit,
) -> SceneHit {
    let mut path = [INVALID_ID; MAX_NESTING];
    if let Some(place) = path.get_mut(level) {
        *place = number;
    }
    SceneHit {
        t: object_ray.scene_t(hit.t, ray),
        u: hit.u,
        v: hit.v,
        primitive: hit.primitive,
        path,
    }
}

const _: () = assert!(size_of::<SceneHit>() == 32);
