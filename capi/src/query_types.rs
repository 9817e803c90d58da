//! The C structs of queries (rays, hits, options, counters), and their conversion to the types of core.
//!
//! The docs here are the text of `hgrid.h`: they are written for C readers.

use core::ffi::c_void;

use hgrid_core::{ClosestPoint, Coherence, Counters, Cull, Hit, INVALID_ID, Ray, Surface, Verdict};

use crate::status::{HGRID_ERROR_INVALID_COHERENCE, HGRID_ERROR_INVALID_CULL, hgrid_status};

/// Your hint about the rays of a batch, by which the library chooses their order: one of `HGRID_COHERENCE_...`. The
/// hint changes the speed, never the answers.
#[allow(non_camel_case_types, reason = "the C name")]
pub type hgrid_coherence = u32;

/// Nothing is known: random rays, rays after several bounces. A tree may sort them by origin and
/// direction, in windows of as many rays as `scratch` of the options holds; rays that follow their
/// neighbours anyway are left as they are. Other methods trace each ray alone.
pub const HGRID_COHERENCE_INCOHERENT: hgrid_coherence = 0;

/// Rays that follow one another start near each other: camera rays of a tile, shadow rays and
/// ambient occlusion from its hits. They are traced in the order given, with a tree in groups of 64.
/// The best order takes tile after tile of 8 x 8 pixels, and within a tile one square of 4 x 4 pixels after the
/// other.
pub const HGRID_COHERENCE_COHERENT: hgrid_coherence = 1;

/// A ray, or the part of it from `t_min` to `t_max`: 32 bytes, in the order of DXR's `RayDesc`.
///
/// A point of the ray is `origin + t * direction`. The direction has any length but zero, and every
/// `t` is a multiple of it. A hit is accepted for `t_min <= t <= t_max`, both ends included. A ray
/// with a NaN anywhere, with an infinite origin or direction, with a zero direction or with
/// `t_min > t_max` hits nothing. A call for a single ray stops a debug build of the library if all bytes of the ray are
/// 0: then nobody has written it.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct hgrid_ray {
    /// The point at which `t` is 0, in scene units.
    pub origin: [f32; 3],
    /// The smallest `t` that is accepted, usually 0; negative reaches behind the origin.
    pub t_min: f32,
    /// The direction, any length but zero.
    pub direction: [f32; 3],
    /// The largest `t` that is accepted; `INFINITY` and `FLT_MAX` are both fine.
    pub t_max: f32,
}

/// The hit of a ray on a triangle: 16 bytes.
///
/// The point is `origin + t * direction`, and also `(1 - u - v) * a + u * b + v * c` for the
/// triangle's vertices `a`, `b`, `c`, up to rounding. A hit is a function of the ray and the triangle
/// alone: other triangles, the method and the box of the grid do not change a bit of it.
///
/// There is no epsilon, but an error bound. Let L be the largest coordinate of a vertex relative to the ray's
/// origin. The `t` of a vertex is its coordinate relative to the origin, divided by the direction, both on the axis
/// along which the direction is longest; Z is the largest `t` of the three vertices minus the least. The reported
/// hit is the exact hit of a triangle whose vertices are moved by up to 2^-50 L across the ray, with these errors:
/// `u` and `v` up to (2^-24 + 2^-38) of their value, `t` up to 2^-24 |t| + 2^-38 (|t| + Z); numbers below 1.2e-38 up
/// to 2^-149. A vertex is moved alike for all triangles that share it, so no ray passes between them.
///
/// The range `t_min <= t <= t_max` is decided exactly, for all finite numbers, by the point where the ray's
/// line meets the plane of the unmoved vertices: a ray that starts above a plane and leaves it does not hit it,
/// however close it starts. An end of the range needs this decision only if it lies between the least and the
/// largest `t` of the vertices, or at one of them. Where a ray grazes a triangle, the `t` that follows from `u` and
/// `v` may differ from that of the plane. If the former lies outside of the range by no more than 2^-21 Z + 2^-49 T,
/// where T is the largest |t| of a vertex, the end of the range is reported. If it lies farther outside, there is
/// no hit. The reported `t` is rounded, so a range that ends at it may exclude the same hit. A triangle that is
/// farther from the origin than 2^50 times its size may be missed. (The source has the proof: core/src/triangle.rs.)
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct hgrid_hit {
    /// Distance in multiples of the ray's direction.
    pub t: f32,
    /// Weight of the triangle's second vertex, 0 to 1.
    pub u: f32,
    /// Weight of the triangle's third vertex, 0 to 1.
    pub v: f32,
    /// The triangle: its position in the index array. Of joined meshes it is counted through all of them.
    pub primitive: u32,
}

