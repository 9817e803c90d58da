/* What is refused, with which status, and is everything then as it was? */

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

/* A build and the two questions for sizes that must all say the same; returns the build's report.
 * Neither the index nor the view is touched. */
static hgrid_report refuse(hgrid_status expected, const hgrid_mesh *input,
                           const hgrid_config *config)
{
    hgrid_report report = HGRID_REPORT_INIT;
    EXPECT(expected, hgrid_sizes(input, config, NULL, 0, &report));
    EXPECT(expected, hgrid_sizes(input, config, region_2, scratch_bytes, &report));

    hgrid_grid grid;
    memset(&grid, 0xc7, sizeof grid);
    memset(region_1, 0xc7, index_bytes);
    memset(&report.is_exact, 0xc7, sizeof report - sizeof report.struct_size);
    EXPECT(expected, hgrid_build(input, config, region_1, index_bytes, region_2, scratch_bytes,
                                 &grid, &report));
    CHECK(all_bytes_are(&grid, sizeof grid, 0xc7));
    CHECK(all_bytes_are(region_1, index_bytes, 0xc7));
    CHECK(report.struct_size == sizeof report && report.reserved == 0 && report.index_bytes == 0);
    return report;
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

static void null_is_refused_everywhere(void)
{
    hgrid_report report = HGRID_REPORT_INIT;
    hgrid_grid grid;
    hgrid_mesh input = mesh;

    EXPECT(HGRID_ERROR_NULL_ARGUMENT, hgrid_sizes(NULL, NULL, NULL, 0, &report));
    refuse(HGRID_ERROR_NULL_ARGUMENT, NULL, NULL);
    input.positions = NULL;
    refuse_mesh(HGRID_ERROR_NULL_ARGUMENT, &input);
    input = mesh;
    input.indices = NULL;
    refuse_mesh(HGRID_ERROR_NULL_ARGUMENT, &input);

    EXPECT(HGRID_ERROR_NULL_ARGUMENT, hgrid_sizes(&mesh, NULL, NULL, 0, NULL));
    EXPECT(HGRID_ERROR_NULL_ARGUMENT, hgrid_sizes(&mesh, NULL, NULL, 64, &report));
    EXPECT(HGRID_ERROR_NULL_ARGUMENT, hgrid_build(&mesh, NULL, NULL, index_bytes, region_2,
                                                  scratch_bytes, &grid, &report));
    EXPECT(HGRID_ERROR_NULL_ARGUMENT, hgrid_build(&mesh, NULL, region_1, index_bytes, NULL,
                                                  scratch_bytes, &grid, &report));
    EXPECT(HGRID_ERROR_NULL_ARGUMENT, hgrid_build(&mesh, NULL, region_1, index_bytes, region_2,
                                                  scratch_bytes, NULL, &report));
    CHECK(all_bytes_are(region_1, index_bytes, 0xc7));
    EXPECT(HGRID_ERROR_NULL_ARGUMENT, hgrid_open(NULL, 0, &mesh, &grid));
    EXPECT(HGRID_ERROR_NULL_ARGUMENT, hgrid_open(NULL, index_bytes, &mesh, &grid));
    EXPECT(HGRID_ERROR_NULL_ARGUMENT, hgrid_open(region_1, index_bytes, &mesh, NULL));
    EXPECT(HGRID_ERROR_NULL_ARGUMENT, hgrid_validate(NULL));
    EXPECT(HGRID_ERROR_NULL_ARGUMENT,
           hgrid_build(NULL, NULL, NULL, 0, NULL, 0, NULL, NULL));

    /* NULL where it is allowed. */
    EXPECT(HGRID_OK, hgrid_build(&mesh, NULL, region_1, index_bytes, region_2, scratch_bytes, &grid,
                                 NULL));
    const hgrid_ray ray = ray_down(0.5f, 0.5f);
    hgrid_hit hit;
    CHECK(hgrid_intersect(&grid, &ray, NULL, &hit) && hgrid_occluded(&grid, &ray, NULL));

    /* And where it makes a query miss. */
    memset(&hit, 0xc7, sizeof hit);
    CHECK(!hgrid_intersect(NULL, &ray, NULL, &hit) && !hgrid_intersect(&grid, NULL, NULL, &hit));
    CHECK(!hgrid_intersect(&grid, &ray, NULL, NULL));
    CHECK(!hgrid_occluded(NULL, &ray, NULL) && !hgrid_occluded(&grid, NULL, NULL));
    CHECK(all_bytes_are(&hit, sizeof hit, 0xc7));
}

/* A struct as a later version may have it. */
#define LATER(type) \
    struct { \
        type known; \
        unsigned char tail[24]; \
    }

/* Runs `call` with every struct_size; `later` is a LATER struct, all right but for its size. */
#define CHECK_STRUCT_SIZES(later, call) \
    do { \
        const uint32_t known_ = (uint32_t)sizeof (later).known; \
        memset((later).tail, 0, sizeof (later).tail); \
        (later).known.struct_size = 0; \
        EXPECT(HGRID_ERROR_STRUCT_SIZE, call); \
        (later).known.struct_size = known_ - 1; \
        EXPECT(HGRID_ERROR_STRUCT_SIZE, call); \
        (later).known.struct_size = UINT32_MAX; \
        EXPECT(HGRID_ERROR_STRUCT_SIZE, call); \
        (later).tail[sizeof (later).tail - 1] = 1; \
        (later).known.struct_size = (uint32_t)sizeof (later); \
        EXPECT(HGRID_ERROR_STRUCT_SIZE, call); \
        (later).known.struct_size = (uint32_t)sizeof (later) - 1; \
        EXPECT(HGRID_OK, call); \
        (later).tail[sizeof (later).tail - 1] = 0; \
        (later).known.struct_size = (uint32_t)sizeof (later); \
        EXPECT(HGRID_OK, call); \
        (later).known.struct_size = known_; \
        EXPECT(HGRID_OK, call); \
    } while (0)

static void struct_sizes_are_checked(void)
{
    LATER(hgrid_mesh) later_mesh = {mesh, {0}};
    LATER(hgrid_config) later_config = {HGRID_CONFIG_INIT, {0}};
    LATER(hgrid_report) later_report = {HGRID_REPORT_INIT, {0}};
    hgrid_report report = HGRID_REPORT_INIT;
    hgrid_grid grid;

    CHECK_STRUCT_SIZES(later_mesh, hgrid_sizes(&later_mesh.known, NULL, NULL, 0, &report));
    CHECK_STRUCT_SIZES(later_config,
                       hgrid_sizes(&mesh, &later_config.known, NULL, 0, &report));
    CHECK_STRUCT_SIZES(later_report, hgrid_sizes(&mesh, NULL, NULL, 0, &later_report.known));

    CHECK_STRUCT_SIZES(later_mesh,
                       hgrid_build(&later_mesh.known, NULL, region_1, index_bytes, region_2,
                                   scratch_bytes, &grid, NULL));
    CHECK_STRUCT_SIZES(later_config,
                       hgrid_build(&mesh, &later_config.known, region_1, index_bytes, region_2,
                                   scratch_bytes, &grid, NULL));
    CHECK_STRUCT_SIZES(later_report,
                       hgrid_build(&mesh, NULL, region_1, index_bytes, region_2, scratch_bytes,
                                   &grid, &later_report.known));
    CHECK_STRUCT_SIZES(later_mesh,
                       hgrid_open(region_1, index_bytes, &later_mesh.known, &grid));

    /* A report keeps the caller's size, and what this version does not know stays as it was. */
    later_report.known.struct_size = (uint32_t)sizeof later_report;
    EXPECT(HGRID_OK, hgrid_sizes(&mesh, NULL, NULL, 0, &later_report.known));
    CHECK(later_report.known.struct_size == sizeof later_report);
    CHECK(all_bytes_are(later_report.tail, sizeof later_report.tail, 0));
}

/* A query has no status: with bad options it misses, and counts nothing. */
static hgrid_status asked(const hgrid_grid *grid, const hgrid_query_options *options)
{
    const hgrid_ray ray = ray_down(0.5f, 0.5f);
    hgrid_hit hit;
    memset(&hit, 0xc7, sizeof hit);
    options->counters->cell_steps = 0;
    const bool is_hit = hgrid_intersect(grid, &ray, options, &hit);
    CHECK(is_hit == hgrid_occluded(grid, &ray, options));
    CHECK(is_hit == (options->counters->cell_steps > 0));
    CHECK(is_hit != all_bytes_are(&hit, sizeof hit, 0xc7));
    return is_hit ? HGRID_OK : HGRID_ERROR_STRUCT_SIZE;
}

static void query_options_are_checked(void)
{
    hgrid_grid grid;
    hgrid_counters counters = {0, 0, 0};
    EXPECT(HGRID_OK, hgrid_build(&mesh, NULL, region_1, index_bytes, region_2, scratch_bytes, &grid,
                                 NULL));
    LATER(hgrid_query_options) later = {HGRID_QUERY_OPTIONS_INIT, {0}};
    later.known.counters = &counters;
    CHECK_STRUCT_SIZES(later, asked(&grid, &later.known));
    later.known.cull = HGRID_CULL_FRONT + 1;
    CHECK(asked(&grid, &later.known) != HGRID_OK);
}

static void regions_must_be_aligned(void)
{
    hgrid_grid grid;
    hgrid_report report = HGRID_REPORT_INIT;
    unsigned char *index = (unsigned char *)guarded(index_bytes + 64);
    unsigned char *scratch = (unsigned char *)guarded(scratch_bytes + 64);
    for (size_t off = 1; off < 64; off += off < 8 ? 1 : 8) {
        EXPECT(HGRID_ERROR_MISALIGNED,
               hgrid_sizes(&mesh, NULL, scratch + off, scratch_bytes, &report));
        EXPECT(HGRID_ERROR_MISALIGNED, hgrid_build(&mesh, NULL, index + off, index_bytes, scratch,
                                                   scratch_bytes, &grid, &report));
        EXPECT(HGRID_ERROR_MISALIGNED, hgrid_build(&mesh, NULL, index, index_bytes, scratch + off,
                                                   scratch_bytes, &grid, &report));
        EXPECT(HGRID_ERROR_MISALIGNED, hgrid_open(index + off, index_bytes, &mesh, &grid));
    }
    CHECK(all_bytes_are(index, index_bytes + 64, 0xc7));
    CHECK(all_bytes_are(scratch, scratch_bytes + 64, 0xc7));
}

static void regions_must_lie_apart(void)
{
    /* index | scratch | positions | indices, right behind each other: fine. */
    const size_t positions_at = index_bytes + scratch_bytes;
    const size_t indices_at = positions_at + sizeof mesh_data.positions;
    const size_t end = indices_at + sizeof mesh_data.indices;
    unsigned char *all = (unsigned char *)guarded((end + 63) / 64 * 64);
    memcpy(all + positions_at, mesh_data.positions, sizeof mesh_data.positions);
    memcpy(all + indices_at, mesh_data.indices, sizeof mesh_data.indices);
    hgrid_mesh input = mesh;
    input.positions = all + positions_at;
    input.indices = all + indices_at;
    hgrid_grid grid;
    hgrid_report report = HGRID_REPORT_INIT;
    EXPECT(HGRID_OK, hgrid_build(&input, NULL, all, index_bytes, all + index_bytes, scratch_bytes,
                                 &grid, &report));

    /* One byte more of either is one too many. */
    memset(all, 0xc7, positions_at);
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_build(&input, NULL, all, index_bytes + 1, all + index_bytes,
                                            scratch_bytes, &grid, &report));
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_build(&input, NULL, all, index_bytes, all + index_bytes,
                                            scratch_bytes + 1, &grid, &report));
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_sizes(&input, NULL, all + index_bytes, scratch_bytes + 1,
                                            &report));
    CHECK(all_bytes_are(all, positions_at, 0xc7));

    /* The same, one inside the other, and regions over the mesh. */
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_build(&input, NULL, all, index_bytes, all, scratch_bytes,
                                            &grid, &report));
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_build(&input, NULL, all, positions_at, all + 64, 64, &grid,
                                            &report));
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_build(&input, NULL, all + positions_at / 64 * 64, 4096, all,
                                            64, &grid, &report));
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_build(&input, NULL, all, 64, all + end / 64 * 64 - 64, 64,
                                            &grid, &report));
    /* A region without bytes lies nowhere. */
    EXPECT(HGRID_ERROR_SCRATCH_TOO_SMALL,
           hgrid_build(&input, NULL, all, index_bytes, all + 64, 0, &grid, &report));
    CHECK(memcmp(all + positions_at, mesh_data.positions, sizeof mesh_data.positions) == 0);
    CHECK(memcmp(all + indices_at, mesh_data.indices, sizeof mesh_data.indices) == 0);
}

