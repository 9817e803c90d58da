/* NULL in each pointer argument of each function: refused with nothing written, or allowed. The test checks
 * that no argument is missing here. */

#include "check.h"

enum { RAYS = 2 };

static sheet mesh_data;
static hgrid_mesh mesh;
static hgrid_grid grid;
static hgrid_config config;
static hgrid_query_options options;
static void *blob;
static size_t blob_bytes;
static unsigned char *index_region, *scratch, *packed;
static void *tree;
static size_t index_bytes, scratch_bytes, packed_bytes, tree_bytes;
static hgrid_ray rays[RAYS];
static const hgrid_point_query query = {{0.5f, 0.5f, 1}, INFINITY};
static hgrid_report report = HGRID_REPORT_INIT;
static hgrid_refit_report refit_report = HGRID_REFIT_REPORT_INIT;

/* Everything that calls write except reports, which are always written. */
typedef struct {
    hgrid_grid grid;
    hgrid_hit hits[RAYS];
    hgrid_closest closest;
    hgrid_surface surface;
    hgrid_config fitted;
    hgrid_mesh mesh;
    hgrid_blob_info info;
    hgrid_statistics statistics;
    uint8_t occluded[RAYS];
    uint32_t occluders[RAYS];
    size_t count;
    uint64_t bytes;
} outputs;

static outputs out, before;

static void reset(outputs *o)
{
    memset(o, 0xc7, sizeof *o);
    o->fitted.struct_size = sizeof o->fitted;
    o->mesh.struct_size = sizeof o->mesh;
    o->info.struct_size = sizeof o->info;
    o->statistics.struct_size = sizeof o->statistics;
}