/// Work done by queries. A query adds to it, so one struct can sum up a whole picture: begin with
/// `hgrid_counters work = {0, 0, 0}`.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct hgrid_counters {
    /// Ray-triangle tests.
    pub primitive_tests: u64,
    /// Cells and macrocells entered, empty ones included; leaves of a tree.
    pub cell_steps: u64,
    /// Steps down a level, into a macrocell, a subgrid or a node; 0 for a grid of one level.
    pub grid_steps: u64,
}

/// The answer of a filter about a hit: one of `HGRID_REJECT`, `HGRID_ACCEPT` and `HGRID_ACCEPT_AND_STOP`.
/// Anything else counts as `HGRID_REJECT`.
#[allow(non_camel_case_types, reason = "the C name")]
pub type hgrid_verdict = u32;

/// The ray goes on as if the triangle were not there.
pub const HGRID_REJECT: hgrid_verdict = 0;

/// The hit counts.
pub const HGRID_ACCEPT: hgrid_verdict = 1;

/// The hit counts, and it is the last one: the same as `HGRID_ACCEPT`,
/// but for `hgrid_intersect_all`.
pub const HGRID_ACCEPT_AND_STOP: hgrid_verdict = 2;

/// Both sides of a triangle are hit: the default of `hgrid_query_options`.
pub const HGRID_CULL_NONE: u32 = 0;

/// A ray passes through triangles that show it their back.
pub const HGRID_CULL_BACK: u32 = 1;

/// A ray passes through triangles that show it their front: the side from which the vertices appear
/// counter-clockwise.
pub const HGRID_CULL_FRONT: u32 = 2;

