/* Every method gives the same answers in exactly the memory it asks for, and fails safely with less. With an
 * argument, a quarter of the sizes that are too small, and a third of the damage. */

#include "check.h"

static sheet mesh_data;
static hgrid_mesh mesh;
static bool is_part;

enum { RAYS = 200 };

/* Returns parameters with which the small sheet has several levels, and subgrids in most cells. */
static hgrid_config deep(hgrid_config config)
{
    config.density = config.method == HGRID_METHOD_RECURSIVE ? 8.0f : 0.5f;
    config.macrocell_factor = 2;
    config.subdivide_above = 3;
    config.depth = HGRID_MAX_DEPTH;
    return config;
}

static bool is_deep(const hgrid_config *config)
{
    return config->subdivide_above == 3;
}

/* Returns true if the size of the index is known before the index is written. */
static bool is_planned(const hgrid_config *config)
{
    return config->method == HGRID_METHOD_ONE_LEVEL || config->method == HGRID_METHOD_FIXED;
}

/* Returns true for a tree, whose number of nodes is known only after the index is written. */
static bool is_tree(const hgrid_config *config)
{
    return config->method == HGRID_METHOD_BVH;
}

/* A grid in memory of exactly its size, with that memory. */
typedef struct {
    hgrid_config config;
    hgrid_report need;
    size_t blob_bytes;
    unsigned char *index, *scratch;
    hgrid_grid grid;
} built;

static built build(const hgrid_config *config)
{
    built b;
    b.config = *config;
    b.need = exact_sizes(&mesh, config);
    b.index = (unsigned char *)guarded(b.need.index_bytes);
    b.scratch = (unsigned char *)guarded(b.need.scratch_bytes);
    hgrid_report report = HGRID_REPORT_INIT;
    EXPECT(HGRID_OK, hgrid_build(&mesh, config, b.index, b.need.index_bytes, b.scratch,
                                 b.need.scratch_bytes, &b.grid, &report));
    CHECK(report.index_bytes == b.need.index_bytes);
    CHECK(report.is_exact == 1);
    CHECK(config->method == HGRID_METHOD_VARIABLE
              ? report.scratch_bytes >= b.need.scratch_bytes
              : report.scratch_bytes == b.need.scratch_bytes);
    CHECK(report.triangle == HGRID_INVALID_ID && report.skipped_count == 0);
    CHECK(report.density == (is_tree(config) ? 0 : config->density));
    CHECK(report.reference_count >= TRIANGLES);
    b.blob_bytes = (size_t)report.index_bytes;
    for (int axis = 0; axis < 3; axis++)
        CHECK(report.resolution[axis] > 0);
    EXPECT_PROOF(HGRID_OK, &b.grid);
    return b;
}

static hgrid_ray ray_number(int i)
{
    hgrid_ray ray = ray_down((float)(i % 20) / 18 - 0.03f, (float)(i / 20) / 9 - 0.04f);
    ray.direction[0] = (float)(i % 7 - 3) / 8;
    ray.direction[1] = (float)(i % 5 - 2) / 9;
    return ray;
}

/* Traces all rays, and returns the work. */
static hgrid_counters ask(const hgrid_grid *grid, hgrid_hit hits[RAYS])
{
    hgrid_counters counters = {0, 0, 0};
    hgrid_query_options options = HGRID_QUERY_OPTIONS_INIT;
    options.counters = &counters;
    memset(hits, 0xc7, RAYS * sizeof *hits);
    for (int i = 0; i < RAYS; i++) {
        const hgrid_ray ray = ray_number(i);
        const bool is_hit = hgrid_intersect(grid, &ray, &options, &hits[i]);
        CHECK(hgrid_occluded(grid, &ray, NULL) == is_hit);
    }
    return counters;
}

