/* Runs the example in the header of hgrid_create, which replaces FUNCTIONS: three rays, two hits. */

#define HGRID_MALLOC
#include <hgrid.h>

#include <math.h>

FUNCTIONS

int main(void)
{
    static const float positions[3][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    static const uint32_t indices[1][3] = {{0, 1, 2}};
    const hgrid_ray rays[] = {{{0.25f, 0.25f, 1}, 0, {0, 0, -1}, INFINITY},
                              {{0.75f, 0.75f, 1}, 0, {0, 0, -1}, INFINITY},
                              {{0.5f, 0.25f, -1}, 0, {0, 0, 1}, INFINITY}};
    hgrid_mesh mesh = HGRID_MESH_INIT;
    mesh.positions = positions, mesh.vertex_count = 3;
    mesh.indices = indices, mesh.triangle_count = 1;
    if (count_hits(&mesh, rays, 3) != 2)
        return 1;
    mesh.vertex_count = 2;
    return count_hits(&mesh, rays, 3) == 0 ? 0 : 2;
}
