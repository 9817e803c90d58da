/* Libraries that were built with fewer methods: those that they have work the same, and the others are
 * refused as left out. `left_out write DIR` stores the grid of every method and its answers; `left_out read
 * DIR METHOD...` compares them in a library that has only these methods. */

#include "check.h"

enum { MOST_BYTES = 1 << 20, RAYS = 100 };

/* The answers of all queries of a method. */
typedef struct {
    hgrid_report bound, fit;
    hgrid_statistics statistics;
    hgrid_hit single[RAYS], tiles[RAYS];
    hgrid_closest closest[RAYS];
} answers;

static sheet mesh_data;
static hgrid_mesh mesh;
HGRID_ALIGNED static unsigned char index_memory[MOST_BYTES], scratch[MOST_BYTES];

/* Runs all queries on a grid that lies in a blob. */
static void ask(const hgrid_config *config, const void *blob, size_t bytes, answers *a)
{
    const hgrid_report report = HGRID_REPORT_INIT;
    const hgrid_statistics statistics = HGRID_STATISTICS_INIT;
    memset(a, 0, sizeof *a);
    a->bound = a->fit = report;
    a->statistics = statistics;
    hgrid_config fitted = *config;
    EXPECT(HGRID_OK, hgrid_bound(TRIANGLES, config, &a->bound));
    EXPECT(HGRID_OK, hgrid_fit(&mesh, config, MOST_BYTES, scratch, sizeof scratch, &fitted, &a->fit));

    hgrid_grid grid;
    EXPECT(HGRID_OK, hgrid_open(blob, bytes, &mesh, &grid));
    EXPECT_PROOF(HGRID_OK, &grid);
    EXPECT(HGRID_OK, hgrid_inspect(&grid, &a->statistics));
    hgrid_ray rays[RAYS];
    int found = 0;
    for (int i = 0; i < RAYS; i++) {
        const float x = (float)(i % 10) / 9, y = (float)(i / 10) / 9;
        const hgrid_point_query query = {{x, y, 0.2f}, INFINITY};
        rays[i] = ray_down(x, y);
        found += hgrid_intersect(&grid, &rays[i], NULL, &a->single[i]);
        found += hgrid_closest_point(&grid, &query, NULL, &a->closest[i]);
    }
    CHECK(found == 2 * RAYS);
    EXPECT(HGRID_OK,
           hgrid_intersect_n(&grid, rays, 0, a->tiles, 0, RAYS, HGRID_COHERENCE_COHERENT, NULL));
    CHECK(memcmp(a->single, a->tiles, sizeof a->single) == 0);
}

/* Opens a file of a method: its blob or its answers. */
static FILE *file_of(const char *dir, int method, const char *kind, const char *mode)
{
    char path[4096];
    snprintf(path, sizeof path, "%s/%d.%s", dir, method, kind);
    FILE *file = fopen(path, mode);
    CHECK(file != NULL);
    return file;
}

static void write_all(const char *dir)
{
    for (int i = 0; i < METHODS; i++) {
        const hgrid_config config = usual(i);
        CHECK(hgrid_has_method(config.method));
        void *blob;
        size_t bytes;
        build_exactly(&mesh, &config, &blob, &bytes);
        answers a;
        ask(&config, blob, bytes, &a);
        FILE *file = file_of(dir, i, "blob", "wb");
        CHECK(fwrite(blob, 1, bytes, file) == bytes && fclose(file) == 0);
        file = file_of(dir, i, "answers", "wb");
        CHECK(fwrite(&a, sizeof a, 1, file) == 1 && fclose(file) == 0);
    }
}

/* Checks that a method builds the same grid and answers as in a library with all methods. */
static void is_there(const hgrid_config *config, const void *stored, size_t stored_bytes,
                     const answers *expected)
{
    void *blob;
    size_t bytes;
    build_exactly(&mesh, config, &blob, &bytes);
    CHECK(bytes == stored_bytes && memcmp(blob, stored, bytes) == 0);
    answers a;
    ask(config, stored, stored_bytes, &a);
    CHECK(memcmp(&a, expected, sizeof a) == 0);
}

static bool is_never_called(void *context, uint32_t done)
{
    (void)context, (void)done;
    CHECK(!"progress of a build that cannot be");
    return false;
}

