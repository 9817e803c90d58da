/* Filters, progress callbacks and loops over tasks may themselves query and build. */

#include "check.h"

enum { RAYS = SIDE };

static sheet mesh_data;
static hgrid_mesh mesh;
static hgrid_ray rays[RAYS];
static hgrid_hit expected[RAYS];

/* Another grid that callbacks query, and regions to build it again. */
typedef struct {
    const hgrid_grid *asked;
    hgrid_config config;
    void *index, *scratch, *blob;
    size_t index_bytes, scratch_bytes, blob_bytes;
    /* The number of builds, and whether one is under way: callbacks of it build nothing. */
    size_t builds;
    bool is_busy;
} other;

static void make_rays(void)
{
    const float side = (float)SIDE;
    for (uint32_t i = 0; i < RAYS; i++)
        rays[i] = ray_down(((float)i + 0.3f) / side, ((float)(i * 5 % SIDE) + 0.4f) / side);
}

static other other_of(int method)
{
    other o;
    memset(&o, 0, sizeof o);
    o.config = usual(method);
    build_exactly(&mesh, &o.config, &o.blob, &o.blob_bytes);
    const hgrid_report need = exact_sizes(&mesh, &o.config);
    o.index_bytes = (size_t)need.index_bytes, o.scratch_bytes = (size_t)need.scratch_bytes;
    o.index = guarded(o.index_bytes), o.scratch = guarded(o.scratch_bytes);
    return o;
}

/* Runs every query on a grid, which may be in use by the call that calls back. */
static void ask(const hgrid_grid *grid)
{
    hgrid_hit hits[RAYS], hit;
    unsigned char occluded[RAYS];
    size_t count;
    EXPECT(HGRID_OK, hgrid_intersect_n(grid, rays, 0, hits, 0, RAYS, HGRID_COHERENCE_COHERENT,
                                       NULL));
    CHECK(memcmp(hits, expected, sizeof hits) == 0);
    EXPECT(HGRID_OK, hgrid_occluded_n(grid, rays, 0, occluded, 0, RAYS,
                                      HGRID_COHERENCE_INCOHERENT, NULL));
    CHECK(all_bytes_are(occluded, sizeof occluded, 1));
    CHECK(hgrid_intersect(grid, &rays[1], NULL, &hit));
    CHECK(memcmp(&hit, &expected[1], sizeof hit) == 0);
    EXPECT(HGRID_OK, hgrid_intersect_all(grid, &rays[1], NULL, &hit, 1, &count));
    CHECK(count >= 1 && memcmp(&hit, &expected[1], sizeof hit) == 0);
    hgrid_closest closest;
    const hgrid_point_query query = {{0.5f, 0.5f, 0.05f}, INFINITY};
    CHECK(hgrid_closest_point(grid, &query, NULL, &closest));
}

/* Builds the other grid again and queries it. */
static void build(other *o)
{
    if (o->is_busy)
        return;
    o->is_busy = true;
    hgrid_grid grid;
    memset(o->index, 0xc7, o->index_bytes);
    EXPECT(HGRID_OK, hgrid_build(&mesh, &o->config, o->index, o->index_bytes, o->scratch,
                                 o->scratch_bytes, &grid, NULL));
    CHECK(memcmp(o->index, o->blob, o->blob_bytes) == 0);
    /* Validate now and then: the bytes are those of a grid that was validated. */
    if (o->builds % 8 == 0)
        EXPECT_PROOF(HGRID_OK, &grid);
    ask(&grid);
    if (o->asked != NULL)
        ask(o->asked);
    o->builds++;
    o->is_busy = false;
}

static hgrid_verdict filter(void *context, size_t place, const hgrid_hit *hit)
{
    const hgrid_hit before = *hit;
    build((other *)context);
    CHECK(place < RAYS && memcmp(hit, &before, sizeof before) == 0);
    return HGRID_ACCEPT;
}

static void filters_ask_and_build(const hgrid_grid *grid, other *o)
{
    hgrid_query_options options = HGRID_QUERY_OPTIONS_INIT;
    hgrid_hit hits[RAYS], hit;
    unsigned char occluded[RAYS];
    size_t count, builds = o->builds;
    o->asked = grid;
    options.filter = filter, options.context = o;
    CHECK(hgrid_intersect(grid, &rays[2], &options, &hit));
    CHECK(memcmp(&hit, &expected[2], sizeof hit) == 0);
    CHECK(hgrid_occluded(grid, &rays[2], &options));
    EXPECT(HGRID_OK, hgrid_intersect_all(grid, &rays[2], &options, &hit, 1, &count));
    CHECK(memcmp(&hit, &expected[2], sizeof hit) == 0 && o->builds == builds + 2 + count);
    for (hgrid_coherence how = 0; how < 2; how++) {
        builds = o->builds;
        EXPECT(HGRID_OK, hgrid_intersect_n(grid, rays, 0, hits, 0, RAYS, how, &options));
        CHECK(memcmp(hits, expected, sizeof hits) == 0 && o->builds == builds + RAYS);
        EXPECT(HGRID_OK, hgrid_occluded_n(grid, rays, 0, occluded, 0, RAYS, how, &options));
        CHECK(all_bytes_are(occluded, sizeof occluded, 1) && o->builds == builds + 2 * RAYS);
    }
}

static bool progress(void *context, uint32_t done)
{
    CHECK(done <= HGRID_PROGRESS_END);
    build((other *)context);
    return true;
}

/* Builds between tasks, and before and after all of them. */
static void run(void *context, uint32_t count, hgrid_task task, void *task_context)
{
    build((other *)context);
    for (uint32_t i = count; i-- > 0;) {
        task(task_context, i);
        build((other *)context);
    }
}

static void builds_ask_and_build(int method, other *o)
{
    hgrid_config config = usual(method);
    void *blob;
    size_t blob_bytes;
    const hgrid_grid grid = build_exactly(&mesh, &config, &blob, &blob_bytes);
    o->asked = &grid;
    config.tasks = 3, config.run = run, config.progress = progress, config.context = o;
    hgrid_report need = HGRID_REPORT_INIT;
    EXPECT(HGRID_OK, hgrid_sizes(&mesh, &config, NULL, 0, &need));
    const size_t index_bytes = (size_t)need.index_bytes;
    const size_t scratch_bytes = (size_t)need.scratch_bytes;
    void *index = guarded(index_bytes), *scratch = guarded(scratch_bytes);
    hgrid_grid built;
    const size_t builds = o->builds;
    EXPECT(HGRID_OK, hgrid_build(&mesh, &config, index, index_bytes, scratch, scratch_bytes,
                                 &built, NULL));
    CHECK(o->builds > builds + 2 && memcmp(index, blob, blob_bytes) == 0);
    ask(&built);
}

int main(void)
{
    make_sheet(&mesh_data);
    mesh = mesh_of(&mesh_data);
    make_rays();
    const hgrid_grid first = build_exactly(&mesh, NULL, NULL, NULL);
    for (uint32_t i = 0; i < RAYS; i++)
        CHECK(hgrid_intersect(&first, &rays[i], NULL, &expected[i]));
    for (int method = 0; method < METHODS; method++) {
        other o = other_of((method + 1) % METHODS);
        const hgrid_config config = usual(method);
        const hgrid_grid grid = build_exactly(&mesh, &config, NULL, NULL);
        filters_ask_and_build(&grid, &o);
        builds_ask_and_build(method, &o);
    }
    return 0;
}
