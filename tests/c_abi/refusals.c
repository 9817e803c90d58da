/* Refused meshes and configurations: which status they get, and that nothing is changed. */

#include "check.h"

static sheet mesh_data;
static hgrid_mesh mesh;
static size_t index_bytes, scratch_bytes;
static unsigned char *region_1, *region_2;

static void prepare(void)
{
    make_sheet(&mesh_data);
    mesh = mesh_of(&mesh_data);
    const hgrid_report need = exact_sizes(&mesh, NULL);
    index_bytes = (size_t)need.index_bytes;
    scratch_bytes = (size_t)need.scratch_bytes;
    region_1 = (unsigned char *)guarded(index_bytes);
    region_2 = (unsigned char *)guarded(scratch_bytes);
}

/* Checks that a build and hgrid_sizes, with and without scratch, return the same status and touch nothing
 * else; returns the build's report. */
static hgrid_report refuse_sizes(hgrid_status expected, const hgrid_mesh *input,
                                 const hgrid_config *config)
{
    hgrid_report report = HGRID_REPORT_INIT;
    /* Without scratch the sizes of a tree are a bound, for which the mesh is not read; and its build writes
     * keys into the index before it has read all triangles. */
    const bool is_tree = config == NULL || config->method == HGRID_METHOD_BVH;
    if (!is_tree)
        EXPECT(expected, hgrid_sizes(input, config, NULL, 0, &report));
    EXPECT(expected, hgrid_sizes(input, config, region_2, scratch_bytes, &report));

    hgrid_grid grid;
    memset(&grid, 0xc7, sizeof grid);
    memset(region_1, 0xc7, index_bytes);
    memset(&report.is_exact, 0xc7, sizeof report - sizeof report.struct_size);
    EXPECT(expected, hgrid_build(input, config, region_1, index_bytes, region_2, scratch_bytes,
                                 &grid, &report));
    CHECK(all_bytes_are(&grid, sizeof grid, 0xc7));
    CHECK(is_tree || all_bytes_are(region_1, index_bytes, 0xc7));
    CHECK(report.struct_size == sizeof report && report.reserved == 0 && report.index_bytes == 0);
    return report;
}

/* The same, and fitting a coarser grid fails too. */
static hgrid_report refuse(hgrid_status expected, const hgrid_mesh *input,
                           const hgrid_config *config)
{
    const hgrid_config before = HGRID_CONFIG_INIT;
    hgrid_config fitted = before;
    EXPECT(expected, hgrid_fit(input, config, index_bytes, region_2, scratch_bytes, &fitted, NULL));
    CHECK(memcmp(&fitted, &before, sizeof fitted) == 0);
    if (config == NULL) {
        const hgrid_config grids = HGRID_CONFIG_INIT_ONE_LEVEL;
        refuse_sizes(expected, input, &grids);
    }
    return refuse_sizes(expected, input, config);
}

/* The same for a configuration that is invalid for every mesh. */
static void refuse_config(hgrid_status expected, const hgrid_config *config)
{
    hgrid_report report = HGRID_REPORT_INIT;
    refuse(expected, &mesh, config);
    EXPECT(expected, hgrid_bound(0, config, &report));
    EXPECT(expected, hgrid_bound(TRIANGLES, config, &report));
    CHECK(report.index_bytes == 0 && report.triangle == HGRID_INVALID_ID);
}

static void refuse_mesh(hgrid_status expected, const hgrid_mesh *input)
{
    const hgrid_report report = refuse(expected, input, NULL);
    CHECK(report.triangle == HGRID_INVALID_ID);
    hgrid_grid grid;
    memset(&grid, 0xc7, sizeof grid);
    EXPECT(expected, hgrid_open(region_1, index_bytes, input, &grid));
    CHECK(all_bytes_are(&grid, sizeof grid, 0xc7));
}