/* Checks that calls that need the method fail and write nothing, with a configuration or NULL. */
static void is_refused(const hgrid_config *config, const void *stored, size_t stored_bytes)
{
    const hgrid_report untouched = HGRID_REPORT_INIT;
    hgrid_report report = HGRID_REPORT_INIT;
    const hgrid_config unfitted = HGRID_CONFIG_INIT_FIXED;
    hgrid_config fitted = HGRID_CONFIG_INIT_FIXED;
    hgrid_grid grid;
    memset(index_memory, 0xc7, sizeof index_memory);
    memset(scratch, 0xc7, sizeof scratch);
    memset(&grid, 0xc7, sizeof grid);
    EXPECT(HGRID_ERROR_METHOD_LEFT_OUT, hgrid_bound(TRIANGLES, config, &report));
    CHECK(memcmp(&report, &untouched, sizeof report) == 0);
    EXPECT(HGRID_ERROR_METHOD_LEFT_OUT,
           hgrid_sizes(&mesh, config, scratch, sizeof scratch, &report));
    CHECK(memcmp(&report, &untouched, sizeof report) == 0);
    EXPECT(HGRID_ERROR_METHOD_LEFT_OUT, hgrid_fit(&mesh, config, sizeof index_memory, scratch,
                                                  sizeof scratch, &fitted, &report));
    CHECK(memcmp(&report, &untouched, sizeof report) == 0);
    EXPECT(HGRID_ERROR_METHOD_LEFT_OUT,
           hgrid_build(&mesh, config, index_memory, sizeof index_memory, scratch, sizeof scratch,
                       &grid, &report));
    CHECK(memcmp(&report, &untouched, sizeof report) == 0);
    EXPECT(HGRID_ERROR_METHOD_LEFT_OUT, hgrid_open(stored, stored_bytes, &mesh, &grid));
    CHECK(all_bytes_are(index_memory, sizeof index_memory, 0xc7));
    CHECK(all_bytes_are(scratch, sizeof scratch, 0xc7));
    CHECK(memcmp(&fitted, &unfitted, sizeof fitted) == 0);
    CHECK(all_bytes_are(&grid, sizeof grid, 0xc7));
}

static void is_left_out(const hgrid_config *config, const void *stored, size_t stored_bytes)
{
    hgrid_config told = *config;
    told.progress = is_never_called;
    is_refused(&told, stored, stored_bytes);
    /* Wrong parameters do not change the status. */
    told.density = -1;
    told.depth = told.macrocell_factor = 0;
    is_refused(&told, stored, stored_bytes);
    if (config->method == HGRID_METHOD_BVH)
        is_refused(NULL, stored, stored_bytes);
    /* Any library can describe a blob. */
    hgrid_blob_info info = HGRID_BLOB_INFO_INIT;
    EXPECT(HGRID_OK, hgrid_peek(stored, stored_bytes, &info));
    CHECK(info.method == config->method && info.grid_bytes == stored_bytes);
}

static void read_all(const char *dir, char **methods, int count)
{
    for (int i = 0; i < METHODS; i++) {
        const hgrid_config config = usual(i);
        HGRID_ALIGNED static unsigned char stored[MOST_BYTES];
        FILE *file = file_of(dir, i, "blob", "rb");
        const size_t bytes = fread(stored, 1, sizeof stored, file);
        CHECK(bytes > 0 && bytes < sizeof stored && fclose(file) == 0);
        answers expected;
        file = file_of(dir, i, "answers", "rb");
        CHECK(fread(&expected, sizeof expected, 1, file) == 1 && fclose(file) == 0);

        bool has = false;
        for (int m = 0; m < count; m++)
            has |= (uint32_t)atoi(methods[m]) == config.method;
        CHECK(hgrid_has_method(config.method) == has);
        if (has)
            is_there(&config, stored, bytes, &expected);
        else
            is_left_out(&config, stored, bytes);
    }
    CHECK(!hgrid_has_method(0) && !hgrid_has_method(5) && !hgrid_has_method(7) && !hgrid_has_method(UINT32_MAX));
}

int main(int count, char **words)
{
    CHECK(count >= 3);
    make_sheet(&mesh_data);
    mesh = mesh_of(&mesh_data);
    if (strcmp(words[1], "write") == 0)
        write_all(words[2]);
    else
        read_all(words[2], words + 3, count - 3);
    return 0;
}
