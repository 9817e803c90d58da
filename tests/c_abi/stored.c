/* Stored grids: header fields, blobs that contain their mesh, blobs read by another process, and what an
 * inspection finds. */

#include "check.h"

#include <sys/wait.h>

/* The offsets of fields in the header of a blob (core/src/blob.rs), and the header's size. */
enum { BYTE_ORDER_AT = 8, VERSION_AT = 12, TRIANGLES_AT = 32, HEADER = 128 };

enum { RAYS = 64 };

/* The sheet in structs of the caller, with indices of 16 bits, and masks. */
typedef struct {
    char name[5];
    float position[3];
} vertex;

typedef struct {
    uint16_t corners[3];
    uint16_t material;
    uint32_t mask;
} triangle;

static vertex vertices[VERTICES];
static triangle triangles[TRIANGLES];
static hgrid_mesh mesh;

static void make_mesh(void)
{
    static sheet s;
    make_sheet(&s);
    for (int i = 0; i < VERTICES; i++)
        memcpy(vertices[i].position, s.positions[i], sizeof s.positions[i]);
    for (int i = 0; i < TRIANGLES; i++) {
        for (int corner = 0; corner < 3; corner++)
            triangles[i].corners[corner] = (uint16_t)s.indices[i][corner];
        triangles[i].mask = (uint32_t)(i % 5);
    }
    const hgrid_mesh empty = HGRID_MESH_INIT;
    mesh = empty;
    mesh.index_type = HGRID_INDEX_U16;
    mesh.positions = vertices[0].position, mesh.position_stride = sizeof(vertex);
    mesh.vertex_count = VERTICES;
    mesh.indices = triangles[0].corners, mesh.index_stride = sizeof(triangle);
    mesh.triangle_count = TRIANGLES;
    mesh.masks = &triangles[0].mask, mesh.mask_stride = sizeof(triangle);
}

/* The closest hits of some rays, each with another mask, and the number of hits of each ray. */
typedef struct {
    hgrid_hit hits[RAYS];
    size_t counts[RAYS];
} answers;

static void ask(const hgrid_grid *grid, answers *a)
{
    hgrid_query_options options = HGRID_QUERY_OPTIONS_INIT;
    memset(a, 0xc7, sizeof *a);
    for (int i = 0; i < RAYS; i++) {
        hgrid_ray ray = ray_down((float)(i % 8) / 7.3f, (float)(i / 8) / 7.1f);
        ray.direction[0] = (float)(i % 5 - 2) / 4;
        options.mask = i % 3 == 0 ? UINT32_MAX : (uint32_t)(1 << i % 3);
        hgrid_intersect(grid, &ray, &options, &a->hits[i]);
        EXPECT(HGRID_OK, hgrid_intersect_all(grid, &ray, &options, NULL, 0, &a->counts[i]));
    }
}

static hgrid_blob_info peek(const void *blob, size_t bytes)
{
    hgrid_blob_info info = HGRID_BLOB_INFO_INIT;
    EXPECT(HGRID_OK, hgrid_peek(blob, bytes, &info));
    return info;
}

static void *pack(const hgrid_grid *grid, size_t *packed_bytes)
{
    uint64_t bytes = 0, again = 0;
    EXPECT(HGRID_ERROR_INDEX_TOO_SMALL, hgrid_pack(grid, NULL, 0, &bytes));
    unsigned char *to = (unsigned char *)guarded((size_t)bytes);
    EXPECT(HGRID_ERROR_INDEX_TOO_SMALL, hgrid_pack(grid, to, (size_t)bytes - 1, &again));
    CHECK(again == bytes && all_bytes_are(to, (size_t)bytes, 0xc7));
    EXPECT(HGRID_OK, hgrid_pack(grid, to, (size_t)bytes, &again));
    CHECK(again == bytes);
    /* Bytes that are not needed are not touched. */
    unsigned char *large = (unsigned char *)guarded((size_t)bytes + 128);
    EXPECT(HGRID_OK, hgrid_pack(grid, large, (size_t)bytes + 128, &again));
    CHECK(again == bytes && memcmp(large, to, (size_t)bytes) == 0);
    CHECK(all_bytes_are(large + bytes, 128, 0xc7));
    *packed_bytes = (size_t)bytes;
    return to;
}

