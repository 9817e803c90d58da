/* Shapes of one's own, and scenes of instances: what they answer, what they refuse, NULL in every pointer, structs of
 * other versions. */

#include "versions.h"

enum { SPHERES = 200, INSTANCES = 30 };

typedef struct {
    float box[6];
    uint32_t mask;
    float center[3], radius;
} sphere;

static sheet mesh_data;
static hgrid_mesh mesh;
static hgrid_grid grid;
static sphere spheres[SPHERES];
static hgrid_boxes boxes;
static hgrid_shapes shapes;
static hgrid_instance instances[INSTANCES];
static hgrid_object objects[3];
static hgrid_scene scene, inner;
static const hgrid_config one_level = HGRID_CONFIG_INIT_ONE_LEVEL;
static const hgrid_report new_report = HGRID_REPORT_INIT;
static unsigned asked;

static void *index_region, *scratch, *shape_blob, *scene_blob, *inner_blob;
static size_t shape_bytes, scene_bytes, inner_bytes;

enum { INDEX_BYTES = 112 * 1000 + 896, SCRATCH_BYTES = 271 * 64 };

/* A square root: the programs are linked without a library of mathematics. */
static double root_of(double square)
{
    double root = square > 1 ? square : 1;
    for (int i = 0; i < 60; i++)
        root = 0.5 * (root + square / root);
    return square > 0 ? root : 0;
}

/* The nearer of the two places where a ray meets a sphere, or the farther one. */
static bool meet(void *context, uint32_t shape, const hgrid_ray *ray, hgrid_shape_hit *hit)
{
    const sphere *s = (const sphere *)context + shape;
    double a = 0, b = 0, c = -(double)s->radius * (double)s->radius;
    asked++;
    CHECK(shape < SPHERES);
    for (int k = 0; k < 3; k++) {
        const double p = (double)ray->origin[k] - (double)s->center[k], d = (double)ray->direction[k];
        a += d * d, b += p * d, c += p * p;
    }
    if (b * b < a * c)
        return false;
    const double root = root_of(b * b - a * c);
    hit->t = (float)((-b - root) / a);
    if (hit->t < ray->t_min)
        hit->t = (float)((-b + root) / a);
    hit->u = s->radius, hit->v = 7;
    return true;
}

static float next_random(void)
{
    static uint32_t state = 1;
    state = state * 1664525u + 1013904223u;
    return (float)(state >> 8) / 16777216.0f;
}

static void prepare(void)
{
    make_sheet(&mesh_data);
    mesh = mesh_of(&mesh_data);
    grid = build_exactly(&mesh, NULL, NULL, NULL);
    for (size_t i = 0; i < SPHERES; i++) {
        sphere *s = &spheres[i];
        s->radius = 0.01f + 0.04f * next_random();
        s->mask = 1u << (i % 2);
        for (int k = 0; k < 3; k++) {
            s->center[k] = next_random();
            s->box[k] = s->center[k] - s->radius * 1.001f;
            s->box[k + 3] = s->center[k] + s->radius * 1.001f;
        }
    }
    const hgrid_boxes none = HGRID_BOXES_INIT;
    boxes = none;
    boxes.boxes = spheres, boxes.box_stride = sizeof *spheres, boxes.count = SPHERES;
    boxes.masks = &spheres[0].mask, boxes.mask_stride = sizeof *spheres;
    boxes.test = meet, boxes.context = spheres;
    index_region = guarded(INDEX_BYTES);
    scratch = guarded(SCRATCH_BYTES);
}

