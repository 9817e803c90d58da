/* The library reads all the memory it was given, and none beside it. Every array ends at a protected page
 * (see guarded in check.h). */

#include "check.h"

static sheet mesh_data;
static hgrid_mesh tight;
static hgrid_config config;
static hgrid_report need;
static unsigned char *expected_blob;
static size_t blob_bytes;

/* Runs all queries with rays onto the whole sheet; each argument ends with its memory. */
static void ask_everything(const hgrid_grid *view, const hgrid_mesh *mesh)
{
    enum { RAYS = 66 };
    const hgrid_grid *grid = (hgrid_grid *)guarded_copy(view, sizeof *view);
    hgrid_ray *rays = (hgrid_ray *)guarded(RAYS * sizeof *rays);
    hgrid_hit *hits = (hgrid_hit *)guarded(RAYS * sizeof *hits);
    hgrid_hit *hit = (hgrid_hit *)guarded(sizeof *hit), all[4];
    uint8_t *occluded = (uint8_t *)guarded(RAYS);
    uint32_t *occluders = (uint32_t *)guarded(RAYS * sizeof *occluders);
    size_t *count = (size_t *)guarded(sizeof *count);
    hgrid_closest *closest = (hgrid_closest *)guarded(sizeof *closest);
    hgrid_query_options *options = (hgrid_query_options *)guarded(sizeof *options);
    const hgrid_query_options defaults = HGRID_QUERY_OPTIONS_INIT;
    const hgrid_counters zero = {0, 0, 0};
    *options = defaults;
    options->counters = (hgrid_counters *)guarded_copy(&zero, sizeof zero);
    for (int i = 0; i < RAYS; i++)
        rays[i] = ray_down((float)(i % 11) / 10.1f + 0.003f, (float)(i / 11) / 6.1f + 0.005f);
    for (hgrid_coherence c = 0; c < 2; c++)
        for (int with = 0; with < 2; with++) {
            const hgrid_query_options *as = with ? options : NULL;
            EXPECT(HGRID_OK, hgrid_intersect_n(grid, rays, 0, hits, 0, RAYS, c, as));
            EXPECT(HGRID_OK, hgrid_occluded_n(grid, rays, 0, occluded, 0, RAYS, c, as));
            EXPECT(HGRID_OK, hgrid_occluder_n(grid, rays, 0, occluders, 0, RAYS, c, as));
            for (int i = 0; i < RAYS; i++)
                CHECK(hits[i].primitive < TRIANGLES && occluded[i] == 1 &&
                      occluders[i] < TRIANGLES);
        }
    for (int i = 0; i < RAYS; i += 13) {
        const hgrid_ray *ray = (hgrid_ray *)guarded_copy(&rays[i], sizeof *ray);
        const hgrid_point_query here = anywhere(ray->origin);
        const hgrid_point_query *query = (hgrid_point_query *)guarded_copy(&here, sizeof here);
        const uint32_t id = hits[i].primitive;
        options->mask = UINT32_MAX;
        CHECK(hgrid_intersect(grid, ray, NULL, hit) && hit->primitive == id);
        CHECK(hgrid_intersect(grid, ray, options, hit) && hit->primitive == id);
        CHECK(hgrid_occluded(grid, ray, options));
        CHECK(hgrid_occluder(grid, ray, options) < TRIANGLES);
        CHECK(hgrid_closest_point(grid, query, options, closest));
        /* Masks are read when a ray hits. */
        options->mask = 1u << id % 31;
        CHECK(hgrid_occluded(grid, ray, options));
        options->mask = 1u << (id + 1) % 31;
        CHECK(hgrid_occluded(grid, ray, options) == (mesh->masks == NULL));
        EXPECT(HGRID_OK, hgrid_intersect_all(grid, ray, options, all, 4, count));
        CHECK(*count == (mesh->masks == NULL));
    }
    CHECK(options->counters->primitive_tests > RAYS);
}

/* Builds the sheet in another form: the blob must be the same, byte by byte. */
static void check_form(const hgrid_mesh *mesh)
{
    void *index = guarded(need.index_bytes), *scratch = guarded(need.scratch_bytes);
    hgrid_grid grid;
    EXPECT(HGRID_OK, hgrid_build(mesh, &config, index, need.index_bytes, scratch,
                                 need.scratch_bytes, &grid, NULL));
    CHECK(memcmp(index, expected_blob, blob_bytes) == 0);
    EXPECT_PROOF(HGRID_OK, &grid);
    ask_everything(&grid, mesh);
}

