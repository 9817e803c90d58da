/* Builds a grid of a scan and traces a picture of it, natively and in WebAssembly: bunny.mjs runs both and
 * prints the times. */

#include <hgrid.h>

enum { VERTICES = 40000, TRIANGLES = 70000, SIDE = 512, RAYS = SIDE * SIDE };

static float positions[VERTICES][3];
static uint32_t indices[TRIANGLES][3];
HGRID_ALIGNED static unsigned char grid_memory[HGRID_INDEX_BOUND(TRIANGLES)];
HGRID_ALIGNED static unsigned char scratch[HGRID_SCRATCH_BOUND(TRIANGLES)];
static hgrid_ray rays[RAYS];
static hgrid_hit hits[RAYS];
static hgrid_mesh mesh = HGRID_MESH_INIT;
static hgrid_grid grid;

#ifdef __wasm__
#define EXPORT(name) __attribute__((export_name(#name)))
#else
#define EXPORT(name)
#endif

EXPORT(vertices) float *vertices(void)
{
    return positions[0];
}

EXPORT(triangles) uint32_t *triangles(void)
{
    return indices[0];
}

/* A camera in front of the box of the mesh: tiles of 8 x 8 pixels, two side by side. */
EXPORT(prepare) int prepare(uint32_t vertex_count, uint32_t triangle_count)
{
    if (vertex_count > VERTICES || triangle_count > TRIANGLES)
        return 1;
    mesh.positions = positions, mesh.vertex_count = vertex_count;
    mesh.indices = indices, mesh.triangle_count = triangle_count;
    float min[3] = {1e30f, 1e30f, 1e30f}, max[3] = {-1e30f, -1e30f, -1e30f};
    for (uint32_t i = 0; i < vertex_count; i++)
        for (int axis = 0; axis < 3; axis++) {
            const float at = positions[i][axis];
            min[axis] = at < min[axis] ? at : min[axis];
            max[axis] = at > max[axis] ? at : max[axis];
        }
    const float size = max[1] - min[1];
    for (uint32_t i = 0; i < RAYS; i++) {
        const uint32_t tile = i / 64, in = i % 64;
        const float x = (float)(tile % (SIDE / 8) * 8 + in % 8);
        const float y = (float)(tile / (SIDE / 8) * 8 + in / 8);
        const hgrid_ray ray = {{(min[0] + max[0]) / 2, (min[1] + max[1]) / 2, max[2] + 2 * size},
                               0,
                               {(x - SIDE / 2) / SIDE * 0.5f, (y - SIDE / 2) / SIDE * 0.5f, -1},
                               1e30f};
        rays[i] = ray;
    }
    return 0;
}

EXPORT(build) int build(void)
{
    return hgrid_build(&mesh, NULL, grid_memory, sizeof grid_memory, scratch, sizeof scratch, &grid,
                       NULL);
}

EXPORT(trace) int trace(void)
{
    return hgrid_intersect_n(&grid, rays, 0, hits, 0, RAYS, HGRID_COHERENCE_COHERENT, NULL);
}

/* Returns a number that is the same wherever the hits are the same. */
EXPORT(sum) uint32_t sum(void)
{
    uint32_t all = 2166136261u;
    for (int i = 0; i < RAYS; i++)
        all = (all ^ hits[i].primitive) * 16777619u;
    return all;
}

#ifndef __wasm__
#include <stdio.h>
#include <time.h>

static double now(void)
{
    struct timespec at;
    clock_gettime(CLOCK_MONOTONIC, &at);
    return (double)at.tv_sec * 1e3 + (double)at.tv_nsec / 1e6;
}

/* Returns the least of several times, in milliseconds. */
static double least(int (*call)(void))
{
    double best = 1e9;
    for (int i = 0; i < 15; i++) {
        const double start = now();
        if (call() != 0)
            return -1;
        const double time = now() - start;
        best = time < best ? time : best;
    }
    return best;
}

/* Reads two counts, the positions and the indices. */
int main(int argc, char **argv)
{
    uint32_t counts[2];
    FILE *file = argc > 1 ? fopen(argv[1], "rb") : NULL;
    if (file == NULL || fread(counts, sizeof counts, 1, file) != 1 || counts[0] > VERTICES ||
        counts[1] > TRIANGLES || fread(positions, 12, counts[0], file) != counts[0] ||
        fread(indices, 12, counts[1], file) != counts[1] || prepare(counts[0], counts[1]) != 0)
        return 1;
    const double building = least(build), tracing = least(trace);
    if (building < 0 || tracing < 0)
        return 1;
    printf("%f %f %u\n", building, tracing, (unsigned)sum());
    return 0;
}
#endif
