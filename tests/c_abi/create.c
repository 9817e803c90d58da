/* hgrid_create builds what hgrid_build builds, and gives back every byte of its memory, whatever fails. For
 * libraries with the feature malloc. */

#ifndef HGRID_MALLOC
#define HGRID_MALLOC
#endif
#include "versions.h"

static sheet mesh_data;
static hgrid_mesh mesh;

/* An allocator that records every live block, and fails on demand. */
typedef struct {
    struct {
        void *start;
        size_t bytes, alignment;
    } blocks[8];
    size_t live, calls, bytes;
    size_t fail_at;  /* the number of the call, from 1, that fails; 0: none */
    size_t shift;    /* the bytes by which the address is off */
} arena;

static arena new_arena(void)
{
    arena a;
    memset(&a, 0, sizeof a);
    return a;
}

static void *arena_allocate(void *context, size_t bytes, size_t alignment)
{
    arena *a = (arena *)context;
    CHECK(bytes > 0 && alignment > 0 && (alignment & (alignment - 1)) == 0);
    if (++a->calls == a->fail_at)
        return NULL;
    void *start = NULL;
    CHECK(a->live < sizeof a->blocks / sizeof *a->blocks);
    CHECK(posix_memalign(&start, alignment, bytes + a->shift) == 0);
    memset(start, 0xc7, bytes + a->shift);
    a->blocks[a->live].start = start;
    a->blocks[a->live].bytes = bytes;
    a->blocks[a->live].alignment = alignment;
    a->live++;
    a->bytes += bytes;
    return (unsigned char *)start + a->shift;
}

static void arena_release(void *context, void *memory, size_t bytes, size_t alignment)
{
    arena *a = (arena *)context;
    void *start = (unsigned char *)memory - a->shift;
    size_t i = 0;
    while (i < a->live && a->blocks[i].start != start)
        i++;
    CHECK(i < a->live && a->blocks[i].bytes == bytes && a->blocks[i].alignment == alignment);
    a->blocks[i] = a->blocks[--a->live];
    a->bytes -= bytes;
    free(start);
}

static hgrid_allocator allocator_of(arena *a)
{
    hgrid_allocator allocator = HGRID_ALLOCATOR_INIT;
    allocator.context = a;
    allocator.allocate = arena_allocate;
    allocator.release = arena_release;
    return allocator;
}

/* A view that no call may touch. */
static hgrid_grid untouched;

/* Checks a refused call: the view pointer is unchanged, and no memory is held. */
static hgrid_report refuse(hgrid_status expected, const hgrid_mesh *input,
                           const hgrid_config *config, arena *a)
{
    const hgrid_allocator allocator = allocator_of(a);
    hgrid_grid *grid = &untouched;
    hgrid_report report = HGRID_REPORT_INIT;
    EXPECT(expected, hgrid_create(input, config, &allocator, &grid, &report));
    CHECK(grid == &untouched && a->live == 0 && a->bytes == 0);
    CHECK(report.struct_size == sizeof report && report.reserved == 0);
    return report;
}

/* Checks that a created grid answers as a built one, with the same report. */
static void compare_with_a_build(const hgrid_grid *grid, const hgrid_report *report,
                                 const hgrid_config *config)
{
    const hgrid_report need = exact_sizes(&mesh, config);
    void *index = guarded(need.index_bytes), *scratch = guarded(need.scratch_bytes);
    hgrid_grid built;
    hgrid_report told = HGRID_REPORT_INIT;
    EXPECT(HGRID_OK, hgrid_build(&mesh, config, index, need.index_bytes, scratch,
                                 need.scratch_bytes, &built, &told));
    CHECK(memcmp(report, &told, sizeof told) == 0);
    EXPECT_PROOF(HGRID_OK, grid);
    const hgrid_grid copy = *grid;
    for (int i = 0; i < 200; i++) {
        const hgrid_ray ray = ray_down((float)(i % 19) / 17, (float)(i % 23) / 21);
        hgrid_hit hits[3];
        const bool is_hit = hgrid_intersect(&built, &ray, NULL, &hits[0]);
        CHECK(hgrid_intersect(grid, &ray, NULL, &hits[1]) == is_hit);
        CHECK(hgrid_intersect(&copy, &ray, NULL, &hits[2]) == is_hit);
        CHECK(!is_hit || memcmp(&hits[0], &hits[1], sizeof *hits) == 0);
        CHECK(!is_hit || memcmp(&hits[0], &hits[2], sizeof *hits) == 0);
    }
}

static void the_systems_memory_serves(void)
{
    for (int i = 0; i < METHODS; i++) {
        const hgrid_config config = usual(i);
        hgrid_grid *grid = NULL;
        hgrid_report report = HGRID_REPORT_INIT;
        EXPECT(HGRID_OK, hgrid_create(&mesh, &config, NULL, &grid, &report));
        compare_with_a_build(grid, &report, &config);
        hgrid_destroy(grid);
    }
}

