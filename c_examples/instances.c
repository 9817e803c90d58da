/*
 * Instances: a field of thousands of knots, turned and scaled, on a floor, under a light that is a sphere.
 *
 *     make -C c_examples && c_examples/build/instances instances.ppm
 *
 * Three objects (a mesh, another mesh, a tree with one shape) and one scene over them. The mesh of the knot is in
 * memory once, however often it is shown. The rays of a tile go through the scene together.
 */

#include "grid.h"
#include "picture.h"
#include "vector.h"

#include <hgrid.h>

#include <stdbool.h>
#include <stdlib.h>

const char *const program_name = "instances";

enum { SIDE = 48, KNOTS = SIDE * SIDE, COUNT = KNOTS + 2, SIZE = 256, TILE = 8 };
enum { KNOT, FLOOR, LIGHT, OBJECTS };

/* The light: its centre and its radius, in the scene. */
static const float LIGHT_AT[3] = {30, 22, 10};
static const float LIGHT_RADIUS = 3;

static float next_random(void)
{
    static uint32_t state = 3;
    state = state * 1664525u + 1013904223u;
    return (float)(state >> 8) / 16777216.0f;
}

/* Finds the place where a ray enters the unit sphere. */
static bool meet(void *context, uint32_t shape, const hgrid_ray *ray, hgrid_shape_hit *hit)
{
    const vector from = vector_of(ray->origin), along = vector_of(ray->direction);
    const double a = dot(along, along), b = dot(from, along), inside = b * b - a * (dot(from, from) - 1);
    (void)context, (void)shape;
    hit->t = inside < 0 ? NAN : (float)((-b - sqrt(inside)) / a);
    hit->u = hit->v = 0;
    return inside >= 0;
}

/* Makes knots on a lattice, each turned about the vertical by some angle and scaled. */
static void make_instances(hgrid_instance *all)
{
    const hgrid_instance usual = HGRID_INSTANCE_INIT;
    for (int i = 0; i < KNOTS; i++) {
        hgrid_instance *one = &all[i];
        *one = usual;
        one->object = KNOT;
        /* A rational rotation, which has the same bits on every machine. */
        const float half = 4 * next_random() - 2, size = 0.5f + 0.4f * next_random();
        const float cosine = (1 - half * half) / (1 + half * half), sine = 2 * half / (1 + half * half);
        one->linear[0][0] = one->linear[2][2] = size * cosine;
        one->linear[0][2] = size * sine, one->linear[2][0] = -size * sine;
        one->linear[1][1] = size;
        one->translation[0] = 3.0 * (i % SIDE) + (double)next_random();
        one->translation[1] = 1.5;
        one->translation[2] = -3.0 * (i / SIDE) - (double)next_random();
    }
    all[KNOTS] = usual, all[KNOTS].object = FLOOR;
    all[KNOTS + 1] = usual, all[KNOTS + 1].object = LIGHT;
    for (int k = 0; k < 3; k++) {
        all[KNOTS + 1].linear[k][k] = LIGHT_RADIUS;
        all[KNOTS + 1].translation[k] = (double)LIGHT_AT[k];
    }
    /* Shadow rays do not see the light itself. */
    all[KNOTS + 1].mask = 1;
}

/* A pixel with its rays and their answers in one struct, which batches read and write. */
typedef struct {
    hgrid_ray_f64 ray, to_light;
    hgrid_scene_hit hit;
    uint8_t is_dark;
    /* The brightness in the shadow, and without a shadow. */
    double dark, lit;
} pixel;

/* Computes a pixel's brightness in both cases, and its shadow ray. A ray without a direction hits nothing. */
static void shade(const hgrid_scene *field, pixel *p)
{
    const hgrid_ray_f64 none = {{0, 0, 0}, {0, 0, 0}, 0, 0, 0};
    const bool is_light = p->hit.path[0] == KNOTS + 1;
    hgrid_scene_surface at;
    p->to_light = none;
    p->dark = p->lit = p->hit.primitive == HGRID_INVALID_ID ? 0.6 : is_light ? 1 : 0;
    if (is_light || !hgrid_scene_surface_at(field, &p->ray, &p->hit, &at))
        return;
    const vector up = vector_of(at.normal), from = {at.above[0], at.above[1], at.above[2]};
    const vector to = offset(vector_of(LIGHT_AT), -1, from);
    const double facing = dot(unit(to, up), up);
    const hgrid_ray_f64 to_light = {{from.x, from.y, from.z}, {(float)to.x, (float)to.y, (float)to.z}, 0, 1, 0};
    p->to_light = to_light;
    p->dark = 0.12, p->lit = facing <= 0 ? 0.12 : 0.12 + 0.8 * facing;
}

