/* Memory sizes: enough for any mesh, enough for this one, and the finest grid for a budget. */

#include "check.h"

static sheet mesh_data;
static hgrid_mesh mesh;
static const hgrid_report new_report = HGRID_REPORT_INIT;

/* Triangles from one end of the mesh to the other, the worst for a grid. */
enum { AWKWARD = 6 };
static float corners[3 * AWKWARD][3];
static uint32_t triangles[AWKWARD][3];

static hgrid_mesh awkward_mesh(size_t count)
{
    uint32_t random = 12345;
    for (uint32_t i = 0; i < 3 * AWKWARD; i++) {
        for (int axis = 0; axis < 3; axis++) {
            random = random * 1664525u + 1013904223u;
            corners[i][axis] = (float)(random >> 8);
        }
        triangles[i / 3][i % 3] = i;
    }
    hgrid_mesh awkward = HGRID_MESH_INIT;
    awkward.positions = corners, awkward.vertex_count = 3 * count;
    awkward.indices = triangles, awkward.triangle_count = count;
    return awkward;
}

/* Runs tasks one after the other. */
static void run(void *context, uint32_t count, hgrid_task task, void *task_context)
{
    CHECK(context == &mesh);
    for (uint32_t i = 0; i < count; i++)
        task(task_context, i);
}

static bool never(void *context, uint32_t done)
{
    CHECK(context == NULL && done > HGRID_PROGRESS_END);
    return false;
}

static hgrid_report bound_of(size_t count, const hgrid_config *config)
{
    hgrid_report bound = new_report;
    EXPECT(HGRID_OK, hgrid_bound(count, config, &bound));
    CHECK(bound.is_exact == 0 && bound.triangle == HGRID_INVALID_ID && bound.density == 0);
    CHECK(bound.index_bytes % 64 == 0 && bound.scratch_bytes % 64 == 0);
    return bound;
}

static void bounds_are_enough(void)
{
    for (int method = 0; method < METHODS; method++)
        for (uint32_t tasks = 1; tasks < 9; tasks += 7)
            for (size_t count = 0; count <= AWKWARD; count += 3) {
                hgrid_config config = usual(method);
                config.tasks = tasks, config.run = run, config.context = &mesh;
                const hgrid_mesh awkward = awkward_mesh(count);
                const hgrid_report bound = bound_of(count, &config);
                void *index = guarded(bound.index_bytes), *scratch = guarded(bound.scratch_bytes);
                hgrid_report sizes = new_report;
                hgrid_grid grid;
                EXPECT(HGRID_OK, hgrid_sizes(&awkward, &config, NULL, 0, &sizes));
                CHECK(sizes.index_bytes <= bound.index_bytes);
                CHECK(sizes.scratch_bytes <= bound.scratch_bytes);
                EXPECT(HGRID_OK, hgrid_build(&awkward, &config, index, bound.index_bytes, scratch,
                                             bound.scratch_bytes, &grid, NULL));
                EXPECT_PROOF(HGRID_OK, &grid);
            }
}

static void macros_are_no_less_than_the_function(void)
{
    for (size_t count = 0; count <= 2147483648u; count += 1 + count / 5) {
        const hgrid_report bound = bound_of(count, NULL);
        CHECK(HGRID_INDEX_BOUND(count) / 64 * 64 >= bound.index_bytes);
        CHECK(HGRID_SCRATCH_BOUND(count) / 64 * 64 >= bound.scratch_bytes);
        hgrid_config high = HGRID_CONFIG_INIT_BVH;
        high.quality = HGRID_QUALITY_HIGH;
        const hgrid_report of_high = bound_of(count, &high);
        CHECK(HGRID_INDEX_BOUND(count) / 64 * 64 >= of_high.index_bytes);
        CHECK(HGRID_BVH_HIGH_SCRATCH_BOUND(count) / 64 * 64 >= of_high.scratch_bytes);
    }
    bound_of(2147483648u, NULL);
    hgrid_report bound = new_report;
    const hgrid_config large_tree = HGRID_CONFIG_INIT_BVH;
    EXPECT(HGRID_ERROR_TOO_MANY_TRIANGLES, hgrid_bound(2147483649u, &large_tree, &bound));
    for (int method = 0; method < METHODS; method++) {
        const hgrid_config config = usual(method);
        EXPECT(HGRID_ERROR_TOO_MANY_TRIANGLES, hgrid_bound(4294967295u, &config, &bound));
        EXPECT(HGRID_ERROR_TOO_MANY_TRIANGLES, hgrid_bound(SIZE_MAX, &config, &bound));
        CHECK(bound.index_bytes == 0 && bound.scratch_bytes == 0);
    }
}

/* Too little scratch for sizes is no error: it is not used. */
static void sizes_are_told_with_any_scratch(void)
{
    for (int method = 0; method < METHODS; method++) {
        const hgrid_config config = usual(method);
        hgrid_report without = new_report, with = new_report;
        EXPECT(HGRID_OK, hgrid_sizes(&mesh, &config, NULL, 0, &without));
        const size_t need = (size_t)exact_sizes(&mesh, &config).scratch_bytes;
        unsigned char *scratch = (unsigned char *)guarded(need);
        const size_t less[] = {1, 63, 64, 127};
        for (size_t i = 0; i < sizeof less / sizeof *less; i++) {
            memset(scratch, 0xc7, need);
            EXPECT(HGRID_OK, hgrid_sizes(&mesh, &config, scratch, less[i], &with));
            CHECK(memcmp(&with, &without, sizeof with) == 0);
            CHECK(all_bytes_are(scratch + less[i], need - less[i], 0xc7));
        }
    }
}