static void answers_are_those_of_one_level(const built *b)
{
    static hgrid_hit expected[RAYS], found[RAYS];
    if (b->config.method == HGRID_METHOD_ONE_LEVEL && !is_deep(&b->config))
        ask(&b->grid, expected);
    const hgrid_counters work = ask(&b->grid, found);
    CHECK(memcmp(expected, found, sizeof found) == 0);
    CHECK(work.primitive_tests > RAYS / 4 && work.cell_steps > RAYS / 2);
    if (b->config.method == HGRID_METHOD_ONE_LEVEL)
        CHECK(work.grid_steps == 0);
    else if (is_deep(&b->config))
        CHECK(work.grid_steps > RAYS / 2);

    /* A copy at another address answers the same. */
    const void *elsewhere = guarded_copy(b->index, b->blob_bytes);
    hgrid_grid opened;
    EXPECT(HGRID_OK, hgrid_open(elsewhere, b->blob_bytes, &mesh, &opened));
    EXPECT_PROOF(HGRID_OK, &opened);
    ask(&opened, found);
    CHECK(memcmp(expected, found, sizeof found) == 0);
}

/* Builds in the first bytes of a region; the bytes after them must stay. */
static void refuse_index(const built *b, unsigned char *region, size_t region_bytes, size_t bytes)
{
    hgrid_grid grid;
    hgrid_report report = HGRID_REPORT_INIT;
    memset(&grid, 0xc7, sizeof grid);
    memset(region, 0xc7, region_bytes);
    EXPECT(HGRID_ERROR_INDEX_TOO_SMALL, hgrid_build(&mesh, &b->config, region, bytes, b->scratch,
                                                    b->need.scratch_bytes, &grid, &report));
    if (is_tree(&b->config)) {
        CHECK(report.index_bytes >= b->need.index_bytes && report.is_exact == 0);
        CHECK(report.scratch_bytes >= b->need.scratch_bytes);
    } else {
        CHECK(report.index_bytes == b->need.index_bytes && report.is_exact == 1);
        CHECK(report.scratch_bytes == b->need.scratch_bytes);
    }
    CHECK(report.triangle == HGRID_INVALID_ID && report.reference_count == 0);
    CHECK(all_bytes_are(&grid, sizeof grid, 0xc7));
    const size_t touched = is_planned(&b->config) ? 0 : bytes;
    CHECK(all_bytes_are(region + touched, region_bytes - touched, 0xc7));
    /* The bytes that were written do not open as a grid. */
    CHECK(hgrid_open(region, bytes, &mesh, &grid) != HGRID_OK);
    CHECK(hgrid_open(region, region_bytes, &mesh, &grid) != HGRID_OK);
    CHECK(all_bytes_are(&grid, sizeof grid, 0xc7));
}

static void too_small_an_index_is_refused_and_used_again(const built *b)
{
    enum { SIZES = 24 };
    const size_t need = (size_t)b->need.index_bytes, half = need / 2;
    unsigned char *region = (unsigned char *)guarded(need);
    refuse_index(b, region, need, 0);
    refuse_index(b, region, need, 1);
    refuse_index(b, region, need, 127);
    refuse_index(b, region, need, 128);
    for (size_t i = 0; i < SIZES; i += is_part ? 4 : 1) {
        /* A size that ends anywhere, even within a word. */
        const size_t bytes = half + (need - half) * i / SIZES;
        refuse_index(b, region, need, bytes);
        /* The same size rounded down to whole blocks of 64 bytes, which end at a protected page. */
        const size_t whole = bytes / 64 * 64;
        refuse_index(b, (unsigned char *)guarded(whole), whole, whole);
    }
    refuse_index(b, region, need, need - 1);
    refuse_index(b, region, need, need - 64);

    hgrid_grid grid;
    EXPECT(HGRID_OK, hgrid_build(&mesh, &b->config, region, need, b->scratch,
                                 b->need.scratch_bytes, &grid, NULL));
    CHECK(memcmp(region, b->index, b->blob_bytes) == 0);
    EXPECT_PROOF(HGRID_OK, &grid);
}

