/* Batches in scenes answer as single queries do, wherever rays and answers lie, and touch nothing else. */

#include "scenes.h"

static const hgrid_coherence COHERENCES[] = {HGRID_COHERENCE_INCOHERENT, HGRID_COHERENCE_COHERENT};

/* RAYS fills several windows of the sort, and many groups with a part of one. */
enum { RAYS = 1000, SOME = 100, SHOWN = 24 };

/* One scene that shows grids, shapes and a scene of both. */
static hgrid_scene all_kinds;
static hgrid_ray_f64 rays[RAYS];
/* The answers of single queries: hits as a batch writes them, and whether there is one. */
static hgrid_scene_hit expected[RAYS];
static uint8_t expected_occluded[RAYS];
static hgrid_scene_hit hits[RAYS];
static uint8_t occluded[RAYS];
static const hgrid_scene_options usual_options = HGRID_SCENE_OPTIONS_INIT;

/* Builds a scene of overlapping instances, some of them mirrored, with three masks. */
static void build_all_kinds(void)
{
    const hgrid_instance here = HGRID_INSTANCE_INIT;
    hgrid_instance all[SHOWN];
    hgrid_report report = new_report;
    for (uint32_t i = 0; i < SHOWN; i++) {
        all[i] = here;
        all[i].object = i % 4 == 1 ? 1 : i % 8 == 3 ? 2 : 0;
        all[i].mask = 1u << (i % 3);
        all[i].linear[0][1] = 0.01f * (float)i;
        all[i].linear[1][1] = i % 5 == 0 ? -1 : 1;
        all[i].translation[0] = 0.15 * (i % 8);
        all[i].translation[1] = i % 5 == 0 ? 1.1 : 0.1 * (i / 8);
        all[i].translation[2] = -0.2 * (i % 6);
    }
    EXPECT(HGRID_OK, hgrid_build_scene(all, SHOWN, objects, 3, NULL, index_region, INDEX_BYTES, scratch, SCRATCH_BYTES,
                                       &all_kinds, &report));
    const size_t bytes = (size_t)report.index_bytes;
    EXPECT(HGRID_OK, hgrid_open_scene(guarded_copy(index_region, bytes), bytes, objects, 3, &all_kinds));
}

/* Makes tiles of 8 x 8 pixels, rays from anywhere, and every kind of odd ray. */
static void make_rays(void)
{
    for (int i = 0; i < RAYS; i++) {
        const int tile = i / 64, pixel = i % 64;
        const double x = (tile % 4 * 8 + pixel % 8) / 15.0 - 0.2, y = (tile / 4 * 8 + pixel / 8) / 30.0;
        /* Add a little that float cannot represent. */
        hgrid_ray_f64 *const ray = &rays[i];
        *ray = wide_ray(x + 1e-10, y, 1);
        ray->direction[0] = (float)(i % 9 - 4) / 60, ray->direction[1] = (float)(i % 11 - 5) / 60;
        if (i >= 700) {
            ray->origin[0] = (double)(2 * next_random()), ray->origin[2] = (double)(next_random() - 1);
            for (int k = 0; k < 3; k++)
                ray->direction[k] = next_random() - 0.5f;
        }
        switch (i % 41) {
        case 1: ray->origin[i % 3] = (double)NAN; break;
        case 2: ray->direction[0] = ray->direction[1] = ray->direction[2] = 0; break;
        case 3: ray->direction[i % 3] = INFINITY; break;
        case 4: ray->t_max = NAN; break;
        case 5: ray->t_min = 2, ray->t_max = 1; break;
        case 6: ray->t_max = 0.9f; break;
        case 7: ray->origin[2] = -3, ray->direction[2] = 1; break;
        case 8: ray->origin[0] = 1e300; break;
        case 9: memset(ray, 0xff, sizeof *ray); break;
        }
    }
}

