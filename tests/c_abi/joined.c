/* Joined meshes: their grid is that of one mesh with the same triangles, and each triangle can be located in
 * its own mesh. */

#include "check.h"

/* The first triangles of a sheet, an empty mesh, and the other triangles in structs of the caller. */
enum { MESHES = 3, LOW = 100, HIGH = TRIANGLES - LOW };

typedef struct {
    char name[3];
    unsigned char position[12];
} vertex;

typedef struct {
    uint16_t corners[3];
    uint32_t mask;
} triangle;

static sheet low;
static vertex vertices[VERTICES];
static triangle triangles[HIGH];
static hgrid_mesh meshes[MESHES];
static hgrid_part parts[MESHES];
static hgrid_mesh joined = HGRID_MESH_INIT;

/* The same triangles in one mesh. */
static float all_positions[2 * VERTICES][3];
static uint32_t all_indices[TRIANGLES][3], all_masks[TRIANGLES];
static hgrid_mesh whole = HGRID_MESH_INIT;

static void prepare(void)
{
    const hgrid_mesh empty = HGRID_MESH_INIT;
    make_sheet(&low);
    for (size_t i = 0; i < VERTICES; i++) {
        memcpy(vertices[i].position, low.positions[i], 12);
        memcpy(all_positions[i], low.positions[i], 12);
        memcpy(all_positions[VERTICES + i], low.positions[i], 12);
    }
    for (size_t i = 0; i < TRIANGLES; i++) {
        all_masks[i] = UINT32_MAX;
        for (int corner = 0; corner < 3; corner++)
            all_indices[i][corner] = low.indices[i][corner] + (i < LOW ? 0 : VERTICES);
    }
    for (size_t i = 0; i < HIGH; i++) {
        for (int corner = 0; corner < 3; corner++)
            triangles[i].corners[corner] = (uint16_t)low.indices[LOW + i][corner];
        triangles[i].mask = all_masks[LOW + i] = (uint32_t)i % 3 + 1;
    }
    meshes[0] = mesh_of(&low);
    meshes[0].triangle_count = LOW;
    meshes[1] = empty;
    meshes[2] = empty;
    meshes[2].index_type = HGRID_INDEX_U16;
    meshes[2].positions = vertices[0].position, meshes[2].position_stride = sizeof vertices[0];
    meshes[2].vertex_count = VERTICES;
    meshes[2].indices = triangles[0].corners, meshes[2].index_stride = sizeof triangles[0];
    meshes[2].triangle_count = HIGH;
    meshes[2].masks = &triangles[0].mask, meshes[2].mask_stride = sizeof triangles[0];
    whole.positions = all_positions, whole.vertex_count = 2 * VERTICES;
    whole.indices = all_indices, whole.triangle_count = TRIANGLES;
    whole.masks = all_masks;
    memset(parts, 0xc7, sizeof parts);
    EXPECT(HGRID_OK, hgrid_join(meshes, MESHES, parts, &joined));
    CHECK(joined.parts == parts && joined.part_count == MESHES);
    CHECK(joined.vertex_count == 2 * VERTICES && joined.triangle_count == TRIANGLES);
    CHECK(joined.positions == NULL && joined.indices == NULL && joined.masks == NULL);
}

static void every_triangle_is_located(const hgrid_grid *grid)
{
    uint32_t geometry = 77, number = 77;
    CHECK(!hgrid_locate(grid, TRIANGLES, &geometry, &number));
    CHECK(!hgrid_locate(grid, HGRID_INVALID_ID, &geometry, &number));
    CHECK(geometry == 77 && number == 77);
    for (uint32_t i = 0; i < TRIANGLES; i++) {
        CHECK(hgrid_locate(grid, i, &geometry, &number));
        CHECK(geometry == (i < LOW ? 0 : 2) && number == (i < LOW ? i : i - LOW));
    }
}