/// The options of a query. Initialise them with `HGRID_QUERY_OPTIONS_INIT`; NULL means these defaults.
///
/// A query with options that are not the defaults is somewhat slower than one without. A tree
/// (`HGRID_METHOD_BVH`) traces the rays of a batch together whatever `mask`, `cull` and `skip` are, and
/// with a `filter` up to their first hits; with `counters`, and with the other methods, they are traced
/// one by one.
/// With options that break the rules for structs, a query of one ray or point returns a miss; a debug build of the
/// library stops. `hgrid_intersect_all` with the same options returns the error.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct hgrid_query_options {
    /// `sizeof(hgrid_query_options)`.
    pub struct_size: u32,
    /// A triangle is seen if its mask and this have a bit in common; see `masks` of `hgrid_mesh`.
    /// With all bits, the default, every triangle is seen, even one whose mask is 0. 0 sees nothing, and no error
    /// tells: begin with `HGRID_QUERY_OPTIONS_INIT`, not with zeros.
    pub mask: u32,
    /// The sides that are not hit: one of `HGRID_CULL_...`.
    pub cull: u32,
    /// A triangle that is not hit, usually the one that the ray leaves, or `HGRID_INVALID_ID`. Skipping needs
    /// no epsilon, but a neighbour across an edge may still be hit if rounding put the origin below that neighbour. All
    /// rays of a batch skip the same triangle; rays from origins of `hgrid_surface_at` need not skip any. 0 skips
    /// triangle 0.
    pub skip: u32,
    /// Yours: passed on to `filter`.
    pub context: *mut c_void,
    /// Returns whether a `hit` counts. NULL means that all hits count. `ray` is the number of the ray in
    /// its batch, 0 for a single ray. `hgrid_closest_point` does not ask it.
    ///
    /// The filter gets the hits of a ray from near to far, at equal `t` by ascending triangle, and each
    /// triangle at most once. In a batch it gets all hits of one ray before those of the next.
    /// `filter_mask` selects the triangles that it is called for. It runs on the thread that called the
    /// query, may query the same grid, and must not be left by `longjmp` or by a C++ exception. Here is
    /// glass, which lets shadow rays pass and weakens them:
    ///
    /// ```c
    /// typedef struct {
    ///     const unsigned char *is_glass;
    ///     float light;
    /// } shadow;
    ///
    /// static hgrid_verdict pass_glass(void *context, size_t ray, const hgrid_hit *hit)
    /// {
    ///     shadow *to = (shadow *)context;
    ///     (void)ray;
    ///     if (!to->is_glass[hit->primitive])
    ///         return HGRID_ACCEPT;
    ///     to->light *= 0.8f;
    ///     return HGRID_REJECT;
    /// }
    ///
    /// static float light_along(const hgrid_grid *grid, const hgrid_ray *ray,
    ///                          const unsigned char *is_glass)
    /// {
    ///     shadow to = {is_glass, 1};
    ///     hgrid_query_options options = HGRID_QUERY_OPTIONS_INIT;
    ///     options.filter = pass_glass, options.context = &to;
    ///     return hgrid_occluded(grid, ray, &options) ? 0 : to.light;
    /// }
    /// ```
    pub filter: Option<
        unsafe extern "C" fn(
            context: *mut c_void,
            ray: usize,
            hit: *const hgrid_hit,
        ) -> hgrid_verdict,
    >,
    /// The counters that the work is added to, or NULL. Each thread needs its own. The rays of a batch are traced one
    /// by one to be counted.
    pub counters: *mut hgrid_counters,
    /// Memory in which a batch with `HGRID_COHERENCE_INCOHERENT` may sort its rays, or NULL. It may have
    /// any alignment and hold anything. It may overlap none of these: rays, answers, view, blob, mesh,
    /// boxes. Each thread needs its own. A filter or test that starts a batch must pass other
    /// scratch. Queries of one ray or point do not look at it.
    pub scratch: *mut c_void,
    /// Bytes of `scratch`. With 16 bytes for each ray a whole batch is sorted at once. With fewer, but 4
    /// KiB or more, the batch is sorted window by window, as many rays as fit. With still fewer a window is
    /// 256 rays on the stack. Larger windows give the answers sooner, up to millions of rays.
    pub scratch_bytes: usize,
    /// `filter` is called for the triangles whose mask has a bit in common with this one. The others are
    /// opaque: their hits count without a call. With 0, the default, and with all bits it is called for
    /// every triangle, even one whose mask is 0.
    ///
    /// In a batch, rays that meet only opaque triangles cost no more than without a filter. If an opaque
    /// triangle blocks a ray, `hgrid_occluded` and its like may call the filter for other hits of the ray,
    /// or not. Here are leaves, whose triangles have the mask 2, among walls:
    ///
    /// ```c
    /// static hgrid_status light_of_rays(const hgrid_grid *grid, const hgrid_ray *rays, size_t count,
    ///                                   hgrid_verdict (*is_leaf_there)(void *, size_t,
    ///                                                                  const hgrid_hit *),
    ///                                   void *textures, unsigned char *occluded)
    /// {
    ///     hgrid_query_options options = HGRID_QUERY_OPTIONS_INIT;
    ///     options.filter = is_leaf_there, options.context = textures;
    ///     options.filter_mask = 2;
    ///     return hgrid_occluded_n(grid, rays, 0, occluded, 0, count, HGRID_COHERENCE_COHERENT, &options);
    /// }
    /// ```
    pub filter_mask: u32,
    /// 0.
    pub reserved: u32,
}

/// A point, and how far to look from there: 16 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct hgrid_point_query {
    /// The point to look from, in scene units.
    pub point: [f32; 3],
    /// The largest distance that is accepted, 0 or more; `INFINITY` and `FLT_MAX` are both fine.
    pub max_distance: f32,
}

/// The point of a mesh that is closest to a point: 28 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct hgrid_closest {
    /// The point, in scene units.
    pub position: [f32; 3],
    /// Distance from the given point, in scene units.
    pub distance: f32,
    /// Weight of the triangle's second vertex, 0 to 1.
    pub u: f32,
    /// Weight of the triangle's third vertex, 0 to 1.
    pub v: f32,
    /// The triangle: its position in the index array. Of joined meshes it is counted through all of them.
    pub primitive: u32,
}

/// A point of a mesh where a ray met it: 52 bytes. `hgrid_surface_at` fills it.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct hgrid_surface {
    /// The point, in scene units; on the triangle but for the rounding to `float`.
    pub position: [f32; 3],
    /// The triangle's normal, of length 1, on the side that the ray came from.
    pub normal: [f32; 3],
    /// Origin for rays that leave on that side: reflections, and rays to lights.
    pub above: [f32; 3],
    /// Origin for rays that go on through the triangle.
    pub below: [f32; 3],
    /// 1 if the ray met the front, from which the vertices appear counter-clockwise; 0 if the back.
    pub is_front: u32,
}