static void a_header_tells_what_a_blob_is(uint32_t method, const void *blob, size_t blob_bytes,
                                          const void *packed, size_t packed_bytes)
{
    /* A peek needs only the first bytes, at any address. */
    for (size_t off = 0; off < 9; off++) {
        unsigned char *at = (unsigned char *)guarded(HEADER + off);
        memcpy(at, blob, HEADER);
        const hgrid_blob_info info = peek(at, HEADER);
        CHECK(info.struct_size == sizeof info && info.version == HGRID_BLOB_VERSION);
        CHECK(info.method == method && info.has_mesh == 0);
        CHECK(info.vertex_count == VERTICES && info.triangle_count == TRIANGLES);
        CHECK(info.grid_bytes == blob_bytes && info.total_bytes == blob_bytes);
        memmove(at + off, packed, HEADER);
        const hgrid_blob_info more = peek(at + off, HEADER);
        CHECK(more.method == method && more.has_mesh == 1);
        CHECK(more.vertex_count == VERTICES && more.triangle_count == TRIANGLES);
        CHECK(more.grid_bytes == blob_bytes && more.total_bytes == packed_bytes);
    }
}

static void a_packed_blob_needs_nothing_else(const hgrid_grid *grid, const void *packed,
                                             size_t packed_bytes)
{
    static answers expected, found;
    hgrid_statistics statistics[2] = {HGRID_STATISTICS_INIT, HGRID_STATISTICS_INIT};
    hgrid_grid opened;
    ask(grid, &expected);
    EXPECT(HGRID_OK, hgrid_open(packed, packed_bytes, NULL, &opened));
    EXPECT_PROOF(HGRID_OK, &opened);
    ask(&opened, &found);
    CHECK(memcmp(&expected, &found, sizeof found) == 0);
    EXPECT(HGRID_OK, hgrid_inspect(grid, &statistics[0]));
    EXPECT(HGRID_OK, hgrid_inspect(&opened, &statistics[1]));
    CHECK(memcmp(&statistics[0], &statistics[1], sizeof statistics[0]) == 0);

    /* Packing it again gives the same bytes, and with a mesh it opens as any other blob. */
    size_t again_bytes;
    const void *again = pack(&opened, &again_bytes);
    CHECK(again_bytes == packed_bytes && memcmp(again, packed, packed_bytes) == 0);
    EXPECT(HGRID_OK, hgrid_open(packed, packed_bytes, &mesh, &opened));
    ask(&opened, &found);
    CHECK(memcmp(&expected, &found, sizeof found) == 0);

    /* Shorter blobs are refused. */
    memset(&opened, 0xc7, sizeof opened);
    for (size_t bytes = 0; bytes < packed_bytes; bytes += bytes < 256 ? 1 : 64) {
        const hgrid_status status = hgrid_open(packed, bytes, NULL, &opened);
        CHECK(status == (bytes < 8 ? HGRID_ERROR_NOT_A_GRID : HGRID_ERROR_TRUNCATED));
    }
    EXPECT(HGRID_ERROR_TRUNCATED, hgrid_open(packed, packed_bytes - 1, NULL, &opened));
    CHECK(all_bytes_are(&opened, sizeof opened, 0xc7));
}

/* Runs in a process that has neither mesh nor grid: maps the file and answers. */
static void answer_from_file(int file, int to)
{
    const off_t bytes = lseek(file, 0, SEEK_END);
    CHECK(bytes > 0);
    const void *blob = mmap(NULL, (size_t)bytes, PROT_READ, MAP_PRIVATE, file, 0);
    CHECK(blob != MAP_FAILED);
    const hgrid_blob_info info = peek(blob, (size_t)bytes);
    CHECK(info.total_bytes == (uint64_t)bytes && info.has_mesh == 1);
    hgrid_grid grid;
    EXPECT(HGRID_OK, hgrid_open(blob, (size_t)bytes, NULL, &grid));
    EXPECT_PROOF(HGRID_OK, &grid);
    static answers a;
    ask(&grid, &a);
    CHECK(write(to, &a, sizeof a) == (ssize_t)sizeof a);
}

static void another_process_reads_it(const char *self, const hgrid_grid *grid, const void *packed,
                                     size_t packed_bytes)
{
    FILE *file = tmpfile();
    CHECK(file != NULL && fwrite(packed, 1, packed_bytes, file) == packed_bytes);
    int ends[2], result = -1;
    CHECK(fflush(file) == 0 && pipe(ends) == 0);
    char from[16], to[16];
    snprintf(from, sizeof from, "%d", fileno(file));
    snprintf(to, sizeof to, "%d", ends[1]);
    fflush(stdout);
    const pid_t child = fork();
    CHECK(child >= 0);
    if (child == 0) {
        execl(self, self, from, to, (char *)NULL);
        _exit(99);
    }
    CHECK(close(ends[1]) == 0);
    static answers expected, found;
    size_t have = 0;
    for (ssize_t more; (more = read(ends[0], (char *)&found + have, sizeof found - have)) > 0;)
        have += (size_t)more;
    CHECK(waitpid(child, &result, 0) == child && WIFEXITED(result) && WEXITSTATUS(result) == 0);
    CHECK(have == sizeof found && close(ends[0]) == 0 && fclose(file) == 0);
    ask(grid, &expected);
    CHECK(memcmp(&expected, &found, sizeof found) == 0);
}