static void all_memory_is_given_back_as_it_was_asked_for(void)
{
    for (int i = 0; i < METHODS; i++) {
        const hgrid_config config = usual(i);
        arena a = new_arena();
        hgrid_grid *grid = NULL;
        hgrid_report report = HGRID_REPORT_INIT;
        {
            /* The allocator struct no longer exists when the grid is destroyed. */
            hgrid_allocator allocator = allocator_of(&a);
            EXPECT(HGRID_OK, hgrid_create(&mesh, &config, &allocator, &grid, &report));
            memset(&allocator, 0xc7, sizeof allocator);
        }
        compare_with_a_build(grid, &report, &config);

        /* Only the grid's block is live: the exact index and a little for the view. */
        const hgrid_report need = exact_sizes(&mesh, &config);
        CHECK(a.live == 1 && a.calls == 2);
        CHECK(a.bytes > need.index_bytes && a.bytes < need.index_bytes + 1024);
        CHECK(a.blocks[0].start == (void *)grid && a.blocks[0].alignment == HGRID_ALIGNMENT);
        hgrid_destroy(grid);
        CHECK(a.live == 0 && a.bytes == 0 && a.calls == 2);
    }
}

static void every_allocation_may_fail(void)
{
    for (int i = 0; i < METHODS; i++) {
        const hgrid_config config = usual(i);
        const hgrid_report need = exact_sizes(&mesh, &config);
        size_t fail_at = 1;
        for (;; fail_at++) {
            arena a = new_arena();
            a.fail_at = fail_at;
            const hgrid_allocator allocator = allocator_of(&a);
            hgrid_grid *grid = &untouched;
            if (hgrid_create(&mesh, &config, &allocator, &grid, NULL) == HGRID_OK) {
                CHECK(a.calls == fail_at - 1);
                hgrid_destroy(grid);
                CHECK(a.live == 0);
                break;
            }
            a = new_arena();
            a.fail_at = fail_at;
            const hgrid_report report =
                refuse(HGRID_ERROR_OUT_OF_MEMORY, &mesh, &config, &a);
            CHECK(report.index_bytes >= need.index_bytes && report.triangle == HGRID_INVALID_ID);
            CHECK(report.scratch_bytes >= need.scratch_bytes);
            CHECK(report.is_exact == (fail_at > 1));
        }
        CHECK(fail_at == 3);
    }
}

static void memory_that_is_not_aligned_is_given_back(void)
{
    for (size_t shift = 1; shift < HGRID_ALIGNMENT; shift++) {
        arena a = new_arena();
        a.shift = shift;
        refuse(HGRID_ERROR_MISALIGNED, &mesh, NULL, &a);
        CHECK(a.calls == 1);
    }
}

/* Memory of an allocator that returns the same block twice, which a build refuses as overlapping regions: the
 * build fails with both regions allocated, and must give both back. */
static HGRID_ALIGNED unsigned char only_region[1 << 17];
static size_t times_released;

static void *give_the_only_region(void *context, size_t bytes, size_t alignment)
{
    CHECK(context == NULL && bytes <= sizeof only_region && alignment <= 64);
    return only_region;
}

static void take_the_only_region(void *context, void *memory, size_t bytes, size_t alignment)
{
    CHECK(context == NULL && memory == only_region && bytes > 0 && alignment <= 64);
    times_released++;
}

static void a_build_that_fails_gives_back_both_regions(void)
{
    hgrid_allocator allocator = HGRID_ALLOCATOR_INIT;
    allocator.allocate = give_the_only_region;
    allocator.release = take_the_only_region;
    const hgrid_config config = usual(4);
    hgrid_grid *grid = &untouched;
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_create(&mesh, &config, &allocator, &grid, NULL));
    CHECK(grid == &untouched && times_released == 2);
}

static void null_is_refused_where_it_is_not_allowed(void)
{
    arena a = new_arena();
    hgrid_allocator allocator = allocator_of(&a);
    hgrid_report report = HGRID_REPORT_INIT;
    hgrid_grid *grid = &untouched;
    refuse(HGRID_ERROR_NULL_ARGUMENT, NULL, NULL, &a);
    puts("null hgrid_create.mesh");
    EXPECT(HGRID_ERROR_NULL_ARGUMENT, hgrid_create(&mesh, NULL, &allocator, NULL, &report));
    puts("null hgrid_create.grid");
    EXPECT(HGRID_ERROR_NULL_ARGUMENT, hgrid_create(NULL, NULL, NULL, NULL, NULL));
    allocator.allocate = NULL;
    EXPECT(HGRID_ERROR_NULL_ARGUMENT, hgrid_create(&mesh, NULL, &allocator, &grid, &report));
    allocator = allocator_of(&a);
    allocator.release = NULL;
    EXPECT(HGRID_ERROR_NULL_ARGUMENT, hgrid_create(&mesh, NULL, &allocator, &grid, &report));
    hgrid_mesh input = mesh;
    input.positions = NULL;
    refuse(HGRID_ERROR_NULL_ARGUMENT, &input, NULL, &a);
    input = mesh;
    input.indices = NULL;
    refuse(HGRID_ERROR_NULL_ARGUMENT, &input, NULL, &a);
    CHECK(grid == &untouched && a.calls == 0);

    /* Config, allocator and report may be NULL, and so may the argument of hgrid_destroy. */
    EXPECT(HGRID_OK, hgrid_create(&mesh, NULL, NULL, &grid, NULL));
    EXPECT_PROOF(HGRID_OK, grid);
    puts("null hgrid_create.config\nnull hgrid_create.allocator\nnull hgrid_create.report");
    hgrid_destroy(grid);
    hgrid_destroy(NULL);
    puts("null hgrid_destroy.grid");
}