static void too_small_a_scratch_is_refused(const built *b)
{
    const size_t need = (size_t)b->need.scratch_bytes;
    hgrid_grid grid;
    memset(&grid, 0xc7, sizeof grid);
    unsigned char *index = (unsigned char *)guarded(b->need.index_bytes);
    for (size_t part = 0; part < 4; part++) {
        const size_t bytes = part < 3 ? need * part / 8 : need - 1;
        hgrid_report report = HGRID_REPORT_INIT;
        memset(b->scratch, 0xc7, need);
        const hgrid_status status = hgrid_build(&mesh, &b->config, index, b->need.index_bytes,
                                                b->scratch, bytes, &grid, &report);
        CHECK(all_bytes_are(b->scratch + bytes, need - bytes, 0xc7));
        /* A variable grid may take less scratch than it asks for. */
        if (b->config.method == HGRID_METHOD_VARIABLE && part > 0 && status == HGRID_OK)
            return;
        EXPECT(HGRID_ERROR_SCRATCH_TOO_SMALL, status);
        CHECK(report.scratch_bytes == need);
        CHECK(report.is_exact == 0);
        CHECK(report.index_bytes >= b->need.index_bytes);
        CHECK(all_bytes_are(&grid, sizeof grid, 0xc7));
        CHECK(all_bytes_are(index, b->need.index_bytes, 0xc7));
    }
}

static void what_is_more_than_needed_is_not_touched(const built *b)
{
    const size_t more = 4096, need = (size_t)b->need.index_bytes;
    const size_t scratch_need = (size_t)b->need.scratch_bytes;
    unsigned char *index = (unsigned char *)guarded(need + more);
    unsigned char *scratch = (unsigned char *)guarded(scratch_need + more);
    hgrid_grid grid;
    EXPECT(HGRID_OK, hgrid_build(&mesh, &b->config, index, need + more, scratch,
                                 scratch_need + more, &grid, NULL));
    CHECK(memcmp(index, b->index, b->blob_bytes) == 0);
    CHECK(all_bytes_are(index + need, more, 0xc7));
    CHECK(all_bytes_are(scratch + scratch_need, more, 0xc7));
}

/* Regions straight from malloc, for a tool that tracks uninitialised memory. */
static void regions_may_hold_anything(const built *b)
{
    const size_t index_bytes = (size_t)b->need.index_bytes;
    const size_t bytes = index_bytes + (size_t)b->need.scratch_bytes;
    unsigned char *memory = (unsigned char *)malloc(bytes + 63);
    CHECK(memory != NULL);
    unsigned char *index = memory + (64 - (uintptr_t)memory % 64) % 64;
    hgrid_grid grid;
    EXPECT(HGRID_OK, hgrid_build(&mesh, &b->config, index, index_bytes, index + index_bytes,
                                 b->need.scratch_bytes, &grid, NULL));
    CHECK(memcmp(index, b->index, b->blob_bytes) == 0);
    EXPECT_PROOF(HGRID_OK, &grid);
    free(memory);
}

/* The counts agree, so the blob opens; only validation looks at the triangles. */
static void a_changed_mesh_is_found(const built *b)
{
    static sheet changed;
    changed = mesh_data;
    changed.positions[40][2] += 0.5f;
    const hgrid_mesh moved = mesh_of(&changed);
    hgrid_grid grid;
    EXPECT(HGRID_OK, hgrid_open(b->index, b->need.index_bytes, &moved, &grid));
    EXPECT_PROOF(HGRID_ERROR_CORRUPT, &grid);
}

/* Flips bits here and there: queries end and stay inside, and a blob that validates answers as the original.
 * */
