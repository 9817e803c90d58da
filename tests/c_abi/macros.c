/* Uses every macro as a program does, in every dialect, without a warning. */

#define HGRID_MALLOC
#include <hgrid.h>
#include <hgrid.h>

HGRID_ALIGNED static unsigned char index_region[HGRID_INDEX_BOUND(3)];
HGRID_ALIGNED unsigned char scratch_region[HGRID_SCRATCH_BOUND(3)];

static hgrid_mesh mesh = HGRID_MESH_INIT;
static const hgrid_config config = HGRID_CONFIG_INIT;
static const hgrid_config others[] = {HGRID_CONFIG_INIT_ONE_LEVEL, HGRID_CONFIG_INIT_FIXED,
                                      HGRID_CONFIG_INIT_VARIABLE, HGRID_CONFIG_INIT_RECURSIVE,
                                      HGRID_CONFIG_INIT_BVH};
HGRID_ALIGNED static unsigned char tree[HGRID_INDEX_BOUND(3)], tree_scratch[HGRID_BVH_HIGH_SCRATCH_BOUND(3)];
static unsigned char proof[HGRID_VALIDATE_BOUND(3)];

#if HGRID_VERSION < 0x000100 || HGRID_BLOB_VERSION < 1 || HGRID_ALIGNMENT != 64 || HGRID_MAX_DEPTH < 1 || \
    HGRID_MAX_TASKS != 64 || HGRID_PROGRESS_END != 1000
#error "the numbers work in the preprocessor, too"
#endif

int main(void)
{
    HGRID_ALIGNED unsigned char local[HGRID_ALIGNMENT] = {0};
    hgrid_query_options options = HGRID_QUERY_OPTIONS_INIT;
    hgrid_report report = HGRID_REPORT_INIT;
    hgrid_blob_info info = HGRID_BLOB_INFO_INIT;
    hgrid_refit_report refit = HGRID_REFIT_REPORT_INIT;
    hgrid_statistics statistics = HGRID_STATISTICS_INIT;
    hgrid_allocator allocator = HGRID_ALLOCATOR_INIT;
    hgrid_grid grid = HGRID_GRID_INIT;
    hgrid_closest closest;
    const hgrid_point_query query = {{0, 0, 0}, 1};
    size_t count = 0;
    const hgrid_ray ray = {{0, 0, 0}, 0, {0, 0, 1}, 1};
    hgrid_hit hit;
    const hgrid_coherence coherence = HGRID_COHERENCE_COHERENT;

    size_t misplaced = ((size_t)index_region | (size_t)scratch_region | (size_t)local) % 64;
    hgrid_status status = hgrid_build(&mesh, &config, index_region, sizeof index_region,
                                      scratch_region, sizeof scratch_region, &grid, &report);
    if (status == HGRID_OK)
        status = hgrid_build(&mesh, &others[4], tree, sizeof tree, tree_scratch, sizeof tree_scratch,
                             &grid, &report);
    if (status == HGRID_OK)
        status = hgrid_validate(&grid, proof, sizeof proof);
    if (status == HGRID_OK)
        status = hgrid_refit(&mesh, tree, sizeof tree, &grid, &refit);
    for (size_t i = 0; i < sizeof others / sizeof *others && status == HGRID_OK; i++)
        status = hgrid_sizes(&mesh, &others[i], NULL, 0, &report);
    if (status == HGRID_OK)
        status = hgrid_peek(index_region, sizeof index_region, &info);
    if (status == HGRID_OK)
        status = hgrid_inspect(&grid, &statistics);
    options.cull = HGRID_CULL_BACK;
    options.skip = HGRID_INVALID_ID;
    return misplaced != 0 || status != HGRID_OK || report.triangle != HGRID_INVALID_ID ||
           hgrid_intersect(&grid, &ray, &options, &hit) || hgrid_occluded(&grid, &ray, NULL) ||
           hgrid_intersect_n(&grid, &ray, 0, &hit, 0, 1, coherence, &options) != HGRID_OK ||
           hgrid_intersect_all(&grid, &ray, &options, &hit, 1, &count) != HGRID_OK || count != 0 ||
           hgrid_closest_point(&grid, &query, NULL, &closest) || info.has_mesh != 0 ||
           statistics.first_bad != HGRID_INVALID_ID || hit.primitive != HGRID_INVALID_ID ||
           allocator.allocate != NULL;
}
