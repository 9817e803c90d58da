/* Runs the examples in the comments of the header's functions, which replace FUNCTIONS: two triangles, one
 * behind the other, fill the lower left half of a tile. One of the examples needs POSIX threads. */

#include "hgrid.h"

#include <math.h>
#include <pthread.h>

FUNCTIONS

static hgrid_verdict reject(void *calls, size_t ray, const hgrid_hit *hit)
{
    *(int *)calls += hit->primitive == 0 && ray < 64;
    return HGRID_REJECT;
}

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
    /* Any memory serves to sort in; these rays are not sorted. */
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

    uint32_t blocker;
    if (is_lit(&grid, &rays[0], &blocker) || blocker > 1 || !is_lit(&grid, &rays[63], &blocker) ||
        blocker != HGRID_INVALID_ID)
        return 12;
    /* A leaf in front of a wall, then a wall in front of a leaf. */
    uint32_t masks[2] = {2, 1};
    hgrid_grid masked;
    HGRID_ALIGNED static unsigned char masked_index[HGRID_INDEX_BOUND(2)];
    mesh.masks = masks;
    if (hgrid_build(&mesh, NULL, masked_index, sizeof masked_index, scratch, sizeof scratch, &masked,
                    NULL))
        return 13;
    unsigned char dark[64];
    int calls = 0;
    for (int i = 0; i < 2; i++, masks[0] = 1, masks[1] = 2)
        if (light_of_rays(&masked, rays, 64, reject, &calls, dark) || dark[0] != 1 || dark[63] != 0)
            return 14;
    masks[0] = 2;
    calls = 0;
    if (light_of_rays(&masked, rays, 64, reject, &calls, dark) || dark[0] != 0 || calls != 36)
        return 15;
    mesh.masks = NULL;
    if (distance_to(&grid, 1, 1, 2) != 2)
        return 16;

    /* From the first triangle the way to a light above is free; from between the two, the first is in the way. */
    const float up[3] = {0, 0, 1}, down[3] = {0, 0, -1};
    const hgrid_ray between = {{0.25f, 0.25f, -1}, 0, {0, 0, -1}, INFINITY};
    hgrid_hit on_first, on_second;
    if (!hgrid_intersect(&grid, &rays[0], NULL, &on_first) ||
        !hgrid_intersect(&grid, &between, NULL, &on_second) ||
        !sees_light(&grid, &rays[0], &on_first, up) || sees_light(&grid, &rays[0], &on_first, down) ||
        sees_light(&grid, &between, &on_second, up))
        return 9;

    HGRID_ALIGNED static unsigned char scene_index[1152], shape_index[704], both_scratch[384];
    hgrid_object object;
    hgrid_scene scene;
    const hgrid_ray_f64 wide = {{10.5, 0.5, 1}, {0, 0, -1}, 0, INFINITY, 0};
    if (put_twice(&grid, scene_index, sizeof scene_index, both_scratch, sizeof both_scratch, &object, &scene) ||
        !hgrid_occluded_scene(&scene, &wide, NULL))
        return 12;
    /* The tile sees the first of the two triangles at both places. */
    hgrid_ray_f64 wide_rays[64];
    hgrid_scene_hit wide_hits[64];
    for (int i = 0; i < 64; i++) {
        const hgrid_ray_f64 ray = {{(i % 8) + 0.25, (i / 8) + 0.25, 1}, {0, 0, -1}, 0, INFINITY, 0};
        wide_rays[i] = ray;
    }
    if (trace_tile_of_scene(&scene, wide_rays, wide_hits) != 36 || wide_hits[0].t != depth[0] ||
        wide_hits[0].path[0] != 0)
        return 17;
    if (!sees_light_in_scene(&scene, &wide_rays[0], &wide_hits[0], up) ||
        sees_light_in_scene(&scene, &wide_rays[0], &wide_hits[0], down))
        return 18;
    static disc discs[1] = {{1, 1, 0, 0.5f}};
    static const float box[6] = {0.5f, 0.5f, 0, 1.5f, 1.5f, 0};
    hgrid_boxes boxes = HGRID_BOXES_INIT;
    hgrid_shapes shapes;
    boxes.boxes = box, boxes.count = 1, boxes.test = meets_disc, boxes.context = discs;
    if (hgrid_build_shapes(&boxes, NULL, shape_index, sizeof shape_index, both_scratch, sizeof both_scratch, &shapes,
                           NULL) ||
        !hgrid_occluded_shapes(&shapes, &rays[9], NULL) || hgrid_occluded_shapes(&shapes, &rays[0], NULL))
        return 13;
    hgrid_ray discs_seen[64];
    hgrid_hit disc_hits[64];
    for (int i = 0; i < 64; i++) {
        const hgrid_ray ray = {{(float)(i % 8) * 0.25f, (float)(i / 8) * 0.25f, 1}, 0, {0, 0, -1}, INFINITY};
        discs_seen[i] = ray;
    }
    /* Radius 0.5 around (1, 1): 13 points of a lattice of quarters. */
    if (trace_tile_of_shapes(&shapes, discs_seen, disc_hits) != 13 || disc_hits[4 * 8 + 4].t != 1)
        return 19;

    /* Two meshes of a triangle each in one grid, and the material of the second. */
    hgrid_mesh halves[2];
    hgrid_part parts[2];
    hgrid_grid both_grid;
    hgrid_hit lower;
    HGRID_ALIGNED static unsigned char joined_index[HGRID_INDEX_BOUND(2)], joined_scratch[HGRID_SCRATCH_BOUND(2)];
    halves[0] = halves[1] = mesh;
    halves[0].triangle_count = halves[1].triangle_count = 1;
    halves[1].indices = indices[1];
    if (build_both(halves, parts, joined_index, sizeof joined_index, joined_scratch, sizeof joined_scratch,
                   &both_grid) ||
        !hgrid_intersect(&both_grid, &between, NULL, &lower) || lower.primitive != 1)
        return 14;
    static const uint32_t stone[1] = {5}, wood[1] = {6};
    static const uint32_t *const materials[2] = {stone, wood};
    if (material_of(&both_grid, &lower, materials) != 6)
        return 15;

    HGRID_ALIGNED static unsigned char more_index[1 << 16], more_scratch[1 << 16];
    if (build_on_threads(&mesh, more_index, sizeof more_index, more_scratch, sizeof more_scratch,
                         &grid))
        return 5;
    return trace_tile(&grid, rays, depth) == 36 ? 0 : 6;
}
