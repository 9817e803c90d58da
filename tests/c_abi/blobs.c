/* Damaged and foreign blobs. Each copy ends at a protected page. */

#include "check.h"

/* The offsets of fields in the header of a blob (core/src/blob.rs). */
enum { BYTE_ORDER_AT = 8, VERSION_AT = 12, SIZE_AT = 16, TRIANGLES_AT = 32, METHOD_AT = 40,
       RESOLUTION_AT = 72, CHECKSUM_AT = 124 };

static sheet mesh_data;
static hgrid_mesh mesh;
static unsigned char *blob;
static size_t blob_bytes;

static void build(const hgrid_config *config)
{
    make_sheet(&mesh_data);
    mesh = mesh_of(&mesh_data);
    const hgrid_report need = exact_sizes(&mesh, config);
    blob_bytes = (size_t)need.index_bytes;
    blob = (unsigned char *)guarded(blob_bytes);
    void *scratch = guarded(need.scratch_bytes);
    hgrid_grid grid;
    EXPECT(HGRID_OK, hgrid_build(&mesh, config, blob, blob_bytes, scratch, need.scratch_bytes, &grid,
                                 NULL));
}

/* Checks that opening fails after some bytes are replaced, and leaves the view untouched. */
static void refuse(hgrid_status expected, size_t at, const void *bytes, size_t count)
{
    unsigned char *changed = (unsigned char *)guarded_copy(blob, blob_bytes);
    memcpy(changed + at, bytes, count);
    hgrid_grid grid;
    memset(&grid, 0xc7, sizeof grid);
    EXPECT(expected, hgrid_open(changed, blob_bytes, &mesh, &grid));
    CHECK(all_bytes_are(&grid, sizeof grid, 0xc7));
}

static void headers_are_checked(void)
{
    const uint32_t next_version = HGRID_BLOB_VERSION + 1, zero = 0;
    const uint64_t larger = blob_bytes + 1, smaller = blob_bytes - 64;
    unsigned char swapped[4];
    for (int i = 0; i < 4; i++)
        swapped[i] = blob[BYTE_ORDER_AT + 3 - i];

    refuse(HGRID_ERROR_NOT_A_GRID, 0, "HGRID", 5);
    refuse(HGRID_ERROR_WRONG_BYTE_ORDER, BYTE_ORDER_AT, swapped, sizeof swapped);
    refuse(HGRID_ERROR_NOT_A_GRID, BYTE_ORDER_AT, &zero, sizeof zero);
    refuse(HGRID_ERROR_UNSUPPORTED_VERSION, VERSION_AT, &next_version, sizeof next_version);
    /* A checksum covers the rest of the header. */
    refuse(HGRID_ERROR_CORRUPT, SIZE_AT, &larger, sizeof larger);
    refuse(HGRID_ERROR_CORRUPT, SIZE_AT, &smaller, sizeof smaller);
    refuse(HGRID_ERROR_CORRUPT, TRIANGLES_AT, &zero, sizeof zero);
    refuse(HGRID_ERROR_CORRUPT, RESOLUTION_AT, &zero, sizeof zero);
}

/* A header with the number of the removed method and a correct checksum. */
static void a_removed_method_is_refused_by_name(void)
{
    unsigned char *old = (unsigned char *)guarded_copy(blob, blob_bytes);
    const uint32_t removed = 5;
    memcpy(old + METHOD_AT, &removed, sizeof removed);
    uint64_t sum = UINT64_C(0xcbf29ce484222325);
    for (size_t at = 0; at < CHECKSUM_AT; at += 4) {
        uint32_t word;
        memcpy(&word, old + at, sizeof word);
        sum = (sum ^ word) * UINT64_C(0x100000001b3);
    }
    sum ^= sum >> 29;
    const uint32_t checksum = (uint32_t)sum ^ (uint32_t)(sum >> 32);
    memcpy(old + CHECKSUM_AT, &checksum, sizeof checksum);
    hgrid_grid grid;
    hgrid_blob_info info = HGRID_BLOB_INFO_INIT;
    EXPECT(HGRID_ERROR_METHOD_REMOVED, hgrid_open(old, blob_bytes, &mesh, &grid));
    EXPECT(HGRID_ERROR_METHOD_REMOVED, hgrid_peek(old, blob_bytes, &info));
}

