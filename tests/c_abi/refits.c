/* Trees whose vertices move: hgrid_refit answers for the new mesh, or fails and changes nothing. */

#include "check.h"

static sheet mesh_data;
static hgrid_mesh mesh;
static void *tree;
static size_t tree_bytes;

/* Checks a refused refit: the blob, the view and the costs stay as they were. */
static hgrid_refit_report refuse(hgrid_status expected, const hgrid_mesh *with, void *blob,
                                 size_t bytes)
{
    hgrid_refit_report report = HGRID_REFIT_REPORT_INIT;
    hgrid_grid grid;
    memset(&grid, 0xc7, sizeof grid);
    unsigned char *before = (unsigned char *)guarded(bytes);
    memcpy(before, blob, bytes);
    EXPECT(expected, hgrid_refit(with, blob, bytes, &grid, &report));
    CHECK(memcmp(before, blob, bytes) == 0 && all_bytes_are(&grid, sizeof grid, 0xc7));
    CHECK(report.cost_before == 0 && report.cost_after == 0);
    return report;
}

static void it_follows_the_vertices(void)
{
    hgrid_refit_report first = HGRID_REFIT_REPORT_INIT, second = HGRID_REFIT_REPORT_INIT;
    hgrid_grid grid;
    hgrid_hit hit;
    unsigned char *built = (unsigned char *)guarded(tree_bytes);
    memcpy(built, tree, tree_bytes);
    sheet moved_data = mesh_data;
    for (size_t i = 0; i < VERTICES; i++)
        moved_data.positions[i][0] += 5, moved_data.positions[i][1] *= 3;
    const hgrid_mesh moved = mesh_of(&moved_data);
    EXPECT(HGRID_OK, hgrid_refit(&moved, tree, tree_bytes, &grid, &first));
    CHECK(first.triangle == HGRID_INVALID_ID && first.cost_before > 1 && first.cost_after > 1);
    const hgrid_ray here = ray_down(5.3f, 1.3f), there = ray_down(0.3f, 0.4f);
    CHECK(hgrid_intersect(&grid, &here, NULL, &hit) && !hgrid_occluded(&grid, &there, NULL));
    CHECK(hgrid_validate(&grid, guarded(hgrid_validate_bytes(&grid)),
                         hgrid_validate_bytes(&grid)) == HGRID_OK);
    EXPECT(HGRID_OK, hgrid_refit(&mesh, tree, tree_bytes, &grid, &second));
    CHECK(second.cost_before == first.cost_after && second.cost_after == first.cost_before);
    CHECK(memcmp(built, tree, tree_bytes) == 0);
    CHECK(hgrid_intersect(&grid, &there, NULL, &hit) && !hgrid_occluded(&grid, &here, NULL));
}

static void what_it_refuses(void)
{
    static sheet other;
    other = mesh_data;
    const hgrid_mesh with = mesh_of(&other);
    other.positions[other.indices[0][0]][2] = NAN;
    CHECK(refuse(HGRID_ERROR_NON_FINITE, &with, tree, tree_bytes).triangle == 0);
    other = mesh_data;
    other.indices[7][1] = VERTICES;
    CHECK(refuse(HGRID_ERROR_INDEX_OUT_OF_RANGE, &with, tree, tree_bytes).triangle == 7);
    hgrid_mesh fewer = mesh;
    fewer.triangle_count--;
    refuse(HGRID_ERROR_MESH_MISMATCH, &fewer, tree, tree_bytes);

    hgrid_mesh inside = mesh;
    inside.positions = tree;
    refuse(HGRID_ERROR_OVERLAP, &inside, tree, tree_bytes);

    const hgrid_config one_level = HGRID_CONFIG_INIT_ONE_LEVEL;
    void *blob;
    size_t bytes;
    build_exactly(&mesh, &one_level, &blob, &bytes);
    refuse(HGRID_ERROR_CANNOT_REFIT, &mesh, blob, bytes);
}

int main(void)
{
    make_sheet(&mesh_data);
    mesh = mesh_of(&mesh_data);
    const hgrid_config bvh = HGRID_CONFIG_INIT_BVH;
    build_exactly(&mesh, &bvh, &tree, &tree_bytes);
    it_follows_the_vertices();
    what_it_refuses();
    return 0;
}
