/*
 * Checks that this copy of hgrid works here: builds a cube by every method of the library, and compares the
 * hits of rays with the expected ones.
 *
 *     cc -Iinclude check/check.c lib/libhgrid.a -o check && ./check
 */

#include <hgrid.h>

#include <math.h>
#include <stdio.h>

/* The corners of a cube from 0 to 1: bit 0 is x, bit 1 is y, bit 2 is z. */
static const float corners[8][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0},
                                    {0, 0, 1}, {1, 0, 1}, {0, 1, 1}, {1, 1, 1}};
static const uint32_t sides[12][3] = {{0, 2, 4}, {2, 6, 4}, {1, 5, 3}, {3, 5, 7}, {0, 4, 1}, {1, 4, 5},
                                      {2, 3, 6}, {3, 7, 6}, {0, 1, 2}, {1, 3, 2}, {4, 6, 5}, {5, 6, 7}};

/* One megabyte is enough for the grid of the cube by any method. */
HGRID_ALIGNED static unsigned char memory[1 << 20], scratch[1 << 20];

/* Prints a complaint, and returns 1 to count it. */
static int wrong(const char *method, const char *what)
{
    fprintf(stderr, "%s: %s\n", method, what);
    return 1;
}

/* Traces rays at both triangles of every side: from outside they must hit at 2, from the middle at 0.5, at
 * the same triangle. A ray that ends before the cube must miss it. */
static int trace(const char *method, const hgrid_grid *grid)
{
    int found = 0;
    for (int ray = 0; ray < 12; ray++) {
        const int axis = ray / 4, upper = ray / 2 % 2;
        const float sign = upper ? 1.0f : -1.0f;
        hgrid_ray in = {{0.25f, 0.25f, 0.25f}, 0, {0, 0, 0}, INFINITY}, out = in;
        if (ray % 2)
            in.origin[(axis + 1) % 3] = in.origin[(axis + 2) % 3] = 0.625f;
        for (int i = 0; i < 3; i++)
            out.origin[i] = in.origin[i];
        in.origin[axis] = 0.5f + 2.5f * sign;
        out.origin[axis] = 0.5f;
        in.direction[axis] = -sign;
        out.direction[axis] = sign;
        hgrid_hit from_outside, from_inside;
        if (!hgrid_intersect(grid, &in, NULL, &from_outside) ||
            !hgrid_intersect(grid, &out, NULL, &from_inside))
            found += wrong(method, "a ray misses the cube");
        else if (from_outside.t != 2 || from_inside.t != 0.5f ||
                 from_outside.primitive != from_inside.primitive)
            found += wrong(method, "a ray hits another place than it must");
        in.t_max = 1.5f;
        if (hgrid_occluded(grid, &in, NULL))
            found += wrong(method, "a ray that ends before the cube hits it");
    }
    return found;
}

static int build_and_trace(const char *method, hgrid_config config)
{
    hgrid_mesh mesh = HGRID_MESH_INIT;
    mesh.positions = corners;
    mesh.vertex_count = 8;
    mesh.indices = sides;
    mesh.triangle_count = 12;
    hgrid_grid grid;
    const hgrid_status status =
        hgrid_build(&mesh, &config, memory, sizeof memory, scratch, sizeof scratch, &grid, NULL);
    if (status != HGRID_OK)
        return wrong(method, hgrid_status_string(status));
    int found = trace(method, &grid);
    const hgrid_status proof = hgrid_validate(&grid, scratch, sizeof scratch);
    if (proof != HGRID_OK)
        found += wrong(method, hgrid_status_string(proof));
#ifdef HGRID_MALLOC
    hgrid_grid *created;
    if (hgrid_create(&mesh, &config, NULL, &created, NULL) != HGRID_OK)
        return found + wrong(method, "hgrid_create fails");
    found += trace(method, created);
    hgrid_destroy(created);
#endif
    return found;
}

int main(void)
{
    if (hgrid_version() != HGRID_VERSION)
        return wrong(hgrid_version_string(), "the header is of " HGRID_VERSION_STRING);
    const hgrid_config configs[] = {HGRID_CONFIG_INIT_BVH, HGRID_CONFIG_INIT_ONE_LEVEL,
                                    HGRID_CONFIG_INIT_FIXED, HGRID_CONFIG_INIT_VARIABLE,
                                    HGRID_CONFIG_INIT_RECURSIVE};
    const char *const names[] = {"bvh", "one-level", "fixed", "variable", "recursive"};
    int found = 0;
    printf("hgrid %s:", hgrid_version_string());
    for (int i = 0; i < 5; i++)
        if (hgrid_has_method(configs[i].method)) {
            printf(" %s", names[i]);
            found += build_and_trace(names[i], configs[i]);
        }
    puts(found ? ": not right" : ": right");
    return found != 0;
}
