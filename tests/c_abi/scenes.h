/* Shapes, a scene of them and of grids, and a scene of that one, for scenes.c, scene_batches.c and
 * scene_refusals.c. */
#ifndef SCENES_H
#define SCENES_H

#include "versions.h"

enum { SPHERES = 200, INSTANCES = 30 };

typedef struct {
    float box[6];
    uint32_t mask;
    float center[3], radius;
} sphere;

static sheet mesh_data;
static hgrid_mesh mesh;
static hgrid_grid grid;
static sphere spheres[SPHERES];
static hgrid_boxes boxes;
static hgrid_shapes shapes;
static hgrid_instance instances[INSTANCES];
static hgrid_object objects[3];
static hgrid_scene scene, inner;
static const hgrid_report new_report = HGRID_REPORT_INIT;
static unsigned asked;

static void *index_region, *scratch, *shape_blob, *scene_blob, *inner_blob;
static size_t shape_bytes, scene_bytes, inner_bytes;

enum { INDEX_BYTES = 112 * 1000 + 896, SCRATCH_BYTES = 271 * 64 };

/* Returns a square root: the programs are linked without a math library. */
static inline double root_of(double square)
{
    double root = square > 1 ? square : 1;
    for (int i = 0; i < 60; i++)
        root = 0.5 * (root + square / root);
    return square > 0 ? root : 0;
}

/* Finds the nearer of the two points where a ray meets a sphere, or the farther one. */
static inline bool meet(void *context, uint32_t shape, const hgrid_ray *ray, hgrid_shape_hit *hit)
{
    const sphere *s = (const sphere *)context + shape;
    double a = 0, b = 0, c = -(double)s->radius * (double)s->radius;
    asked++;
    CHECK(shape < SPHERES);
    for (int k = 0; k < 3; k++) {
        const double p = (double)ray->origin[k] - (double)s->center[k], d = (double)ray->direction[k];
        a += d * d, b += p * d, c += p * p;
    }
    if (b * b < a * c)
        return false;
    const double root = root_of(b * b - a * c);
    hit->t = (float)((-b - root) / a);
    if (hit->t < ray->t_min)
        hit->t = (float)((-b + root) / a);
    hit->u = s->radius, hit->v = 7;
    return true;
}

static inline float next_random(void)
{
    static uint32_t state = 1;
    state = state * 1664525u + 1013904223u;
    return (float)(state >> 8) / 16777216.0f;
}

static inline void prepare(void)
{
    make_sheet(&mesh_data);
    mesh = mesh_of(&mesh_data);
    grid = build_exactly(&mesh, NULL, NULL, NULL);
    for (size_t i = 0; i < SPHERES; i++) {
        sphere *s = &spheres[i];
        s->radius = 0.01f + 0.04f * next_random();
        s->mask = 1u << (i % 2);
        for (int k = 0; k < 3; k++) {
            s->center[k] = next_random();
            s->box[k] = s->center[k] - s->radius * 1.001f;
            s->box[k + 3] = s->center[k] + s->radius * 1.001f;
        }
    }
    const hgrid_boxes none = HGRID_BOXES_INIT;
    boxes = none;
    boxes.boxes = spheres, boxes.box_stride = sizeof *spheres, boxes.count = SPHERES;
    boxes.masks = &spheres[0].mask, boxes.mask_stride = sizeof *spheres;
    boxes.test = meet, boxes.context = spheres;
    index_region = guarded(INDEX_BYTES);
    scratch = guarded(SCRATCH_BYTES);
}

static inline hgrid_ray_f64 wide_ray(double x, double y, double z)
{
    const hgrid_ray_f64 ray = {{x, y, z}, {0, 0, -1}, 0, INFINITY, 0};
    return ray;
}

/* Builds the tree of the spheres. */
static inline hgrid_report build_shapes(void)
{
    hgrid_report report = new_report;
    EXPECT(HGRID_OK, hgrid_build_shapes(&boxes, NULL, index_region, INDEX_BYTES, scratch, SCRATCH_BYTES, &shapes,
                                        &report));
    shape_bytes = (size_t)report.index_bytes;
    shape_blob = guarded_copy(index_region, shape_bytes);
    EXPECT(HGRID_OK, hgrid_open_shapes(shape_blob, shape_bytes, &boxes, &shapes));
    return report;
}

/* Builds a scene of sheets and spheres in turn. */
static inline hgrid_report build_inner(size_t index_bytes, size_t extra_bytes)
{
    const hgrid_instance here = HGRID_INSTANCE_INIT;
    EXPECT(HGRID_OK, hgrid_object_grid(&grid, &objects[0]));
    EXPECT(HGRID_OK, hgrid_object_shapes(&shapes, &objects[1]));
    for (uint32_t i = 0; i < INSTANCES; i++) {
        instances[i] = here;
        instances[i].object = i % 2;
        instances[i].id = 1000 + i;
        instances[i].mask = 1u << (i % 3);
        /* Ten units apart, with the sheets upside down: their fronts face away. */
        instances[i].translation[0] = 10.0 * i;
        instances[i].linear[2][2] = i % 2 ? 1 : -1;
    }
    hgrid_report report = new_report;
    EXPECT(HGRID_OK, hgrid_build_scene(instances, INSTANCES, objects, 2, NULL, index_region, index_bytes, scratch,
                                       extra_bytes, &inner, &report));
    inner_bytes = (size_t)report.index_bytes;
    inner_blob = guarded_copy(index_region, inner_bytes);
    EXPECT(HGRID_OK, hgrid_open_scene(inner_blob, inner_bytes, objects, 2, &inner));
    return report;
}

/* Builds a scene that shows the other one twice, a million units apart. */
static inline void build_outer(void)
{
    hgrid_instance two[2] = {HGRID_INSTANCE_INIT, HGRID_INSTANCE_INIT};
    hgrid_report report = new_report;
    EXPECT(HGRID_OK, hgrid_object_scene(&inner, &objects[2]));
    two[0].object = two[1].object = 2;
    two[1].translation[1] = 1e6;
    EXPECT(HGRID_OK, hgrid_build_scene(two, 2, objects, 3, NULL, index_region, INDEX_BYTES, scratch, SCRATCH_BYTES,
                                       &scene, &report));
    scene_bytes = (size_t)report.index_bytes;
    scene_blob = guarded_copy(index_region, scene_bytes);
    EXPECT(HGRID_OK, hgrid_open_scene(scene_blob, scene_bytes, objects, 3, &scene));
}

#endif