static void unknown_values_are_errors(void)
{
    const uint32_t unknown[] = {0, 8, 100, 0x7fffffffu, 0x80000000u, UINT32_MAX};
    for (size_t i = 0; i < sizeof unknown / sizeof *unknown; i++) {
        hgrid_config config = HGRID_CONFIG_INIT_ONE_LEVEL;
        config.method = unknown[i];
        refuse_config(HGRID_ERROR_INVALID_METHOD, &config);
        /* Number 5 belonged to a removed method and stays unknown. */
        config.method = 5;
        refuse_config(HGRID_ERROR_INVALID_METHOD, &config);
        /* Each of them has a bit that no flag uses. */
        if (unknown[i] != 0) {
            hgrid_config flags = HGRID_CONFIG_INIT_ONE_LEVEL;
            flags.flags = unknown[i];
            refuse_config(HGRID_ERROR_INVALID_FLAGS, &flags);
            hgrid_config quality = HGRID_CONFIG_INIT_BVH;
            quality.quality = unknown[i];
            refuse_config(HGRID_ERROR_INVALID_QUALITY, &quality);
            hgrid_mesh input = mesh;
            input.index_type = unknown[i];
            refuse_mesh(HGRID_ERROR_INVALID_INDEX_TYPE, &input);
        }
    }
    /* These densities are too high for this mesh, and fitting lowers them; the others are invalid (see below). */
    const float densities[] = {1e30f, FLT_MAX};
    for (size_t i = 0; i < sizeof densities / sizeof *densities; i++) {
        hgrid_config config = HGRID_CONFIG_INIT_ONE_LEVEL;
        config.density = densities[i];
        refuse_sizes(HGRID_ERROR_INVALID_DENSITY, &mesh, &config);
        EXPECT(HGRID_OK, hgrid_fit(&mesh, &config, index_bytes, region_2, scratch_bytes, &config, NULL));
        CHECK(config.density < densities[i]);
    }
}

/* A method's own fields are checked; those of other methods are not read. */
static void fields_of_methods_are_checked(void)
{
    const uint32_t depths[] = {0, HGRID_MAX_DEPTH + 1, UINT32_MAX};
    for (int i = 0; i < METHODS; i++) {
        const uint32_t method = usual(i).method;
        for (uint32_t factor = 0; factor < 2; factor++) {
            hgrid_config config = usual(i);
            config.macrocell_factor = factor;
            if (method == HGRID_METHOD_FIXED)
                refuse_config(HGRID_ERROR_INVALID_MACROCELL_FACTOR, &config);
            else
                exact_sizes(&mesh, &config);
        }
        for (size_t d = 0; d < sizeof depths / sizeof *depths; d++) {
            hgrid_config config = usual(i);
            config.depth = depths[d];
            if (method == HGRID_METHOD_RECURSIVE)
                refuse_config(HGRID_ERROR_INVALID_DEPTH, &config);
            else
                exact_sizes(&mesh, &config);
        }
        const float numbers[] = {0, -0.0f, -1, NAN, INFINITY, -INFINITY};
        for (size_t n = 0; n < sizeof numbers / sizeof *numbers; n++) {
            hgrid_config density = usual(i);
            density.density = numbers[n];
            if (method == HGRID_METHOD_BVH) {
                exact_sizes(&mesh, &density);
            } else {
                refuse_config(HGRID_ERROR_INVALID_DENSITY, &density);
            }
        }
        hgrid_config config = usual(i);
        config.flags = 0x80000000u;
        refuse_config(HGRID_ERROR_INVALID_FLAGS, &config);
        config = usual(i);
        config.macrocell_factor = UINT32_MAX;
        config.subdivide_above = i % 2 == 0 ? 0 : UINT32_MAX;
        config.depth = HGRID_MAX_DEPTH;
        exact_sizes(&mesh, &config);
    }
}

