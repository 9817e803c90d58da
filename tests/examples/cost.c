/* Functions as a C programmer writes them by hand: cost.cpp has the same through hgrid.hpp, and the test
 * compares the compiled code. */

#include <hgrid.h>

typedef struct {
    hgrid_ray ray;
    hgrid_hit hit;
    uint8_t is_dark;
} pixel;

bool nearest(const hgrid_grid *grid, const hgrid_ray *ray, float *t)
{
    hgrid_hit hit;
    if (!hgrid_intersect(grid, ray, NULL, &hit))
        return false;
    *t = hit.t;
    return true;
}

bool is_dark(const hgrid_grid *grid, const hgrid_ray *ray)
{
    return hgrid_occluded(grid, ray, NULL);
}

hgrid_status trace(const hgrid_grid *grid, pixel *pixels, size_t count)
{
    return hgrid_intersect_n(grid, &pixels->ray, sizeof *pixels, &pixels->hit, sizeof *pixels, count,
                             HGRID_COHERENCE_COHERENT, NULL);
}

hgrid_status shadow(const hgrid_grid *grid, pixel *pixels, size_t count)
{
    return hgrid_occluded_n(grid, &pixels->ray, sizeof *pixels, &pixels->is_dark, sizeof *pixels,
                            count, HGRID_COHERENCE_INCOHERENT, NULL);
}

static hgrid_verdict is_solid(void *context, size_t ray, const hgrid_hit *hit)
{
    const unsigned char *materials = *(const unsigned char **)context;
    (void)ray;
    return materials[hit->primitive] != 0 ? HGRID_ACCEPT : HGRID_REJECT;
}

bool is_dark_behind_leaves(const hgrid_grid *grid, const hgrid_ray *ray,
                           const unsigned char *materials)
{
    hgrid_query_options options = HGRID_QUERY_OPTIONS_INIT;
    options.cull = HGRID_CULL_BACK;
    options.context = &materials;
    options.filter = is_solid;
    return hgrid_occluded(grid, ray, &options);
}

float distance(const hgrid_grid *grid, const float *point, float most)
{
    const hgrid_point_query query = {{point[0], point[1], point[2]}, most};
    hgrid_closest closest;
    return hgrid_closest_point(grid, &query, NULL, &closest) ? closest.distance : most;
}

size_t count_hits(const hgrid_grid *grid, const hgrid_ray *ray, hgrid_hit *hits, size_t capacity)
{
    size_t count = 0;
    if (hgrid_intersect_all(grid, ray, NULL, hits, capacity, &count) != HGRID_OK)
        return 0;
    return count;
}

hgrid_status build(const float (*positions)[3], size_t vertex_count, const uint32_t (*indices)[3],
                   size_t triangle_count, void *index, size_t index_bytes, void *scratch,
                   size_t scratch_bytes, hgrid_grid *grid)
{
    hgrid_mesh mesh = HGRID_MESH_INIT;
    mesh.positions = positions, mesh.position_stride = sizeof *positions;
    mesh.vertex_count = vertex_count;
    mesh.indices = indices, mesh.index_stride = sizeof *indices;
    mesh.triangle_count = triangle_count;
    const hgrid_config config = HGRID_CONFIG_INIT;
    return hgrid_build(&mesh, &config, index, index_bytes, scratch, scratch_bytes, grid, NULL);
}