/* Creates a grid and destroys it. */
static hgrid_status create(const hgrid_mesh *input, const hgrid_config *config,
                           const hgrid_allocator *allocator, hgrid_report *report)
{
    hgrid_grid *grid = &untouched;
    const hgrid_status status = hgrid_create(input, config, allocator, &grid, report);
    CHECK((grid == &untouched) == (status != HGRID_OK));
    if (status == HGRID_OK)
        hgrid_destroy(grid);
    return status;
}

static void structs_are_checked(void)
{
    const hgrid_report report = HGRID_REPORT_INIT;
    arena a = new_arena();
    hgrid_allocator allocator = allocator_of(&a);
    CHECK_VERSIONS(hgrid_create.mesh, hgrid_mesh, mesh, create(it, NULL, NULL, NULL));
    CHECK_VERSIONS(hgrid_create.config, hgrid_config, usual(0), create(&mesh, it, NULL, NULL));
    CHECK_VERSIONS(hgrid_create.allocator, hgrid_allocator, allocator,
                   create(&mesh, NULL, it, NULL));
    CHECK_VERSIONS(hgrid_create.report, hgrid_report, report, create(&mesh, NULL, NULL, it));
    allocator.reserved = 1;
    hgrid_grid *grid = &untouched;
    EXPECT(HGRID_ERROR_STRUCT_SIZE, hgrid_create(&mesh, NULL, &allocator, &grid, NULL));
    CHECK(grid == &untouched && a.live == 0);
}

static void what_a_build_refuses_is_refused(void)
{
    arena a = new_arena();
    hgrid_config config = HGRID_CONFIG_INIT_ONE_LEVEL, grids = HGRID_CONFIG_INIT_ONE_LEVEL;
    config.method = 99;
    refuse(HGRID_ERROR_INVALID_METHOD, &mesh, &config, &a);
    static sheet broken;
    broken = mesh_data;
    broken.indices[77][1] = VERTICES;
    hgrid_mesh input = mesh_of(&broken);
    /* A grid takes no memory before it has read the mesh; a tree needs some to read it. */
    CHECK(refuse(HGRID_ERROR_INDEX_OUT_OF_RANGE, &input, &grids, &a).triangle == 77);
    CHECK(a.calls == 0);
    CHECK(refuse(HGRID_ERROR_INDEX_OUT_OF_RANGE, &input, NULL, &a).triangle == 77);
    a = new_arena();
    broken = mesh_data;
    broken.positions[VERTICES - 1][2] = NAN;
    config = usual(4);
    config.flags = grids.flags = HGRID_BUILD_STRICT;
    CHECK(refuse(HGRID_ERROR_NON_FINITE, &input, &grids, &a).triangle == TRIANGLES - 2);
    CHECK(a.calls == 0);
    CHECK(refuse(HGRID_ERROR_NON_FINITE, &input, &config, &a).triangle == TRIANGLES - 2);
    hgrid_report report = HGRID_REPORT_INIT;
    report.struct_size = 3;
    hgrid_grid *grid = &untouched;
    EXPECT(HGRID_ERROR_STRUCT_SIZE, hgrid_create(&mesh, NULL, NULL, &grid, &report));
    CHECK(grid == &untouched);
}

static void an_empty_mesh_is_a_grid(void)
{
    const hgrid_mesh empty = HGRID_MESH_INIT;
    for (int i = 0; i < METHODS; i++) {
        const hgrid_config config = usual(i);
        arena a = new_arena();
        const hgrid_allocator allocator = allocator_of(&a);
        hgrid_grid *grid = NULL;
        EXPECT(HGRID_OK, hgrid_create(&empty, &config, &allocator, &grid, NULL));
        const hgrid_ray ray = ray_down(0, 0);
        CHECK(!hgrid_occluded(grid, &ray, NULL));
        hgrid_destroy(grid);
        CHECK(a.live == 0);
    }
}

int main(void)
{
    make_sheet(&mesh_data);
    mesh = mesh_of(&mesh_data);
    memset(&untouched, 0xc7, sizeof untouched);
    the_systems_memory_serves();
    all_memory_is_given_back_as_it_was_asked_for();
    every_allocation_may_fail();
    memory_that_is_not_aligned_is_given_back();
    a_build_that_fails_gives_back_both_regions();
    null_is_refused_where_it_is_not_allowed();
    structs_are_checked();
    what_a_build_refuses_is_refused();
    an_empty_mesh_is_a_grid();
    CHECK(all_bytes_are(&untouched, sizeof untouched, 0xc7));
    return 0;
}