static void shapes_answer_as_a_loop_over_all(void)
{
    hgrid_report report = new_report;
    EXPECT(HGRID_OK, hgrid_build_shapes(&boxes, NULL, index_region, INDEX_BYTES, scratch, SCRATCH_BYTES, &shapes,
                                        &report));
    CHECK(report.is_exact == 1 && report.index_bytes <= HGRID_INDEX_BOUND(SPHERES) && report.skipped_count == 0);
    CHECK(report.reference_count == SPHERES && report.triangle == HGRID_INVALID_ID);
    shape_bytes = (size_t)report.index_bytes;
    shape_blob = guarded_copy(index_region, shape_bytes);
    EXPECT(HGRID_OK, hgrid_open_shapes(shape_blob, shape_bytes, &boxes, &shapes));
    EXPECT(HGRID_OK, hgrid_validate_shapes(&shapes, scratch, HGRID_VALIDATE_BOUND(SPHERES)));
    EXPECT(HGRID_ERROR_SCRATCH_TOO_SMALL, hgrid_validate_shapes(&shapes, scratch, 3));
    hgrid_query_options options = HGRID_QUERY_OPTIONS_INIT;
    hgrid_counters counters = {0, 0, 0};
    options.counters = &counters;
    unsigned hits = 0;
    for (int round = 0; round < 400; round++) {
        hgrid_ray ray = {{0, 0, 0}, 0, {0, 0, 0}, INFINITY};
        for (int k = 0; k < 3; k++) {
            ray.origin[k] = 4 * next_random() - 2;
            ray.direction[k] = next_random() - ray.origin[k];
        }
        options.mask = round % 2 ? 2u : 0xffffffffu;
        hgrid_hit best = {INFINITY, 0, 0, HGRID_INVALID_ID}, hit;
        for (uint32_t i = 0; i < SPHERES; i++) {
            hgrid_shape_hit at;
            if ((spheres[i].mask & options.mask) != 0 && meet(spheres, i, &ray, &at) && at.t >= 0 && at.t < best.t)
                best.t = at.t, best.u = at.u, best.v = at.v, best.primitive = i;
        }
        asked = 0;
        const bool is_hit = hgrid_intersect_shapes(&shapes, &ray, &options, &hit);
        CHECK(asked < SPHERES / 2);
        CHECK(is_hit == (best.primitive != HGRID_INVALID_ID));
        CHECK(hgrid_occluded_shapes(&shapes, &ray, &options) == is_hit);
        if (is_hit)
            CHECK(memcmp(&hit, &best, sizeof hit) == 0);
        hits += is_hit;
    }
    CHECK(hits > 40 && counters.primitive_tests > 0);

    /* Without a test nothing is hit. */
    hgrid_boxes silent = boxes;
    silent.test = NULL;
    hgrid_shapes view;
    hgrid_hit hit;
    const hgrid_ray ray = {{0.5f, 0.5f, -1}, 0, {0, 0, 1}, INFINITY};
    EXPECT(HGRID_OK, hgrid_open_shapes(shape_blob, shape_bytes, &silent, &view));
    CHECK(!hgrid_intersect_shapes(&view, &ray, NULL, &hit));

    /* A refit follows the boxes, and the way back gives the same bytes. */
    hgrid_refit_report first = HGRID_REFIT_REPORT_INIT;
    void *built = guarded_copy(shape_blob, shape_bytes);
    for (size_t i = 0; i < SPHERES; i++)
        spheres[i].box[2] -= 1, spheres[i].box[5] -= 1, spheres[i].center[2] -= 1;
    EXPECT(HGRID_OK, hgrid_refit_shapes(&boxes, shape_blob, shape_bytes, &shapes, &first));
    CHECK(first.cost_before > 1 && first.cost_after > 1);
    EXPECT(HGRID_OK, hgrid_validate_shapes(&shapes, scratch, HGRID_VALIDATE_BOUND(SPHERES)));
    for (size_t i = 0; i < SPHERES; i++)
        spheres[i].center[2] += 1, spheres[i].box[2] = spheres[i].center[2] - spheres[i].radius * 1.001f,
        spheres[i].box[5] = spheres[i].center[2] + spheres[i].radius * 1.001f;
    EXPECT(HGRID_OK, hgrid_refit_shapes(&boxes, shape_blob, shape_bytes, &shapes, NULL));
    CHECK(memcmp(built, shape_blob, shape_bytes) == 0);
}

static hgrid_ray_f64 wide_ray(double x, double y, double z)
{
    const hgrid_ray_f64 ray = {{x, y, z}, {0, 0, -1}, 0, INFINITY, 0};
    return ray;
}

static void scenes_show_grids_shapes_and_scenes(void)
{
    const hgrid_instance here = HGRID_INSTANCE_INIT;
    EXPECT(HGRID_OK, hgrid_object_grid(&grid, &objects[0]));
    EXPECT(HGRID_OK, hgrid_object_shapes(&shapes, &objects[1]));
    for (uint32_t i = 0; i < INSTANCES; i++) {
        instances[i] = here;
        instances[i].object = i % 2;
        instances[i].id = 1000 + i;
        instances[i].mask = 1u << (i % 3);
        /* Ten units apart, and the sheets upside down: their front shows away. */
        instances[i].translation[0] = 10.0 * i;
        instances[i].linear[2][2] = i % 2 ? 1 : -1;
    }
    hgrid_report report = new_report, bound = new_report;
    EXPECT(HGRID_OK, hgrid_scene_bound(INSTANCES, NULL, &bound));
    CHECK(bound.index_bytes <= HGRID_SCENE_BOUND(INSTANCES) && bound.is_exact == 0);
    CHECK(bound.scratch_bytes <= HGRID_SCRATCH_BOUND(INSTANCES));
    EXPECT(HGRID_OK, hgrid_build_scene(instances, INSTANCES, objects, 2, NULL, index_region,
                                       (size_t)bound.index_bytes, scratch, (size_t)bound.scratch_bytes, &inner,
                                       &report));
    CHECK(report.is_exact == 1 && report.index_bytes <= bound.index_bytes && report.reference_count == INSTANCES);
    inner_bytes = (size_t)report.index_bytes;
    inner_blob = guarded_copy(index_region, inner_bytes);
    EXPECT(HGRID_OK, hgrid_open_scene(inner_blob, inner_bytes, objects, 2, &inner));
    EXPECT(HGRID_OK, hgrid_validate_scene(&inner, scratch, HGRID_VALIDATE_BOUND(INSTANCES)));
    EXPECT(HGRID_ERROR_SCRATCH_TOO_SMALL, hgrid_validate_scene(&inner, scratch, 3));

    /* Every sheet is where it was put, and hit as the grid alone is. */
    const hgrid_ray down = {{0.3f, 0.4f, 1}, 0, {0, 0, -1}, INFINITY};
    hgrid_hit alone;
    CHECK(hgrid_intersect(&grid, &down, NULL, &alone));
    for (uint32_t i = 0; i < INSTANCES; i += 2) {
        hgrid_ray_f64 up = wide_ray(10.0 * i + 0.3, 0.4, -1);
        up.direction[2] = 1;
        hgrid_scene_hit hit;
        CHECK(hgrid_intersect_scene(&inner, &up, NULL, &hit) && hgrid_occluded_scene(&inner, &up, NULL));
        CHECK(hit.path[0] == i && hit.path[1] == HGRID_INVALID_ID && hit.primitive == alone.primitive);
        CHECK(fabsf(hit.t - alone.t) < 1e-5f);
        float normal[3], given[3] = {0, 0, 5};
        CHECK(hgrid_scene_normal(&inner, &hit, NULL, normal) && normal[2] < -0.5f);
        CHECK(hgrid_scene_normal(&inner, &hit, given, normal) && fabsf(normal[2] + 1) < 1e-6f);

        hgrid_scene_options options = HGRID_SCENE_OPTIONS_INIT;
        hgrid_counters counters = {0, 0, 0};
        options.counters = &counters;
        options.mask = 1u << (i % 3);
        CHECK(hgrid_intersect_scene(&inner, &up, &options, &hit) && counters.primitive_tests > 0);
        options.mask = 1u << ((i + 1) % 3);
        CHECK(!hgrid_intersect_scene(&inner, &up, &options, &hit));
        options.mask = 0xffffffffu;
        /* The front is that of the mesh, though the instance mirrors. */
        options.cull = HGRID_CULL_BACK;
        CHECK(hgrid_occluded_scene(&inner, &up, &options));
        options.cull = HGRID_CULL_FRONT;
        CHECK(!hgrid_occluded_scene(&inner, &up, &options));
        options.cull = 3;
        CHECK(!hgrid_occluded_scene(&inner, &up, &options));
    }

    /* A scene in a scene, a million units away. */
    hgrid_instance two[2] = {HGRID_INSTANCE_INIT, HGRID_INSTANCE_INIT};
    EXPECT(HGRID_OK, hgrid_object_scene(&inner, &objects[2]));
    two[0].object = two[1].object = 2;
    two[1].translation[1] = 1e6;
    EXPECT(HGRID_OK, hgrid_build_scene(two, 2, objects, 3, NULL, index_region, INDEX_BYTES, scratch, SCRATCH_BYTES,
                                       &scene, &report));
    scene_bytes = (size_t)report.index_bytes;
    scene_blob = guarded_copy(index_region, scene_bytes);
    EXPECT(HGRID_OK, hgrid_open_scene(scene_blob, scene_bytes, objects, 3, &scene));
    hgrid_ray_f64 up = wide_ray(40.3, 1e6 + 0.4, -1);
    up.direction[2] = 1;
    hgrid_scene_hit hit;
    CHECK(hgrid_intersect_scene(&scene, &up, NULL, &hit));
    CHECK(hit.path[0] == 1 && hit.path[1] == 4 && hit.path[2] == HGRID_INVALID_ID);
    CHECK(hit.primitive == alone.primitive && fabsf(hit.t - alone.t) < 1e-5f);
}