static void check_fit(const hgrid_config *config, size_t budget, void *scratch, size_t bytes,
                      double *finest)
{
    hgrid_config fitted = *config, in_place = *config;
    hgrid_report report = new_report, again = new_report;
    const hgrid_status status =
        hgrid_fit(&mesh, config, budget, scratch, bytes, &fitted, &report);
    CHECK(hgrid_fit(&mesh, &in_place, budget, scratch, bytes, &in_place, &again) == status);
    CHECK(memcmp(&fitted, &in_place, sizeof fitted) == 0);
    CHECK(memcmp(&report, &again, sizeof report) == 0);
    if (status == HGRID_ERROR_INDEX_TOO_SMALL) {
        /* Nothing was written, and the size that it asks for is enough. */
        EXPECT(status, hgrid_fit(&mesh, config, budget, scratch, bytes, &fitted, NULL));
        CHECK(memcmp(&fitted, config, sizeof fitted) == 0 && report.index_bytes > budget);
        CHECK(report.triangle == HGRID_INVALID_ID);
        EXPECT(HGRID_OK, hgrid_fit(&mesh, config, (size_t)report.index_bytes, scratch, bytes,
                                   &fitted, &again));
        CHECK(again.index_bytes <= report.index_bytes);
        return;
    }
    EXPECT(HGRID_OK, status);
    CHECK(report.index_bytes <= budget && report.is_exact == (scratch != NULL));

    /* All fields but the density stay as the caller set them. */
    const double cells = fitted.density;
    CHECK(fitted.density <= config->density);
    CHECK(cells <= *finest * 1.0001);
    *finest = cells;
    hgrid_config rest = fitted;
    rest.density = config->density;
    CHECK(memcmp(&rest, config, sizeof rest) == 0);

    /* The grid fits the budget, and a grid with one step more density needs more. */
    fitted.progress = NULL;
    EXPECT(HGRID_OK, hgrid_sizes(&mesh, &fitted, scratch, bytes, &again));
    void *index = guarded((budget + 63) / 64 * 64), *enough = guarded(again.scratch_bytes);
    hgrid_grid grid;
    EXPECT(HGRID_OK, hgrid_build(&mesh, &fitted, index, budget, enough, again.scratch_bytes, &grid,
                                 NULL));
    EXPECT_PROOF(HGRID_OK, &grid);
    if (fitted.density < config->density) {
        fitted.density *= 1.41422f;
        EXPECT(HGRID_OK, hgrid_sizes(&mesh, &fitted, scratch, bytes, &again));
        CHECK(again.index_bytes > budget);
    }
}

static void the_finest_grid_that_fits_is_found(void)
{
    for (int method = 0; method < METHODS; method++)
        for (int with = 0; with < 2; with++) {
            hgrid_config config = usual(method);
            config.tasks = 3, config.run = run, config.context = &mesh, config.progress = never;
            hgrid_report whole = new_report;
            EXPECT(HGRID_OK, hgrid_sizes(&mesh, &config, NULL, 0, &whole));
            const size_t bytes = with ? (size_t)whole.scratch_bytes : 0;
            void *scratch = with ? guarded(bytes) : NULL;
            EXPECT(HGRID_OK, hgrid_sizes(&mesh, &config, scratch, bytes, &whole));
            double finest = INFINITY;
            const size_t most = (size_t)whole.index_bytes;
            /* A budget that the grid fits into changes nothing. */
            hgrid_config fitted = usual(0);
            hgrid_report report = new_report;
            config.tasks = 1;
            const bool is_planned = config.method == HGRID_METHOD_ONE_LEVEL
                                    || config.method == HGRID_METHOD_FIXED;
            if (!with && !is_planned) {
                /* Without scratch these methods have only bounds, which say nothing about this mesh. */
                EXPECT(HGRID_ERROR_SCRATCH_TOO_SMALL,
                       hgrid_fit(&mesh, &config, SIZE_MAX, scratch, bytes, &fitted, &report));
                CHECK(report.scratch_bytes > 0);
                continue;
            }
            EXPECT(HGRID_OK, hgrid_fit(&mesh, &config, SIZE_MAX, scratch, bytes, &fitted, &report));
            CHECK(memcmp(&fitted, &config, sizeof config) == 0);
            CHECK(report.index_bytes <= whole.index_bytes);
            config.tasks = 3;
            for (size_t less = 0; less < 3; less++)
                check_fit(&config, most * (5 - 2 * less) / 4, scratch, bytes, &finest);
            check_fit(&config, 100, scratch, bytes, &finest);
            check_fit(&config, 0, scratch, bytes, &finest);
        }
}

int main(void)
{
    make_sheet(&mesh_data);
    mesh = mesh_of(&mesh_data);
    bounds_are_enough();
    macros_are_no_less_than_the_function();
    sizes_are_told_with_any_scratch();
    the_finest_grid_that_fits_is_found();
    return 0;
}