/* Traces the rays of a tile together, and then their shadow rays. */
static void trace(const hgrid_scene *field, pixel tile[TILE * TILE])
{
    hgrid_scene_options options = HGRID_SCENE_OPTIONS_INIT;
    options.mask = 2;
    check(hgrid_intersect_scene_n(field, &tile->ray, sizeof *tile, &tile->hit, sizeof *tile, TILE * TILE,
                                  HGRID_COHERENCE_COHERENT, NULL),
          NULL);
    for (int i = 0; i < TILE * TILE; i++)
        shade(field, &tile[i]);
    check(hgrid_occluded_scene_n(field, &tile->to_light, sizeof *tile, &tile->is_dark, sizeof *tile, TILE * TILE,
                                 HGRID_COHERENCE_COHERENT, &options),
          NULL);
}

int main(int count, char **words)
{
    const char *path = count > 1 ? words[1] : "instances.ppm";
    if (count > 2 || path[0] == '-')
        fail("the only word it takes is the name of the picture: instances FILE.ppm");
    FILE *file = open_picture(path);
    scene knot = make_knot();
    const hgrid_mesh mesh = mesh_of(&knot);
    const hgrid_config config = HGRID_CONFIG_INIT;
    built_grid grid = build_grid(&mesh, &config, 1, NULL);

    /* The floor: two triangles, in static memory. */
    static const float corners[4][3] = {{-50, 0, 50}, {250, 0, 50}, {250, 0, -250}, {-50, 0, -250}};
    static const uint32_t halves[2][3] = {{0, 1, 2}, {0, 2, 3}};
    HGRID_ALIGNED static unsigned char floor_index[HGRID_INDEX_BOUND(2)], small[HGRID_SCRATCH_BOUND(2)];
    hgrid_mesh floor_mesh = HGRID_MESH_INIT;
    floor_mesh.positions = corners, floor_mesh.vertex_count = 4;
    floor_mesh.indices = halves, floor_mesh.triangle_count = 2;
    hgrid_grid floor_grid;
    check(hgrid_build(&floor_mesh, NULL, floor_index, sizeof floor_index, small, sizeof small, &floor_grid, NULL),
          NULL);

    /* The light: one shape. */
    static const float box[6] = {-1, -1, -1, 1, 1, 1};
    HGRID_ALIGNED static unsigned char light_index[HGRID_INDEX_BOUND(1)];
    hgrid_boxes boxes = HGRID_BOXES_INIT;
    boxes.boxes = box, boxes.count = 1, boxes.test = meet;
    hgrid_shapes light;
    check(hgrid_build_shapes(&boxes, NULL, light_index, sizeof light_index, small, sizeof small, &light, NULL), NULL);

    /* All of it as a scene, which reads objects and views in place. */
    hgrid_object objects[OBJECTS];
    check(hgrid_object_grid(&grid.grid, &objects[KNOT]), NULL);
    check(hgrid_object_grid(&floor_grid, &objects[FLOOR]), NULL);
    check(hgrid_object_shapes(&light, &objects[LIGHT]), NULL);
    hgrid_instance *instances = (hgrid_instance *)allocate(COUNT, sizeof *instances);
    make_instances(instances);
    const region index = allocate_region(HGRID_SCENE_BOUND(COUNT));
    const region scratch = allocate_region(HGRID_SCRATCH_BOUND(COUNT));
    hgrid_report report = HGRID_REPORT_INIT;
    hgrid_scene all;
    check(hgrid_build_scene(instances, COUNT, objects, OBJECTS, NULL, index.start, index.bytes, scratch.start,
                            scratch.bytes, &all, &report),
          &report);
    free(scratch.allocation);
    free(instances);

    unsigned char *pixels = (unsigned char *)allocate(SIZE * SIZE, 3);
    for (int first = 0; first < SIZE * SIZE; first += TILE * TILE) {
        /* The corner of the tile: a row of tiles fills the width. */
        const int left = first / TILE % SIZE, top = first / (SIZE * TILE) * TILE;
        pixel tile[TILE * TILE];
        for (int i = 0; i < TILE * TILE; i++) {
            const float x = 1.4f * ((float)(left + i % TILE) + 0.5f) / SIZE - 0.7f;
            const float y = 0.7f - 1.4f * ((float)(top + i / TILE) + 0.5f) / SIZE;
            const hgrid_ray_f64 ray = {{20, 14, 18}, {x + 0.25f, y - 0.35f, -1}, 0, INFINITY, 0};
            tile[i].ray = ray;
        }
        trace(&all, tile);
        for (int i = 0; i < TILE * TILE; i++) {
            const double brightness = tile[i].is_dark ? tile[i].dark : tile[i].lit;
            unsigned char *to = pixels + 3 * (SIZE * (top + i / TILE) + left + i % TILE);
            to[0] = to[1] = to[2] = (unsigned char)(255 * brightness + 0.5);
        }
    }
    write_picture(file, path, SIZE, SIZE, pixels);
    printf("%d instances in %lu bytes, %lu triangles in memory, wrote %s\n", COUNT,
           (unsigned long)report.index_bytes, (unsigned long)knot.triangle_count + 2, path);

    free(pixels);
    free(index.allocation);
    free(grid.index.allocation);
    free(knot.positions);
    free(knot.indices);
    return 0;
}