static bool is_proven(const hgrid_grid *grid)
{
    const size_t bytes = hgrid_validate_bytes(grid);
    return hgrid_validate(grid, guarded(bytes), bytes) == HGRID_OK;
}

/* Puts the same queries to both grids. */
static void answers_are_the_same(const hgrid_grid *one, const hgrid_grid *other)
{
    enum { RAYS = 64 };
    hgrid_ray rays[RAYS];
    hgrid_hit hits[2][RAYS];
    memset(hits, 0, sizeof hits);
    const uint32_t masks[] = {UINT32_MAX, 2};
    for (int m = 0; m < 2; m++) {
        hgrid_query_options options = HGRID_QUERY_OPTIONS_INIT;
        options.mask = masks[m];
        int met = 0;
        for (int i = 0; i < RAYS; i++) {
            rays[i] = ray_down((float)(i % 8) / 8 + 0.03f, (float)(i / 8) / 8 + 0.01f);
            hgrid_hit a = {0, 0, 0, 0}, b = a;
            const bool is_hit = hgrid_intersect(one, &rays[i], &options, &a);
            CHECK(hgrid_intersect(other, &rays[i], &options, &b) == is_hit);
            CHECK(memcmp(&a, &b, sizeof a) == 0);
            met += is_hit;
            if (is_hit) {
                hgrid_surface s, t;
                CHECK(hgrid_surface_at(one, &rays[i], &a, &s));
                CHECK(hgrid_surface_at(other, &rays[i], &a, &t));
                CHECK(memcmp(&s, &t, sizeof s) == 0);
            }
            if (i % 4 != 0)
                continue;
            hgrid_point_query near_start = {{0, 0, 0}, INFINITY};
            hgrid_closest c, d;
            memcpy(near_start.point, rays[i].origin, sizeof near_start.point);
            CHECK(hgrid_closest_point(one, &near_start, &options, &c));
            CHECK(hgrid_closest_point(other, &near_start, &options, &d));
            CHECK(memcmp(&c, &d, sizeof c) == 0);
        }
        CHECK(met > RAYS / 3 && (m == 1) == (met < RAYS));
        const hgrid_coherence c = m == 0 ? HGRID_COHERENCE_COHERENT : HGRID_COHERENCE_INCOHERENT;
        EXPECT(HGRID_OK, hgrid_intersect_n(one, rays, 0, hits[0], 0, RAYS, c, &options));
        EXPECT(HGRID_OK, hgrid_intersect_n(other, rays, 0, hits[1], 0, RAYS, c, &options));
        CHECK(memcmp(hits[0], hits[1], sizeof hits[0]) == 0);
    }
}