static unsigned shown;

static hgrid_verdict no_even(void *context, const hgrid_scene_hit *hit)
{
    CHECK(context == &shown);
    shown++;
    return hit->primitive % 2 == 0 ? HGRID_REJECT : HGRID_ACCEPT;
}

static void filters_are_shown_hits_of_the_scene(void)
{
    hgrid_scene_options options = HGRID_SCENE_OPTIONS_INIT;
    options.filter = no_even, options.context = &shown;
    unsigned hits = 0;
    for (int i = 0; i < 100; i++) {
        hgrid_ray_f64 up = wide_ray(20 + 0.01 * i, 0.011 * i, -1);
        up.direction[2] = 1;
        hgrid_scene_hit hit, with;
        const bool plain = hgrid_intersect_scene(&scene, &up, NULL, &hit);
        const bool is_hit = hgrid_intersect_scene(&scene, &up, &options, &with);
        CHECK(!is_hit || with.primitive % 2 == 1);
        /* A neighbour may be hit across an edge. */
        CHECK(plain || !is_hit);
        CHECK(!plain || hit.primitive % 2 == 0 || is_hit);
        hits += is_hit;
    }
    CHECK(hits > 10 && shown > 2 * hits / 2);
}

static void a_refit_follows_the_instances(void)
{
    hgrid_scene view;
    hgrid_refit_report report = HGRID_REFIT_REPORT_INIT;
    hgrid_instance moved[INSTANCES];
    void *copy = guarded_copy(inner_blob, inner_bytes);
    memcpy(moved, instances, sizeof moved);
    for (size_t i = 0; i < INSTANCES; i++)
        moved[i].translation[2] = 100;
    EXPECT(HGRID_OK, hgrid_refit_scene(moved, INSTANCES, objects, 2, copy, inner_bytes, &view, &report));
    CHECK(report.cost_after > 1);
    EXPECT(HGRID_OK, hgrid_validate_scene(&view, scratch, SCRATCH_BYTES));
    hgrid_ray_f64 up = wide_ray(0.3, 0.4, 98);
    up.direction[2] = 1, up.t_max = 3;
    hgrid_scene_hit hit;
    CHECK(hgrid_intersect_scene(&view, &up, NULL, &hit) && hit.path[0] == 0);
    EXPECT(HGRID_OK, hgrid_refit_scene(instances, INSTANCES, objects, 2, copy, inner_bytes, &view, NULL));
    CHECK(memcmp(copy, inner_blob, inner_bytes) == 0);
}

/* Builds shapes that cannot be. */
static uint32_t no_shapes(hgrid_status expected, const hgrid_boxes *of, const hgrid_config *config, void *index,
                          size_t index_bytes, void *extra, size_t extra_bytes)
{
    hgrid_shapes view;
    hgrid_report report = new_report;
    memset(&view, 0xc7, sizeof view);
    EXPECT_OF("hgrid_build_shapes(", expected,
              hgrid_build_shapes(of, config, index, index_bytes, extra, extra_bytes, &view, &report));
    CHECK(all_bytes_are(&view, sizeof view, 0xc7));
    return report.triangle;
}

