/* Where the picture is taken from. */
#ifndef CAMERA_H
#define CAMERA_H

#include "scene.h"

#include <hgrid.h>

typedef struct {
    float eye[3], right[3], up[3], forward[3];
    /* Half the diagonal of the scene's box. */
    double scene_radius;
} camera;

/* Stands where all of the scene just fits. */
camera frame(const scene *s);

/* The ray through the middle of a pixel, counted from the upper left, of a square picture. */
hgrid_ray ray_of(const camera *c, int column, int row, int size);

#endif