static void a_grid_of_them_is_that_of_one(int method)
{
    const hgrid_config config = usual(method);
    void *blobs[2];
    size_t bytes[2];
    const hgrid_grid one = build_exactly(&whole, &config, &blobs[0], &bytes[0]);
    const hgrid_grid grid = build_exactly(&joined, &config, &blobs[1], &bytes[1]);
    CHECK(bytes[0] == bytes[1] && memcmp(blobs[0], blobs[1], bytes[0]) == 0);
    answers_are_the_same(&grid, &one);
    every_triangle_is_located(&grid);
    CHECK(is_proven(&grid));
    uint32_t geometry, number;
    CHECK(hgrid_locate(&one, LOW, &geometry, &number) && geometry == 0 && number == LOW);

    /* The grid knows its mesh, which opens the blob again. */
    hgrid_mesh found = HGRID_MESH_INIT;
    EXPECT(HGRID_OK, hgrid_mesh_of(&grid, &found));
    CHECK(memcmp(&found, &joined, sizeof found) == 0);
    hgrid_grid again;
    EXPECT(HGRID_OK, hgrid_open(blobs[1], bytes[1], &found, &again));
    answers_are_the_same(&again, &one);

    /* The packed blob has one mesh, and still knows the parts. */
    uint64_t packed_bytes;
    EXPECT(HGRID_ERROR_INDEX_TOO_SMALL, hgrid_pack(&grid, NULL, 0, &packed_bytes));
    void *packed = guarded((size_t)packed_bytes);
    EXPECT(HGRID_OK, hgrid_pack(&grid, packed, (size_t)packed_bytes, &packed_bytes));
    EXPECT(HGRID_OK, hgrid_open(packed, (size_t)packed_bytes, NULL, &again));
    answers_are_the_same(&again, &one);
    every_triangle_is_located(&again);
    CHECK(is_proven(&again));
    /* The first triangles of the parts are the last section. */
    unsigned char *last = (unsigned char *)packed + packed_bytes - HGRID_ALIGNMENT;
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_validate(&again, last, HGRID_ALIGNMENT));
    EXPECT(HGRID_OK, hgrid_mesh_of(&again, &found));
    CHECK(found.parts == NULL && found.part_count == 0 && found.triangle_count == TRIANGLES);
    CHECK(memcmp(found.indices, all_indices, sizeof all_indices) == 0);
    CHECK(memcmp(found.positions, all_positions, sizeof all_positions) == 0);
    CHECK(memcmp(found.masks, all_masks, sizeof all_masks) == 0);
    /* Brought by the caller, this mesh is one; the meshes that were joined are known as before. */
    EXPECT(HGRID_OK, hgrid_open(packed, (size_t)packed_bytes, &found, &again));
    CHECK(hgrid_locate(&again, LOW, &geometry, &number) && geometry == 0 && number == LOW);
    EXPECT(HGRID_OK, hgrid_open(packed, (size_t)packed_bytes, &joined, &again));
    every_triangle_is_located(&again);
}

static void vertices_may_move(void)
{
    void *tree;
    size_t tree_bytes;
    hgrid_grid grid;
    build_exactly(&joined, NULL, &tree, &tree_bytes);
    float up[3];
    for (size_t i = 0; i < VERTICES; i++) {
        memcpy(up, vertices[i].position, 12);
        up[2] += 0.25f;
        memcpy(vertices[i].position, up, 12);
    }
    EXPECT(HGRID_OK, hgrid_refit(&joined, tree, tree_bytes, &grid, NULL));
    const hgrid_ray below = ray_down(0.06f, 0.01f), above = ray_down(0.06f, 0.9f);
    hgrid_hit hit;
    CHECK(hgrid_intersect(&grid, &below, NULL, &hit) && hit.primitive < LOW && hit.t > 0.85f);
    CHECK(hgrid_intersect(&grid, &above, NULL, &hit) && hit.primitive >= LOW && hit.t < 0.76f);
    CHECK(is_proven(&grid));
    prepare();
}

static void bad_triangles_are_named(void)
{
    const size_t index_bytes = (HGRID_INDEX_BOUND(TRIANGLES) + 63) / 64 * 64;
    const size_t scratch_bytes = (HGRID_SCRATCH_BOUND(TRIANGLES) + 63) / 64 * 64;
    hgrid_report report = HGRID_REPORT_INIT;
    hgrid_grid grid = HGRID_GRID_INIT;
    triangles[7].corners[1] = VERTICES;
    void *index = guarded(index_bytes), *scratch = guarded(scratch_bytes);
    EXPECT(HGRID_ERROR_INDEX_OUT_OF_RANGE,
           hgrid_build(&joined, NULL, index, index_bytes, scratch, scratch_bytes, &grid, &report));
    CHECK(report.triangle == LOW + 7);
    const hgrid_config one_level = usual(0);
    EXPECT(HGRID_ERROR_INDEX_OUT_OF_RANGE, hgrid_sizes(&joined, &one_level, NULL, 0, &report));
    CHECK(report.triangle == LOW + 7);
    uint32_t geometry, number;
    CHECK(!hgrid_locate(&grid, 0, &geometry, &number));
    prepare();
}