static bool is_miss(const hgrid_scene_hit *hit)
{
    const hgrid_scene_hit miss = {INFINITY, 0, 0, HGRID_INVALID_ID,
                                  {HGRID_INVALID_ID, HGRID_INVALID_ID, HGRID_INVALID_ID, HGRID_INVALID_ID}};
    return memcmp(hit, &miss, sizeof miss) == 0;
}

/* Asks for each ray alone; returns the number of hits. */
static size_t ask_one_by_one(const hgrid_scene *of, const hgrid_scene_options *options)
{
    size_t count = 0;
    for (int i = 0; i < RAYS; i++) {
        memset(&expected[i], 0xff, sizeof *expected);
        expected[i].t = INFINITY, expected[i].u = expected[i].v = 0;
        expected_occluded[i] = hgrid_intersect_scene(of, &rays[i], options, &expected[i]);
        CHECK(expected_occluded[i] != is_miss(&expected[i]));
        count += expected_occluded[i];
    }
    return count;
}

static void check_batch(const hgrid_scene *of, const hgrid_scene_options *options, hgrid_coherence coherence)
{
    memset(hits, 0xc7, sizeof hits);
    memset(occluded, 0xc7, sizeof occluded);
    EXPECT(HGRID_OK, hgrid_intersect_scene_n(of, rays, 0, hits, 0, RAYS, coherence, options));
    EXPECT(HGRID_OK, hgrid_occluded_scene_n(of, rays, 0, occluded, 0, RAYS, coherence, options));
    CHECK(memcmp(hits, expected, sizeof hits) == 0);
    CHECK(memcmp(occluded, expected_occluded, sizeof occluded) == 0);
}

/* Tries scenes of every kind of object, masks and culling, and scratch of any size and alignment. */
static void answers_are_those_of_single_queries(void)
{
    const hgrid_scene *const scenes[] = {&all_kinds, &inner, &scene};
    const size_t sizes[] = {0, 1, 4096, 16 * (size_t)RAYS, 16 * (size_t)RAYS + 5};
    const uint32_t masks[] = {UINT32_MAX, 6}, culls[] = {HGRID_CULL_NONE, HGRID_CULL_BACK, HGRID_CULL_FRONT};
    for (size_t s = 0; s < 3; s++)
        for (size_t m = 0; m < 2; m++)
            for (size_t side = 0; side < 3; side++) {
                hgrid_scene_options options = usual_options;
                options.mask = masks[m], options.cull = culls[side];
                const size_t count = ask_one_by_one(scenes[s], &options);
                CHECK(s > 0 || (count > RAYS / 4 && count < RAYS * 9 / 10));
                for (size_t c = 0; c < 2; c++) {
                    if (m + side == 0)
                        check_batch(scenes[s], NULL, COHERENCES[c]);
                    check_batch(scenes[s], &options, COHERENCES[c]);
                }
                for (size_t size = 0; size < 5; size++) {
                    /* Let the scratch end at a protected page. */
                    unsigned char *const room = (unsigned char *)guarded(sizes[size] + 3);
                    options.scratch = room + 3, options.scratch_bytes = sizes[size];
                    check_batch(scenes[s], &options, HGRID_COHERENCE_INCOHERENT);
                    CHECK(all_bytes_are(room, 3, 0xc7));
                }
            }
}

