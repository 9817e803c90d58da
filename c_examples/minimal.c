/*
 * The smallest use of hgrid: one triangle, one ray, and no malloc.
 *
 *     cargo build --release -p hgrid-capi
 *     cc -std=c99 -Iinclude c_examples/minimal.c target/release/libhgrid.a -o minimal
 */

#include <hgrid.h>

#include <math.h>
#include <stdio.h>

/* hgrid reads the mesh in place at every query. */
static const float positions[3][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
static const uint32_t indices[1][3] = {{0, 1, 2}};

/* The grid's memory. The bounds are enough for any mesh with so many triangles; with scratch, hgrid_sizes would
 * plan the grid and return the exact size of the index. The index keeps the grid; only the build needs the
 * scratch. */
HGRID_ALIGNED static unsigned char index_region[HGRID_INDEX_BOUND(1)];
HGRID_ALIGNED static unsigned char scratch_region[HGRID_SCRATCH_BOUND(1)];

int main(void)
{
    /* The header must have the library's version, except for its patch number. */
    if (hgrid_version() >> 8 != HGRID_VERSION >> 8) {
        fprintf(stderr, "compiled for hgrid %s, linked with %s\n", HGRID_VERSION_STRING,
                hgrid_version_string());
        return 1;
    }

    /* The mesh: where its triangles are. Strides of 0 mean tight arrays. */
    hgrid_mesh mesh = HGRID_MESH_INIT;
    mesh.positions = positions;
    mesh.vertex_count = 3;
    mesh.indices = indices;
    mesh.triangle_count = 1;

    /* Build. NULL means the default configuration; the report is optional, too. */
    hgrid_grid grid;
    hgrid_report report = HGRID_REPORT_INIT;
    hgrid_status status =
        hgrid_build(&mesh, NULL, index_region, sizeof index_region, scratch_region,
                    sizeof scratch_region, &grid, &report);
    if (status != HGRID_OK) {
        fprintf(stderr, "hgrid_build: %s\n", hgrid_status_string(status));
        return 1;
    }
    printf("built a grid of %lu bytes\n", (unsigned long)report.index_bytes);

    /* Trace a ray: from one unit above, straight down, without an end. */
    const hgrid_ray ray = {{0.25f, 0.5f, 1}, 0, {0, 0, -1}, INFINITY};
    hgrid_hit hit;
    if (!hgrid_intersect(&grid, &ray, NULL, &hit)) {
        fprintf(stderr, "the ray missed\n");
        return 1;
    }
    printf("hit triangle %u at t = %g, u = %g, v = %g\n", (unsigned)hit.primitive, hit.t, hit.u,
           hit.v);

    /* Nothing needs to be closed or freed. */
    return 0;
}