/* Builds a scene that cannot be. */
static uint32_t no_scene(hgrid_status expected, const hgrid_instance *of, size_t count, size_t object_count,
                         const hgrid_config *config, void *index, size_t index_bytes, void *extra,
                         size_t extra_bytes)
{
    hgrid_scene view;
    hgrid_report report = new_report;
    memset(&view, 0xc7, sizeof view);
    EXPECT_OF("hgrid_build_scene(", expected,
              hgrid_build_scene(of, count, objects, object_count, config, index, index_bytes, extra, extra_bytes,
                                &view, &report));
    CHECK(all_bytes_are(&view, sizeof view, 0xc7));
    return report.triangle;
}

static void what_shapes_refuse(void)
{
    char *const index = (char *)index_region, *const extra = (char *)scratch;
    hgrid_boxes bad = boxes;
    bad.box_stride = 23;
    no_shapes(HGRID_ERROR_INVALID_POSITIONS, &bad, NULL, index, INDEX_BYTES, extra, SCRATCH_BYTES);
    bad = boxes, bad.mask_stride = 3;
    no_shapes(HGRID_ERROR_INVALID_MASKS, &bad, NULL, index, INDEX_BYTES, extra, SCRATCH_BYTES);
    bad = boxes, bad.reserved = 1;
    no_shapes(HGRID_ERROR_STRUCT_SIZE, &bad, NULL, index, INDEX_BYTES, extra, SCRATCH_BYTES);
    bad = boxes, bad.boxes = NULL;
    no_shapes(HGRID_ERROR_NULL_ARGUMENT, &bad, NULL, index, INDEX_BYTES, extra, SCRATCH_BYTES);
    bad = boxes, bad.boxes = index;
    no_shapes(HGRID_ERROR_OVERLAP, &bad, NULL, index, INDEX_BYTES, extra, SCRATCH_BYTES);
    bad = boxes, bad.masks = NULL, bad.count = 4294967295u;
    no_shapes(HGRID_ERROR_TOO_MANY_TRIANGLES, &bad, NULL, index, INDEX_BYTES, extra, SCRATCH_BYTES);
    no_shapes(HGRID_ERROR_INVALID_METHOD, &boxes, &one_level, index, INDEX_BYTES, extra, SCRATCH_BYTES);
    no_shapes(HGRID_ERROR_MISALIGNED, &boxes, NULL, index + 8, INDEX_BYTES - 64, extra, SCRATCH_BYTES);
    no_shapes(HGRID_ERROR_INDEX_TOO_SMALL, &boxes, NULL, index, 640, extra, SCRATCH_BYTES);
    no_shapes(HGRID_ERROR_SCRATCH_TOO_SMALL, &boxes, NULL, index, INDEX_BYTES, extra, 64);

    /* A box that is not finite is left out, or named. */
    static sphere broken[SPHERES];
    hgrid_config strict = HGRID_CONFIG_INIT;
    hgrid_report report = new_report;
    hgrid_shapes view;
    memcpy(broken, spheres, sizeof broken);
    broken[7].box[3] = NAN;
    bad = boxes, bad.boxes = broken;
    strict.flags = HGRID_BUILD_STRICT;
    CHECK(no_shapes(HGRID_ERROR_NON_FINITE, &bad, &strict, index, INDEX_BYTES, extra, SCRATCH_BYTES) == 7);
    EXPECT(HGRID_OK,
           hgrid_build_shapes(&bad, NULL, index, INDEX_BYTES, extra, SCRATCH_BYTES, &view, &report));
    CHECK(report.skipped_count == 1 && report.reference_count == SPHERES - 1);

    /* Blobs of something else. */
    hgrid_grid none;
    hgrid_blob_info info = HGRID_BLOB_INFO_INIT;
    EXPECT(HGRID_ERROR_OTHER_CONTENT, hgrid_open_shapes(scene_blob, scene_bytes, &boxes, &view));
    EXPECT(HGRID_ERROR_OTHER_CONTENT, hgrid_open(shape_blob, shape_bytes, &mesh, &none));
    EXPECT(HGRID_OK, hgrid_peek(scene_blob, scene_bytes, &info));
    CHECK(info.total_bytes == scene_bytes && info.triangle_count == 2);
    bad = boxes, bad.box_stride = 23;
    EXPECT(HGRID_ERROR_INVALID_POSITIONS, hgrid_open_shapes(shape_blob, shape_bytes, &bad, &view));
    bad = boxes, bad.mask_stride = 3;
    EXPECT(HGRID_ERROR_INVALID_MASKS, hgrid_open_shapes(shape_blob, shape_bytes, &bad, &view));
    bad = boxes, bad.count--;
    EXPECT(HGRID_ERROR_MESH_MISMATCH, hgrid_open_shapes(shape_blob, shape_bytes, &bad, &view));
    EXPECT(HGRID_ERROR_MESH_MISMATCH, hgrid_refit_shapes(&bad, shape_blob, shape_bytes, &view, NULL));
    EXPECT(HGRID_ERROR_TRUNCATED, hgrid_open_shapes(shape_blob, shape_bytes - 1, &boxes, &view));

    /* A view of zeros. */
    const hgrid_shapes zeros = HGRID_SHAPES_INIT;
    const hgrid_ray ray = {{0.5f, 0.5f, -1}, 0, {0, 0, 1}, INFINITY};
    hgrid_hit hit;
    hgrid_object object;
    EXPECT(HGRID_ERROR_NOT_A_GRID, hgrid_validate_shapes(&zeros, scratch, SCRATCH_BYTES));
    EXPECT(HGRID_ERROR_NOT_A_GRID, hgrid_object_shapes(&zeros, &object));
    CHECK(!hgrid_intersect_shapes(&zeros, &ray, NULL, &hit) && !hgrid_occluded_shapes(&zeros, &ray, NULL));

    /* A damaged tree is no tree. */
    void *copy = guarded_copy(shape_blob, shape_bytes);
    ((unsigned char *)copy)[shape_bytes - 65] ^= 0x5a;
    ((unsigned char *)copy)[200] ^= 0x5a;
    EXPECT(HGRID_OK, hgrid_open_shapes(copy, shape_bytes, &boxes, &view));
    EXPECT(HGRID_ERROR_CORRUPT, hgrid_validate_shapes(&view, scratch, SCRATCH_BYTES));
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_validate_shapes(&view, copy, 64));
}

