/* A user's program: a grid without memory management by hand. The library was built with malloc. */

#define HGRID_MALLOC
#include <hgrid.h>

#include <stdio.h>

int main(void)
{
    static const float positions[3][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    static const uint32_t indices[1][3] = {{0, 1, 2}};
    hgrid_mesh mesh = HGRID_MESH_INIT;
    mesh.positions = positions, mesh.vertex_count = 3;
    mesh.indices = indices, mesh.triangle_count = 1;

    hgrid_grid *grid;
    const hgrid_status status = hgrid_create(&mesh, NULL, NULL, &grid, NULL);
    if (status != HGRID_OK)
        return puts(hgrid_status_string(status)), 1;
    const hgrid_ray ray = {{0.25f, 0.25f, 1}, 0, {0, 0, -1}, 100};
    hgrid_hit hit;
    if (hgrid_intersect(grid, &ray, NULL, &hit))
        printf("hit at t = %g\n", (double)hit.t);
    hgrid_destroy(grid);
    return 0;
}
