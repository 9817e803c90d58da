/* Shapes of the caller, and scenes of instances: the answers. */

#include "scenes.h"

static void shapes_answer_as_a_loop_over_all(void)
{
    const hgrid_report report = build_shapes();
    CHECK(report.is_exact == 1 && report.index_bytes <= HGRID_INDEX_BOUND(SPHERES) && report.skipped_count == 0);
    CHECK(report.reference_count == SPHERES && report.triangle == HGRID_INVALID_ID);
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

    /* A refit follows the boxes, and moving them back gives the same bytes. */
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

static void scenes_show_grids_shapes_and_scenes(void)
{
    hgrid_report bound = new_report;
    EXPECT(HGRID_OK, hgrid_scene_bound(INSTANCES, NULL, &bound));
    CHECK(bound.index_bytes <= HGRID_SCENE_BOUND(INSTANCES) && bound.is_exact == 0);
    CHECK(bound.scratch_bytes <= HGRID_SCRATCH_BOUND(INSTANCES));
    const hgrid_report report = build_inner((size_t)bound.index_bytes, (size_t)bound.scratch_bytes);
    CHECK(report.is_exact == 1 && report.index_bytes <= bound.index_bytes && report.reference_count == INSTANCES);
    EXPECT(HGRID_OK, hgrid_validate_scene(&inner, scratch, HGRID_VALIDATE_BOUND(INSTANCES)));
    EXPECT(HGRID_ERROR_SCRATCH_TOO_SMALL, hgrid_validate_scene(&inner, scratch, 3));

    /* Every sheet is at its instance's place, and hit as in the grid alone. */
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
        /* Any length will do, but for none and for no number. */
        given[2] = i % 4 == 0 ? FLT_MAX : FLT_MIN / 4;
        CHECK(hgrid_scene_normal(&inner, &hit, given, normal) && fabsf(normal[2] + 1) < 1e-6f);
        given[i % 3] = i % 4 == 0 ? NAN : INFINITY;
        CHECK(!hgrid_scene_normal(&inner, &hit, given, normal) && fabsf(normal[2] + 1) < 1e-6f);
        hgrid_scene_surface at;
        CHECK(hgrid_scene_surface_at(&inner, &up, &hit, &at) && at.is_front && at.normal[2] < -0.5f);
        CHECK(fabs(at.position[2] - (up.origin[2] + (double)hit.t)) < 1e-5);
        CHECK(at.above[2] < at.position[2] && at.position[2] < at.below[2]);
        /* A ray that goes on through the triangle misses it, and so does one that turns back. */
        hgrid_ray_f64 on = up, back = up;
        memcpy(on.origin, at.below, sizeof on.origin);
        memcpy(back.origin, at.above, sizeof back.origin);
        back.direction[2] = -1;
        CHECK(!hgrid_occluded_scene(&inner, &on, NULL) && !hgrid_occluded_scene(&inner, &back, NULL));

        hgrid_scene_options options = HGRID_SCENE_OPTIONS_INIT;
        hgrid_counters counters = {0, 0, 0};
        options.counters = &counters;
        options.mask = 1u << (i % 3);
        CHECK(hgrid_intersect_scene(&inner, &up, &options, &hit) && counters.primitive_tests > 0);
        options.mask = 1u << ((i + 1) % 3);
        CHECK(!hgrid_intersect_scene(&inner, &up, &options, &hit));
        options.mask = 0xffffffffu;
        /* The front is that of the mesh, although the instance mirrors. */
        options.cull = HGRID_CULL_BACK;
        CHECK(hgrid_occluded_scene(&inner, &up, &options));
        options.cull = HGRID_CULL_FRONT;
        CHECK(!hgrid_occluded_scene(&inner, &up, &options));
        options.cull = 3;
        CHECK(!hgrid_occluded_scene(&inner, &up, &options));
    }

    /* A scene in a scene, a million units away. */
    build_outer();
    hgrid_ray_f64 up = wide_ray(40.3, 1e6 + 0.4, -1);
    up.direction[2] = 1;
    hgrid_scene_hit hit;
    CHECK(hgrid_intersect_scene(&scene, &up, NULL, &hit));
    CHECK(hit.path[0] == 1 && hit.path[1] == 4 && hit.path[2] == HGRID_INVALID_ID);
    CHECK(hit.primitive == alone.primitive && fabsf(hit.t - alone.t) < 1e-5f);
}