static void impossible_arrays_are_refused(void)
{
    hgrid_mesh input = mesh;
    input.position_stride = 11;
    refuse_mesh(HGRID_ERROR_INVALID_POSITIONS, &input);
    input.position_stride = SIZE_MAX / 2;
    refuse_mesh(HGRID_ERROR_INVALID_POSITIONS, &input);
    input = mesh;
    input.vertex_count = SIZE_MAX;
    refuse_mesh(HGRID_ERROR_INVALID_POSITIONS, &input);
    input = mesh;
    input.index_stride = 11;
    refuse_mesh(HGRID_ERROR_INVALID_INDICES, &input);
    input.index_type = HGRID_INDEX_U16;
    input.index_stride = 5;
    refuse_mesh(HGRID_ERROR_INVALID_INDICES, &input);
    input.index_stride = SIZE_MAX;
    refuse_mesh(HGRID_ERROR_INVALID_INDICES, &input);
    input = mesh;
    input.masks = mesh_data.indices;
    for (input.mask_stride = 1; input.mask_stride < 4; input.mask_stride++)
        refuse_mesh(HGRID_ERROR_INVALID_MASKS, &input);
    input.mask_stride = SIZE_MAX / TRIANGLES + 1;
    refuse_mesh(HGRID_ERROR_INVALID_MASKS, &input);
#if SIZE_MAX > UINT32_MAX
    input = mesh;
    input.triangle_count = 4294967295u;
    refuse_mesh(HGRID_ERROR_TOO_MANY_TRIANGLES, &input);
    input.triangle_count = SIZE_MAX;
    refuse_mesh(HGRID_ERROR_TOO_MANY_TRIANGLES, &input);
#endif
}

static void bad_triangles_are_named(void)
{
    hgrid_config strict = HGRID_CONFIG_INIT;
    strict.flags = HGRID_BUILD_STRICT;
    static sheet bad;
    const hgrid_mesh input = mesh_of(&bad);

    /* The first bad triangle is named. */
    bad = mesh_data;
    bad.indices[17][2] = VERTICES;
    bad.indices[18][0] = UINT32_MAX;
    CHECK(refuse(HGRID_ERROR_INDEX_OUT_OF_RANGE, &input, NULL).triangle == 17);
    CHECK(refuse(HGRID_ERROR_INDEX_OUT_OF_RANGE, &input, &strict).triangle == 17);

    const float values[] = {NAN, INFINITY, -INFINITY, FLT_MAX};
    for (size_t i = 0; i < sizeof values / sizeof *values; i++) {
        bad = mesh_data;
        bad.positions[0][i % 3] = values[i];
        CHECK(refuse(HGRID_ERROR_NON_FINITE, &input, &strict).triangle == 0);

        /* Without the flag, the two triangles at this vertex are left out, and counted. */
        hgrid_grid rest;
        hgrid_report report = HGRID_REPORT_INIT;
        EXPECT(HGRID_OK, hgrid_build(&input, NULL, region_1, index_bytes, region_2, scratch_bytes,
                                     &rest, &report));
        CHECK(report.skipped_count == 2 && report.triangle == HGRID_INVALID_ID);
        const hgrid_ray here = ray_down(0.01f, 0.02f), beside = ray_down(0.5f, 0.5f);
        CHECK(!hgrid_occluded(&rest, &here, NULL) && hgrid_occluded(&rest, &beside, NULL));
    }
    hgrid_grid grid;
    bad = mesh_data;
    EXPECT(HGRID_OK, hgrid_build(&input, &strict, region_1, index_bytes, region_2, scratch_bytes,
                                 &grid, NULL));
}

static void every_status_has_words_of_its_own(void)
{
    const char *texts[64];
    size_t count = 0;
    for (hgrid_status status = 1; status > -64; status--) {
        const char *text = hgrid_status_string(status);
        CHECK(text != NULL && strlen(text) > 0);
        if (strcmp(text, "unknown status") == 0)
            continue;
        for (size_t i = 0; i < count; i++)
            CHECK(strcmp(texts[i], text) != 0);
        texts[count++] = text;
        printf("described %d\n", (int)status);
    }
    CHECK(strcmp(hgrid_status_string(INT32_MIN), "unknown status") == 0);
    CHECK(strcmp(hgrid_status_string(INT32_MAX), "unknown status") == 0);
}

int main(void)
{
    prepare();
    unknown_values_are_errors();
    fields_of_methods_are_checked();
    impossible_arrays_are_refused();
    bad_triangles_are_named();
    every_status_has_words_of_its_own();
    return 0;
}