static void refuse_peek(hgrid_status expected, const void *header, size_t at, const void *bytes,
                        size_t count)
{
    unsigned char changed[HEADER];
    hgrid_blob_info info = HGRID_BLOB_INFO_INIT;
    const hgrid_blob_info before = info;
    memcpy(changed, header, HEADER);
    memcpy(changed + at, bytes, count);
    EXPECT(expected, hgrid_peek(changed, HEADER, &info));
    CHECK(memcmp(&info, &before, sizeof info) == 0);
}

static void headers_are_checked(const void *header)
{
    const uint32_t next_version = HGRID_BLOB_VERSION + 1, zero = 0;
    unsigned char swapped[4];
    for (int i = 0; i < 4; i++)
        swapped[i] = ((const unsigned char *)header)[BYTE_ORDER_AT + 3 - i];
    refuse_peek(HGRID_ERROR_NOT_A_GRID, header, 0, "HGRID", 5);
    refuse_peek(HGRID_ERROR_WRONG_BYTE_ORDER, header, BYTE_ORDER_AT, swapped, 4);
    refuse_peek(HGRID_ERROR_UNSUPPORTED_VERSION, header, VERSION_AT, &next_version, 4);
    refuse_peek(HGRID_ERROR_CORRUPT, header, TRIANGLES_AT, &zero, 4);
    for (size_t bytes = 0; bytes < HEADER; bytes++) {
        hgrid_blob_info info = HGRID_BLOB_INFO_INIT;
        EXPECT(bytes < 8 ? HGRID_ERROR_NOT_A_GRID : HGRID_ERROR_TRUNCATED,
               hgrid_peek(guarded_copy(header, bytes), bytes, &info));
        CHECK(info.version == 0 && info.total_bytes == 0);
    }
}

/* A mesh that was damaged after the build cannot be packed. */
static void a_damaged_mesh_is_not_packed(const hgrid_grid *grid)
{
    uint64_t bytes;
    size_t need;
    const void *sound = pack(grid, &need);
    unsigned char *to = (unsigned char *)guarded(need);
    triangles[77].corners[1] = VERTICES;
    bytes = 77;
    EXPECT(HGRID_ERROR_INDEX_OUT_OF_RANGE, hgrid_pack(grid, to, need, &bytes));
    CHECK(bytes == 77 && all_bytes_are(to, need, 0xc7));
    EXPECT_PROOF(HGRID_ERROR_INDEX_OUT_OF_RANGE, grid);
    make_mesh();
    EXPECT(HGRID_OK, hgrid_pack(grid, to, need, &bytes));
    CHECK(memcmp(to, sound, need) == 0);
}

/* Checks the arrays of a grid that was built here, and those in a packed blob. */
static void a_grid_knows_its_mesh(const hgrid_grid *grid, const unsigned char *packed,
                                  size_t packed_bytes)
{
    hgrid_mesh found = HGRID_MESH_INIT;
    EXPECT(HGRID_OK, hgrid_mesh_of(grid, &found));
    CHECK(found.struct_size == sizeof found && memcmp(&found, &mesh, sizeof found) == 0);

    hgrid_grid opened;
    EXPECT(HGRID_OK, hgrid_open(packed, packed_bytes, NULL, &opened));
    EXPECT(HGRID_OK, hgrid_mesh_of(&opened, &found));
    CHECK(found.index_type == HGRID_INDEX_U32 && found.vertex_count == VERTICES);
    CHECK(found.position_stride == 12 && found.index_stride == 12 && found.mask_stride == 4);
    const unsigned char *const starts[] = {(const unsigned char *)found.positions,
                                           (const unsigned char *)found.indices,
                                           (const unsigned char *)found.masks};
    for (int i = 0; i < 3; i++)
        CHECK(starts[i] > packed && starts[i] < packed + packed_bytes);
    CHECK(found.triangle_count == TRIANGLES);
    for (int i = 0; i < TRIANGLES; i++) {
        for (int corner = 0; corner < 3; corner++) {
            uint32_t index;
            memcpy(&index, starts[1] + 12 * i + 4 * corner, sizeof index);
            CHECK(index == triangles[i].corners[corner]);
            CHECK(memcmp(starts[0] + 12 * index, vertices[index].position, 12) == 0);
        }
        CHECK(memcmp(starts[2] + 4 * i, &triangles[i].mask, 4) == 0);
    }

    /* The mesh that was found serves as well as the original: the blob opens with it and validates. */
    hgrid_grid again;
    EXPECT(HGRID_OK, hgrid_open(packed, packed_bytes, &found, &again));
    EXPECT_PROOF(HGRID_OK, &again);
    /* A mesh given by the caller takes precedence over the packed one. */
    static float elsewhere[VERTICES][3];
    found.positions = elsewhere;
    EXPECT(HGRID_OK, hgrid_open(packed, packed_bytes, &found, &again));
    const hgrid_ray ray = ray_down(0.5f, 0.5f);
    CHECK(hgrid_occluded(grid, &ray, NULL) && !hgrid_occluded(&again, &ray, NULL));
}

