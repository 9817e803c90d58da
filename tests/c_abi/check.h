/* Helpers of the C programs of this folder. All programs also compile as C++. */
#ifndef CHECK_H
#define CHECK_H

#include <hgrid.h>

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

/* Ends the program with the line that failed. */
#define CHECK(condition) \
    do { \
        if (!(condition)) { \
            fprintf(stderr, "%s:%d: failed: %s\n", __FILE__, __LINE__, #condition); \
            exit(1); \
        } \
    } while (0)

/* Checks the status of a call, and prints which function returned which status. */
#define EXPECT(expected, call) EXPECT_OF(#call, expected, call)

/* The same for a validation. */
#define EXPECT_PROOF(expected, grid) \
    EXPECT_OF("hgrid_validate(" #grid ", scratch, bytes)", expected, proof(grid))

#define EXPECT_OF(text, expected, call) \
    do { \
        const hgrid_status status_ = (call); \
        if (status_ != (expected)) { \
            fprintf(stderr, "%s:%d: %s: %s\n", __FILE__, __LINE__, text, \
                    hgrid_status_string(status_)); \
            exit(1); \
        } \
        reached(text, status_); \
    } while (0)

/* Validates a grid in scratch of exactly the size that it asks for. */
static inline hgrid_status proof(const hgrid_grid *grid)
{
    const size_t bytes = hgrid_validate_bytes(grid);
    void *scratch = bytes > 0 ? malloc(bytes) : NULL;
    const hgrid_status status = hgrid_validate(grid, scratch, bytes);
    free(scratch);
    return status;
}

/* Prints the name of a function and the status that it returned, each pair once. */
static inline void reached(const char *call, hgrid_status status)
{
    static char told[64][256];
    static size_t told_count;
    char line[256];
    snprintf(line, sizeof line, "reached %d %.*s", (int)status, (int)strcspn(call, "("), call);
    for (size_t i = 0; i < told_count; i++)
        if (strcmp(told[i], line) == 0)
            return;
    if (told_count < sizeof told / sizeof *told)
        strcpy(told[told_count++], line);
    puts(line);
}

/* Returns memory that ends at a protected page, so that reading or writing one byte past it stops the
 * program, even inside a library without sanitizers. It is filled with a pattern that is no sensible float,
 * index or count, and never freed. */
static inline void *guarded(size_t bytes)
{
    const size_t page = (size_t)sysconf(_SC_PAGESIZE);
    const size_t pages = (bytes + page - 1) / page + 2;
    unsigned char *all = (unsigned char *)mmap(NULL, pages * page, PROT_READ | PROT_WRITE,
                                               MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    CHECK(all != MAP_FAILED);
    CHECK(mprotect(all, page, PROT_NONE) == 0);
    CHECK(mprotect(all + (pages - 1) * page, page, PROT_NONE) == 0);
    memset(all + page, 0xc7, (pages - 2) * page);
    return all + (pages - 1) * page - bytes;
}

/* Returns a copy in such memory. */
static inline void *guarded_copy(const void *from, size_t bytes)
{
    void *copy = guarded(bytes);
    if (bytes > 0)
        memcpy(copy, from, bytes);
    return copy;
}

static inline bool all_bytes_are(const void *memory, size_t bytes, unsigned char value)
{
    const unsigned char *byte = (const unsigned char *)memory;
    while (bytes-- > 0)
        if (*byte++ != value)
            return false;
    return true;
}

/* A wavy sheet of SIDE * SIDE squares over the unit square, without holes when seen from above. */
enum { SIDE = 12, VERTICES = (SIDE + 1) * (SIDE + 1), TRIANGLES = 2 * SIDE * SIDE };

typedef struct {
    float positions[VERTICES][3];
    uint32_t indices[TRIANGLES][3];
} sheet;

static inline void make_sheet(sheet *s)
{
    for (uint32_t y = 0; y <= SIDE; y++)
        for (uint32_t x = 0; x <= SIDE; x++) {
            float *p = s->positions[y * (SIDE + 1) + x];
            p[0] = (float)x / (float)SIDE;
            p[1] = (float)y / (float)SIDE;
            p[2] = (float)((x * 5 + y * 3) % 7) / 70;
        }
    for (uint32_t y = 0; y < SIDE; y++)
        for (uint32_t x = 0; x < SIDE; x++) {
            const uint32_t a = y * (SIDE + 1) + x, b = a + 1, d = a + SIDE + 1, c = d + 1;
            const uint32_t square[2][3] = {{a, b, c}, {a, c, d}};
            memcpy(s->indices[2 * (y * SIDE + x)], square, sizeof square);
        }
}

static inline hgrid_mesh mesh_of(const sheet *s)
{
    hgrid_mesh mesh = HGRID_MESH_INIT;
    mesh.positions = s->positions;
    mesh.vertex_count = VERTICES;
    mesh.indices = s->indices;
    mesh.triangle_count = TRIANGLES;
    return mesh;
}

/* The usual configuration of each method. */
enum { METHODS = 5 };

static inline hgrid_config usual(int method)
{
    const hgrid_config all[METHODS] = {HGRID_CONFIG_INIT_ONE_LEVEL, HGRID_CONFIG_INIT_FIXED,
                                       HGRID_CONFIG_INIT_VARIABLE, HGRID_CONFIG_INIT_RECURSIVE,
                                       HGRID_CONFIG_INIT};
    return all[method];
}

/* Returns a query for the closest point at any distance. */
static inline hgrid_point_query anywhere(const float point[3])
{
    const hgrid_point_query query = {{point[0], point[1], point[2]}, INFINITY};
    return query;
}

/* Returns a ray straight down onto the sheet. */
static inline hgrid_ray ray_down(float x, float y)
{
    const hgrid_ray ray = {{x, y, 1}, 0, {0, 0, -1}, INFINITY};
    return ray;
}

/* Returns the exact sizes, and compares them with the sizes without scratch. */
static inline hgrid_report exact_sizes(const hgrid_mesh *mesh, const hgrid_config *config)
{
    hgrid_report enough = HGRID_REPORT_INIT, exact = HGRID_REPORT_INIT;
    EXPECT(HGRID_OK, hgrid_sizes(mesh, config, NULL, 0, &enough));
    void *scratch = guarded(enough.scratch_bytes);
    EXPECT(HGRID_OK, hgrid_sizes(mesh, config, scratch, enough.scratch_bytes, &exact));
    CHECK(enough.is_exact == 0 && exact.is_exact == 1);
    if (config == NULL || config->method == HGRID_METHOD_BVH)
        CHECK(exact.scratch_bytes <= enough.scratch_bytes);
    else
        CHECK(exact.scratch_bytes == enough.scratch_bytes);
    CHECK(exact.index_bytes <= enough.index_bytes);
    return exact;
}

/* Builds a grid in memory of exactly its size. Stores the address and size in `blob` and `blob_bytes` unless NULL. */
static inline hgrid_grid build_exactly(const hgrid_mesh *mesh, const hgrid_config *config,
                                       void **blob, size_t *blob_bytes)
{
    const hgrid_report need = exact_sizes(mesh, config);
    void *index = guarded(need.index_bytes), *scratch = guarded(need.scratch_bytes);
    hgrid_report report = HGRID_REPORT_INIT;
    hgrid_grid grid;
    EXPECT(HGRID_OK, hgrid_build(mesh, config, index, need.index_bytes, scratch,
                                 need.scratch_bytes, &grid, &report));
    if (blob != NULL)
        *blob = index, *blob_bytes = (size_t)report.index_bytes;
    return grid;
}

#endif
