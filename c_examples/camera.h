/* The camera: its place and its picture's axes. */
#ifndef CAMERA_H
#define CAMERA_H

#include "scene.h"

#include <hgrid.h>

typedef struct {
    float eye[3], right[3], up[3], forward[3];
    /* Half the diagonal of the scene's box. */
    double scene_radius;
} camera;

/* Places the camera where all of the scene just fits. */
camera frame(const scene *s);

/* Returns the ray through the middle of a pixel of a square picture, counted from the upper left. */
hgrid_ray ray_of(const camera *c, int column, int row, int size);

#endif
