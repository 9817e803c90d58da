/* The examples in the header's functions, put in place of FUNCTIONS and run: two triangles, one behind
 * the other, fill the lower left half of a tile. POSIX threads are what one of them is about. */

#include "hgrid.h"

#include <math.h>
#include <pthread.h>

FUNCTIONS

int main(void)
{
    static const float positions[6][3] = {{0, 0, 0},  {8, 0, 0},  {0, 8, 0},
                                          {0, 0, -2}, {8, 0, -2}, {0, 8, -2}};
    static const uint32_t indices[2][3] = {{0, 1, 2}, {3, 4, 5}};
    HGRID_ALIGNED static unsigned char index[HGRID_INDEX_BOUND(2)], scratch[HGRID_SCRATCH_BOUND(2)];
    hgrid_mesh mesh = HGRID_MESH_INIT;
    mesh.positions = positions, mesh.vertex_count = 6;
    mesh.indices = indices, mesh.triangle_count = 2;
    hgrid_grid grid;
    if (hgrid_build(&mesh, NULL, index, sizeof index, scratch, sizeof scratch, &grid, NULL))
        return 1;

    hgrid_ray rays[128];
    float depth[64];
    for (int i = 0; i < 128; i++) {
        const hgrid_ray ray = {{(float)(i % 8) + 0.25f, (float)(i / 8) + 0.25f, 1}, 0, {0, 0, -1},
                               INFINITY};
        rays[i] = ray;
    }
    if (trace_tile(&grid, rays, depth) != 36)
        return 2;
    for (int i = 0; i < 64; i++)
        if (i % 8 + i / 8 < 8 ? depth[i] != 1 : depth[i] != INFINITY)
            return 3;
    if (count_lit(&grid, rays, 100) != 100 - 36)
        return 4;
    /* Any memory will do to sort in: these rays are left as they are. */
    hgrid_hit all[128];
    unsigned char memory[64];
    if (trace_all(&grid, rays, all, 128, memory, sizeof memory))
        return 10;
    for (int i = 0; i < 64; i++)
        if (all[i].t != depth[i])
            return 11;
    const float half[] = {0.5f, 0.5f};
    if (light_behind(&grid, &rays[0], half) != 0.25f || light_behind(&grid, &rays[63], half) != 1)
        return 7;
    const unsigned char none[] = {0, 0}, first[] = {1, 0}, both[] = {1, 1};
    if (light_along(&grid, &rays[0], none) != 0 || light_along(&grid, &rays[0], first) != 0 ||
        fabsf(light_along(&grid, &rays[0], both) - 0.64f) > 1e-6f ||
        light_along(&grid, &rays[63], none) != 1)
        return 8;

    if (distance_to(&grid, 1, 1, 2) != 2)
        return 12;

    /* From the first triangle nothing is in the way of a light above; between the two is the first. */
    const float up[3] = {0, 0, 1}, down[3] = {0, 0, -1};
    const hgrid_ray between = {{0.25f, 0.25f, -1}, 0, {0, 0, -1}, INFINITY};
    hgrid_hit on_first, on_second;
    if (!hgrid_intersect(&grid, &rays[0], NULL, &on_first) ||
        !hgrid_intersect(&grid, &between, NULL, &on_second) ||
        !sees_light(&grid, &rays[0], &on_first, up) || sees_light(&grid, &rays[0], &on_first, down) ||
        sees_light(&grid, &between, &on_second, up))
        return 9;

    HGRID_ALIGNED static unsigned char more_index[1 << 16], more_scratch[1 << 16];
    if (build_on_threads(&mesh, more_index, sizeof more_index, more_scratch, sizeof more_scratch,
                         &grid))
        return 5;
    return trace_tile(&grid, rays, depth) == 36 ? 0 : 6;
}