/* Checks that a changed joined mesh is refused. */
static void refuse(hgrid_status expected, const hgrid_mesh *mesh)
{
    static unsigned char *index, *scratch;
    hgrid_report report = HGRID_REPORT_INIT;
    hgrid_config fitted = usual(4);
    hgrid_grid grid;
    if (index == NULL) {
        EXPECT(HGRID_OK, hgrid_sizes(&joined, NULL, NULL, 0, &report));
        index = (unsigned char *)guarded((size_t)report.index_bytes);
        scratch = (unsigned char *)guarded((size_t)report.scratch_bytes);
    }
    EXPECT(expected, hgrid_sizes(mesh, NULL, NULL, 0, &report));
    EXPECT(expected, hgrid_fit(mesh, NULL, 100000, NULL, 0, &fitted, NULL));
    EXPECT(expected, hgrid_build(mesh, NULL, index, 0, scratch, 0, &grid, NULL));
    EXPECT(expected, hgrid_open(index, 64, mesh, &grid));
    EXPECT(expected, hgrid_refit(mesh, index, 64, &grid, NULL));
}

static void parts_are_as_the_call_wrote_them(void)
{
    static hgrid_part none[MESHES];
    hgrid_mesh wrong = joined;
    wrong.parts = none;
    refuse(HGRID_ERROR_INVALID_PARTS, &wrong);
    wrong.parts = NULL;
    refuse(HGRID_ERROR_NULL_ARGUMENT, &wrong);
    wrong = joined;
    wrong.part_count--;
    refuse(HGRID_ERROR_INVALID_PARTS, &wrong);
    wrong.part_count = 0;
    refuse(HGRID_ERROR_INVALID_PARTS, &wrong);
    wrong = joined;
    wrong.triangle_count--;
    refuse(HGRID_ERROR_INVALID_PARTS, &wrong);
    wrong = joined;
    wrong.vertex_count++;
    refuse(HGRID_ERROR_INVALID_PARTS, &wrong);
    wrong = joined;
    wrong.masks = all_masks;
    refuse(HGRID_ERROR_INVALID_PARTS, &wrong);
    wrong = joined;
    wrong.positions = all_positions;
    refuse(HGRID_ERROR_INVALID_PARTS, &wrong);
    wrong = joined;
    wrong.indices = all_indices;
    refuse(HGRID_ERROR_INVALID_PARTS, &wrong);
}

/* Checks that a changed join is refused and writes nothing. */
static void refuse_join(hgrid_status expected, const hgrid_mesh *given, size_t count)
{
    static hgrid_part to[MESHES];
    hgrid_mesh all = HGRID_MESH_INIT;
    const hgrid_mesh before = all;
    EXPECT(expected, hgrid_join(given, count, to, &all));
    CHECK(memcmp(&all, &before, sizeof all) == 0);
}