static void damage_is_harmless_and_found(const built *b)
{
    enum { FLIPS = 100 };
    const int flips = is_part ? FLIPS / 3 : FLIPS;
    static hgrid_hit expected[RAYS], found[RAYS];
    const size_t bytes = b->blob_bytes;
    unsigned char *damaged = (unsigned char *)guarded_copy(b->index, bytes);
    hgrid_grid grid;
    ask(&b->grid, expected);
    int opened = 0, passed = 0;
    for (size_t i = 0; i < FLIPS; i += is_part ? 3 : 1) {
        const size_t at = i * (bytes - 1) / (FLIPS - 1);
        const unsigned char bit = (unsigned char)(1 << (i * 5 % 8));
        damaged[at] ^= bit;
        if (hgrid_open(damaged, bytes, &mesh, &grid) == HGRID_OK) {
            opened++;
            memset(found, 0xc7, sizeof found);
            for (int ray = 0; ray < RAYS; ray += 9) {
                const hgrid_ray asked = ray_number(ray);
                hgrid_intersect(&grid, &asked, NULL, &found[ray]);
            }
            if (proof(&grid) == HGRID_OK) {
                passed++;
                for (int ray = 0; ray < RAYS; ray += 9)
                    CHECK(memcmp(&expected[ray], &found[ray], sizeof *found) == 0);
            }
        }
        damaged[at] ^= bit;
    }
    CHECK(opened > flips / 2);
    /* Some flips are harmless and validate: the end of a list that is a subgrid, or a larger box in a tree.
     * */
    CHECK(passed < (is_tree(&b->config) ? flips / 2 : flips / 5));
}

/* Validation works at any address, and uses no more scratch than it asks for. */
static void a_proof_takes_the_scratch_that_it_asks_for(const built *b)
{
    const size_t need = hgrid_validate_bytes(&b->grid);
    CHECK((need > 0) == is_tree(&b->config) && need <= HGRID_VALIDATE_BOUND(TRIANGLES));
    for (size_t more = 0; more < 4; more++) {
        unsigned char *scratch = (unsigned char *)guarded(need + more);
        EXPECT(HGRID_OK, hgrid_validate(&b->grid, scratch, need + more));
        CHECK(all_bytes_are(scratch + need, more, 0xc7));
    }
    for (size_t bytes = 0; bytes < need; bytes += 7)
        EXPECT(HGRID_ERROR_SCRATCH_TOO_SMALL,
               hgrid_validate(&b->grid, guarded(bytes), bytes));
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_validate(&b->grid, b->index + b->blob_bytes - 1, 64));
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_validate(&b->grid, mesh_data.indices, sizeof(uint32_t)));
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_validate(&b->grid, mesh_data.positions, 1));
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_validate(&b->grid, (void *)(uintptr_t)&b->grid, 4));
    EXPECT_PROOF(HGRID_OK, &b->grid);
}

static void check_method(const hgrid_config *config)
{
    const built b = build(config);
    answers_are_those_of_one_level(&b);
    too_small_an_index_is_refused_and_used_again(&b);
    too_small_a_scratch_is_refused(&b);
    what_is_more_than_needed_is_not_touched(&b);
    regions_may_hold_anything(&b);
    a_changed_mesh_is_found(&b);
    a_proof_takes_the_scratch_that_it_asks_for(&b);
    /* This takes a while. */
    if (!is_deep(config))
        damage_is_harmless_and_found(&b);
}

int main(int argc, char **argv)
{
    (void)argv;
    is_part = argc > 1;
    make_sheet(&mesh_data);
    mesh = mesh_of(&mesh_data);
    for (int i = 0; i < METHODS; i++) {
        const hgrid_config config = usual(i);
        /* Number 5 belonged to a removed method. */
        CHECK(config.method == (uint32_t)(i < 4 ? i + 1 : 6));
        check_method(&config);
    }
    for (int i = 0; i < METHODS; i++) {
        const hgrid_config config = deep(usual(i));
        check_method(&config);
    }
    return 0;
}