/* Uses odd addresses and strides, in memory that ends with the last element's own bytes. */
static void gaps_are_not_touched(hgrid_coherence coherence)
{
    for (size_t extra = 0; extra < 20; extra += 3) {
        const size_t ray_stride = sizeof *rays + extra, hit_stride = sizeof *hits + 2 * extra;
        unsigned char *const from = (unsigned char *)guarded((SOME - 1) * ray_stride + sizeof *rays);
        unsigned char *const to = (unsigned char *)guarded((SOME - 1) * hit_stride + sizeof *hits);
        unsigned char *const bytes = (unsigned char *)guarded((SOME - 1) * (1 + extra) + 1);
        for (size_t i = 0; i < SOME; i++)
            memcpy(from + i * ray_stride, &rays[i], sizeof *rays);
        EXPECT(HGRID_OK, hgrid_intersect_scene_n(&all_kinds, (hgrid_ray_f64 *)(void *)from, ray_stride,
                                                 (hgrid_scene_hit *)(void *)to, hit_stride, SOME, coherence, NULL));
        EXPECT(HGRID_OK, hgrid_occluded_scene_n(&all_kinds, (hgrid_ray_f64 *)(void *)from, ray_stride, bytes, 1 + extra,
                                                SOME, coherence, NULL));
        for (size_t i = 0; i < SOME; i++) {
            CHECK(memcmp(to + i * hit_stride, &expected[i], sizeof *hits) == 0);
            CHECK(bytes[i * (1 + extra)] == expected_occluded[i]);
            if (i + 1 == SOME)
                continue;
            CHECK(all_bytes_are(from + i * ray_stride + sizeof *rays, extra, 0xc7));
            CHECK(all_bytes_are(to + i * hit_stride + sizeof *hits, 2 * extra, 0xc7));
            CHECK(all_bytes_are(bytes + i * (1 + extra) + 1, extra, 0xc7));
        }
    }
}

/* All of a ray in one struct, as renderers keep it. */
typedef struct {
    uint8_t is_occluded;
    hgrid_ray_f64 ray;
    double weight;
    hgrid_scene_hit hit;
    uint32_t pixel;
} path;

static void rays_and_answers_in_one_struct(hgrid_coherence coherence)
{
    path *const paths = (path *)guarded(SOME * sizeof *paths);
    for (size_t i = 0; i < SOME; i++)
        paths[i].ray = rays[i];
    path *const as_expected = (path *)guarded_copy(paths, SOME * sizeof *paths);
    EXPECT(HGRID_OK, hgrid_intersect_scene_n(&all_kinds, &paths->ray, sizeof *paths, &paths->hit, sizeof *paths, SOME,
                                             coherence, NULL));
    EXPECT(HGRID_OK, hgrid_occluded_scene_n(&all_kinds, &paths->ray, sizeof *paths, &paths->is_occluded, sizeof *paths,
                                            SOME, coherence, NULL));
    /* Nothing but the answers has changed. */
    for (size_t i = 0; i < SOME; i++)
        as_expected[i].hit = expected[i], as_expected[i].is_occluded = expected_occluded[i];
    CHECK(memcmp(as_expected, paths, SOME * sizeof *paths) == 0);
    /* A hit may not overlap its ray. */
    EXPECT(HGRID_ERROR_OVERLAP,
           hgrid_intersect_scene_n(&all_kinds, &paths->ray, sizeof *paths,
                                   (hgrid_scene_hit *)(void *)&paths->ray.direction[1], sizeof *paths, SOME, coherence,
                                   NULL));
    EXPECT(HGRID_ERROR_OVERLAP,
           hgrid_occluded_scene_n(&all_kinds, &paths->ray, sizeof *paths, (uint8_t *)&paths->ray + 47, sizeof *paths,
                                  SOME, coherence, NULL));
    CHECK(memcmp(as_expected, paths, SOME * sizeof *paths) == 0);
}

/* The hits that a filter was shown, and how many of each ray of a batch. */
typedef struct {
    hgrid_scene_hit seen[8 * RAYS];
    size_t count;
    unsigned of_ray[RAYS];
} shown_hits;

static hgrid_verdict note_and_reject_some(void *context, size_t ray, const hgrid_scene_hit *hit)
{
    shown_hits *const noted = (shown_hits *)context;
    CHECK(noted->count < 8 * RAYS && ray < RAYS);
    noted->seen[noted->count++] = *hit;
    noted->of_ray[ray]++;
    return (hit->primitive + hit->path[0]) % 3 == 0 ? HGRID_REJECT : HGRID_ACCEPT;
}