static void build_the_expected_blob(void)
{
    make_sheet(&mesh_data);
    tight = mesh_of(&mesh_data);
    need = exact_sizes(&tight, &config);
    void *blob;
    build_exactly(&tight, &config, &blob, &blob_bytes);
    expected_blob = (unsigned char *)blob;
}

static void tight_arrays_are_read_to_their_last_byte_and_no_further(void)
{
    hgrid_mesh mesh = tight;
    mesh.positions = guarded_copy(mesh_data.positions, sizeof mesh_data.positions);
    mesh.indices = guarded_copy(mesh_data.indices, sizeof mesh_data.indices);
    check_form(&mesh);
    mesh.position_stride = 12;
    mesh.index_stride = 12;
    check_form(&mesh);
}

/* Masks lie at any address and end with the mask of the last triangle. */
static void masks_are_read_to_their_last_byte_and_no_further(void)
{
    for (size_t stride = 4; stride < 8; stride++) {
        unsigned char *masks = (unsigned char *)guarded((TRIANGLES - 1) * stride + 4);
        for (uint32_t i = 0; i < TRIANGLES; i++) {
            const uint32_t mask = 1u << i % 31;
            memcpy(masks + i * stride, &mask, sizeof mask);
        }
        hgrid_mesh mesh = tight;
        mesh.masks = masks;
        mesh.mask_stride = stride == 4 ? 0 : stride;
        check_form(&mesh);
    }
}

/* Elements lie in the caller's structs at odd addresses, and memory ends with the last element's own bytes. */
static void strides_need_no_alignment_and_no_padding_at_the_end(void)
{
    for (size_t extra = 1; extra < 9; extra += extra < 3 ? 1 : 5) {
        const size_t stride = 12 + extra;
        const size_t position_bytes = (VERTICES - 1) * stride + 12;
        const size_t index_bytes = (TRIANGLES - 1) * stride + 12;
        unsigned char *positions = (unsigned char *)guarded(position_bytes);
        unsigned char *indices = (unsigned char *)guarded(index_bytes);
        for (size_t i = 0; i < VERTICES; i++)
            memcpy(positions + i * stride, mesh_data.positions[i], 12);
        for (size_t i = 0; i < TRIANGLES; i++)
            memcpy(indices + i * stride, mesh_data.indices[i], 12);
        hgrid_mesh mesh = tight;
        mesh.positions = positions, mesh.position_stride = stride;
        mesh.indices = indices, mesh.index_stride = stride;
        check_form(&mesh);
    }
}

static void indices_of_16_bits_are_read_as_such(void)
{
    for (size_t stride = 6; stride < 12; stride += stride < 8 ? 1 : 3) {
        unsigned char *indices = (unsigned char *)guarded((TRIANGLES - 1) * stride + 6);
        for (size_t i = 0; i < TRIANGLES; i++) {
            uint16_t triangle[3];
            for (int corner = 0; corner < 3; corner++)
                triangle[corner] = (uint16_t)mesh_data.indices[i][corner];
            memcpy(indices + i * stride, triangle, 6);
        }
        hgrid_mesh mesh = tight;
        mesh.index_type = HGRID_INDEX_U16;
        mesh.indices = indices;
        mesh.index_stride = stride == 6 ? 0 : stride;
        check_form(&mesh);
    }
}

/* A method that plans every byte before it writes one. */
static const hgrid_config one_level = HGRID_CONFIG_INIT_ONE_LEVEL;

static void one_byte_less_is_refused_and_nothing_is_touched(void)
{
    unsigned char *index = (unsigned char *)guarded(need.index_bytes);
    unsigned char *scratch = (unsigned char *)guarded(need.scratch_bytes);
    hgrid_grid grid;
    memset(&grid, 0xc7, sizeof grid);

    hgrid_report report = HGRID_REPORT_INIT;
    EXPECT(HGRID_ERROR_INDEX_TOO_SMALL,
           hgrid_build(&tight, &one_level, index, need.index_bytes - 1, scratch, need.scratch_bytes,
                       &grid, &report));
    CHECK(report.index_bytes == need.index_bytes && report.is_exact == 1);
    CHECK(report.scratch_bytes == need.scratch_bytes);
    CHECK(report.triangle == HGRID_INVALID_ID);

    const size_t less = (size_t)need.scratch_bytes - 1;
    memset(scratch, 0xc7, need.scratch_bytes);
    EXPECT(HGRID_ERROR_SCRATCH_TOO_SMALL, hgrid_build(&tight, &one_level, index, need.index_bytes,
                                                      scratch, less, &grid, &report));
    CHECK(report.scratch_bytes == need.scratch_bytes);
    CHECK(report.index_bytes >= need.index_bytes && report.is_exact == 0);
    CHECK(scratch[less] == 0xc7);

    /* Without any memory, the report gives enough of both. */
    EXPECT(HGRID_ERROR_SCRATCH_TOO_SMALL,
           hgrid_build(&tight, &one_level, NULL, 0, NULL, 0, &grid, &report));
    CHECK(report.scratch_bytes == need.scratch_bytes && report.index_bytes >= need.index_bytes);
    EXPECT(HGRID_ERROR_INDEX_TOO_SMALL, hgrid_build(&tight, &one_level, NULL, 0, scratch,
                                                    need.scratch_bytes, &grid, &report));
    CHECK(report.index_bytes == need.index_bytes && report.is_exact == 1);

    CHECK(all_bytes_are(index, need.index_bytes, 0xc7));
    CHECK(all_bytes_are(&grid, sizeof grid, 0xc7));
}