static void what_cannot_be_joined(void)
{
    hgrid_mesh wrong[MESHES];
#define WRONG(status, change) \
    do { \
        memcpy(wrong, meshes, sizeof wrong); \
        change; \
        refuse_join(status, wrong, MESHES); \
    } while (0)
    WRONG(HGRID_ERROR_INVALID_PARTS, wrong[1] = joined);
    WRONG(HGRID_ERROR_INVALID_POSITIONS, wrong[2].position_stride = 11);
    WRONG(HGRID_ERROR_INVALID_INDICES, wrong[0].index_stride = 11);
    WRONG(HGRID_ERROR_INVALID_INDEX_TYPE, wrong[1].index_type = 2);
    WRONG(HGRID_ERROR_INVALID_MASKS, wrong[2].mask_stride = 3);
    WRONG(HGRID_ERROR_NULL_ARGUMENT, wrong[2].indices = NULL);
    WRONG(HGRID_ERROR_STRUCT_SIZE, wrong[1].struct_size++);
    WRONG(HGRID_ERROR_STRUCT_SIZE, wrong[0].struct_size = 0);
#if SIZE_MAX > UINT32_MAX
    WRONG(HGRID_ERROR_TOO_MANY_TRIANGLES, wrong[2].triangle_count = UINT32_MAX);
#endif
    /* The second description of this size would not be aligned. */
    struct {
        hgrid_mesh first;
        char rest[sizeof(hgrid_mesh)];
    } odd = {meshes[1], {0}};
    odd.first.struct_size++;
    refuse_join(HGRID_ERROR_STRUCT_SIZE, &odd.first, 2);
    refuse_join(HGRID_ERROR_INVALID_PARTS, meshes, SIZE_MAX / 8);

    hgrid_mesh all = HGRID_MESH_INIT;
    EXPECT(HGRID_OK, hgrid_join(NULL, 0, NULL, &all));
    CHECK(all.triangle_count == 0 && all.part_count == 0 && all.parts == NULL);
    build_exactly(&all, NULL, NULL, NULL);
    EXPECT(HGRID_OK, hgrid_join(&meshes[1], 1, parts, &all));
    CHECK(all.triangle_count == 0 && all.part_count == 1);
    build_exactly(&all, NULL, NULL, NULL);
    prepare();
}

/* Meshes, parts and regions may not overlap. */
static void memory_lies_apart(void)
{
    static union {
        hgrid_part parts[MESHES];
        hgrid_mesh meshes[MESHES];
        float positions[VERTICES][3];
    } shared;
    hgrid_mesh all = HGRID_MESH_INIT;
    memcpy(shared.meshes, meshes, sizeof meshes);
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_join(shared.meshes, MESHES, shared.parts, &all));
    memcpy(shared.positions, low.positions, sizeof low.positions);
    hgrid_mesh some[MESHES];
    memcpy(some, meshes, sizeof some);
    some[0].positions = shared.positions;
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_join(some, MESHES, shared.parts, &all));
    CHECK(memcmp(shared.positions, low.positions, sizeof low.positions) == 0);

    /* Regions over the parts, and over an array of one of them. */
    hgrid_report need = HGRID_REPORT_INIT;
    EXPECT(HGRID_OK, hgrid_sizes(&joined, NULL, NULL, 0, &need));
    const size_t index_bytes = (size_t)need.index_bytes, at = sizeof parts + sizeof triangles;
    unsigned char *index = (unsigned char *)guarded((index_bytes + at + 63) / 64 * 64);
    const size_t scratch_bytes = ((size_t)need.scratch_bytes + 63) / 64 * 64;
    unsigned char *scratch = (unsigned char *)guarded(scratch_bytes);
    hgrid_grid grid;
    hgrid_part *in = (hgrid_part *)(void *)index;
    EXPECT(HGRID_OK, hgrid_join(meshes, MESHES, in, &all));
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_build(&all, NULL, index, index_bytes, scratch,
                                            scratch_bytes, &grid, NULL));
    memcpy(index, triangles, sizeof triangles);
    memcpy(some, meshes, sizeof some);
    some[2].indices = index, some[2].masks = NULL;
    EXPECT(HGRID_OK, hgrid_join(some, MESHES, parts, &all));
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_build(&all, NULL, index, index_bytes, scratch,
                                            scratch_bytes, &grid, NULL));
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_refit(&all, index, index_bytes, &grid, NULL));
    prepare();
    const hgrid_grid built = build_exactly(&joined, NULL, NULL, NULL);
    uint64_t bytes;
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_pack(&built, parts, sizeof parts, &bytes));
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_validate(&built, triangles, sizeof triangles));
}

int main(void)
{
    prepare();
    for (int method = 0; method < METHODS; method++)
        a_grid_of_them_is_that_of_one(method);
    vertices_may_move();
    bad_triangles_are_named();
    parts_are_as_the_call_wrote_them();
    what_cannot_be_joined();
    memory_lies_apart();
    return 0;
}
