/* Structs of earlier and later versions (see versions.h), in each function that takes one. The test checks
 * that no struct of any function is missing here. */

#include "versions.h"

static sheet mesh_data;
static hgrid_mesh mesh;
static hgrid_grid grid;
static hgrid_config config;
static void *blob, *tree;
static size_t blob_bytes, tree_bytes, index_bytes, scratch_bytes;
static unsigned char *index_region, *scratch;
static const hgrid_report new_report = HGRID_REPORT_INIT;

static void prepare(void)
{
    make_sheet(&mesh_data);
    mesh = mesh_of(&mesh_data);
    const hgrid_config what_null_means = HGRID_CONFIG_INIT;
    config = what_null_means;
    grid = build_exactly(&mesh, &config, &blob, &blob_bytes);
    const hgrid_config bvh = HGRID_CONFIG_INIT_BVH;
    build_exactly(&mesh, &bvh, &tree, &tree_bytes);
    hgrid_report need = HGRID_REPORT_INIT;
    /* Fitting takes as much scratch as hgrid_sizes reports without scratch. */
    EXPECT(HGRID_OK, hgrid_sizes(&mesh, &config, NULL, 0, &need));
    index_bytes = (size_t)exact_sizes(&mesh, &config).index_bytes;
    scratch_bytes = (size_t)need.scratch_bytes;
    index_region = (unsigned char *)guarded(index_bytes);
    scratch = (unsigned char *)guarded(scratch_bytes);
}

static void meshes(void)
{
    hgrid_report report = new_report;
    hgrid_config fitted = config;
    hgrid_grid view;
    CHECK_VERSIONS(hgrid_sizes.mesh, hgrid_mesh, mesh, hgrid_sizes(it, NULL, NULL, 0, &report));
    CHECK_VERSIONS(hgrid_fit.mesh, hgrid_mesh, mesh,
                   hgrid_fit(it, NULL, index_bytes, scratch, scratch_bytes, &fitted, NULL));
    CHECK_VERSIONS(hgrid_build.mesh, hgrid_mesh, mesh,
                   hgrid_build(it, NULL, index_region, index_bytes, scratch, scratch_bytes, &view,
                               NULL));
    CHECK_VERSIONS(hgrid_open.mesh, hgrid_mesh, mesh, hgrid_open(blob, blob_bytes, it, &view));
    CHECK_VERSIONS(hgrid_refit.mesh, hgrid_mesh, mesh,
                   hgrid_refit(it, tree, tree_bytes, &view, NULL));
    static hgrid_part parts[1];
    hgrid_mesh all = HGRID_MESH_INIT;
    CHECK_VERSIONS(hgrid_join.meshes, hgrid_mesh, mesh, hgrid_join(it, 1, parts, &all));
    CHECK_VERSIONS(hgrid_join.joined, hgrid_mesh, mesh, hgrid_join(&mesh, 1, parts, it));
    CHECK_VERSIONS(hgrid_mesh_of.mesh, hgrid_mesh, mesh, hgrid_mesh_of(&grid, it));
}

static void configurations(void)
{
    hgrid_report report = new_report;
    hgrid_config fitted = config;
    hgrid_grid view;
    CHECK_VERSIONS(hgrid_bound.config, hgrid_config, config, hgrid_bound(5, it, &report));
    CHECK_VERSIONS(hgrid_sizes.config, hgrid_config, config,
                   hgrid_sizes(&mesh, it, NULL, 0, &report));
    CHECK_VERSIONS(hgrid_fit.config, hgrid_config, config,
                   hgrid_fit(&mesh, it, index_bytes, scratch, scratch_bytes, &fitted, NULL));
    CHECK(memcmp(&fitted, &config, sizeof config) == 0);
    CHECK_VERSIONS(hgrid_fit.fitted, hgrid_config, config,
                   hgrid_fit(&mesh, NULL, index_bytes, scratch, scratch_bytes, it, NULL));
    /* The same struct for both. */
    CHECK_VERSIONS(hgrid_fit.fitted, hgrid_config, config,
                   hgrid_fit(&mesh, it, index_bytes, scratch, scratch_bytes, it, NULL));
    CHECK_VERSIONS(hgrid_build.config, hgrid_config, config,
                   hgrid_build(&mesh, it, index_region, index_bytes, scratch, scratch_bytes, &view,
                               NULL));
    /* An unknown value in a field that had to be 0 in another version of the struct. */
    hgrid_config other = config;
    other.method = HGRID_METHOD_BVH, other.quality = 2;
    EXPECT(HGRID_ERROR_INVALID_QUALITY, hgrid_bound(5, &other, &report));
    EXPECT(HGRID_ERROR_INVALID_QUALITY, hgrid_sizes(&mesh, &other, NULL, 0, &report));
    EXPECT(HGRID_ERROR_INVALID_QUALITY,
           hgrid_fit(&mesh, &other, index_bytes, scratch, scratch_bytes, &fitted, NULL));
    EXPECT(HGRID_ERROR_INVALID_QUALITY,
           hgrid_build(&mesh, &other, index_region, index_bytes, scratch, scratch_bytes, &view,
                       NULL));
}

