/*
 * User-defined shapes: thousands of spheres in one tree, with a light and shadows.
 *
 *     cc -std=c99 -Iinclude c_examples/spheres.c c_examples/memory.c c_examples/picture.c \
 *         target/release/libhgrid.a -lm -o spheres
 *     ./spheres spheres.ppm
 *
 * hgrid reads the boxes of the spheres, and calls meet() for the hit of a ray on a sphere.
 */

#include "memory.h"
#include "picture.h"
#include "vector.h"

#include <hgrid.h>

#include <stdbool.h>
#include <stdlib.h>

const char *const program_name = "spheres";

enum { COUNT = 4000, SIZE = 256 };

/* A sphere and its box in one struct, which hgrid reads with a stride. */
typedef struct {
    float box[6];
    float center[3], radius;
} sphere;

static float next_random(void)
{
    static uint32_t state = 7;
    state = state * 1664525u + 1013904223u;
    return (float)(state >> 8) / 16777216.0f;
}

/* Makes spheres all over a ball of radius 1, larger in the middle. */
static void make_spheres(sphere *all)
{
    for (size_t i = 0; i < COUNT;) {
        sphere *s = &all[i];
        double away = 0;
        for (int k = 0; k < 3; k++) {
            s->center[k] = 2 * next_random() - 1;
            away += (double)s->center[k] * (double)s->center[k];
        }
        if (away > 1)
            continue;
        s->radius = 0.01f + 0.05f * (1 - (float)away) * next_random();
        for (int k = 0; k < 3; k++) {
            /* A little larger than the sphere, so that float rounding never cuts it. */
            s->box[k] = s->center[k] - 1.0001f * s->radius - 1e-6f;
            s->box[k + 3] = s->center[k] + 1.0001f * s->radius + 1e-6f;
        }
        i++;
    }
}

/* Finds the place where a ray enters a sphere, or leaves it if it starts inside. */
static bool meet(void *context, uint32_t shape, const hgrid_ray *ray, hgrid_shape_hit *hit)
{
    const sphere *s = (const sphere *)context + shape;
    const vector from = offset(vector_of(ray->origin), -1, vector_of(s->center));
    const vector along = vector_of(ray->direction);
    const double a = dot(along, along), b = dot(from, along);
    const double c = dot(from, from) - (double)s->radius * (double)s->radius;
    const double inside = b * b - a * c;
    if (inside < 0)
        return false;
    const double root = sqrt(inside);
    hit->t = (float)((-b - root) / a);
    if (hit->t < ray->t_min)
        hit->t = (float)((-b + root) / a);
    hit->u = hit->v = 0;
    return true;
}

/* Returns the brightness along a ray. */
static double look(const hgrid_shapes *shapes, const sphere *all, const hgrid_ray *ray)
{
    const vector light = unit((vector){1, 2, 2}, (vector){0, 1, 0});
    hgrid_hit hit;
    if (!hgrid_intersect_shapes(shapes, ray, NULL, &hit))
        return 1;
    const sphere *s = &all[hit.primitive];
    const vector at = offset(vector_of(ray->origin), (double)hit.t, vector_of(ray->direction));
    const vector normal = unit(offset(at, -1, vector_of(s->center)), light);
    const double facing = dot(normal, light);
    if (facing <= 0)
        return 0.15;
    hgrid_ray to_light = {{0, 0, 0}, 0, {0, 0, 0}, INFINITY};
    round_to(to_light.origin, offset(at, 1e-3 * (double)s->radius, normal));
    round_to(to_light.direction, light);
    return hgrid_occluded_shapes(shapes, &to_light, NULL) ? 0.15 : 0.15 + 0.8 * facing;
}

int main(int count, char **words)
{
    const char *path = count > 1 ? words[1] : "spheres.ppm";
    if (count > 2 || path[0] == '-')
        fail("the only word it takes is the name of the picture: spheres FILE.ppm");
    FILE *file = open_picture(path);
    sphere *all = (sphere *)allocate(COUNT, sizeof *all);
    make_spheres(all);

    hgrid_boxes boxes = HGRID_BOXES_INIT;
    boxes.boxes = all[0].box, boxes.box_stride = sizeof *all, boxes.count = COUNT;
    boxes.test = meet, boxes.context = all;
    const region index = allocate_region(HGRID_INDEX_BOUND(COUNT));
    const region scratch = allocate_region(HGRID_SCRATCH_BOUND(COUNT));
    hgrid_shapes shapes;
    hgrid_report report = HGRID_REPORT_INIT;
    const hgrid_status status = hgrid_build_shapes(&boxes, NULL, index.start, index.bytes, scratch.start,
                                                   scratch.bytes, &shapes, &report);
    if (status != HGRID_OK)
        fail("%s", hgrid_status_string(status));
    free(scratch.allocation);

    unsigned char *pixels = (unsigned char *)allocate(SIZE * SIZE, 3);
    for (int row = 0; row < SIZE; row++)
        for (int column = 0; column < SIZE; column++) {
            const float x = 2.2f * ((float)column + 0.5f) / SIZE - 1.1f;
            const float y = 1.1f - 2.2f * ((float)row + 0.5f) / SIZE;
            const hgrid_ray ray = {{0, 0, 4}, 0, {x, y, -4}, INFINITY};
            const unsigned char grey = (unsigned char)(255 * look(&shapes, all, &ray) + 0.5);
            unsigned char *pixel = pixels + 3 * (SIZE * row + column);
            pixel[0] = pixel[1] = pixel[2] = grey;
        }
    write_picture(file, path, SIZE, SIZE, pixels);
    printf("%d spheres in %lu bytes, wrote %s\n", COUNT, (unsigned long)report.index_bytes, path);

    free(pixels);
    free(index.allocation);
    free(all);
    return 0;
}