/* A view that no call has written is no grid. */
static void views_of_nothing_are_recognised(void)
{
    const hgrid_grid none = HGRID_GRID_INIT;
    hgrid_statistics statistics = HGRID_STATISTICS_INIT;
    uint64_t bytes = 77;
    unsigned char *to = (unsigned char *)guarded(64);
    EXPECT_PROOF(HGRID_ERROR_NOT_A_GRID, &none);
    EXPECT(HGRID_ERROR_NOT_A_GRID, hgrid_inspect(&none, &statistics));
    hgrid_mesh found = HGRID_MESH_INIT;
    const hgrid_mesh untouched = found;
    EXPECT(HGRID_ERROR_NOT_A_GRID, hgrid_mesh_of(&none, &found));
    CHECK(memcmp(&found, &untouched, sizeof found) == 0);
    hgrid_surface surface;
    const hgrid_ray ray = ray_down(0.5f, 0.5f);
    const hgrid_hit hit = {1, 0.25f, 0.25f, 0};
    CHECK(!hgrid_surface_at(&none, &ray, &hit, &surface));
    EXPECT(HGRID_ERROR_NOT_A_GRID, hgrid_pack(&none, to, 64, &bytes));
    CHECK(bytes == 77 && all_bytes_are(to, 64, 0xc7));
    CHECK(statistics.list_count == 0 && statistics.first_bad == HGRID_INVALID_ID);
}

static void a_look_finds_bad_triangles(void)
{
    vertices[3].position[1] = NAN;
    memcpy(triangles[200].corners, triangles[201].corners, sizeof triangles[200].corners);
    triangles[200].corners[0] = triangles[200].corners[1];
    uint64_t hashes[METHODS];
    for (int method = 0; method < METHODS; method++) {
        const hgrid_config config = usual(method);
        hgrid_statistics found = HGRID_STATISTICS_INIT;
        hgrid_report report = HGRID_REPORT_INIT;
        const hgrid_report need = exact_sizes(&mesh, &config);
        void *index = guarded(need.index_bytes), *scratch = guarded(need.scratch_bytes);
        hgrid_grid grid;
        EXPECT(HGRID_OK, hgrid_build(&mesh, &config, index, need.index_bytes, scratch,
                                     need.scratch_bytes, &grid, &report));
        EXPECT(HGRID_OK, hgrid_inspect(&grid, &found));
        /* Three triangles use that corner; the fourth triangle of the two squares does not. */
        CHECK(found.skipped_count == 3 && report.skipped_count == 3);
        CHECK(found.degenerate_count == 1 && found.first_bad == 4);
        CHECK(found.list_count > 0 && found.longest_list > 0 && found.reserved == 0);
        CHECK(found.reference_count >= TRIANGLES - 3);
        CHECK(found.reference_count <= found.list_count * found.longest_list);
        hashes[method] = found.content_hash;
        for (int other = 0; other < method; other++)
            CHECK(hashes[other] != found.content_hash);
    }
    make_mesh();
}

int main(int argc, char **argv)
{
    if (argc == 3) {
        answer_from_file(atoi(argv[1]), atoi(argv[2]));
        return 0;
    }
    make_mesh();
    for (int method = 0; method < METHODS; method++) {
        const hgrid_config config = usual(method);
        void *blob;
        size_t blob_bytes, packed_bytes;
        const hgrid_grid grid = build_exactly(&mesh, &config, &blob, &blob_bytes);
        const void *packed = pack(&grid, &packed_bytes);
        a_header_tells_what_a_blob_is(config.method, blob, blob_bytes, packed, packed_bytes);
        a_packed_blob_needs_nothing_else(&grid, packed, packed_bytes);
        a_grid_knows_its_mesh(&grid, (const unsigned char *)packed, packed_bytes);
        another_process_reads_it(argv[0], &grid, packed, packed_bytes);
        headers_are_checked(method % 2 == 0 ? blob : packed);
        a_damaged_mesh_is_not_packed(&grid);
    }
    views_of_nothing_are_recognised();
    a_look_finds_bad_triangles();
    return 0;
}