static void unknown_values_are_errors(void)
{
    const uint32_t unknown[] = {0, 6, 100, 0x7fffffffu, 0x80000000u, UINT32_MAX};
    for (size_t i = 0; i < sizeof unknown / sizeof *unknown; i++) {
        hgrid_config config = HGRID_CONFIG_INIT;
        config.method = unknown[i];
        refuse(HGRID_ERROR_INVALID_METHOD, &mesh, &config);
        /* All of them have a bit that no flag has. */
        if (unknown[i] != 0) {
            hgrid_config flags = HGRID_CONFIG_INIT;
            flags.flags = unknown[i];
            refuse(HGRID_ERROR_INVALID_FLAGS, &mesh, &flags);
            hgrid_mesh input = mesh;
            input.index_type = unknown[i];
            refuse_mesh(HGRID_ERROR_INVALID_INDEX_TYPE, &input);
        }
    }
    const float densities[] = {0, -0.0f, -1, NAN, INFINITY, -INFINITY, 1e30f, FLT_MAX};
    for (size_t i = 0; i < sizeof densities / sizeof *densities; i++) {
        hgrid_config config = HGRID_CONFIG_INIT;
        config.density = densities[i];
        refuse(HGRID_ERROR_INVALID_DENSITY, &mesh, &config);
    }
}