static void what_scenes_refuse(void)
{
    char *const index = (char *)index_region, *const extra = (char *)scratch;
    const hgrid_instance here = HGRID_INSTANCE_INIT;
    hgrid_instance three[3] = {HGRID_INSTANCE_INIT, HGRID_INSTANCE_INIT, HGRID_INSTANCE_INIT};
    hgrid_report report = new_report;
    three[1].object = 3;
    CHECK(no_scene(HGRID_ERROR_INSTANCE_OBJECT, three, 3, 3, NULL, index, INDEX_BYTES, extra, SCRATCH_BYTES) == 1);
    three[1] = here;
    const float odd[] = {0, NAN, INFINITY, 1e-40f};
    for (size_t i = 0; i < sizeof odd / sizeof *odd; i++) {
        three[2].linear[1][1] = odd[i];
        CHECK(no_scene(HGRID_ERROR_INSTANCE_MATRIX, three, 3, 3, NULL, index, INDEX_BYTES, extra, SCRATCH_BYTES)
              == 2);
    }
    /* Rank two, and a place that is none. */
    const hgrid_instance flat = {{{1, 2, 3}, {4, 5, 6}, {7, 8, 9}}, 0, {0, 0, 0}, 1, 0};
    three[2] = flat;
    CHECK(no_scene(HGRID_ERROR_INSTANCE_MATRIX, three, 3, 3, NULL, index, INDEX_BYTES, extra, SCRATCH_BYTES) == 2);
    three[2] = here, three[2].translation[0] = (double)NAN;
    CHECK(no_scene(HGRID_ERROR_INSTANCE_MATRIX, three, 3, 3, NULL, index, INDEX_BYTES, extra, SCRATCH_BYTES) == 2);
    three[2] = here;
    no_scene(HGRID_ERROR_INVALID_METHOD, three, 3, 3, &one_level, index, INDEX_BYTES, extra, SCRATCH_BYTES);
    EXPECT(HGRID_ERROR_INVALID_METHOD, hgrid_scene_bound(3, &one_level, &report));
    EXPECT(HGRID_ERROR_TOO_MANY_TRIANGLES, hgrid_scene_bound(SIZE_MAX, NULL, &report));
    no_scene(HGRID_ERROR_TOO_MANY_TRIANGLES, three, SIZE_MAX / 2, 3, NULL, index, INDEX_BYTES, extra,
             SCRATCH_BYTES);
    no_scene(HGRID_ERROR_NULL_ARGUMENT, NULL, 3, 3, NULL, index, INDEX_BYTES, extra, SCRATCH_BYTES);
    no_scene(HGRID_ERROR_MISALIGNED, three, 3, 3, NULL, index + 8, INDEX_BYTES - 64, extra, SCRATCH_BYTES);
    no_scene(HGRID_ERROR_INDEX_TOO_SMALL, three, 3, 3, NULL, index, 640, extra, SCRATCH_BYTES);
    no_scene(HGRID_ERROR_SCRATCH_TOO_SMALL, three, 3, 3, NULL, index, INDEX_BYTES, extra, 0);
    no_scene(HGRID_ERROR_OVERLAP, (const hgrid_instance *)index, 3, 3, NULL, index, INDEX_BYTES, extra,
             SCRATCH_BYTES);

    /* Nothing is a scene, too. */
    hgrid_scene empty;
    hgrid_scene_hit hit;
    const hgrid_ray_f64 ray = wide_ray(0.5, 0.5, 1);
    EXPECT(HGRID_OK, hgrid_build_scene(NULL, 0, NULL, 0, NULL, index, HGRID_SCENE_BOUND(0), extra, SCRATCH_BYTES,
                                       &empty, NULL));
    CHECK(!hgrid_intersect_scene(&empty, &ray, NULL, &hit));

    /* Four inside one another, and not one more. */
    hgrid_object around[4];
    hgrid_scene nested[4];
    EXPECT(HGRID_OK, hgrid_object_scene(&inner, &around[0]));
    for (int level = 0; level < 3; level++) {
        void *blob = guarded(1024);
        EXPECT(HGRID_OK, hgrid_build_scene(&here, 1, &around[level], 1, NULL, blob, HGRID_SCENE_BOUND(1), extra,
                                           SCRATCH_BYTES, &nested[level], NULL));
        EXPECT(HGRID_OK, hgrid_object_scene(&nested[level], &around[level + 1]));
    }
    hgrid_ray_f64 up = wide_ray(0.3, 0.4, -1);
    up.direction[2] = 1;
    CHECK(hgrid_intersect_scene(&nested[2], &up, NULL, &hit) && hit.path[3] == 0);
    EXPECT(HGRID_ERROR_TOO_DEEP, hgrid_build_scene(&here, 1, &around[3], 1, NULL, index, INDEX_BYTES, extra,
                                                   SCRATCH_BYTES, &empty, NULL));
    EXPECT(HGRID_ERROR_TOO_DEEP, hgrid_open_scene(scene_blob, scene_bytes, around, 4, &empty));

    EXPECT(HGRID_ERROR_MISSING_OBJECTS, hgrid_open_scene(scene_blob, scene_bytes, objects, 2, &empty));
    EXPECT(HGRID_ERROR_OTHER_CONTENT, hgrid_open_scene(shape_blob, shape_bytes, objects, 3, &empty));
    EXPECT(HGRID_ERROR_TRUNCATED, hgrid_open_scene(scene_blob, scene_bytes - 1, objects, 3, &empty));
    void *copy = guarded_copy(inner_blob, inner_bytes);
    EXPECT(HGRID_ERROR_MESH_MISMATCH,
           hgrid_refit_scene(instances, INSTANCES - 1, objects, 2, copy, inner_bytes, &empty, NULL));
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_refit_scene((const hgrid_instance *)copy, INSTANCES, objects, 2, copy,
                                                  inner_bytes, &empty, NULL));
    hgrid_refit_report refit = HGRID_REFIT_REPORT_INIT;
    instances[3].object = 9;
    EXPECT(HGRID_ERROR_INSTANCE_OBJECT,
           hgrid_refit_scene(instances, INSTANCES, objects, 2, copy, inner_bytes, &empty, &refit));
    CHECK(refit.triangle == 3);
    refit.triangle = 0;
    instances[3].object = 1, instances[3].linear[0][0] = 0;
    copy = guarded_copy(inner_blob, inner_bytes);
    EXPECT(HGRID_ERROR_INSTANCE_MATRIX,
           hgrid_refit_scene(instances, INSTANCES, objects, 2, copy, inner_bytes, &empty, &refit));
    CHECK(refit.triangle == 3);
    instances[3].linear[0][0] = 1;

    /* Boxes that are not those of the instances. */
    copy = guarded_copy(inner_blob, inner_bytes);
    /* The place of the last instance, before the padding of its section. */
    const double elsewhere = 1234;
    memcpy((char *)copy + inner_bytes - 16 - 72 + 40, &elsewhere, sizeof elsewhere);
    EXPECT(HGRID_OK, hgrid_open_scene(copy, inner_bytes, objects, 2, &empty));
    EXPECT(HGRID_ERROR_CORRUPT, hgrid_validate_scene(&empty, scratch, SCRATCH_BYTES));
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_validate_scene(&empty, copy, 64));

    const hgrid_scene zeros = HGRID_SCENE_INIT;
    const hgrid_grid no_grid = HGRID_GRID_INIT;
    hgrid_object object;
    float normal[3];
    EXPECT(HGRID_ERROR_NOT_A_GRID, hgrid_validate_scene(&zeros, scratch, SCRATCH_BYTES));
    EXPECT(HGRID_ERROR_NOT_A_GRID, hgrid_object_scene(&zeros, &object));
    EXPECT(HGRID_ERROR_NOT_A_GRID, hgrid_object_grid(&no_grid, &object));
    CHECK(!hgrid_intersect_scene(&zeros, &ray, NULL, &hit) && !hgrid_occluded_scene(&zeros, &ray, NULL));
    CHECK(!hgrid_scene_normal(&zeros, &hit, NULL, normal));
    hgrid_scene_hit miss = {INFINITY, 0, 0, HGRID_INVALID_ID, {99, 0, 0, 0}};
    CHECK(!hgrid_scene_normal(&scene, &miss, NULL, normal));
}