/* Filters see the same hits as for single rays, in the order of the rays, and the work is the same. */
static void filters_and_counters_see_one_ray_after_the_other(void)
{
    static shown_hits alone, together, again;
    hgrid_counters work = {0, 0, 0};
    hgrid_scene_options options = usual_options;
    options.filter = note_and_reject_some, options.context = &alone, options.counters = &work;
    const size_t count = ask_one_by_one(&all_kinds, &options);
    CHECK(count > RAYS / 4 && alone.count > count && work.primitive_tests > 0);
    for (size_t c = 0; c < 2; c++) {
        hgrid_counters sum = {1, 2, 3};
        together.count = 0;
        memset(together.of_ray, 0, sizeof together.of_ray);
        options.context = &together, options.counters = &sum;
        EXPECT(HGRID_OK, hgrid_intersect_scene_n(&all_kinds, rays, 0, hits, 0, RAYS, COHERENCES[c], &options));
        CHECK(memcmp(hits, expected, sizeof hits) == 0);
        CHECK(together.count == alone.count);
        CHECK(memcmp(together.seen, alone.seen, alone.count * sizeof *alone.seen) == 0);
        CHECK(sum.primitive_tests == work.primitive_tests + 1 && sum.cell_steps == work.cell_steps + 2 &&
              sum.grid_steps == work.grid_steps + 3);
        for (int i = 0; i < RAYS; i++) {
            hgrid_scene_hit hit;
            again.count = 0;
            options.context = &again;
            CHECK(hgrid_intersect_scene(&all_kinds, &rays[i], &options, &hit) == expected_occluded[i]);
            CHECK(again.count == together.of_ray[i]);
        }
        for (int i = 1; i < RAYS; i++)
            CHECK(again.of_ray[i] == 0);
        options.context = &together;
        EXPECT(HGRID_OK, hgrid_occluded_scene_n(&all_kinds, rays, 0, occluded, 0, RAYS, COHERENCES[c], &options));
        CHECK(memcmp(occluded, expected_occluded, sizeof occluded) == 0);
    }
}

/* The same for shapes: rays in float, options of grids. */
static void shapes_answer_as_single_queries(void)
{
    static hgrid_ray narrow[RAYS];
    static hgrid_hit one[RAYS], many[RAYS];
    static unsigned char sorted[16 * RAYS];
    const hgrid_query_options usual = HGRID_QUERY_OPTIONS_INIT;
    for (int i = 0; i < RAYS; i++) {
        hgrid_ray ray = {{0, 0, 0}, rays[i].t_min, {0, 0, 0}, rays[i].t_max};
        for (int k = 0; k < 3; k++)
            ray.origin[k] = (float)rays[i].origin[k], ray.direction[k] = rays[i].direction[k];
        narrow[i] = ray;
    }
    for (int kind = 0; kind < 4; kind++) {
        hgrid_counters work = {0, 0, 0}, sum = {0, 0, 0};
        hgrid_query_options options = usual;
        options.mask = kind == 1 ? 2 : UINT32_MAX, options.skip = kind == 2 ? 3 : HGRID_INVALID_ID;
        options.counters = kind == 3 ? &work : NULL;
        size_t count = 0;
        for (int i = 0; i < RAYS; i++) {
            const hgrid_hit miss = {INFINITY, 0, 0, HGRID_INVALID_ID};
            one[i] = miss;
            expected_occluded[i] = hgrid_intersect_shapes(&shapes, &narrow[i], &options, &one[i]);
            count += expected_occluded[i];
        }
        CHECK(count > RAYS / 20 && count < RAYS * 9 / 10);
        for (size_t c = 0; c < 4; c++) {
            memset(many, 0xc7, sizeof many);
            memset(occluded, 0xc7, sizeof occluded);
            if (c >= 2)
                options.scratch = sorted, options.scratch_bytes = sizeof sorted;
            options.counters = kind == 3 ? &sum : NULL;
            sum.primitive_tests = 0;
            EXPECT(HGRID_OK, hgrid_intersect_shapes_n(&shapes, narrow, 0, many, 0, RAYS, COHERENCES[c % 2], &options));
            CHECK(memcmp(many, one, sizeof many) == 0 && sum.primitive_tests == work.primitive_tests);
            EXPECT(HGRID_OK,
                   hgrid_occluded_shapes_n(&shapes, narrow, 0, occluded, 0, RAYS, COHERENCES[c % 2], &options));
            CHECK(memcmp(occluded, expected_occluded, sizeof occluded) == 0);
        }
    }
    EXPECT(HGRID_OK, hgrid_intersect_shapes_n(&shapes, narrow, 0, many, 0, RAYS, HGRID_COHERENCE_COHERENT, NULL));
    CHECK(memcmp(many, one, sizeof many) == 0);
    EXPECT(HGRID_OK, hgrid_intersect_shapes_n(&shapes, NULL, 0, NULL, 0, 0, HGRID_COHERENCE_COHERENT, NULL));
    /* Without a test nothing is hit. */
    hgrid_boxes silent = boxes;
    hgrid_shapes view;
    silent.test = NULL;
    EXPECT(HGRID_OK, hgrid_open_shapes(shape_blob, shape_bytes, &silent, &view));
    EXPECT(HGRID_OK, hgrid_occluded_shapes_n(&view, narrow, 0, occluded, 0, RAYS, HGRID_COHERENCE_COHERENT, NULL));
    CHECK(all_bytes_are(occluded, sizeof occluded, 0));
}

