#include "camera.h"

#include "vector.h"

#include <stdbool.h>

/* The tangent of half the field of view, and the size of the picture as a multiple of the box's. */
static const float HALF_VIEW_TANGENT = 0.364f;
static const double MARGIN = 1.04;

/* Finds the box around all finite vertices, or the origin if there are none. */
static void find_bounds(const scene *s, float min[3], float max[3])
{
    bool is_empty = true;
    for (int axis = 0; axis < 3; axis++)
        min[axis] = max[axis] = 0;
    for (size_t i = 0; i < s->vertex_count; i++) {
        const float *p = s->positions[i];
        if (!isfinite(p[0]) || !isfinite(p[1]) || !isfinite(p[2]))
            continue;
        for (int axis = 0; axis < 3; axis++) {
            min[axis] = is_empty || p[axis] < min[axis] ? p[axis] : min[axis];
            max[axis] = is_empty || p[axis] > max[axis] ? p[axis] : max[axis];
        }
        is_empty = false;
    }
}

/* Places the camera where all eight corners of the scene's box just fit: in front of it, or above it if the
 * scene is flat. */
camera frame(const scene *s)
{
    float min[3], max[3];
    double middle[3], half[3];
    find_bounds(s, min, max);
    for (int axis = 0; axis < 3; axis++) {
        middle[axis] = 0.5 * min[axis] + 0.5 * max[axis];
        half[axis] = 0.5 * max[axis] - 0.5 * min[axis];
    }

    /* The picture's axes, in scene space. */
    const vector front = {0, 0, 1}, above = {2, 1.5, 3}, level = {1, 0, 0};
    const bool is_flat = half[1] < 0.25 * larger(half[0], half[2]);
    const vector toward_eye = unit(is_flat ? above : front, front);
    const vector sideways = {toward_eye.z, 0, -toward_eye.x};
    const vector right = unit(sideways, level), up = cross(toward_eye, right);

    double distance = 0;
    for (int i = 0; i < 8; i++) {
        const vector corner = {i & 1 ? half[0] : -half[0], i & 2 ? half[1] : -half[1],
                               i & 4 ? half[2] : -half[2]};
        const double reach = larger(fabs(dot(corner, right)), fabs(dot(corner, up)));
        const double depth = dot(corner, toward_eye);
        distance = larger(distance, MARGIN * reach / HALF_VIEW_TANGENT + depth);
    }
    const vector centre = {middle[0], middle[1], middle[2]};
    const vector diagonal = {half[0], half[1], half[2]};
    camera c;
    round_to(c.eye, offset(centre, distance, toward_eye));
    round_to(c.right, right);
    round_to(c.up, up);
    round_to(c.forward, scale(toward_eye, -1));
    c.scene_radius = sqrt(dot(diagonal, diagonal));
    return c;
}

hgrid_ray ray_of(const camera *c, int column, int row, int size)
{
    const float step = HALF_VIEW_TANGENT / (float)size;
    const float x = (2 * (float)column + 1 - (float)size) * step;
    const float y = ((float)size - 2 * (float)row - 1) * step;
    hgrid_ray ray = {{c->eye[0], c->eye[1], c->eye[2]}, 0, {0, 0, 0}, INFINITY};
    for (int axis = 0; axis < 3; axis++)
        ray.direction[axis] = c->forward[axis] + x * c->right[axis] + y * c->up[axis];
    return ray;
}