static void every_shorter_blob_is_refused(void)
{
    for (size_t bytes = 0; bytes < blob_bytes; bytes += bytes < 200 ? 1 : 64) {
        /* A region starts at a multiple of 64, so only these sizes can end at a protected page. */
        const void *start = bytes % 64 == 0 ? guarded_copy(blob, bytes) : blob;
        hgrid_grid grid;
        const hgrid_status status = hgrid_open(start, bytes, &mesh, &grid);
        CHECK(status == (bytes < 8 ? HGRID_ERROR_NOT_A_GRID : HGRID_ERROR_TRUNCATED));
    }
    hgrid_grid grid;
    EXPECT(HGRID_ERROR_TRUNCATED, hgrid_open(blob, blob_bytes - 1, &mesh, &grid));
}

static void another_mesh_is_refused(void)
{
    hgrid_grid grid;
    EXPECT(HGRID_ERROR_NO_MESH, hgrid_open(blob, blob_bytes, NULL, &grid));
    hgrid_mesh other = mesh;
    other.triangle_count--;
    EXPECT(HGRID_ERROR_MESH_MISMATCH, hgrid_open(blob, blob_bytes, &other, &grid));
    other = mesh;
    other.vertex_count--;
    EXPECT(HGRID_ERROR_MESH_MISMATCH, hgrid_open(blob, blob_bytes, &other, &grid));
}

/* The counts agree, so the blob opens; only validation looks at the triangles. */
static void a_changed_mesh_is_found(void)
{
    static sheet changed;
    changed = mesh_data;
    changed.positions[40][2] += 0.5f;
    const hgrid_mesh moved = mesh_of(&changed);
    hgrid_grid grid;
    EXPECT(HGRID_OK, hgrid_open(blob, blob_bytes, &moved, &grid));
    EXPECT_PROOF(HGRID_ERROR_CORRUPT, &grid);
    changed = mesh_data;
    changed.indices[7][1] = VERTICES;
    EXPECT_PROOF(HGRID_ERROR_INDEX_OUT_OF_RANGE, &grid);
}

static void answers(const hgrid_grid *grid, hgrid_hit hits[64])
{
    memset(hits, 0xc7, 64 * sizeof *hits);
    for (int i = 0; i < 64; i++) {
        hgrid_ray ray = ray_down((float)(i % 8) / 7, (float)(i / 8) / 7);
        ray.direction[0] = (float)(i % 5 - 2) / 4;
        hgrid_intersect(grid, &ray, NULL, &hits[i]);
    }
}

/* Flips one bit of each byte in turn: queries end and stay inside, and a blob that validates answers as the
 * original. Fewer than `most` flips validate. */
static void damage_is_harmless_and_found(size_t most)
{
    unsigned char *damaged = (unsigned char *)guarded_copy(blob, blob_bytes);
    hgrid_grid grid;
    hgrid_hit expected[64], found[64];
    EXPECT(HGRID_OK, hgrid_open(damaged, blob_bytes, &mesh, &grid));
    answers(&grid, expected);

    size_t opened = 0, passed = 0;
    for (size_t at = 0; at < blob_bytes; at++) {
        const unsigned char bit = (unsigned char)(1 << (at * 5 % 8));
        damaged[at] ^= bit;
        if (hgrid_open(damaged, blob_bytes, &mesh, &grid) == HGRID_OK) {
            opened++;
            answers(&grid, found);
            if (proof(&grid) == HGRID_OK) {
                passed++;
                CHECK(memcmp(expected, found, sizeof found) == 0);
            }
        }
        damaged[at] ^= bit;
    }
    CHECK(opened > blob_bytes / 2);
    CHECK(passed < most);
}

int main(void)
{
    build(NULL);
    headers_are_checked();
    a_removed_method_is_refused_by_name();
    every_shorter_blob_is_refused();
    another_mesh_is_refused();
    a_changed_mesh_is_found();
    /* A tree's box may be larger than needed: that costs work, not hits. */
    damage_is_harmless_and_found(blob_bytes / 4);
    const hgrid_config one_level = HGRID_CONFIG_INIT_ONE_LEVEL;
    build(&one_level);
    damage_is_harmless_and_found(blob_bytes / 100);
    return 0;
}