/* NULL for a parameter: refused, allowed, or a miss. */
#define REFUSED(parameter, call) \
    do { \
        EXPECT(HGRID_ERROR_NULL_ARGUMENT, call); \
        puts("null " #parameter); \
    } while (0)
#define ALLOWED(parameter, call) \
    do { \
        EXPECT(HGRID_OK, call); \
        puts("null " #parameter); \
    } while (0)
#define MISSED(parameter, call) \
    do { \
        CHECK(!(call)); \
        puts("null " #parameter); \
    } while (0)

static void no_pointers(void)
{
    void *const x = index_region, *const y = scratch, *const b = shape_blob, *const c = inner_blob;
    const size_t n = INDEX_BYTES, m = SCRATCH_BYTES, s = shape_bytes, t = inner_bytes, k = INSTANCES;
    hgrid_shapes view;
    hgrid_scene sight;
    hgrid_object object;
    hgrid_report report = new_report;
    hgrid_hit hit;
    hgrid_scene_hit scene_hit;
    const hgrid_ray ray = {{0.5f, 0.5f, -1}, 0, {0, 0, 1}, INFINITY};
    hgrid_ray_f64 wide = wide_ray(0.3, 0.4, -1);
    float normal[3];
    wide.direction[2] = 1;
    CHECK(hgrid_intersect_scene(&inner, &wide, NULL, &scene_hit));
    REFUSED(hgrid_build_shapes.boxes, hgrid_build_shapes(NULL, NULL, x, n, y, m, &view, NULL));
    ALLOWED(hgrid_build_shapes.config, hgrid_build_shapes(&boxes, NULL, x, n, y, m, &view, &report));
    REFUSED(hgrid_build_shapes.index, hgrid_build_shapes(&boxes, NULL, NULL, n, y, m, &view, NULL));
    REFUSED(hgrid_build_shapes.scratch, hgrid_build_shapes(&boxes, NULL, x, n, NULL, m, &view, NULL));
    REFUSED(hgrid_build_shapes.shapes, hgrid_build_shapes(&boxes, NULL, x, n, y, m, NULL, NULL));
    ALLOWED(hgrid_build_shapes.report, hgrid_build_shapes(&boxes, NULL, x, n, y, m, &view, NULL));
    REFUSED(hgrid_open_shapes.blob, hgrid_open_shapes(NULL, s, &boxes, &view));
    REFUSED(hgrid_open_shapes.boxes, hgrid_open_shapes(b, s, NULL, &view));
    REFUSED(hgrid_open_shapes.shapes, hgrid_open_shapes(b, s, &boxes, NULL));
    REFUSED(hgrid_refit_shapes.boxes, hgrid_refit_shapes(NULL, b, s, &view, NULL));
    REFUSED(hgrid_refit_shapes.blob, hgrid_refit_shapes(&boxes, NULL, s, &view, NULL));
    REFUSED(hgrid_refit_shapes.shapes, hgrid_refit_shapes(&boxes, b, s, NULL, NULL));
    ALLOWED(hgrid_refit_shapes.report, hgrid_refit_shapes(&boxes, b, s, &view, NULL));
    REFUSED(hgrid_validate_shapes.shapes, hgrid_validate_shapes(NULL, y, m));
    REFUSED(hgrid_validate_shapes.scratch, hgrid_validate_shapes(&shapes, NULL, m));
    MISSED(hgrid_intersect_shapes.shapes, hgrid_intersect_shapes(NULL, &ray, NULL, &hit));
    MISSED(hgrid_intersect_shapes.ray, hgrid_intersect_shapes(&shapes, NULL, NULL, &hit));
    MISSED(hgrid_intersect_shapes.hit, hgrid_intersect_shapes(&shapes, &ray, NULL, NULL));
    CHECK(hgrid_intersect_shapes(&shapes, &ray, NULL, &hit) == hgrid_occluded_shapes(&shapes, &ray, NULL));
    puts("null hgrid_intersect_shapes.options");
    puts("null hgrid_occluded_shapes.options");
    MISSED(hgrid_occluded_shapes.shapes, hgrid_occluded_shapes(NULL, &ray, NULL));
    MISSED(hgrid_occluded_shapes.ray, hgrid_occluded_shapes(&shapes, NULL, NULL));
    REFUSED(hgrid_object_grid.grid, hgrid_object_grid(NULL, &object));
    REFUSED(hgrid_object_grid.object, hgrid_object_grid(&grid, NULL));
    REFUSED(hgrid_object_shapes.shapes, hgrid_object_shapes(NULL, &object));
    REFUSED(hgrid_object_shapes.object, hgrid_object_shapes(&shapes, NULL));
    REFUSED(hgrid_object_scene.scene, hgrid_object_scene(NULL, &object));
    REFUSED(hgrid_object_scene.object, hgrid_object_scene(&scene, NULL));
    ALLOWED(hgrid_scene_bound.config, hgrid_scene_bound(k, NULL, &report));
    REFUSED(hgrid_scene_bound.report, hgrid_scene_bound(k, NULL, NULL));
    REFUSED(hgrid_build_scene.instances, hgrid_build_scene(NULL, k, objects, 2, NULL, x, n, y, m, &sight, NULL));
    REFUSED(hgrid_build_scene.objects, hgrid_build_scene(instances, k, NULL, 2, NULL, x, n, y, m, &sight, NULL));
    ALLOWED(hgrid_build_scene.config, hgrid_build_scene(instances, k, objects, 2, NULL, x, n, y, m, &sight, NULL));
    REFUSED(hgrid_build_scene.index, hgrid_build_scene(instances, k, objects, 2, NULL, NULL, n, y, m, &sight, NULL));
    REFUSED(hgrid_build_scene.scratch, hgrid_build_scene(instances, k, objects, 2, NULL, x, n, NULL, m, &sight, NULL));
    REFUSED(hgrid_build_scene.scene, hgrid_build_scene(instances, k, objects, 2, NULL, x, n, y, m, NULL, NULL));
    ALLOWED(hgrid_build_scene.report, hgrid_build_scene(instances, k, objects, 2, NULL, x, n, y, m, &sight, NULL));
    REFUSED(hgrid_open_scene.blob, hgrid_open_scene(NULL, t, objects, 2, &sight));
    REFUSED(hgrid_open_scene.objects, hgrid_open_scene(c, t, NULL, 2, &sight));
    REFUSED(hgrid_open_scene.scene, hgrid_open_scene(c, t, objects, 2, NULL));
    REFUSED(hgrid_refit_scene.instances, hgrid_refit_scene(NULL, k, objects, 2, c, t, &sight, NULL));
    REFUSED(hgrid_refit_scene.objects, hgrid_refit_scene(instances, k, NULL, 2, c, t, &sight, NULL));
    REFUSED(hgrid_refit_scene.blob, hgrid_refit_scene(instances, k, objects, 2, NULL, t, &sight, NULL));
    REFUSED(hgrid_refit_scene.scene, hgrid_refit_scene(instances, k, objects, 2, c, t, NULL, NULL));
    ALLOWED(hgrid_refit_scene.report, hgrid_refit_scene(instances, k, objects, 2, c, t, &sight, NULL));
    REFUSED(hgrid_validate_scene.scene, hgrid_validate_scene(NULL, y, m));
    REFUSED(hgrid_validate_scene.scratch, hgrid_validate_scene(&scene, NULL, m));
    MISSED(hgrid_intersect_scene.scene, hgrid_intersect_scene(NULL, &wide, NULL, &scene_hit));
    MISSED(hgrid_intersect_scene.ray, hgrid_intersect_scene(&inner, NULL, NULL, &scene_hit));
    MISSED(hgrid_intersect_scene.hit, hgrid_intersect_scene(&inner, &wide, NULL, NULL));
    puts("null hgrid_intersect_scene.options");
    puts("null hgrid_occluded_scene.options");
    MISSED(hgrid_occluded_scene.scene, hgrid_occluded_scene(NULL, &wide, NULL));
    MISSED(hgrid_occluded_scene.ray, hgrid_occluded_scene(&inner, NULL, NULL));
    MISSED(hgrid_scene_normal.scene, hgrid_scene_normal(NULL, &scene_hit, NULL, normal));
    MISSED(hgrid_scene_normal.hit, hgrid_scene_normal(&inner, NULL, NULL, normal));
    MISSED(hgrid_scene_normal.normal, hgrid_scene_normal(&inner, &scene_hit, NULL, NULL));
    CHECK(hgrid_scene_normal(&inner, &scene_hit, NULL, normal));
    puts("null hgrid_scene_normal.object_normal");
}

static hgrid_status found(bool is_found)
{
    return is_found ? HGRID_OK : HGRID_ERROR_STRUCT_SIZE;
}

static void structs_of_other_versions(void)
{
    void *const x = index_region, *const y = scratch, *const b = shape_blob, *const c = inner_blob;
    const size_t n = INDEX_BYTES, m = SCRATCH_BYTES, s = shape_bytes, t = inner_bytes, k = INSTANCES;
    const hgrid_config config = HGRID_CONFIG_INIT;
    const hgrid_refit_report refit = HGRID_REFIT_REPORT_INIT;
    const hgrid_query_options options = HGRID_QUERY_OPTIONS_INIT;
    const hgrid_scene_options scene_options = HGRID_SCENE_OPTIONS_INIT;
    const float *const at = spheres[0].center;
    const hgrid_ray ray = {{at[0], at[1], at[2] - 3}, 0, {0, 0, 1}, INFINITY};
    hgrid_ray_f64 wide = wide_ray(0.3, 0.4, -1);
    hgrid_shapes view;
    hgrid_scene sight;
    hgrid_report report = new_report;
    hgrid_hit hit;
    hgrid_scene_hit scene_hit;
    wide.direction[2] = 1;
    CHECK_VERSIONS(hgrid_build_shapes.boxes, hgrid_boxes, boxes,
                   hgrid_build_shapes(it, NULL, x, n, y, m, &view, NULL));
    CHECK_VERSIONS(hgrid_build_shapes.config, hgrid_config, config,
                   hgrid_build_shapes(&boxes, it, x, n, y, m, &view, NULL));
    CHECK_VERSIONS(hgrid_build_shapes.report, hgrid_report, new_report,
                   hgrid_build_shapes(&boxes, NULL, x, n, y, m, &view, it));
    CHECK_VERSIONS(hgrid_open_shapes.boxes, hgrid_boxes, boxes, hgrid_open_shapes(b, s, it, &view));
    CHECK_VERSIONS(hgrid_refit_shapes.boxes, hgrid_boxes, boxes, hgrid_refit_shapes(it, b, s, &view, NULL));
    CHECK_VERSIONS(hgrid_refit_shapes.report, hgrid_refit_report, refit,
                   hgrid_refit_shapes(&boxes, b, s, &view, it));
    CHECK_VERSIONS(hgrid_intersect_shapes.options, hgrid_query_options, options,
                   found(hgrid_intersect_shapes(&shapes, &ray, it, &hit)));
    CHECK_VERSIONS(hgrid_occluded_shapes.options, hgrid_query_options, options,
                   found(hgrid_occluded_shapes(&shapes, &ray, it)));
    CHECK_VERSIONS(hgrid_scene_bound.config, hgrid_config, config, hgrid_scene_bound(5, it, &report));
    CHECK_VERSIONS(hgrid_scene_bound.report, hgrid_report, new_report, hgrid_scene_bound(5, NULL, it));
    CHECK_VERSIONS(hgrid_build_scene.config, hgrid_config, config,
                   hgrid_build_scene(instances, k, objects, 2, it, x, n, y, m, &sight, NULL));
    CHECK_VERSIONS(hgrid_build_scene.report, hgrid_report, new_report,
                   hgrid_build_scene(instances, k, objects, 2, NULL, x, n, y, m, &sight, it));
    CHECK_VERSIONS(hgrid_refit_scene.report, hgrid_refit_report, refit,
                   hgrid_refit_scene(instances, k, objects, 2, c, t, &sight, it));
    CHECK_VERSIONS(hgrid_intersect_scene.options, hgrid_scene_options, scene_options,
                   found(hgrid_intersect_scene(&inner, &wide, it, &scene_hit)));
    CHECK_VERSIONS(hgrid_occluded_scene.options, hgrid_scene_options, scene_options,
                   found(hgrid_occluded_scene(&inner, &wide, it)));
}

int main(void)
{
    prepare();
    shapes_answer_as_a_loop_over_all();
    scenes_show_grids_shapes_and_scenes();
    filters_are_shown_hits_of_the_scene();
    a_refit_follows_the_instances();
    what_shapes_refuse();
    what_scenes_refuse();
    no_pointers();
    structs_of_other_versions();
    return 0;
}