static void results(void)
{
    const hgrid_blob_info info = HGRID_BLOB_INFO_INIT;
    const hgrid_refit_report refit = HGRID_REFIT_REPORT_INIT;
    const hgrid_statistics statistics = HGRID_STATISTICS_INIT;
    hgrid_config fitted = config;
    hgrid_grid view;
    CHECK_VERSIONS(hgrid_bound.report, hgrid_report, new_report, hgrid_bound(5, NULL, it));
    CHECK_VERSIONS(hgrid_sizes.report, hgrid_report, new_report,
                   hgrid_sizes(&mesh, NULL, NULL, 0, it));
    CHECK_VERSIONS(hgrid_fit.report, hgrid_report, new_report,
                   hgrid_fit(&mesh, NULL, index_bytes, scratch, scratch_bytes, &fitted, it));
    CHECK_VERSIONS(hgrid_build.report, hgrid_report, new_report,
                   hgrid_build(&mesh, NULL, index_region, index_bytes, scratch, scratch_bytes,
                               &view, it));
    CHECK_VERSIONS(hgrid_refit.report, hgrid_refit_report, refit,
                   hgrid_refit(&mesh, tree, tree_bytes, &view, it));
    CHECK_VERSIONS(hgrid_peek.info, hgrid_blob_info, info, hgrid_peek(blob, blob_bytes, it));
    CHECK_VERSIONS(hgrid_inspect.statistics, hgrid_statistics, statistics,
                   hgrid_inspect(&grid, it));
}

/* Returns a status for a query of one ray, which has none. */
static hgrid_status found(bool is_found)
{
    return is_found ? HGRID_OK : HGRID_ERROR_STRUCT_SIZE;
}

static void options_of_queries(void)
{
    const hgrid_query_options options = HGRID_QUERY_OPTIONS_INIT;
    const hgrid_ray ray = ray_down(0.5f, 0.5f);
    const hgrid_point_query query = {{0.5f, 0.5f, 1}, 5};
    const hgrid_coherence c = HGRID_COHERENCE_COHERENT;
    hgrid_hit hit;
    hgrid_closest closest;
    uint8_t occluded;
    uint32_t occluder;
    size_t count;
    CHECK_VERSIONS(hgrid_intersect.options, hgrid_query_options, options,
                   found(hgrid_intersect(&grid, &ray, it, &hit)));
    CHECK_VERSIONS(hgrid_occluded.options, hgrid_query_options, options,
                   found(hgrid_occluded(&grid, &ray, it)));
    CHECK_VERSIONS(hgrid_occluder.options, hgrid_query_options, options,
                   found(hgrid_occluder(&grid, &ray, it) != HGRID_INVALID_ID));
    CHECK_VERSIONS(hgrid_closest_point.options, hgrid_query_options, options,
                   found(hgrid_closest_point(&grid, &query, it, &closest)));
    CHECK_VERSIONS(hgrid_intersect_all.options, hgrid_query_options, options,
                   hgrid_intersect_all(&grid, &ray, it, &hit, 1, &count));
    CHECK_VERSIONS(hgrid_intersect_n.options, hgrid_query_options, options,
                   hgrid_intersect_n(&grid, &ray, 0, &hit, 0, 1, c, it));
    CHECK_VERSIONS(hgrid_occluded_n.options, hgrid_query_options, options,
                   hgrid_occluded_n(&grid, &ray, 0, &occluded, 0, 1, c, it));
    CHECK_VERSIONS(hgrid_occluder_n.options, hgrid_query_options, options,
                   hgrid_occluder_n(&grid, &ray, 0, &occluder, 0, 1, c, it));
}

int main(void)
{
    prepare();
    meshes();
    configurations();
    results();
    options_of_queries();
    return 0;
}
