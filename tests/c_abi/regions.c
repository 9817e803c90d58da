/* Regions at wrong addresses, at every offset from a multiple of 64, and regions that overlap each other or
 * the mesh: refused, and nothing is written. */

#include "check.h"

static sheet mesh_data;
static uint32_t masks[TRIANGLES];
static hgrid_mesh mesh;
static hgrid_grid grid;
static void *blob;
static size_t blob_bytes, index_bytes, scratch_bytes, packed_bytes;

static void prepare(void)
{
    make_sheet(&mesh_data);
    mesh = mesh_of(&mesh_data);
    mesh.masks = masks;
    const hgrid_report need = exact_sizes(&mesh, NULL);
    index_bytes = (size_t)need.index_bytes, scratch_bytes = (size_t)need.scratch_bytes;
    grid = build_exactly(&mesh, NULL, &blob, &blob_bytes);
    uint64_t bytes;
    EXPECT(HGRID_ERROR_INDEX_TOO_SMALL, hgrid_pack(&grid, NULL, 0, &bytes));
    packed_bytes = (size_t)bytes;
}

/* Tries all calls at one offset. */
static void check_offset(size_t off)
{
    const hgrid_report new_report = HGRID_REPORT_INIT;
    static unsigned char *index, *scratch, *to;
    if (off == 1) {
        index = (unsigned char *)guarded(index_bytes + 64);
        scratch = (unsigned char *)guarded(scratch_bytes + 64);
        to = (unsigned char *)guarded(packed_bytes + 64);
    }
    hgrid_report report = new_report;
    hgrid_config fitted = usual(0);
    hgrid_grid view;
    memset(&view, 0xc7, sizeof view);
    fitted.density = 77;
    uint64_t bytes = 77;
    for (int method = 0; method < METHODS; method++) {
        const hgrid_config config = usual(method);
        EXPECT(HGRID_ERROR_MISALIGNED,
               hgrid_sizes(&mesh, &config, scratch + off, scratch_bytes, &report));
        EXPECT(HGRID_ERROR_MISALIGNED, hgrid_fit(&mesh, &config, index_bytes, scratch + off,
                                                 scratch_bytes, &fitted, &report));
        EXPECT(HGRID_ERROR_MISALIGNED, hgrid_build(&mesh, &config, index + off, index_bytes,
                                                   scratch, scratch_bytes, &view, &report));
        EXPECT(HGRID_ERROR_MISALIGNED,
               hgrid_build(&mesh, &config, index, index_bytes, scratch + off, scratch_bytes, &view,
                           &report));
    }
    EXPECT(HGRID_ERROR_MISALIGNED, hgrid_pack(&grid, to + off, packed_bytes, &bytes));
    CHECK(bytes == 77 && fitted.density == 77 && report.index_bytes == 0);
    CHECK(all_bytes_are(index, index_bytes + 64, 0xc7));
    CHECK(all_bytes_are(scratch, scratch_bytes + 64, 0xc7));
    CHECK(all_bytes_are(to, packed_bytes + 64, 0xc7));

    /* A misaligned blob does not open, even if it is complete. */
    unsigned char *moved = (unsigned char *)guarded(blob_bytes + 64);
    memcpy(moved + off, blob, blob_bytes);
    EXPECT(HGRID_ERROR_MISALIGNED, hgrid_open(moved + off, blob_bytes, &mesh, &view));
    EXPECT(HGRID_ERROR_MISALIGNED, hgrid_open(moved + off, blob_bytes, NULL, &view));
    CHECK(all_bytes_are(&view, sizeof view, 0xc7));
    /* But peek describes it. */
    hgrid_blob_info info = HGRID_BLOB_INFO_INIT;
    EXPECT(HGRID_OK, hgrid_peek(moved + off, blob_bytes, &info));
    CHECK(info.total_bytes == blob_bytes);
}

static void refuse_overlap(const hgrid_mesh *input, void *index, size_t bytes, void *scratch,
                           size_t more_bytes)
{
    hgrid_report report = HGRID_REPORT_INIT;
    hgrid_grid view;
    memset(&view, 0xc7, sizeof view);
    EXPECT(HGRID_ERROR_OVERLAP,
           hgrid_build(input, NULL, index, bytes, scratch, more_bytes, &view, &report));
    CHECK(all_bytes_are(&view, sizeof view, 0xc7));
    CHECK(report.index_bytes == 0 && report.triangle == HGRID_INVALID_ID);
}