/* The box of an object alone is that of what is in it; that of a scene holds those of its instances. */
static void boxes_hold_what_is_in_them(void)
{
    float of_grid[6], of_shapes[6], of_scene[6];
    CHECK(hgrid_box_of(&grid, of_grid) && hgrid_box_of_shapes(&shapes, of_shapes));
    CHECK(hgrid_box_of_scene(&inner, of_scene));
    for (int k = 0; k < 3; k++) {
        const float most = 1e-4f * (of_grid[k + 3] - of_grid[k]);
        float least = INFINITY, greatest = -INFINITY;
        for (uint32_t i = 0; i < mesh.vertex_count; i++) {
            const float at = ((const float *)mesh.positions)[3 * i + k];
            least = at < least ? at : least, greatest = at > greatest ? at : greatest;
        }
        CHECK(of_grid[k] <= least && least - of_grid[k] < most);
        CHECK(of_grid[k + 3] >= greatest && of_grid[k + 3] - greatest < most);
        for (uint32_t i = 0; i < SPHERES; i++)
            CHECK(of_shapes[k] <= spheres[i].box[k] && of_shapes[k + 3] >= spheres[i].box[k + 3]);
    }
    /* Ten units from one instance to the next along x. */
    const float last = 10.0f * (INSTANCES - 1);
    CHECK(of_scene[0] <= of_grid[0] && of_scene[3] >= last && of_scene[3] < last + 2);
}

static unsigned shown;

static hgrid_verdict no_even(void *context, size_t ray, const hgrid_scene_hit *hit)
{
    CHECK(context == &shown && ray == 0);
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
        /* With the filter, a ray may hit a neighbour across an edge. */
        CHECK(plain || !is_hit);
        CHECK(!plain || hit.primitive % 2 == 0 || is_hit);
        hits += is_hit;
    }
    CHECK(hits > 10 && shown > 2 * hits / 2);
}

static hgrid_verdict reject(void *context, size_t ray, const hgrid_scene_hit *hit)
{
    (void)hit;
    CHECK(ray == 0);
    ++*(unsigned *)context;
    return HGRID_REJECT;
}