static void no_rays_are_no_error(void)
{
    const hgrid_coherence coherence = HGRID_COHERENCE_INCOHERENT;
    hgrid_counters work = {1, 2, 3};
    hgrid_scene_options options = usual_options;
    options.counters = &work;
    EXPECT(HGRID_OK, hgrid_intersect_scene_n(&all_kinds, NULL, 0, NULL, 0, 0, coherence, NULL));
    EXPECT(HGRID_OK, hgrid_intersect_scene_n(&all_kinds, NULL, 64, NULL, 64, 0, coherence, &options));
    EXPECT(HGRID_OK, hgrid_occluded_scene_n(&all_kinds, NULL, 0, NULL, 0, 0, coherence, NULL));
    EXPECT(HGRID_OK, hgrid_occluded_scene_n(&all_kinds, NULL, 64, NULL, 64, 0, coherence, &options));
    CHECK(work.primitive_tests == 1 && work.cell_steps == 2 && work.grid_steps == 3);
    /* A scene without instances misses. */
    hgrid_scene empty;
    EXPECT(HGRID_OK, hgrid_build_scene(NULL, 0, NULL, 0, NULL, index_region, INDEX_BYTES, scratch, SCRATCH_BYTES,
                                       &empty, NULL));
    EXPECT(HGRID_OK, hgrid_intersect_scene_n(&empty, rays, 0, hits, 0, RAYS, coherence, NULL));
    EXPECT(HGRID_OK, hgrid_occluded_scene_n(&empty, rays, 0, occluded, 0, RAYS, coherence, NULL));
    CHECK(is_miss(&hits[0]) && is_miss(&hits[RAYS - 1]) && all_bytes_are(occluded, sizeof occluded, 0));
}

int main(void)
{
    prepare();
    build_shapes();
    build_inner(INDEX_BYTES, SCRATCH_BYTES);
    build_outer();
    build_all_kinds();
    make_rays();
    answers_are_those_of_single_queries();
    ask_one_by_one(&all_kinds, NULL);
    for (size_t c = 0; c < 2; c++) {
        gaps_are_not_touched(COHERENCES[c]);
        rays_and_answers_in_one_struct(COHERENCES[c]);
    }
    filters_and_counters_see_one_ray_after_the_other();
    shapes_answer_as_single_queries();
    no_rays_are_no_error();
    return 0;
}