const _: () = assert!(HGRID_COHERENCE_INCOHERENT == Coherence::Incoherent as u32);
const _: () = assert!(HGRID_COHERENCE_COHERENT == Coherence::Coherent as u32);
const _: () = assert!(HGRID_REJECT == Verdict::Reject as u32);
const _: () = assert!(HGRID_ACCEPT == Verdict::Accept as u32);
const _: () = assert!(HGRID_ACCEPT_AND_STOP == Verdict::AcceptAndStop as u32);
const _: () = assert!(HGRID_CULL_NONE == Cull::None as u32);
const _: () = assert!(HGRID_CULL_BACK == Cull::Back as u32);
const _: () = assert!(HGRID_CULL_FRONT == Cull::Front as u32);

impl From<Ray> for hgrid_ray {
    fn from(Ray { origin, t_min, direction, t_max }: Ray) -> Self {
        Self { origin, t_min, direction, t_max }
    }
}

impl From<hgrid_ray> for Ray {
    fn from(ray: hgrid_ray) -> Self {
        let hgrid_ray { origin, t_min, direction, t_max } = ray;
        Self { origin, t_min, direction, t_max }
    }
}

impl From<Hit> for hgrid_hit {
    fn from(hit: Hit) -> Self {
        let Hit { t, u, v, primitive } = hit;
        Self { t, u, v, primitive }
    }
}

impl From<hgrid_counters> for Counters {
    fn from(counters: hgrid_counters) -> Self {
        let hgrid_counters { primitive_tests, cell_steps, grid_steps } = counters;
        Self { primitive_tests, cell_steps, grid_steps }
    }
}

impl From<Counters> for hgrid_counters {
    fn from(counters: Counters) -> Self {
        let Counters { primitive_tests, cell_steps, grid_steps } = counters;
        Self { primitive_tests, cell_steps, grid_steps }
    }
}

impl From<ClosestPoint> for hgrid_closest {
    fn from(closest: ClosestPoint) -> Self {
        let ClosestPoint { position, distance, u, v, primitive } = closest;
        Self { position, distance, u, v, primitive }
    }
}

impl From<hgrid_hit> for Hit {
    fn from(hit: hgrid_hit) -> Self {
        let hgrid_hit { t, u, v, primitive } = hit;
        Self { t, u, v, primitive }
    }
}

impl From<Surface> for hgrid_surface {
    fn from(surface: Surface) -> Self {
        let Surface { position, normal, above, below, is_front } = surface;
        Self { position, normal, above, below, is_front }
    }
}

impl hgrid_query_options {
    /// Returns true if these are the defaults, which need not be looked at.
    pub(crate) const fn are_default(&self) -> bool {
        self.mask == u32::MAX
            && self.cull == HGRID_CULL_NONE
            && self.skip == INVALID_ID
            && self.filter.is_none()
            && self.counters.is_null()
    }

    /// The sides that are not hit.
    pub(crate) const fn cull(&self) -> Result<Cull, hgrid_status> {
        cull(self.cull)
    }
}

/// Sides as core knows them.
pub(crate) const fn cull(cull: u32) -> Result<Cull, hgrid_status> {
    match cull {
        HGRID_CULL_NONE => Ok(Cull::None),
        HGRID_CULL_BACK => Ok(Cull::Back),
        HGRID_CULL_FRONT => Ok(Cull::Front),
        _ => Err(HGRID_ERROR_INVALID_CULL),
    }
}

/// The mask of the triangles that a filter is asked about, as core knows it.
pub(crate) const fn filter_mask(bits: u32) -> u32 {
    if bits == 0 { u32::MAX } else { bits }
}

/// A verdict as core knows it.
pub(crate) const fn verdict(verdict: hgrid_verdict) -> Verdict {
    match verdict {
        HGRID_ACCEPT => Verdict::Accept,
        HGRID_ACCEPT_AND_STOP => Verdict::AcceptAndStop,
        _ => Verdict::Reject,
    }
}

/// The coherence as core knows it.
pub(crate) const fn coherence(coherence: hgrid_coherence) -> Result<Coherence, hgrid_status> {
    match coherence {
        HGRID_COHERENCE_INCOHERENT => Ok(Coherence::Incoherent),
        HGRID_COHERENCE_COHERENT => Ok(Coherence::Coherent),
        _ => Err(HGRID_ERROR_INVALID_COHERENCE),
    }
}