static void a_filter_is_asked_about_the_bits_of_its_mask(void)
{
    static uint32_t masks[TRIANGLES];
    const uint32_t asked_about[] = {0, UINT32_MAX, 2, 4};
    hgrid_mesh masked = mesh;
    hgrid_scene view;
    hgrid_object object;
    const hgrid_instance one = HGRID_INSTANCE_INIT;
    for (uint32_t i = 0; i < TRIANGLES; i++)
        masks[i] = i % 2 == 0 ? 2 : 1;
    masked.masks = masks;
    const hgrid_grid of_masked = build_exactly(&masked, NULL, NULL, NULL);
    EXPECT(HGRID_OK, hgrid_object_grid(&of_masked, &object));
    EXPECT(HGRID_OK, hgrid_build_scene(&one, 1, &object, 1, NULL, guarded(INDEX_BYTES), INDEX_BYTES, scratch,
                                       SCRATCH_BYTES, &view, NULL));
    unsigned hits = 0;
    for (int i = 0; i < 100; i++)
        for (int m = 0; m < 4; m++) {
            const hgrid_ray_f64 down = wide_ray(0.01 * i, 0.011 * i, 1);
            hgrid_scene_options options = HGRID_SCENE_OPTIONS_INIT;
            hgrid_scene_hit hit, with;
            unsigned calls = 0;
            options.filter = reject, options.context = &calls, options.filter_mask = asked_about[m];
            if (!hgrid_intersect_scene(&view, &down, NULL, &hit))
                continue;
            const bool is_hit = hgrid_intersect_scene(&view, &down, &options, &with);
            const bool is_asked = m < 2 || (masks[hit.primitive] & asked_about[m]) != 0;
            CHECK((calls > 0) == is_asked);
            /* A ray through an edge may hit the neighbour, too. */
            CHECK(is_asked ? !is_hit || with.primitive != hit.primitive
                           : is_hit && memcmp(&with, &hit, sizeof hit) == 0);
            hits += !is_asked;
        }
    CHECK(hits > 50);
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

static void run_all(void *context, uint32_t count, hgrid_task task, void *task_context)
{
    (void)context;
    for (uint32_t i = 0; i < count; i++)
        task(task_context, i);
}

/* Sizes that one build reports are enough for the next. */
static void reports_are_enough(const hgrid_config *config)
{
    const hgrid_instance three[3] = {HGRID_INSTANCE_INIT, HGRID_INSTANCE_INIT, HGRID_INSTANCE_INIT};
    const size_t large = 256 * 1024;
    void *const index = guarded(large), *const extra = guarded(large);
    const hgrid_status missing[2] = {HGRID_ERROR_SCRATCH_TOO_SMALL, HGRID_ERROR_INDEX_TOO_SMALL};
    int refusals[2][2] = {{0, 0}, {0, 0}};
    for (size_t offered = 0; offered < 2048; offered += 64)
        for (size_t lent = 0; lent < 2; lent++) {
            hgrid_report report = new_report;
            hgrid_shapes tree;
            hgrid_scene made;
            hgrid_status status = hgrid_build_shapes(&boxes, config, index, lent ? offered : large, extra,
                                                     lent * large, &tree, &report);
            refusals[0][lent] += status == missing[lent];
            if (status != HGRID_OK)
                EXPECT(HGRID_OK, hgrid_build_shapes(&boxes, config, index, (size_t)report.index_bytes, extra,
                                                    (size_t)report.scratch_bytes, &tree, NULL));
            report = new_report;
            status = hgrid_build_scene(three, 3, objects, 3, config, index, lent ? offered : large, extra,
                                       lent * large, &made, &report);
            refusals[1][lent] += status == missing[lent];
            if (status != HGRID_OK)
                EXPECT(HGRID_OK, hgrid_build_scene(three, 3, objects, 3, config, index, (size_t)report.index_bytes,
                                                   extra, (size_t)report.scratch_bytes, &made, NULL));
        }
    for (int of = 0; of < 2; of++)
        CHECK(refusals[of][0] > 0 && refusals[of][1] > 0);
}

static void what_is_reported_is_enough(void)
{
    hgrid_config config = HGRID_CONFIG_INIT;
    reports_are_enough(NULL);
    config.tasks = 2, config.run = run_all;
    reports_are_enough(&config);
    config.quality = HGRID_QUALITY_HIGH;
    reports_are_enough(&config);
}

/* A large index is not touched behind what is enough for any scene. */
static void the_rest_of_an_index_is_not_touched(void)
{
    const size_t large = 256 * 1024;
    hgrid_config config = HGRID_CONFIG_INIT;
    config.run = run_all;
    for (config.tasks = 1; config.tasks < 4; config.tasks += 2) {
        unsigned char *const index = (unsigned char *)guarded(large);
        hgrid_report bound = new_report;
        hgrid_scene made;
        EXPECT(HGRID_OK, hgrid_scene_bound(INSTANCES, &config, &bound));
        CHECK(bound.index_bytes < large);
        EXPECT(HGRID_OK, hgrid_build_scene(instances, INSTANCES, objects, 2, &config, index, large, scratch,
                                           SCRATCH_BYTES, &made, NULL));
        CHECK(all_bytes_are(index + bound.index_bytes, large - (size_t)bound.index_bytes, 0xc7));
        EXPECT(HGRID_OK, hgrid_validate_scene(&made, scratch, SCRATCH_BYTES));
    }
}

int main(void)
{
    prepare();
    shapes_answer_as_a_loop_over_all();
    scenes_show_grids_shapes_and_scenes();
    boxes_hold_what_is_in_them();
    filters_are_shown_hits_of_the_scene();
    a_filter_is_asked_about_the_bits_of_its_mask();
    a_refit_follows_the_instances();
    what_is_reported_is_enough();
    the_rest_of_an_index_is_not_touched();
    return 0;
}
