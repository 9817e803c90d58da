/* Libraries that were built with fewer methods: do they have those, and say of the others that they
 * are left out? `left_out write DIR` stores a grid of every method, `left_out read DIR METHOD...`
 * checks what a library with only these methods makes of them. */

#include "check.h"

enum { MOST_BYTES = 1 << 20, RAYS = 100 };

static sheet mesh_data;
static hgrid_mesh mesh;

/* The file of a method. */
static FILE *file_of(const char *dir, int method, const char *mode)
{
    char path[4096];
    snprintf(path, sizeof path, "%s/%d.blob", dir, method);
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
        FILE *file = file_of(dir, i, "wb");
        CHECK(fwrite(blob, 1, bytes, file) == bytes && fclose(file) == 0);
    }
}

/* A method that the library has builds the same grid as the library that has all, and opens it. */
static void is_there(const hgrid_config *config, const void *stored, size_t stored_bytes)
{
    void *blob;
    size_t bytes;
    const hgrid_grid built = build_exactly(&mesh, config, &blob, &bytes);
    CHECK(bytes == stored_bytes && memcmp(blob, stored, bytes) == 0);
    hgrid_grid grid;
    EXPECT(HGRID_OK, hgrid_open(stored, stored_bytes, &mesh, &grid));
    EXPECT(HGRID_OK, hgrid_validate(&grid));
    for (int i = 0; i < RAYS; i++) {
        const hgrid_ray ray = ray_down((float)i / RAYS, 0.3f);
        hgrid_hit a, b;
        CHECK(hgrid_intersect(&built, &ray, NULL, &a) && hgrid_intersect(&grid, &ray, NULL, &b));
        CHECK(memcmp(&a, &b, sizeof a) == 0);
    }
}

/* One that it has not is refused by all that would need it, and nothing is written. */
static void is_left_out(const hgrid_config *config, const void *stored, size_t stored_bytes)
{
    static unsigned char index[MOST_BYTES], scratch[MOST_BYTES];
    memset(index, 0xc7, sizeof index);
    hgrid_report report = HGRID_REPORT_INIT;
    hgrid_config fitted = *config;
    hgrid_grid grid = HGRID_GRID_INIT;
    unsigned char *aligned = index + (HGRID_ALIGNMENT - (uintptr_t)index % HGRID_ALIGNMENT);
    unsigned char *room = scratch + (HGRID_ALIGNMENT - (uintptr_t)scratch % HGRID_ALIGNMENT);
    const size_t bytes = MOST_BYTES - HGRID_ALIGNMENT;
    EXPECT(HGRID_ERROR_METHOD_LEFT_OUT, hgrid_bound(TRIANGLES, config, &report));
    EXPECT(HGRID_ERROR_METHOD_LEFT_OUT, hgrid_sizes(&mesh, config, room, bytes, &report));
    EXPECT(HGRID_ERROR_METHOD_LEFT_OUT,
           hgrid_fit(&mesh, config, bytes, room, bytes, &fitted, &report));
    EXPECT(HGRID_ERROR_METHOD_LEFT_OUT,
           hgrid_build(&mesh, config, aligned, bytes, room, bytes, &grid, &report));
    EXPECT(HGRID_ERROR_METHOD_LEFT_OUT, hgrid_open(stored, stored_bytes, &mesh, &grid));
    CHECK(all_bytes_are(index, sizeof index, 0xc7));
    /* What a blob is can be told by any library. */
    hgrid_blob_info info = HGRID_BLOB_INFO_INIT;
    EXPECT(HGRID_OK, hgrid_peek(stored, stored_bytes, &info));
    CHECK(info.method == config->method && info.grid_bytes == stored_bytes);
}

static void read_all(const char *dir, char **methods, int count)
{
    for (int i = 0; i < METHODS; i++) {
        const hgrid_config config = usual(i);
        unsigned char *stored = (unsigned char *)guarded(MOST_BYTES);
        FILE *file = file_of(dir, i, "rb");
        const size_t bytes = fread(stored, 1, MOST_BYTES, file);
        CHECK(bytes > 0 && bytes < MOST_BYTES && fclose(file) == 0);
        bool has = false;
        for (int m = 0; m < count; m++)
            has |= (uint32_t)atoi(methods[m]) == config.method;
        CHECK(hgrid_has_method(config.method) == has);
        (has ? is_there : is_left_out)(&config, stored, bytes);
    }
    CHECK(!hgrid_has_method(0) && !hgrid_has_method(METHODS + 1) && !hgrid_has_method(UINT32_MAX));
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
