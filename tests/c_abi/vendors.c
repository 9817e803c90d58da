/* A program with this library and another one that is written in Rust. */

#include "check.h"

uint64_t vendor_mean(const uint64_t *numbers, size_t count);

int main(void)
{
    static sheet data;
    make_sheet(&data);
    const hgrid_mesh mesh = mesh_of(&data);
    const hgrid_report need = exact_sizes(&mesh, NULL);
    void *index = guarded(need.index_bytes), *scratch = guarded(need.scratch_bytes);
    hgrid_grid grid;
    CHECK(hgrid_build(&mesh, NULL, index, need.index_bytes, scratch, need.scratch_bytes, &grid,
                      NULL) == HGRID_OK);
    const hgrid_ray ray = ray_down(0.5f, 0.5f);
    hgrid_hit hit;
    CHECK(hgrid_intersect(&grid, &ray, NULL, &hit) && hit.primitive < TRIANGLES);

    const uint64_t numbers[] = {UINT64_MAX, UINT64_MAX - 2, UINT64_MAX - 1};
    CHECK(vendor_mean(numbers, 3) == UINT64_MAX - 1);
    return 0;
}