static void regions_of_a_build_lie_apart(void)
{
    /* index | scratch | positions | indices | masks, with no gap between them, is allowed. */
    const size_t positions_at = index_bytes + scratch_bytes;
    const size_t indices_at = positions_at + sizeof mesh_data.positions;
    const size_t masks_at = indices_at + sizeof mesh_data.indices;
    const size_t end = masks_at + sizeof masks;
    unsigned char *all = (unsigned char *)guarded((end + 63) / 64 * 64);
    memcpy(all + positions_at, mesh_data.positions, sizeof mesh_data.positions);
    memcpy(all + indices_at, mesh_data.indices, sizeof mesh_data.indices);
    memcpy(all + masks_at, masks, sizeof masks);
    hgrid_mesh input = mesh;
    input.positions = all + positions_at;
    input.indices = all + indices_at;
    input.masks = all + masks_at;
    hgrid_grid view;
    EXPECT(HGRID_OK, hgrid_build(&input, NULL, all, index_bytes, all + index_bytes, scratch_bytes,
                                 &view, NULL));
    const unsigned char *copy = (unsigned char *)guarded_copy(all, end);

    /* One byte more of either is too much. */
    unsigned char *scratch = all + index_bytes;
    refuse_overlap(&input, all, index_bytes + 1, scratch, scratch_bytes);
    refuse_overlap(&input, all, index_bytes, scratch, scratch_bytes + 1);
    hgrid_report report = HGRID_REPORT_INIT;
    hgrid_config fitted = usual(0);
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_sizes(&input, NULL, scratch, scratch_bytes + 1, &report));
    EXPECT(HGRID_ERROR_OVERLAP,
           hgrid_fit(&input, NULL, index_bytes, scratch, scratch_bytes + 1, &fitted, &report));

    /* The same region twice, one inside the other, and each over each array of the mesh. */
    refuse_overlap(&input, all, index_bytes, all, scratch_bytes);
    refuse_overlap(&input, all, positions_at, all + 64, 64);
    const size_t arrays[] = {positions_at, indices_at, masks_at, end - 64};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) {
        unsigned char *over = all + (arrays[i] + 63) / 64 * 64;
        if (i == 3)
            over = all + arrays[i] / 64 * 64;
        refuse_overlap(&input, over, 64, all, 64);
        refuse_overlap(&input, all, 64, over, 64);
        EXPECT(HGRID_ERROR_OVERLAP, hgrid_sizes(&input, NULL, over, 64, &report));
    }
    /* A region without bytes overlaps nothing. */
    EXPECT(HGRID_ERROR_SCRATCH_TOO_SMALL,
           hgrid_build(&input, NULL, all, index_bytes, all + 64, 0, &view, &report));
    /* None of the calls wrote a byte. */
    CHECK(memcmp(all, copy, end) == 0);
}

static void a_packed_blob_lies_apart(void)
{
    /* Room for the packed blob | positions | indices | masks | blob. */
    const size_t positions_at = packed_bytes;
    const size_t indices_at = positions_at + sizeof mesh_data.positions;
    const size_t masks_at = indices_at + sizeof mesh_data.indices;
    const size_t blob_at = (masks_at + sizeof masks + 63) / 64 * 64;
    const size_t end = blob_at + blob_bytes;
    unsigned char *all = (unsigned char *)guarded(end);
    memcpy(all + positions_at, mesh_data.positions, sizeof mesh_data.positions);
    memcpy(all + indices_at, mesh_data.indices, sizeof mesh_data.indices);
    memcpy(all + masks_at, masks, sizeof masks);
    memcpy(all + blob_at, blob, blob_bytes);
    hgrid_mesh input = mesh;
    input.positions = all + positions_at;
    input.indices = all + indices_at;
    input.masks = all + masks_at;
    hgrid_grid view;
    EXPECT(HGRID_OK, hgrid_open(all + blob_at, blob_bytes, &input, &view));
    const unsigned char *copy = (unsigned char *)guarded_copy(all, end);

    uint64_t bytes = 77;
    EXPECT(HGRID_ERROR_OVERLAP, hgrid_pack(&view, all, packed_bytes + 1, &bytes));
    const size_t over[] = {(positions_at + 63) / 64, (indices_at + 63) / 64, (masks_at + 63) / 64,
                           blob_at / 64, (end - 64) / 64};
    for (size_t i = 0; i < sizeof over / sizeof *over; i++)
        EXPECT(HGRID_ERROR_OVERLAP, hgrid_pack(&view, all + 64 * over[i], 64, &bytes));
    CHECK(bytes == 77 && memcmp(all, copy, end) == 0);
    EXPECT(HGRID_OK, hgrid_pack(&view, all, packed_bytes, &bytes));
    CHECK(bytes == packed_bytes);
    CHECK(memcmp(all + positions_at, copy + positions_at, end - positions_at) == 0);
}

int main(void)
{
    prepare();
    for (size_t off = 1; off < HGRID_ALIGNMENT; off++)
        check_offset(off);
    regions_of_a_build_lie_apart();
    a_packed_blob_lies_apart();
    return 0;
}