static void what_is_more_than_needed_is_not_touched(void)
{
    const size_t more = 4096;
    unsigned char *index = (unsigned char *)guarded(need.index_bytes + more);
    unsigned char *scratch = (unsigned char *)guarded(need.scratch_bytes + more);
    hgrid_grid grid;
    hgrid_report report = HGRID_REPORT_INIT;
    EXPECT(HGRID_OK, hgrid_sizes(&tight, &one_level, scratch, need.scratch_bytes + more, &report));
    CHECK(report.index_bytes == need.index_bytes && report.is_exact == 1);
    EXPECT(HGRID_OK, hgrid_build(&tight, &one_level, index, need.index_bytes + more, scratch,
                                 need.scratch_bytes + more, &grid, &report));
    CHECK(memcmp(index, expected_blob, need.index_bytes) == 0);
    CHECK(all_bytes_are(index + need.index_bytes, more, 0xc7));
    CHECK(all_bytes_are(scratch + need.scratch_bytes, more, 0xc7));
}

/* Regions straight from malloc, as in most programs, for a tool that tracks uninitialised memory. */
static void regions_may_hold_anything(void)
{
    for (int fill = 0; fill < 3; fill++) {
        unsigned char *memory = (unsigned char *)malloc(need.index_bytes + need.scratch_bytes + 63);
        CHECK(memory != NULL);
        unsigned char *index = memory + (64 - (uintptr_t)memory % 64) % 64;
        if (fill > 0)
            memset(index, fill == 1 ? 0 : 0xff, need.index_bytes + need.scratch_bytes);
        hgrid_grid grid;
        EXPECT(HGRID_OK, hgrid_build(&tight, &one_level, index, need.index_bytes,
                                     index + need.index_bytes, need.scratch_bytes, &grid, NULL));
        CHECK(memcmp(index, expected_blob, need.index_bytes) == 0);
        EXPECT_PROOF(HGRID_OK, &grid);
        free(memory);
    }
}

static void an_empty_mesh_needs_no_arrays(void)
{
    hgrid_mesh mesh = HGRID_MESH_INIT;
    HGRID_ALIGNED static unsigned char index[HGRID_INDEX_BOUND(0)];
    HGRID_ALIGNED static unsigned char scratch[HGRID_SCRATCH_BOUND(0)];
    hgrid_grid grid;
    EXPECT(HGRID_OK, hgrid_build(&mesh, NULL, index, sizeof index, scratch, sizeof scratch, &grid,
                                 NULL));
    EXPECT_PROOF(HGRID_OK, &grid);
    const hgrid_ray ray = ray_down(0, 0);
    CHECK(!hgrid_occluded(&grid, &ray, NULL));

    mesh.positions = mesh_data.positions;
    mesh.vertex_count = VERTICES;
    EXPECT(HGRID_OK, hgrid_build(&mesh, NULL, index, sizeof index, scratch, sizeof scratch, &grid,
                                 NULL));
}

int main(void)
{
    for (int method = METHODS; method-- > 0;) {
        config = usual(method);
        build_the_expected_blob();
        tight_arrays_are_read_to_their_last_byte_and_no_further();
        strides_need_no_alignment_and_no_padding_at_the_end();
        indices_of_16_bits_are_read_as_such();
        masks_are_read_to_their_last_byte_and_no_further();
    }
    /* The rest is checked to the byte for one_level only; methods.c checks the other methods. */
    CHECK(config.method == HGRID_METHOD_ONE_LEVEL);
    one_byte_less_is_refused_and_nothing_is_touched();
    what_is_more_than_needed_is_not_touched();
    regions_may_hold_anything();
    an_empty_mesh_needs_no_arrays();
    return 0;
}