/* Checks a call with NULL for a parameter that must not be NULL: nothing is written. */
#define REFUSED(parameter, status, call) \
    do { \
        reset(&out); \
        EXPECT(status, call); \
        CHECK(memcmp(&out, &before, sizeof out) == 0); \
        puts("null " #parameter); \
    } while (0)

/* The same for a query of one ray, which returns false. */
#define MISSED(parameter, call) \
    do { \
        reset(&out); \
        CHECK(!(call)); \
        CHECK(memcmp(&out, &before, sizeof out) == 0); \
        puts("null " #parameter); \
    } while (0)

/* Checks a call with NULL for a parameter that may be NULL. */
#define ALLOWED(parameter, call) \
    do { \
        reset(&out); \
        EXPECT(HGRID_OK, call); \
        puts("null " #parameter); \
    } while (0)

static void prepare(void)
{
    make_sheet(&mesh_data);
    mesh = mesh_of(&mesh_data);
    const hgrid_config what_null_means = HGRID_CONFIG_INIT;
    config = what_null_means;
    const hgrid_query_options defaults = HGRID_QUERY_OPTIONS_INIT;
    options = defaults;
    grid = build_exactly(&mesh, &config, &blob, &blob_bytes);
    /* Fitting takes as much scratch as hgrid_sizes reports without scratch. */
    EXPECT(HGRID_OK, hgrid_sizes(&mesh, &config, NULL, 0, &report));
    index_bytes = (size_t)exact_sizes(&mesh, &config).index_bytes;
    scratch_bytes = (size_t)report.scratch_bytes;
    index_region = (unsigned char *)guarded(index_bytes);
    scratch = (unsigned char *)guarded(scratch_bytes);
    uint64_t bytes;
    EXPECT(HGRID_ERROR_INDEX_TOO_SMALL, hgrid_pack(&grid, NULL, 0, &bytes));
    packed_bytes = (size_t)bytes;
    packed = (unsigned char *)guarded(packed_bytes);
    EXPECT(HGRID_OK, hgrid_pack(&grid, packed, packed_bytes, &bytes));
    const hgrid_config bvh = HGRID_CONFIG_INIT_BVH;
    build_exactly(&mesh, &bvh, &tree, &tree_bytes);
    for (int i = 0; i < RAYS; i++)
        rays[i] = ray_down(0.3f + 0.1f * (float)i, 0.4f);
    reset(&before);
}

static void questions_for_sizes(void)
{
    ALLOWED(hgrid_bound.config, hgrid_bound(5, NULL, &report));
    REFUSED(hgrid_bound.report, HGRID_ERROR_NULL_ARGUMENT, hgrid_bound(5, &config, NULL));

    REFUSED(hgrid_sizes.mesh, HGRID_ERROR_NULL_ARGUMENT,
            hgrid_sizes(NULL, &config, scratch, scratch_bytes, &report));
    ALLOWED(hgrid_sizes.config, hgrid_sizes(&mesh, NULL, scratch, scratch_bytes, &report));
    ALLOWED(hgrid_sizes.scratch, hgrid_sizes(&mesh, &config, NULL, 0, &report));
    REFUSED(hgrid_sizes.scratch, HGRID_ERROR_NULL_ARGUMENT,
            hgrid_sizes(&mesh, &config, NULL, 64, &report));
    REFUSED(hgrid_sizes.report, HGRID_ERROR_NULL_ARGUMENT,
            hgrid_sizes(&mesh, &config, scratch, scratch_bytes, NULL));

    REFUSED(hgrid_fit.mesh, HGRID_ERROR_NULL_ARGUMENT,
            hgrid_fit(NULL, &config, index_bytes, scratch, scratch_bytes, &out.fitted, &report));
    ALLOWED(hgrid_fit.config,
            hgrid_fit(&mesh, NULL, index_bytes, scratch, scratch_bytes, &out.fitted, &report));
    CHECK(memcmp(&out.fitted, &config, sizeof config) == 0);
    /* The default method, bvh, needs scratch for fitting. */
    const hgrid_config one_level = HGRID_CONFIG_INIT_ONE_LEVEL;
    ALLOWED(hgrid_fit.scratch,
            hgrid_fit(&mesh, &one_level, index_bytes, NULL, 0, &out.fitted, &report));
    REFUSED(hgrid_fit.scratch, HGRID_ERROR_NULL_ARGUMENT,
            hgrid_fit(&mesh, &config, index_bytes, NULL, 1, &out.fitted, &report));
    REFUSED(hgrid_fit.fitted, HGRID_ERROR_NULL_ARGUMENT,
            hgrid_fit(&mesh, &config, index_bytes, scratch, scratch_bytes, NULL, &report));
    ALLOWED(hgrid_fit.report,
            hgrid_fit(&mesh, &config, index_bytes, scratch, scratch_bytes, &out.fitted, NULL));
}

static void builds(void)
{
    memset(index_region, 0xc7, index_bytes);
    REFUSED(hgrid_build.mesh, HGRID_ERROR_NULL_ARGUMENT,
            hgrid_build(NULL, &config, index_region, index_bytes, scratch, scratch_bytes,
                        &out.grid, &report));
    REFUSED(hgrid_build.index, HGRID_ERROR_NULL_ARGUMENT,
            hgrid_build(&mesh, &config, NULL, index_bytes, scratch, scratch_bytes, &out.grid,
                        &report));
    /* NULL with a size of 0 is only too small. */
    REFUSED(hgrid_build.index, HGRID_ERROR_INDEX_TOO_SMALL,
            hgrid_build(&mesh, &config, NULL, 0, scratch, scratch_bytes, &out.grid, &report));
    REFUSED(hgrid_build.scratch, HGRID_ERROR_NULL_ARGUMENT,
            hgrid_build(&mesh, &config, index_region, index_bytes, NULL, scratch_bytes, &out.grid,
                        &report));
    REFUSED(hgrid_build.scratch, HGRID_ERROR_SCRATCH_TOO_SMALL,
            hgrid_build(&mesh, &config, index_region, index_bytes, NULL, 0, &out.grid, &report));
    REFUSED(hgrid_build.grid, HGRID_ERROR_NULL_ARGUMENT,
            hgrid_build(&mesh, &config, index_region, index_bytes, scratch, scratch_bytes, NULL,
                        &report));
    CHECK(all_bytes_are(index_region, index_bytes, 0xc7));
    REFUSED(hgrid_build.mesh, HGRID_ERROR_NULL_ARGUMENT,
            hgrid_build(NULL, NULL, NULL, 0, NULL, 0, NULL, NULL));
    ALLOWED(hgrid_build.config, hgrid_build(&mesh, NULL, index_region, index_bytes, scratch,
                                            scratch_bytes, &out.grid, &report));
    ALLOWED(hgrid_build.report, hgrid_build(&mesh, &config, index_region, index_bytes, scratch,
                                            scratch_bytes, &out.grid, NULL));
}

/* A mesh may have NULL for arrays without elements, and for masks. */
static void arrays_of_a_mesh(void)
{
    hgrid_mesh bad[2] = {mesh, mesh};
    bad[0].positions = NULL;
    bad[1].indices = NULL;
    for (int i = 0; i < 2; i++) {
        EXPECT(HGRID_ERROR_NULL_ARGUMENT, hgrid_sizes(&bad[i], NULL, NULL, 0, &report));
        EXPECT(HGRID_ERROR_NULL_ARGUMENT, hgrid_open(blob, blob_bytes, &bad[i], &out.grid));
        EXPECT(HGRID_ERROR_NULL_ARGUMENT,
               hgrid_fit(&bad[i], NULL, index_bytes, NULL, 0, &out.fitted, NULL));
        EXPECT(HGRID_ERROR_NULL_ARGUMENT,
               hgrid_build(&bad[i], NULL, index_region, index_bytes, scratch, scratch_bytes,
                           &out.grid, NULL));
    }
    const hgrid_mesh empty = HGRID_MESH_INIT;
    EXPECT(HGRID_OK, hgrid_sizes(&empty, NULL, NULL, 0, &report));
}

static void joined_meshes(void)
{
    static hgrid_part parts[1];
    REFUSED(hgrid_join.meshes, HGRID_ERROR_NULL_ARGUMENT, hgrid_join(NULL, 1, parts, &out.mesh));
    REFUSED(hgrid_join.parts, HGRID_ERROR_NULL_ARGUMENT, hgrid_join(&mesh, 1, NULL, &out.mesh));
    REFUSED(hgrid_join.joined, HGRID_ERROR_NULL_ARGUMENT, hgrid_join(&mesh, 1, parts, NULL));
    ALLOWED(hgrid_join.meshes, hgrid_join(NULL, 0, NULL, &out.mesh));
    uint32_t geometry = 77, triangle = 77;
    MISSED(hgrid_locate.grid, hgrid_locate(NULL, 0, &geometry, &triangle));
    MISSED(hgrid_locate.geometry, hgrid_locate(&grid, 0, NULL, &triangle));
    MISSED(hgrid_locate.triangle, hgrid_locate(&grid, 0, &geometry, NULL));
    CHECK(geometry == 77 && triangle == 77);
    float corners[6];
    const hgrid_grid nothing = HGRID_GRID_INIT;
    MISSED(hgrid_box_of.grid, hgrid_box_of(NULL, corners));
    MISSED(hgrid_box_of.corners, hgrid_box_of(&grid, NULL));
    CHECK(!hgrid_box_of(&nothing, corners) && hgrid_box_of(&grid, corners));
    for (int k = 0; k < 3; k++)
        CHECK(corners[k] < corners[k + 3]);
    CHECK(hgrid_locate(&grid, 5, &geometry, &triangle) && geometry == 0 && triangle == 5);
}

/* More than one task needs a loop that runs them. */
static void callbacks(void)
{
    hgrid_config parallel = usual(4);
    parallel.tasks = 2;
    EXPECT(HGRID_ERROR_NULL_ARGUMENT, hgrid_bound(5, &parallel, &report));
    EXPECT(HGRID_ERROR_NULL_ARGUMENT, hgrid_sizes(&mesh, &parallel, NULL, 0, &report));
    EXPECT(HGRID_ERROR_NULL_ARGUMENT,
           hgrid_fit(&mesh, &parallel, index_bytes, NULL, 0, &out.fitted, NULL));
    EXPECT(HGRID_ERROR_NULL_ARGUMENT,
           hgrid_build(&mesh, &parallel, NULL, 0, NULL, 0, &out.grid, NULL));
    for (parallel.tasks = 0; parallel.tasks < 2; parallel.tasks++)
        EXPECT(HGRID_OK, hgrid_sizes(&mesh, &parallel, NULL, 0, &report));
}

static void queries(void)
{
    MISSED(hgrid_intersect.grid, hgrid_intersect(NULL, rays, &options, out.hits));
    MISSED(hgrid_intersect.ray, hgrid_intersect(&grid, NULL, &options, out.hits));
    MISSED(hgrid_intersect.hit, hgrid_intersect(&grid, rays, &options, NULL));
    CHECK(hgrid_intersect(&grid, rays, NULL, out.hits));
    puts("null hgrid_intersect.options");

    MISSED(hgrid_occluded.grid, hgrid_occluded(NULL, rays, &options));
    MISSED(hgrid_occluded.ray, hgrid_occluded(&grid, NULL, &options));
    CHECK(hgrid_occluded(&grid, rays, NULL));
    puts("null hgrid_occluded.options");

    MISSED(hgrid_occluder.grid, hgrid_occluder(NULL, rays, &options) != HGRID_INVALID_ID);
    MISSED(hgrid_occluder.ray, hgrid_occluder(&grid, NULL, &options) != HGRID_INVALID_ID);
    CHECK(hgrid_occluder(&grid, rays, NULL) != HGRID_INVALID_ID);
    puts("null hgrid_occluder.options");

    REFUSED(hgrid_intersect_all.grid, HGRID_ERROR_NULL_ARGUMENT,
            hgrid_intersect_all(NULL, rays, &options, out.hits, RAYS, &out.count));
    REFUSED(hgrid_intersect_all.ray, HGRID_ERROR_NULL_ARGUMENT,
            hgrid_intersect_all(&grid, NULL, &options, out.hits, RAYS, &out.count));
    ALLOWED(hgrid_intersect_all.options,
            hgrid_intersect_all(&grid, rays, NULL, out.hits, RAYS, &out.count));
    ALLOWED(hgrid_intersect_all.hits,
            hgrid_intersect_all(&grid, rays, &options, NULL, 0, &out.count));
    CHECK(out.count > 0);
    REFUSED(hgrid_intersect_all.hits, HGRID_ERROR_NULL_ARGUMENT,
            hgrid_intersect_all(&grid, rays, &options, NULL, RAYS, &out.count));
    REFUSED(hgrid_intersect_all.count, HGRID_ERROR_NULL_ARGUMENT,
            hgrid_intersect_all(&grid, rays, &options, out.hits, RAYS, NULL));

    MISSED(hgrid_closest_point.grid,
           hgrid_closest_point(NULL, &query, &options, &out.closest));
    MISSED(hgrid_closest_point.query,
           hgrid_closest_point(&grid, NULL, &options, &out.closest));
    MISSED(hgrid_closest_point.closest,
           hgrid_closest_point(&grid, &query, &options, NULL));
    CHECK(hgrid_closest_point(&grid, &query, NULL, &out.closest));
    puts("null hgrid_closest_point.options");
    /* A distance that no float holds is not found. */
    hgrid_point_query far_away = query;
    far_away.max_distance = INFINITY, far_away.point[0] = FLT_MAX;
    CHECK(hgrid_closest_point(&grid, &far_away, NULL, &out.closest));
    far_away.point[1] = FLT_MAX;
    CHECK(!hgrid_closest_point(&grid, &far_away, NULL, &out.closest));

    const hgrid_hit hit = {1, 0.25f, 0.25f, 3};
    MISSED(hgrid_surface_at.grid, hgrid_surface_at(NULL, rays, &hit, &out.surface));
    MISSED(hgrid_surface_at.ray, hgrid_surface_at(&grid, NULL, &hit, &out.surface));
    MISSED(hgrid_surface_at.hit, hgrid_surface_at(&grid, rays, NULL, &out.surface));
    MISSED(hgrid_surface_at.surface, hgrid_surface_at(&grid, rays, &hit, NULL));
    CHECK(hgrid_surface_at(&grid, rays, &hit, &out.surface));
}

static void batches(void)
{
    const hgrid_coherence c = HGRID_COHERENCE_COHERENT;
    REFUSED(hgrid_intersect_n.grid, HGRID_ERROR_NULL_ARGUMENT,
            hgrid_intersect_n(NULL, rays, 0, out.hits, 0, RAYS, c, &options));
    REFUSED(hgrid_intersect_n.rays, HGRID_ERROR_NULL_ARGUMENT,
            hgrid_intersect_n(&grid, NULL, 0, out.hits, 0, RAYS, c, &options));
    REFUSED(hgrid_intersect_n.hits, HGRID_ERROR_NULL_ARGUMENT,
            hgrid_intersect_n(&grid, rays, 0, NULL, 0, RAYS, c, &options));
    ALLOWED(hgrid_intersect_n.rays, hgrid_intersect_n(&grid, NULL, 0, NULL, 0, 0, c, &options));
    ALLOWED(hgrid_intersect_n.options,
            hgrid_intersect_n(&grid, rays, 0, out.hits, 0, RAYS, c, NULL));

    REFUSED(hgrid_occluded_n.grid, HGRID_ERROR_NULL_ARGUMENT,
            hgrid_occluded_n(NULL, rays, 0, out.occluded, 0, RAYS, c, &options));
    REFUSED(hgrid_occluded_n.rays, HGRID_ERROR_NULL_ARGUMENT,
            hgrid_occluded_n(&grid, NULL, 0, out.occluded, 0, RAYS, c, &options));
    REFUSED(hgrid_occluded_n.occluded, HGRID_ERROR_NULL_ARGUMENT,
            hgrid_occluded_n(&grid, rays, 0, NULL, 0, RAYS, c, &options));
    ALLOWED(hgrid_occluded_n.rays, hgrid_occluded_n(&grid, NULL, 0, NULL, 0, 0, c, &options));
    ALLOWED(hgrid_occluded_n.options,
            hgrid_occluded_n(&grid, rays, 0, out.occluded, 0, RAYS, c, NULL));

    REFUSED(hgrid_occluder_n.grid, HGRID_ERROR_NULL_ARGUMENT,
            hgrid_occluder_n(NULL, rays, 0, out.occluders, 0, RAYS, c, &options));
    REFUSED(hgrid_occluder_n.rays, HGRID_ERROR_NULL_ARGUMENT,
            hgrid_occluder_n(&grid, NULL, 0, out.occluders, 0, RAYS, c, &options));
    REFUSED(hgrid_occluder_n.occluders, HGRID_ERROR_NULL_ARGUMENT,
            hgrid_occluder_n(&grid, rays, 0, NULL, 0, RAYS, c, &options));
    ALLOWED(hgrid_occluder_n.rays, hgrid_occluder_n(&grid, NULL, 0, NULL, 0, 0, c, &options));
    ALLOWED(hgrid_occluder_n.options,
            hgrid_occluder_n(&grid, rays, 0, out.occluders, 0, RAYS, c, NULL));
}

static void stored_grids(void)
{
    REFUSED(hgrid_open.blob, HGRID_ERROR_NULL_ARGUMENT, hgrid_open(NULL, 0, &mesh, &out.grid));
    REFUSED(hgrid_open.blob, HGRID_ERROR_NULL_ARGUMENT,
            hgrid_open(NULL, blob_bytes, &mesh, &out.grid));
    REFUSED(hgrid_open.mesh, HGRID_ERROR_NO_MESH, hgrid_open(blob, blob_bytes, NULL, &out.grid));
    ALLOWED(hgrid_open.mesh, hgrid_open(packed, packed_bytes, NULL, &out.grid));
    REFUSED(hgrid_open.grid, HGRID_ERROR_NULL_ARGUMENT, hgrid_open(blob, blob_bytes, &mesh, NULL));

    REFUSED(hgrid_refit.mesh, HGRID_ERROR_NULL_ARGUMENT,
            hgrid_refit(NULL, tree, tree_bytes, &out.grid, &refit_report));
    REFUSED(hgrid_refit.blob, HGRID_ERROR_NULL_ARGUMENT,
            hgrid_refit(&mesh, NULL, tree_bytes, &out.grid, &refit_report));
    REFUSED(hgrid_refit.grid, HGRID_ERROR_NULL_ARGUMENT,
            hgrid_refit(&mesh, tree, tree_bytes, NULL, &refit_report));
    ALLOWED(hgrid_refit.report, hgrid_refit(&mesh, tree, tree_bytes, &out.grid, NULL));

    REFUSED(hgrid_peek.blob, HGRID_ERROR_NULL_ARGUMENT, hgrid_peek(NULL, 128, &out.info));
    REFUSED(hgrid_peek.blob, HGRID_ERROR_NOT_A_GRID, hgrid_peek(NULL, 0, &out.info));
    REFUSED(hgrid_peek.info, HGRID_ERROR_NULL_ARGUMENT, hgrid_peek(blob, blob_bytes, NULL));

    REFUSED(hgrid_pack.grid, HGRID_ERROR_NULL_ARGUMENT,
            hgrid_pack(NULL, packed, packed_bytes, &out.bytes));
    REFUSED(hgrid_pack.to, HGRID_ERROR_NULL_ARGUMENT,
            hgrid_pack(&grid, NULL, packed_bytes, &out.bytes));
    REFUSED(hgrid_pack.bytes, HGRID_ERROR_NULL_ARGUMENT,
            hgrid_pack(&grid, packed, packed_bytes, NULL));

    REFUSED(hgrid_mesh_of.grid, HGRID_ERROR_NULL_ARGUMENT, hgrid_mesh_of(NULL, &out.mesh));
    REFUSED(hgrid_mesh_of.mesh, HGRID_ERROR_NULL_ARGUMENT, hgrid_mesh_of(&grid, NULL));
    REFUSED(hgrid_validate.grid, HGRID_ERROR_NULL_ARGUMENT, hgrid_validate(NULL, scratch, 1));
    REFUSED(hgrid_validate.scratch, HGRID_ERROR_NULL_ARGUMENT, hgrid_validate(&grid, NULL, 1));
    REFUSED(hgrid_validate.scratch, HGRID_ERROR_SCRATCH_TOO_SMALL, hgrid_validate(&grid, NULL, 0));
    CHECK(hgrid_validate_bytes(NULL) == 0);
    puts("null hgrid_validate_bytes.grid");
    REFUSED(hgrid_inspect.grid, HGRID_ERROR_NULL_ARGUMENT, hgrid_inspect(NULL, &out.statistics));
    REFUSED(hgrid_inspect.statistics, HGRID_ERROR_NULL_ARGUMENT, hgrid_inspect(&grid, NULL));
}

int main(void)
{
    prepare();
    questions_for_sizes();
    builds();
    arrays_of_a_mesh();
    joined_meshes();
    callbacks();
    queries();
    batches();
    stored_grids();
    return 0;
}