/* A method's own fields are checked, those of the others are not looked at. */
static void fields_of_methods_are_checked(void)
{
    const hgrid_config usual[] = {HGRID_CONFIG_INIT, HGRID_CONFIG_INIT_FIXED,
                                  HGRID_CONFIG_INIT_VARIABLE, HGRID_CONFIG_INIT_RECURSIVE,
                                  HGRID_CONFIG_INIT_BRICK};
    const uint32_t depths[] = {0, HGRID_MAX_DEPTH + 1, UINT32_MAX};
    for (size_t i = 0; i < sizeof usual / sizeof *usual; i++) {
        const uint32_t method = usual[i].method;
        for (uint32_t factor = 0; factor < 2; factor++) {
            hgrid_config config = usual[i];
            config.macrocell_factor = factor;
            if (method == HGRID_METHOD_FIXED)
                refuse(HGRID_ERROR_INVALID_MACROCELL_FACTOR, &mesh, &config);
            else
                exact_sizes(&mesh, &config);
        }
        for (size_t d = 0; d < sizeof depths / sizeof *depths; d++) {
            hgrid_config config = usual[i];
            config.depth = depths[d];
            if (method == HGRID_METHOD_RECURSIVE)
                refuse(HGRID_ERROR_INVALID_DEPTH, &mesh, &config);
            else
                exact_sizes(&mesh, &config);
        }
        const float numbers[] = {0, -0.0f, -1, NAN, INFINITY, -INFINITY};
        for (size_t n = 0; n < sizeof numbers / sizeof *numbers; n++) {
            hgrid_config density = usual[i], cell_size = usual[i];
            density.density = cell_size.cell_size = numbers[n];
            if (method == HGRID_METHOD_BRICK) {
                refuse(HGRID_ERROR_INVALID_CELL_SIZE, &mesh, &cell_size);
            } else {
                refuse(HGRID_ERROR_INVALID_DENSITY, &mesh, &density);
                exact_sizes(&mesh, &cell_size);
            }
        }
        hgrid_config config = usual[i];
        config.flags = 0x80000000u;
        refuse(HGRID_ERROR_INVALID_FLAGS, &mesh, &config);
        config = usual[i];
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

    /* The first one counts. */
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
    null_is_refused_everywhere();
    struct_sizes_are_checked();
    query_options_are_checked();
    regions_must_be_aligned();
    regions_must_lie_apart();
    unknown_values_are_errors();
    fields_of_methods_are_checked();
    impossible_arrays_are_refused();
    bad_triangles_are_named();
    every_status_has_words_of_its_own();
    return 0;
}
